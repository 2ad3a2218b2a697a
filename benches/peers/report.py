"""The tables of docs/benchmarks/peers.md, from results.json."""

import numpy
from measure import fit, time_to
from plot import by_count


def mean_of(rows, key):
    values = [row["seconds"][key] for row in rows if key in row["seconds"]]
    return float(numpy.mean(values)) if values else None


def times_table(result) -> list[str]:
    out = ["| renderer | start (s) | load (s) | compile, first (s) | samples/pixel | render (s) | MSE | relMSE |",
           "|---|---|---|---|---|---|---|---|"]
    for name, data in result["renderers"].items():
        start = mean_of(data["rows"], "start") or data["once"]["start"]
        load = mean_of(data["rows"], "load") or data["once"]["load"]
        spp, seconds, error, spread = by_count(data["rows"], "mse")[-1]
        relative, relative_spread = by_count(data["rows"], "relmse")[-1][2:]
        out.append(f"| {name} | {start:.2f} | {load:.2f} | {data['rows'][0]['seconds']['compile']:.2f} | {spp} | "
                   f"{seconds:.2f} | {error:.3g} ± {spread:.1g} | {relative:.3g} ± {relative_spread:.1g} |")
    return out


def ratio_lines(result) -> list[str]:
    """Time to Sunfleck's lowest error, from straight lines through each renderer's log-log points."""
    out = []
    rows = result["renderers"]
    if "sunfleck" not in rows:
        return out
    for key in ("mse", "relmse"):
        lines = {}
        for name, data in rows.items():
            points = [p for p in by_count(data["rows"], key)[-4:] if p[2] > 0]
            if len(points) >= 2:
                lines[name] = fit([p[1] for p in points], [p[2] for p in points])
        target = by_count(rows["sunfleck"]["rows"], key)[-1][2]
        for name in lines:
            # A line that does not fall says that time bought nothing there; no ratio follows from it.
            if name == "sunfleck" or target <= 0 or max(lines[name][0], lines["sunfleck"][0]) >= 0:
                continue
            ratio = time_to(target, lines["sunfleck"]) / time_to(target, lines[name])
            out.append(f"- to a {'MSE' if key == 'mse' else 'relMSE'} of {target:.3g}: Sunfleck takes {ratio:.3g} times "
                       f"as long as {name} (slopes {lines['sunfleck'][0]:.2f} and {lines[name][0]:.2f})")
    return out


def equality_lines(result) -> list[str]:
    return [f"- {peer} − Sunfleck: means "
            + ", ".join(f"{d:+.2%}" for d in figures["relative_difference"])
            + f" (standard error {max(figures['relative_standard_error']):.2%}); {figures['tiles_that_differ']} of "
              f"{figures['tiles']} tile channels differ at 1 % overall; smallest p {figures['smallest_p']:.2g}"
            for peer, figures in result["equality"].items()]


def write_report(results, path) -> None:
    text = [f"Processor: {results['processor']}; load average at the start {results['load_average']:.1f}; "
            f"{results['resolution']}×{results['resolution']}; Mitsuba's sampler: {results['mitsuba_sampler']}; "
            f"Sunfleck's flags: {results['sunfleck_flags'] or 'none'}; "
            f"the whole run took {results['seconds'] / 60:.0f} minutes.", ""]
    text += [f"**Absent**: {name}: {why}\n" for name, why in results["absent"].items()]
    text += [f"**Failed**: {scene}: {why}\n" for scene, why in results["failed"].items()]
    for result in results["scenes"]:
        versions = "; ".join(data["version"] for data in result["renderers"].values())
        text += [f"### {result['title']}", "",
                 f"`{result['scene']}`: {result['triangles']:,} triangles, at most {result['max_bounces']} bounces. "
                 f"{versions}.", "", f"![time against error](peers/{result['scene']}.svg)", ""]
        text += [f"Not rendered by {name}, which has no equal {' and '.join(what)}.\n" for name, what in
                 result["lacks"].items()]
        text += times_table(result) + [""] + ratio_lines(result) + [""] + equality_lines(result) + [""]
    path.write_text("\n".join(text))
