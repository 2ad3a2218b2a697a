// The page of `sunfleck watch`: takes status and images from the server's WebSocket, and says what is to be seen.

import { dolly, orbit, pan } from "./camera.js";
import { Picture } from "./picture.js";
import { Plot } from "./plot.js";

const $ = (id) => document.getElementById(id);
const picture = new Picture($("picture"));
const plot = new Plot($("plot"), $("key"));
let socket = null;
let status = null;
let view = null;
let resolution = [1, 1];
let last = null;
let pinned = null;

// ---- The server

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => (typeof data === "string" ? told(JSON.parse(data)) : received(data));
  socket.onclose = () => {
    $("stage").textContent = "disconnected";
    setTimeout(connect, 1000);
  };
}

function say(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function told(message) {
  if (message.type === "pixel") return showPixel(message);
  status = message;
  if (status.ready) {
    resolution = status.ready.resolution;
    $("scene").textContent = status.ready.scene;
    $("scene").title = status.ready.device;
    listCameras(status.ready.cameras);
  }
  if (!view) takeView(status.view);
  $("stage").textContent = { Load: "loading", Build: "building the kernel", Render: "rendering", Idle: "finished" }[status.stage];
  showProblems();
  showEdits();
  showCommand();
}

async function received(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const bytes = new Uint8Array(buffer, 4 + length);
  if (about.type === "file") return download(about.name, bytes);
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  // Decoding may be overtaken.
  if (last && (about.start < last.start && about.edit === last.edit)) return bitmap.close();
  last = about;
  picture.show(bitmap, about.moving ? resolution : [about.width, about.height]);
  plot.add(about);
  const rate = (about.rays / about.seconds / 1e6).toFixed(2);
  const error = about.error ? `, error ≤ ${(100 * about.error).toPrecision(3)} %` : "";
  const broken = about.non_finite ? `, ${about.non_finite} samples NaN or infinite` : "";
  $("figures").textContent = `${about.width}×${about.height}, ${about.spp} spp, ${about.seconds.toFixed(1)} s, ${rate} Mrays/s${error}${broken}`;
  document.body.dataset.frames = Number(document.body.dataset.frames ?? 0) + 1;
  document.body.dataset.edit = about.edit;
  placeMark();
  if (pinned && !about.moving) say({ type: "inspect", x: pinned[0], y: pinned[1] });
  flushView();
}

function download(name, bytes) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes]));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// ---- What is to be seen. While the camera moves the next view waits for an image of the one before.

let waiting = false;
let dirty = false;
let settled = 0;

function changeView(change) {
  view = { ...view, ...change };
  dirty = true;
  if (!view.moving || !waiting) flushView(true);
  showCommand();
}

function flushView(now = false) {
  waiting = false;
  if (!dirty) return;
  dirty = false;
  waiting = view.moving;
  say({ type: "view", ...view });
  if (now) setTimeout(() => { if (waiting) flushView(); }, 300);
}

function move(next) {
  changeView({ pose: next, moving: true });
  clearTimeout(settled);
  settled = setTimeout(() => changeView({ moving: false }), 250);
}

const pose = () => view.pose ?? status.ready.cameras[view.camera].pose;

function takeView(from) {
  view = { ...from, moving: false };
  $("integrator").value = view.integrator;
  $("exposure").value = view.exposure;
  $("tonemap").value = view.tonemap;
  showExposure();
}

function listCameras(cameras) {
  const names = cameras.map((camera, i) => `${i}${camera.name ? ` ${camera.name}` : ""}`);
  const select = $("camera");
  if (names.join("\n") !== [...select.options].map((o) => o.text).join("\n")) {
    select.replaceChildren(...names.map((name, i) => new Option(name, i)));
  }
  select.value = view?.camera ?? status.view.camera;
}

$("camera").onchange = (event) => changeView({ camera: Number(event.target.value), pose: null });
$("integrator").onchange = (event) => changeView({ integrator: event.target.value });
$("tonemap").onchange = (event) => changeView({ tonemap: event.target.value });
$("exposure").oninput = (event) => {
  changeView({ exposure: Number(event.target.value) });
  showExposure();
};
$("reset").onclick = () => changeView({ pose: null, moving: false });
$("zoom").onchange = (event) => {
  picture.zoom = Number(event.target.value);
  picture.fit();
  placeMark();
};

function showExposure() {
  $("exposure-value").textContent = `${view.exposure > 0 ? "+" : ""}${view.exposure} EV`;
}

// ---- Mouse and keys

const canvas = $("picture");
let held = null;

canvas.onpointerdown = (event) => {
  held = { x: event.clientX, y: event.clientY, moved: false, pans: event.shiftKey || event.button !== 0 };
  canvas.setPointerCapture(event.pointerId);
  canvas.classList.add("held");
};
canvas.onpointermove = (event) => {
  if (!held) return hover(event);
  const [x, y] = [event.clientX - held.x, event.clientY - held.y];
  if (!held.moved && Math.hypot(x, y) < 3) return;
  Object.assign(held, { x: event.clientX, y: event.clientY, moved: true });
  if (!status?.ready) return;
  const height = canvas.clientHeight;
  move(held.pans ? pan(pose(), -x / height, y / height) : orbit(pose(), (4 * x) / height, (4 * y) / height));
};
canvas.onpointerup = (event) => {
  if (held && !held.moved) pin(picture.pixelAt(event.clientX, event.clientY));
  held = null;
  canvas.classList.remove("held");
};
canvas.oncontextmenu = (event) => event.preventDefault();
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (status?.ready) move(dolly(pose(), Math.exp(event.deltaY / 1000)));
}, { passive: false });

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

canvas.onkeydown = (event) => {
  const arrow = ARROWS[event.key];
  if (!status?.ready) return;
  if (arrow && event.altKey) {
    const [x, y] = pinned ?? resolution.map((n) => n >> 1);
    pin([x + arrow[0], y + arrow[1]].map((v, i) => Math.min(Math.max(v, 0), resolution[i] - 1)));
  } else if (arrow && event.shiftKey) move(pan(pose(), 0.05 * arrow[0], -0.05 * arrow[1]));
  else if (arrow) move(orbit(pose(), 0.1 * arrow[0], 0.1 * arrow[1]));
  else if (event.key === "+" || event.key === "=") move(dolly(pose(), 0.9));
  else if (event.key === "-") move(dolly(pose(), 1 / 0.9));
  else return;
  event.preventDefault();
};

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input")) return;
  const button = { f: "freeze", r: "reset", s: "png" }[event.key.toLowerCase()];
  if (button) return $(button).click();
  const mode = { w: "wipe", d: "difference", h: "heat", a: "a", b: "b" }[event.key.toLowerCase()];
  if (mode && picture.frozen) {
    $("compare").value = mode;
    compare();
  }
});

// ---- Pixel inspector: follows the mouse, until a click pins it

let asked = 0;

function hover(event) {
  if (pinned || performance.now() - asked < 60) return;
  asked = performance.now();
  const pixel = picture.pixelAt(event.clientX, event.clientY);
  if (pixel) say({ type: "inspect", x: pixel[0], y: pixel[1] });
}

function pin(pixel) {
  const again = pixel && pinned && pixel.join() === pinned.join();
  pinned = again ? null : pixel;
  placeMark();
  if (pinned) say({ type: "inspect", x: pinned[0], y: pinned[1] });
}

function placeMark() {
  $("mark").hidden = !pinned;
  if (!pinned) return;
  const size = Math.max(picture.scale, 3);
  const style = $("mark").style;
  style.left = `${(pinned[0] + 0.5) * picture.scale - size / 2}px`;
  style.top = `${(pinned[1] + 0.5) * picture.scale - size / 2}px`;
  style.width = style.height = `${size}px`;
}

function showPixel(pixel) {
  $("pixel-place").textContent = `${pixel.x}, ${pixel.y}${pinned ? " (pinned)" : ""}`;
  $("pixel-radiance").textContent = pixel.radiance.map((c) => Number(c).toPrecision(5)).join("  ");
  $("pixel-samples").textContent = pixel.samples;
  $("pixel-variance").textContent = pixel.variance === null ? "–" : pixel.variance.toExponential(3);
}

// ---- Before and after

$("freeze").onclick = async () => {
  await picture.freeze();
  $("compare").disabled = $("wipe").disabled = !picture.frozen;
};
$("compare").onchange = compare;
$("wipe").oninput = () => {
  $("compare").value = "wipe";
  compare();
};

function compare() {
  picture.mode = $("compare").value;
  picture.wipe = Number($("wipe").value);
  picture.draw();
}

// ---- What the server has to say

function showProblems() {
  const parts = status.errors.flatMap((error) => {
    const place = document.createElement("p");
    place.textContent = `${error.file}:${error.line}:${error.column}: ${error.message}`;
    const source = document.createElement("pre");
    const trail = error.included_from.map((file) => `\nincluded from ${file}`).join("");
    source.textContent = `${error.source}\n${" ".repeat(Math.max(error.column - 1, 0))}^${trail}`;
    return error.line ? [place, source] : [place];
  });
  if (status.notice) {
    const notice = document.createElement("p");
    notice.textContent = status.notice;
    parts.push(notice);
  }
  $("problems").replaceChildren(...parts);
  $("problems").hidden = parts.length === 0;
}

function showEdits() {
  const ms = (value) => (value === null ? "–" : `${Math.round(value)} ms`);
  const ratio = (value) => (value === null ? "" : ` ×${value.toFixed(2)}`);
  const rows = status.reports.toReversed().map((report) => {
    const rate = report.rays_per_second === null ? "–" : (report.rays_per_second / 1e6).toFixed(2);
    const error = report.error === null || !report.is_measured ? "–" : `${(100 * report.error).toPrecision(2)} %`;
    const row = document.createElement("tr");
    const compile = report.compile_ms === null ? report.build_ms : report.compile_ms + (report.build_ms ?? 0);
    const name = report.what.replaceAll(/[^ ,]*\//g, "");
    row.title = report.what;
    const cells = [`${report.edit} ${name}`, ms(compile), ms(report.first_image_ms), rate + ratio(report.speed_ratio), error + ratio(report.error_ratio)];
    row.append(...cells.map((text) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      return cell;
    }));
    return row;
  });
  $("edits").replaceChildren(...rows);
}

function command() {
  const flags = [`--camera=${view.camera}`, `--exposure=${view.exposure}`, `--tonemap=${view.tonemap}`, `--integrator=${view.integrator}`];
  const base = status.command.split(" ").filter((word) => !word.startsWith("--integrator="));
  const moved = view.pose ? "  # the camera was moved here: render takes the scene's own" : "";
  return [...base, ...flags].join(" ") + moved;
}

function showCommand() {
  if (status && view) $("command").textContent = command();
}

$("png").onclick = () => say({ type: "save", format: "png" });
$("exr").onclick = () => say({ type: "save", format: "exr" });
$("copy").onclick = async () => {
  await navigator.clipboard?.writeText(command());
  $("copy").textContent = "Copied";
  setTimeout(() => ($("copy").textContent = "Copy command"), 1500);
};

new ResizeObserver(() => {
  picture.fit();
  placeMark();
  plot.draw();
}).observe($("scroller"));

connect();
