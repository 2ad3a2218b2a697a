// What is to be seen: the controls, and what of them the server is told. While the camera moves, the next view waits for an
// image of the one before.

import { $, say, state } from "./state.js";

/** Controls whose value is a word of the view. */
const NAMED = { integrator: "integrator", light_sampling: "light-sampling", mis: "mis", sampler: "sampler", tonemap: "tonemap" };

let waiting = false;
let dirty = false;
let settled = 0;

export function changeView(change) {
  state.view = { ...state.view, ...change };
  dirty = true;
  if (!state.view.moving || !waiting) flushView(true);
  showCommand();
}

export function flushView(now = false) {
  waiting = false;
  if (!dirty) return;
  dirty = false;
  waiting = state.view.moving;
  say({ type: "view", ...state.view });
  if (now) setTimeout(() => { if (waiting) flushView(); }, 300);
}

export function move(pose) {
  changeView({ pose, moving: true });
  clearTimeout(settled);
  settled = setTimeout(() => changeView({ moving: false }), 250);
}

/** The server's view, when the page has none. */
export function takeView(view) {
  state.view = { ...view, moving: false };
  for (const [field, id] of Object.entries(NAMED)) $(id).value = view[field];
  $("max-bounces").value = view.max_bounces ?? "";
  $("exposure").value = view.exposure;
  $("debug").checked = view.debug;
  state.pinned = view.pixel;
  showExposure();
}

export function listCameras(cameras) {
  const names = cameras.map((camera, i) => `${i}${camera.name ? ` ${camera.name}` : ""}`);
  const select = $("camera");
  if (names.join("\n") !== [...select.options].map((o) => o.text).join("\n")) {
    select.replaceChildren(...names.map((name, i) => new Option(name, i)));
  }
  select.value = state.view?.camera ?? state.status.view.camera;
}

for (const [field, id] of Object.entries(NAMED)) {
  $(id).onchange = (event) => changeView({ [field]: event.target.value });
}
$("camera").onchange = (event) => changeView({ camera: Number(event.target.value), pose: null });
$("max-bounces").onchange = (event) => {
  const { value, validity } = event.target;
  if (validity.valid) changeView({ max_bounces: value === "" ? null : Number(value) });
};
$("debug").onchange = (event) => changeView({ debug: event.target.checked });
$("exposure").oninput = (event) => {
  changeView({ exposure: Number(event.target.value) });
  showExposure();
};
$("reset").onclick = () => changeView({ pose: null, moving: false });

function showExposure() {
  $("exposure-value").textContent = `${state.view.exposure > 0 ? "+" : ""}${state.view.exposure} EV`;
}

// ---- The command that renders this view

function command() {
  const { view, status } = state;
  const own = ["camera", "exposure", ...Object.values(NAMED), "max-bounces"];
  const flags = own.filter((name) => name !== "max-bounces" || view.max_bounces !== null).map((name) => {
    const field = name.replaceAll("-", "_");
    return `--${name}=${view[field]}`;
  });
  const base = status.command.split(" ").filter((word) => !own.some((name) => word.startsWith(`--${name}=`)));
  const moved = view.pose ? "  # the camera was moved here: render takes the scene's own" : "";
  return [...base, ...flags].join(" ") + moved;
}

export function showCommand() {
  if (state.status && state.view) $("command").textContent = command();
}

$("png").onclick = () => say({ type: "save", format: "png" });
$("exr").onclick = () => say({ type: "save", format: "exr" });
$("copy").onclick = async () => {
  await navigator.clipboard?.writeText(command());
  $("copy").textContent = "Copied";
  setTimeout(() => ($("copy").textContent = "Copy command"), 1500);
};
