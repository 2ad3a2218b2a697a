// Mouse, fingers and keys.

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
  /** Where pointers are down, by their ids; two of them are fingers. */
  const down = new Map();
  let held = null;
  /** What two fingers began with: by all they did since, the camera is where it would be had they done it at once. */
  let pinch = null;
  const spread = () => {
    const [a, b] = [...down.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1) };
  };

  canvas.onpointerdown = (event) => {
    const { pointerId, clientX: x, clientY: y } = event;
    if (down.size === 2) return;
    held = { moved: down.size > 0, pans: event.shiftKey || event.button !== 0 };
    down.set(pointerId, { x, y });
    if (down.size === 2 && state.status?.ready) pinch = { pose: pose(), ...spread() };
    canvas.setPointerCapture(pointerId);
    canvas.classList.add("held");
  };
  canvas.onpointermove = (event) => {
    const { pointerId, clientX, clientY } = event;
    const from = down.get(pointerId);
    if (!from) return event.pointerType === "touch" || hover(picture.pixelAt(clientX, clientY));
    const [x, y] = [clientX - from.x, clientY - from.y];
    if (!held.moved && Math.hypot(x, y) < 3) return;
    down.set(pointerId, { x: clientX, y: clientY });
    held.moved = true;
    if (!state.status?.ready) return;
    const height = canvas.clientHeight;
    if (pinch) {
      const now = spread();
      move(pan(dolly(pinch.pose, pinch.apart / now.apart), (pinch.x - now.x) / height, (now.y - pinch.y) / height));
    } else move(held.pans ? pan(pose(), -x / height, y / height) : orbit(pose(), (4 * x) / height, (4 * y) / height));
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => {
    const { type, pointerId, clientX, clientY } = event;
    if (!down.delete(pointerId)) return;
    pinch = null;
    if (type === "pointerup" && !held.moved) pin(picture.pixelAt(clientX, clientY), picture);
    canvas.classList.toggle("held", down.size > 0);
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
