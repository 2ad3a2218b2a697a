#!/usr/bin/env python3
"""Million paths a second, Sunfleck over Mitsuba 3 (`make bench-speed`): independent samples, the same geometry, materials
and depth (7 bounces), on the Cornell box, on the box with a bumpy sphere of 9.8 k, 159 k and 1.96 M triangles, and on 1,024
instances of the first. Sunfleck ends paths by roulette, Mitsuba does not: rays a path are in the table.

The two take turns, so that what else the machine does falls on both; each pair gives a ratio of rendering times alone (no
start, load or compilation), and the table their geometric mean with its 95 % interval. Writes DIR/speed.json and prints the
table. Exit codes: 0 done; 3 a renderer failed; 4 a peer cannot be installed; 5 a ratio is below --least.
"""

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path

from run import HERE, InstallationFailed, enter_environment, processor

SCENES = ("cornell", "cornell_moved", "bumpy_9k", "bumpy_159k", "bumpy_2m", "instances")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", default=",".join(SCENES), help="names with commas")
    parser.add_argument("--pairs", type=int, default=8, help="renderings of each renderer [8]")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel; a quarter of it for 2 M triangles [64]")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--model", type=Path, help="a .gltf or .glb file, in place of the scenes; with --env")
    parser.add_argument("--env", type=Path, help="its environment, .hdr or .exr")
    parser.add_argument("--flags", default="", help="more flags for `sunfleck render`, with spaces")
    parser.add_argument("--least", type=float, help="fail where the upper end of a ratio's interval is below this")
    parser.add_argument("--timeout", type=float, default=240.0)
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "out" / "speed")
    chosen = parser.parse_args()
    if (chosen.model is None) != (chosen.env is None):
        parser.error("--model and --env go together")
    return chosen


def ratio(pairs) -> dict:
    """Geometric mean of how many times as long the second of each pair takes as the first, with the 95 % interval of Student's t on their logarithms."""
    import numpy
    from scipy import stats

    logs = numpy.log([second / first for first, second in pairs])
    mean, half = float(logs.mean()), math.inf
    if len(logs) > 1:
        half = float(stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / math.sqrt(len(logs)))
    return {"ratio": math.exp(mean), "low": math.exp(mean - half), "high": math.exp(mean + half)}


def interval(ratio) -> str:
    return f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"


def model_options(chosen) -> dict:
    """The model with the camera that Sunfleck gives it, which stands in its EXR."""
    import numpy
    import OpenEXR
    from render_sunfleck import release_binary

    probe = chosen.out / "camera.exr"
    subprocess.run([release_binary(), "render", chosen.model, "--resolution", "4x4", "--spp", "1", "--quiet", "-o", probe],
                   check=True)
    with OpenEXR.File(str(probe)) as file:
        # EXR's matrices act on rows; its cameras look down +Z.
        to_camera, to_ndc = (numpy.array(file.header()[name], float).reshape(4, 4).T for name in ("worldToCamera", "worldToNDC"))
    camera_to_ndc = to_ndc @ numpy.linalg.inv(to_camera)
    yfov = 2 * math.degrees(math.atan(-0.5 / camera_to_ndc[1, 1]))
    return {"file": str(chosen.model.resolve()), "environment": str(chosen.env.resolve()), "max_bounces": 7,
            "camera_to_world": numpy.linalg.inv(numpy.diag([1, 1, -1, 1]) @ to_camera).tolist(), "yfov_degrees": yfov}


def model_triangles(path) -> int:
    from render_sunfleck import release_binary

    info = subprocess.run([release_binary(), "info", path, "--json"], capture_output=True, text=True, check=True).stdout
    return json.loads(info)["triangles"]


def measure_scene(name, chosen, renderers=("sunfleck", "mitsuba")) -> dict:
    from children import Child
    from scenes import SCENES as ALL

    options = {"sampler": "independent", "flags": ["--sampler", "independent", *chosen.flags.split()]}
    if chosen.model:
        options["model"] = model_options(chosen)
    spp = max(4, chosen.spp // 4) if name == "bumpy_2m" else chosen.spp
    children = {}
    try:
        for renderer in renderers:
            children[renderer] = Child(renderer, name, chosen.out, chosen.resolution, options, chosen.timeout)
        seconds, rays = {renderer: [] for renderer in children}, None
        for index in range(chosen.pairs + 1):
            for renderer in sorted(children, reverse=index % 2 == 0):
                answer = children[renderer].render(spp, index)[1]
                taken = answer["render"]
                rays = answer.get("rays_per_path", rays)
                # The first of each compiles, fills caches and counts for nothing.
                if index > 0:
                    seconds[renderer].append(taken)
        versions = {renderer: child.version for renderer, child in children.items()}
    finally:
        for child in children.values():
            child.close()
    paths = chosen.resolution**2 * spp
    best = {renderer: paths / min(taken) / 1e6 for renderer, taken in seconds.items()}
    triangles = model_triangles(chosen.model) if chosen.model else ALL[name]().triangle_count()
    return {"scene": name, "triangles": triangles, "spp": spp, "seconds": seconds,
            "rays_per_path": rays, "best_million_paths_per_second": best, "versions": versions,
            **(ratio(list(zip(*(seconds[renderer] for renderer in renderers)))) if len(renderers) > 1 else {})}


def table(results) -> str:
    lines = ["| scene | triangles | Sunfleck, best (M paths/s) | its rays a path | Mitsuba, best | ratio of the pairs (95 %) |",
             "|---|---|---|---|---|---|"]
    for r in results:
        best = r["best_million_paths_per_second"]
        peer = f"{best['mitsuba']:.2f} | {interval(r)}" if "mitsuba" in best else "– | –"
        lines.append(f"| {r['scene']} | {r['triangles']:,} | {best['sunfleck']:.2f} | {r['rays_per_path']:.2f} | {peer} |")
    return "\n".join(lines)


def main() -> int:
    chosen = arguments()
    try:
        enter_environment(Path(__file__))
        from children import RENDERERS, ChildFailed

        RENDERERS["mitsuba"][0]()
    except InstallationFailed as error:
        print(f"error: {error}", file=sys.stderr)
        return 4
    chosen.out.mkdir(parents=True, exist_ok=True)
    results = []
    for name in [chosen.model.stem] if chosen.model else chosen.scenes.split(","):
        try:
            results.append(measure_scene(name, chosen))
        except ChildFailed as error:
            print(f"error: {name}: {error}", file=sys.stderr)
            return 3
        print(f"{name}: {results[-1]['ratio']:.3f}", file=sys.stderr)
        report = {"processor": processor(), "load_average": os.getloadavg()[0], "scenes": results}
        (chosen.out / "speed.json").write_text(json.dumps(report, indent=1))
    print(f"{report['processor']}; {'; '.join(results[0]['versions'].values())}\n\n{table(results)}")
    missed = [r["scene"] for r in results if chosen.least and r["high"] < chosen.least]
    if missed:
        print(f"below {chosen.least}: {', '.join(missed)}", file=sys.stderr)
    return 5 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
