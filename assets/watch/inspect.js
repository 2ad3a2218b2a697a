// The pixel inspector: follows the mouse, until a click pins a pixel. What shaders print is that of the pinned pixel.

import { $, say, state } from "./state.js";
import { changeView } from "./view.js";

let asked = 0;

export function hover(pixel) {
  if (state.pinned || !pixel || performance.now() - asked < 60) return;
  asked = performance.now();
  say({ type: "inspect", x: pixel[0], y: pixel[1] });
}

/** The same pixel again lets it go. */
export function pin(pixel, picture) {
  const again = pixel && state.pinned && pixel.join() === state.pinned.join();
  state.pinned = again ? null : pixel;
  placeMark(picture);
  inspectPinned();
  changeView({ pixel: state.pinned });
}

export function inspectPinned() {
  if (state.pinned) say({ type: "inspect", x: state.pinned[0], y: state.pinned[1] });
}

export function placeMark(picture) {
  $("mark").hidden = !state.pinned;
  if (!state.pinned) return;
  const size = Math.max(picture.scale, 3);
  const style = $("mark").style;
  style.left = `${(state.pinned[0] + 0.5) * picture.scale - size / 2}px`;
  style.top = `${(state.pinned[1] + 0.5) * picture.scale - size / 2}px`;
  style.width = style.height = `${size}px`;
}

export function showPixel({ x, y, radiance, samples, variance, seen, aovs }) {
  const number = (value) => (value === null ? "not finite" : Number(value).toPrecision(5));
  $("pixel-place").textContent = `${x}, ${y}${state.pinned ? " (pinned)" : ""}`;
  $("pixel-radiance").textContent = radiance.map(number).join("  ");
  $("pixel-samples").textContent = samples;
  $("pixel-variance").textContent = variance === null ? "–" : variance.toExponential(3);
  $("pixel-material").textContent = seen ? `${seen.material} (${seen.bsdf}${seen.is_back ? ", back" : ""})` : "nothing";
  $("pixel-mesh").textContent = seen ? (seen.instance === seen.mesh ? seen.mesh : `${seen.mesh} in ${seen.instance}`) : "–";
  $("pixel-triangle").textContent = seen ? `${seen.triangle} of primitive ${seen.primitive}` : "–";
  $("pixel-distance").textContent = seen ? `${seen.distance.toPrecision(5)} m` : "–";
  $("pixel-aovs").replaceChildren(...aovs.flatMap(([name, values]) => {
    const [term, value] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name;
    value.textContent = values.map(number).join("  ");
    return [term, value];
  }));
}

/** What shaders give to DEBUG_PRINT. */
export function showPrints(prints) {
  $("prints").hidden = !prints;
  if (!prints) return;
  $("prints-place").textContent = prints.pixel.join(", ");
  const rows = prints.values.map(([place, value]) => {
    const row = document.createElement("li");
    const at = document.createElement("span");
    at.textContent = `${place.file.replace(/.*\//, "")}:${place.line}`;
    at.title = place.file;
    const what = document.createElement("code");
    what.textContent = `${place.text} = ${value}`;
    row.append(at, what);
    return row;
  });
  if (rows.length === 0) {
    const none = document.createElement("li");
    none.textContent = "the path comes to no DEBUG_PRINT";
    rows.push(none);
  }
  $("prints-list").replaceChildren(...rows);
}
