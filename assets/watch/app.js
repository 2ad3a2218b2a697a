// The page of `sunfleck watch`: takes status and images from the server's WebSocket, and hands them to the page's parts.

import { listen } from "./input.js";
import { inspectPinned, placeMark, showPixel, showPrints } from "./inspect.js";
import { showCounts, showKernel, showShown } from "./kernel.js";
import { Picture } from "./picture.js";
import { Plot } from "./plot.js";
import { showEdits, showFigures, showProblems, showStage } from "./report.js";
import { $, state } from "./state.js";
import { flushView, listCameras, listShown, showCommand, takeView, unusual } from "./view.js";

const picture = new Picture($("picture"));
const plot = new Plot($("plot"), $("key"));

function connect() {
  state.socket = new WebSocket(`ws://${location.host}/socket`);
  state.socket.binaryType = "arraybuffer";
  state.socket.onmessage = ({ data }) => (typeof data === "string" ? told(JSON.parse(data)) : received(data));
  state.socket.onclose = () => {
    $("stage").textContent = "disconnected";
    setTimeout(connect, 1000);
  };
}

function told(message) {
  if (message.type === "pixel") return showPixel(message);
  state.status = message;
  if (message.ready) {
    state.resolution = message.ready.resolution;
    $("scene").textContent = message.ready.scene;
    $("scene").title = message.ready.device;
    listCameras(message.ready.cameras);
    listShown(message.ready.aovs);
  }
  if (!state.view) takeView(message.view);
  $("debug-row").hidden = !message.has_debug_pixel;
  showStage(message);
  showProblems(message);
  showEdits(message);
  showKernel(message);
  showPrints(message.prints);
  showCommand();
}

async function received(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const bytes = new Uint8Array(buffer, 4 + length);
  if (about.type === "file") return download(about.name, bytes);
  // Decoding may be overtaken by that of a later image.
  const number = ++state.received;
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  if (number < state.drawn) return bitmap.close();
  state.drawn = number;
  state.frame = about;
  picture.show(bitmap, about.moving ? state.resolution : [about.width, about.height]);
  plot.add(about, unusual());
  showFigures(about);
  showCounts(about);
  showShown(about);
  document.body.dataset.frames = Number(document.body.dataset.frames ?? 0) + 1;
  document.body.dataset.edit = about.edit;
  document.body.dataset.start = about.start;
  document.body.dataset.spp = about.spp;
  placeMark(picture);
  if (!about.moving) inspectPinned();
  flushView();
}

function download(name, bytes) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes]));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// ---- Before and after, and how large

function compare(mode = $("compare").value) {
  $("compare").value = mode;
  picture.mode = mode;
  picture.wipe = Number($("wipe").value);
  picture.draw();
}

$("freeze").onclick = async () => {
  await picture.freeze();
  plot.freeze();
  $("compare").disabled = $("wipe").disabled = !picture.frozen;
};
$("compare").onchange = () => compare();
$("wipe").oninput = () => compare("wipe");
$("zoom").onchange = (event) => {
  picture.zoom = Number(event.target.value);
  picture.fit();
  placeMark(picture);
};
new ResizeObserver(() => {
  picture.fit();
  placeMark(picture);
  plot.draw();
}).observe($("scroller"));

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plot.draw());

listen(picture, compare);
connect();
