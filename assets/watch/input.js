// Mouse and keys.

import { dolly, orbit, pan } from "./camera.js";
import { hover, pin } from "./inspect.js";
import { $, pose, state } from "./state.js";
import { move } from "./view.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const BUTTONS = { f: "freeze", r: "reset", s: "png", v: "debug", c: "statistics" };
const MODES = { w: "wipe", d: "difference", h: "heat", a: "a", b: "b" };

/** `compare(mode)` changes what is shown of before and after. */
export function listen(picture, compare) {
  const canvas = picture.canvas;
  let held = null;

  canvas.onpointerdown = (event) => {
    held = { x: event.clientX, y: event.clientY, moved: false, pans: event.shiftKey || event.button !== 0 };
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("held");
  };
  canvas.onpointermove = (event) => {
    if (!held) return hover(picture.pixelAt(event.clientX, event.clientY));
    const [x, y] = [event.clientX - held.x, event.clientY - held.y];
    if (!held.moved && Math.hypot(x, y) < 3) return;
    Object.assign(held, { x: event.clientX, y: event.clientY, moved: true });
    if (!state.status?.ready) return;
    const height = canvas.clientHeight;
    move(held.pans ? pan(pose(), -x / height, y / height) : orbit(pose(), (4 * x) / height, (4 * y) / height));
  };
  canvas.onpointerup = (event) => {
    if (held && !held.moved) pin(picture.pixelAt(event.clientX, event.clientY), picture);
    held = null;
    canvas.classList.remove("held");
  };
  canvas.oncontextmenu = (event) => event.preventDefault();
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (state.status?.ready) move(dolly(pose(), Math.exp(event.deltaY / 1000)));
  }, { passive: false });

  canvas.onkeydown = (event) => {
    const arrow = ARROWS[event.key];
    if (!state.status?.ready) return;
    if (arrow && event.altKey) {
      const [x, y] = state.pinned ?? state.resolution.map((n) => n >> 1);
      pin([x + arrow[0], y + arrow[1]].map((v, i) => Math.min(Math.max(v, 0), state.resolution[i] - 1)), picture);
    } else if (arrow && event.shiftKey) move(pan(pose(), 0.05 * arrow[0], -0.05 * arrow[1]));
    else if (arrow) move(orbit(pose(), 0.1 * arrow[0], 0.1 * arrow[1]));
    else if (event.key === "+" || event.key === "=") move(dolly(pose(), 0.9));
    else if (event.key === "-") move(dolly(pose(), 1 / 0.9));
    else if (event.key === "Escape" && state.pinned) pin(null, picture);
    else return;
    event.preventDefault();
  };

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input:not([type=checkbox])")) return;
    const key = event.key.toLowerCase();
    // What is not there cannot be pressed.
    if (BUTTONS[key]) return $(BUTTONS[key]).offsetParent && $(BUTTONS[key]).click();
    if (MODES[key] && picture.frozen) compare(MODES[key]);
    const shown = $("shown").options[/^\d$/.test(key) ? Number(key) : -1];
    if (shown) {
      $("shown").value = shown.value;
      $("shown").dispatchEvent(new Event("change"));
    }
  });
}
