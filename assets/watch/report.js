// What the server reports: errors, edits with their figures, and the kernel that runs.

import { $ } from "./state.js";

const STAGES = { Load: "loading", Render: "rendering", Idle: "finished" };

export function showStage(status) {
  const stage = STAGES[status.stage];
  $("stage").textContent = status.building === null ? stage : `${stage}, building edit ${status.building}`;
}

function element(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

export function showProblems(status) {
  const parts = status.errors.flatMap((error) => {
    if (!error.line) return [element("p", `${error.file}: ${error.message}`)];
    const trail = error.included_from.map((file) => `\nincluded from ${file}`).join("");
    const caret = `${" ".repeat(Math.max(error.column - 1, 0))}^`;
    return [
      element("p", `${error.file}:${error.line}:${error.column}: ${error.message}`),
      element("pre", `${error.source}\n${caret}${trail}`),
    ];
  });
  if (status.notice) parts.push(element("p", status.notice));
  $("problems").replaceChildren(...parts);
  $("problems").hidden = parts.length === 0;
}

const ms = (value) => (value === null ? "–" : `${Math.round(value)} ms`);
const rate = (value) => (value === null ? "–" : (value / 1e6).toFixed(2));
const ratio = (value) => (value === null ? "" : ` ×${value.toFixed(2)}`);
const percent = (value) => `${(100 * value).toPrecision(2)} %`;

export function showEdits(status) {
  const rows = status.reports.toReversed().flatMap((report) => {
    const error = report.error === null || !report.is_measured ? "–" : percent(report.error);
    const [head, row] = [document.createElement("tr"), document.createElement("tr")];
    head.className = "name";
    head.title = row.title = `${report.what}: GLSL to SPIR-V ${ms(report.compile_ms)}, the driver's build ${ms(report.build_ms)}, `
      + `save to the first image ${ms(report.first_image_ms)}; ${report.spp} samples per pixel`;
    const name = report.what.replaceAll(/[^ ,]*\//g, "");
    const more = [report.reused, report.is_superseded && `superseded at ${report.spp} spp`].filter(Boolean);
    const named = element("td", [`${report.edit} ${name}`, ...more].join(": "));
    named.colSpan = 5;
    head.append(named);
    const cells = [
      ms(report.compile_ms), ms(report.build_ms), ms(report.first_image_ms),
      rate(report.rays_per_second) + ratio(report.speed_ratio), error + ratio(report.error_ratio),
    ];
    row.append(...cells.map((text) => element("td", text)));
    return [head, row];
  });
  $("edits").replaceChildren(...rows);
}

/** Below the picture's head: size, samples, time, speed, error. */
export function showFigures({ width, height, spp, seconds, rays, error, non_finite }) {
  const parts = [`${width}×${height}`, `${spp} spp`, `${seconds.toFixed(1)} s`, `${rate(rays / seconds)} Mrays/s`];
  parts.push(`${((1e3 * seconds) / spp).toPrecision(3)} ms a sample`);
  if (error) parts.push(`error ≤ ${(100 * error).toPrecision(3)} %`);
  if (non_finite) parts.push(`${non_finite} samples NaN or infinite`);
  $("figures").textContent = parts.join(", ");
}
