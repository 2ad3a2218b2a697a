// The kernel that renders: how long it took to build and takes to run, and what it counts if it is asked to.

import { $, state } from "./state.js";

const ms = (value) => (value === null || value === undefined ? "–" : `${Math.round(value)} ms`);
const percent = (share) => (share === null ? "–" : `${(100 * share).toFixed(1)} %`);
const perRay = (value) => (value === null ? "–" : value.toFixed(2));
const PREFIXES = ["", " k", " M", " G", " T"];

function count(value) {
  const power = value < 1000 ? 0 : Math.min(Math.floor(Math.log10(value) / 3), PREFIXES.length - 1);
  return (value / 1000 ** power).toPrecision(value < 1000 ? 4 : 3).replace(/\.?0+$/, "") + PREFIXES[power];
}

/** Built when, of what. */
export function showKernel({ reports, ready }) {
  const last = reports.findLast((report) => report.build_ms !== null);
  $("kernel-compile").textContent = ms(last?.compile_ms);
  $("kernel-build").textContent = ms(last?.build_ms);
  $("kernel-key").textContent = ready ? ready.kernel : "";
}

/** How fast, and what was counted. */
export function showCounts({ seconds, spp, rays, statistics }) {
  $("kernel-time").textContent = `${((1e3 * seconds) / spp).toPrecision(3)} ms a sample of every pixel`;
  $("kernel-rays").textContent = `${(rays / seconds / 1e6).toFixed(2)} million a second`;
  $("counts").hidden = !statistics;
  if (!statistics) return;
  const all = statistics.rays.find(({ kind }) => kind === "all").rays;
  $("counts-rays").replaceChildren(...statistics.rays.map((of) => {
    const row = document.createElement("tr");
    const cells = [of.kind, count(of.rays), percent(all > 0 ? of.rays / all : null), perRay(of.nodes_per_ray), perRay(of.triangles_per_ray)];
    row.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
    return row;
  }));
  $("counts-lanes").textContent = `${percent(statistics.search_occupancy)} in the search, ${percent(statistics.shading_occupancy)} in shading`;
  const { slices } = statistics;
  const [median, shortest, longest] = [slices.median, slices.shortest, slices.longest].map((s) => (1e3 * s).toPrecision(3));
  const resumed = slices.dispatches - slices.count;
  $("counts-slices").textContent = `median ${median} ms, ${shortest} to ${longest} ms; ${slices.count} slices, resumed ${resumed} times`
    + (statistics.saturated ? "; a counter is full: there was more" : "");
}

/** What the picture shows, and what its colours span. */
export function showShown({ shown, scale }) {
  const waits = (shown ?? "") !== state.view.shown;
  $("scale").textContent = waits ? "its kernel is being built" : scale ?? "";
  $("scale").hidden = !$("scale").textContent;
  document.body.dataset.shown = shown ?? "light";
}
