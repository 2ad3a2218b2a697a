"""The pictures: time against error of one scene, and what every renderer made of it side by side."""

import matplotlib
import numpy

matplotlib.use("Agg")
import matplotlib.pyplot as pyplot  # noqa: E402

COLOURS = {"sunfleck": "#d95f02", "mitsuba": "#1b6ca8", "cycles": "#4d9221", "luxcore": "#8856a7"}


def by_count(rows, key, whole=0.0):
    """For each sample count: seconds and error (means over the seeds) and the error's standard error."""
    out = []
    for spp in sorted({row["spp"] for row in rows}):
        same = [row for row in rows if row["spp"] == spp]
        values = numpy.array([row[key] for row in same])
        seconds = numpy.mean([row["seconds"]["render"] + (whole and whole_extra(row, whole)) for row in same])
        out.append((spp, seconds, values.mean(), values.std(ddof=1) / len(values) ** 0.5 if len(values) > 1 else 0.0))
    return out


def whole_extra(row, once) -> float:
    """Starting, loading and compiling: from the row where each rendering is a process, else what was paid once."""
    return row["seconds"].get("start", once["start"]) + row["seconds"].get("load", once["load"]) \
        + row["seconds"]["compile"]


def plot_scene(result, folder):
    figure, panels = pyplot.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    kinds = (("mse", False, "render time"), ("relmse", False, "render time"), ("mse", True, "whole process"))
    for panel, (key, whole, axis) in zip(panels, kinds):
        for name, data in result["renderers"].items():
            points = [p for p in by_count(data["rows"], key, data["once"] if whole else 0) if p[2] > 0]
            _, seconds, error, spread = zip(*points)
            # A bar that would reach zero has no place on a logarithmic axis: it ends at a tenth of the value.
            low = [min(s, 0.9 * e) for s, e in zip(spread, error)]
            panel.errorbar(seconds, error, yerr=(low, spread), marker="o", markersize=3, capsize=2, label=name,
                           color=COLOURS.get(name))
        panel.set(xscale="log", yscale="log", xlabel=f"{axis} (s)", ylabel={"mse": "MSE", "relmse": "relMSE"}[key])
        panel.grid(which="both", alpha=0.2)
    panels[0].legend()
    figure.suptitle(result["title"])
    for kind in ("svg", "png"):
        figure.savefig(folder / f"{result['scene']}.{kind}", dpi=80)
    pyplot.close(figure)


def contact_sheet(result, images, folder):
    """The references, one exposure for all, and where a peer's differs from Sunfleck's."""
    names = list(images)
    figure, panels = pyplot.subplots(2, len(names), figsize=(3 * len(names), 6.2), layout="constrained", squeeze=False)
    white = numpy.percentile(images[names[0]], 97)
    for column, name in enumerate(names):
        panels[0][column].imshow(numpy.clip(images[name] / white, 0, 1) ** (1 / 2.2))
        panels[0][column].set_title(name)
        difference = (images[name] - images[names[0]]).mean(axis=2) / white
        panels[1][column].imshow(difference, cmap="RdBu", vmin=-0.1, vmax=0.1)
        panels[1][column].set_title(f"{name} − {names[0]}, ±10 % of white")
    for panel in panels.ravel():
        panel.axis("off")
    figure.savefig(folder / f"{result['scene']}-pictures.png", dpi=70)
    pyplot.close(figure)
