#!/usr/bin/env python3
"""Sunfleck beside its peers: time against error on the same scenes and cores (`make bench-peers`; docs/benchmarks/peers.md).

Per scene every renderer is started once, then they take turns: each renders doubling sample counts with several seeds
until one rendering takes --budget seconds, then the parts of its reference with other seeds. Writes to out/peers:
results.json, one plot a scene (SVG, PNG), one contact sheet a scene (PNG), peers.md with the tables.

Exit codes: 0 done; 1 the renderers disagree; 3 a renderer failed while it ran; 4 a peer cannot be installed (--short).
"""

import argparse
import json
import os
import platform
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "scripts")]
from python_environment import InstallationFailed  # noqa: E402

# The whole-image means may differ by this much and be called equal, beside 4 standard errors of their difference.
TOLERANCE = 0.005


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", help="names with commas; all seven without it")
    parser.add_argument("--renderers", default="sunfleck,mitsuba,cycles,luxcore", help="names with commas")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--budget", type=float, default=2.0, help="seconds of the longest rendering [2]")
    parser.add_argument("--counts", help="samples per pixel with commas, the same for all, in place of the budget")
    parser.add_argument("--parts", type=int, default=8, help="independent renderings in a reference [8]")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds until a silent renderer is given up [240]")
    parser.add_argument("--mitsuba-sampler", default="multijitter")
    parser.add_argument("--sunfleck-flags", default="", help="more flags for `sunfleck render`, as in '--adaptive'")
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "out" / "peers")
    parser.add_argument("--short", action="store_true", help="the check of CI: Mitsuba alone, cornell, 64x64")
    chosen = parser.parse_args()
    if chosen.short:
        chosen.scenes, chosen.renderers, chosen.resolution, chosen.budget = "cornell", "sunfleck,mitsuba", 64, 0.5
        chosen.counts = "4,16,64"
    return chosen


def enter_environment(script=HERE / "run.py") -> None:
    """Goes on in the interpreter that has this program's packages, at the beginning of `script`."""
    from children import report_environment

    python = report_environment()
    if Path(sys.prefix) != python.parent.parent:
        os.execv(python, [str(python), str(script), *sys.argv[1:]])


def processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return f"{line.split(':', 1)[1].strip()}, {os.cpu_count()} cores"
    except OSError:
        pass
    return f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores"


def installed(names) -> tuple[list, dict]:
    from children import RENDERERS

    there, absent = [], {}
    for name in names:
        try:
            RENDERERS[name][0]()
            there.append(name)
        except InstallationFailed as error:
            absent[name] = str(error)
            print(f"absent: {error}", file=sys.stderr)
    return there, absent


def measured(children, chosen) -> dict:
    """Images and times of every renderer: {name: [{spp, seed, seconds, image}]}, taken in turns."""
    images = {name: [] for name in children}
    fixed = [int(count) for count in chosen.counts.split(",")] if chosen.counts else None
    going = set(children)
    for spp in fixed or (2**power for power in range(13)):
        for _ in range(chosen.seeds):
            for name in sorted(going):
                # One seed an image, far below those of the references, whatever the counts are.
                number = len(images[name])
                image, seconds = children[name].render(spp, number)
                images[name].append({"spp": spp, "seed": number, "seconds": seconds, "image": image})
        # Stop before the rendering that would pass the budget; two counts at least, or there is no line to fit.
        for name in list(going):
            last = min(row["seconds"]["render"] for row in images[name] if row["spp"] == spp)
            if not fixed and 2 * last > chosen.budget and spp > 1:
                going.discard(name)
    return images


def references(children, images, chosen) -> dict:
    from measure import Reference
    from worker import REFERENCE_SEED

    parts = {name: [] for name in children}
    for index in range(chosen.parts):
        for name, child in children.items():
            spp = max(row["spp"] for row in images[name])
            parts[name].append(child.render(spp, REFERENCE_SEED + index)[0])
    return {name: Reference(images_of_one) for name, images_of_one in parts.items()}


def compare_scene(name, renderers, chosen) -> dict:
    from children import LACKS, Child, needs
    from gltf import write_environment
    from measure import equality, errors
    from scenes import SCENES

    scene = SCENES[name]()
    if scene.environment is not None:
        write_environment(scene, chosen.out)
    missing = {renderer: sorted(LACKS.get(renderer, set()) & needs(scene)) for renderer in renderers}
    children = {}
    try:
        for renderer in (r for r in renderers if not missing[r]):
            options = {"sampler": chosen.mitsuba_sampler, "flags": chosen.sunfleck_flags.split()}
            children[renderer] = Child(renderer, name, chosen.out, chosen.resolution, options, chosen.timeout)
        images = measured(children, chosen)
        truth = references(children, images, chosen)
        result = {"scene": name, "title": scene.title, "triangles": scene.triangle_count(),
                  "max_bounces": scene.max_bounces, "renderers": {}, "equality": {},
                  "lacks": {renderer: what for renderer, what in missing.items() if what}}
        for renderer, child in children.items():
            rows = [{k: v for k, v in row.items() if k != "image"} | errors(row["image"], truth[renderer])
                    for row in images[renderer]]
            result["renderers"][renderer] = {"version": child.version, "once": child.seconds, "rows": rows,
                                             "mean": truth[renderer].mean.mean(axis=(0, 1)).tolist()}
            if renderer != "sunfleck" and "sunfleck" in truth:
                result["equality"][renderer] = equality(truth[renderer], truth["sunfleck"])
    finally:
        for child in children.values():
            child.close()
    from plot import contact_sheet, plot_scene

    plot_scene(result, chosen.out)
    contact_sheet(result, {renderer: reference.mean for renderer, reference in truth.items()}, chosen.out)
    return result


def agree(result) -> bool:
    good = True
    for peer, figures in result["equality"].items():
        for difference, error in zip(figures["relative_difference"], figures["relative_standard_error"]):
            # An error that large could hide a difference of the tolerance: such a run proves nothing.
            good &= error <= TOLERANCE and abs(difference) <= 4 * error + TOLERANCE
        print(f"{result['scene']}: {peer} − sunfleck, means {[f'{d:+.3%}' for d in figures['relative_difference']]} "
              f"± {max(figures['relative_standard_error']):.3%}, {figures['tiles_that_differ']} of {figures['tiles']} "
              "tiles differ", file=sys.stderr)
    return good


def main() -> int:
    chosen = arguments()
    try:
        enter_environment()
    except InstallationFailed as error:
        print(f"error: {error}", file=sys.stderr)
        return 4
    from children import RENDERERS, ChildFailed
    from report import write_report
    from scenes import COMPARED, SCENES

    wanted, scenes = chosen.renderers.split(","), chosen.scenes.split(",") if chosen.scenes else list(COMPARED)
    for kind, names, known in (("renderer", wanted, RENDERERS), ("scene", scenes, SCENES)):
        if unknown := set(names) - set(known):
            print(f"error: no {kind} {', '.join(sorted(unknown))}; there are {', '.join(known)}", file=sys.stderr)
            return 2
    there, absent = installed(wanted)
    if chosen.short and absent:
        print("error: the peer of the short form cannot be installed; nothing was compared", file=sys.stderr)
        return 4
    chosen.out.mkdir(parents=True, exist_ok=True)
    results = {"processor": processor(), "load_average": os.getloadavg()[0], "absent": absent, "scenes": [],
               "mitsuba_sampler": chosen.mitsuba_sampler, "sunfleck_flags": chosen.sunfleck_flags,
               "resolution": chosen.resolution, "failed": {}}
    started, good = time.monotonic(), True
    for name in scenes:
        try:
            result = compare_scene(name, there, chosen)
        except ChildFailed as error:
            print(f"error: {name}: {error}", file=sys.stderr)
            results["failed"][name] = str(error)
            continue
        good &= agree(result)
        results["scenes"].append(result)
        results["seconds"] = time.monotonic() - started
        (chosen.out / "results.json").write_text(json.dumps(results, indent=1))
        write_report(results, chosen.out / "peers.md")
        print(f"{name}: {time.monotonic() - started:.0f} s so far", file=sys.stderr)
    if results["failed"]:
        return 3
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
