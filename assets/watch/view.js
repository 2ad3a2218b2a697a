// What is to be seen: the controls, and what of them the server is told. While the camera moves, the next view waits for an
// image of the one before.

import { $, say, state } from "./state.js";

const idOf = (field) => field.replaceAll("_", "-");
/** Fields of the view whose value is a name, with their names and defaults. */
const choices = () => state.status.choices;

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
  for (const { field, names } of choices()) {
    const select = $(idOf(field));
    select.replaceChildren(...names.map((name) => new Option(name)));
    select.value = view[field];
    select.onchange = () => changeView({ [field]: select.value });
  }
  $("shown").value = view.shown;
  $("max-bounces").value = view.max_bounces ?? "";
  $("exposure").value = view.exposure;
  $("debug").checked = view.debug;
  $("statistics").checked = view.statistics;
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

/** Light, and the AOVs that the device can give. */
export function listShown(aovs) {
  const select = $("shown");
  if (select.options.length === aovs.length + 1) return;
  select.replaceChildren(new Option("light", ""), ...aovs.map((name) => new Option(name, name)));
  select.value = state.view?.shown ?? state.status.view.shown;
}

$("shown").onchange = (event) => changeView({ shown: event.target.value });
$("camera").onchange = (event) => changeView({ camera: Number(event.target.value), pose: null });
$("max-bounces").onchange = (event) => {
  const { value, validity } = event.target;
  if (validity.valid) changeView({ max_bounces: value === "" ? null : Number(value) });
};
$("statistics").onchange = (event) => changeView({ statistics: event.target.checked });
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

/** What `render` does unless it is told otherwise, by its flags. */
const defaults = () => ({
  camera: 0, exposure: 0, "max-bounces": null, "look-at": null, aov: "", stats: false,
  ...Object.fromEntries(choices().map(({ field, default: name }) => [idOf(field), name])),
});

function command() {
  const { view, status } = state;
  const { pose } = view;
  const usual = defaults();
  const words = status.command.split(" ");
  const kept = words.find((word) => word.startsWith("--aov="))?.slice(6).split(",") ?? [];
  const values = {
    ...Object.fromEntries(Object.keys(usual).map((name) => [name, view[name.replaceAll("-", "_")] ?? null])),
    "look-at": pose && [pose.eye, pose.target, pose.up].map((point) => point.join(",")).join(":"),
    aov: [...new Set([...kept, view.shown].filter(Boolean))].join(","),
    stats: view.statistics,
  };
  const flags = Object.entries(values).filter(([name, value]) => value !== usual[name]);
  const base = words.filter((word) => !Object.keys(usual).some((name) => word.startsWith(`--${name}=`)));
  return [...base, ...flags.map(([name, value]) => (value === true ? `--${name}` : `--${name}=${value}`))].join(" ");
}

/** What of the view decides how fast it converges and is not as usual, in words. */
export function unusual() {
  const { view } = state;
  const named = choices().filter(({ field, default: name }) => field !== "tonemap" && view[field] !== name);
  const words = named.map(({ field }) => view[field]);
  if (view.max_bounces !== null) words.push(`${view.max_bounces} bounces`);
  if (view.camera !== 0 || view.pose) words.push("another view");
  if (view.shown) words.push("AOVs");
  if (view.statistics) words.push("counted");
  return words.join(" ");
}

export function showCommand() {
  if (!state.status || !state.view) return;
  // Lines break between words, not at hyphens.
  const words = command().split(" ").map((word) => Object.assign(document.createElement("span"), { textContent: word }));
  $("command").replaceChildren(...words.flatMap((word) => [" ", word]).slice(1));
}

$("png").onclick = () => say({ type: "save", format: "png" });
$("exr").onclick = () => say({ type: "save", format: "exr" });
$("copy").onclick = async () => {
  await navigator.clipboard?.writeText(command());
  $("copy").textContent = "Copied";
  setTimeout(() => ($("copy").textContent = "Copy command"), 1500);
};
