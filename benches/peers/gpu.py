#!/usr/bin/env python3
"""What Sunfleck does on this machine's GPU, in one report (`make bench-gpu`; docs/benchmarks/gpu.md): calibration of the
device, million paths a second beside Mitsuba 3 (on CUDA where there is any), time against error, ray queries beside our own
BVH, starts with and without caches, and what specialised kernels gain.

Writes DIR/report.md and DIR/report.json after every step. On a machine without a GPU it measures the CPU's driver and says
so; --short is for trying it there. Exit codes: 0 done; 3 a step failed, see the report; 4 no Vulkan device, or no PyPI.
"""

import argparse
import datetime
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

from run import HERE, InstallationFailed, enter_environment, installed, processor

ROOT = HERE.parents[1]
SCENES = ("cornell", "bumpy_9k", "bumpy_159k", "bumpy_2m", "instances")


class StepFailed(Exception):
    """A step has no figures; the message says why."""


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--device", help="as `sunfleck render --device`; without it the one that is taken by default")
    parser.add_argument("--pairs", type=int, default=8, help="renderings of each side of a comparison [8]")
    parser.add_argument("--budget", type=float, default=1.0, help="least seconds of a rendering that is timed [1]")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds until a rendering is given up [600]")
    parser.add_argument("--short", action="store_true", help="the smallest form of every step, to see that all of it works")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "gpu")
    chosen = parser.parse_args()
    chosen.scenes, chosen.suite, chosen.resolution = SCENES, "standard", 512
    if chosen.short:
        chosen.scenes, chosen.suite, chosen.resolution = ("cornell", "bumpy_9k"), "short", 64
        chosen.pairs, chosen.budget = 2, 0.1
    return chosen


class Bench:
    """The program, the device and the files that all steps share."""

    def __init__(self, chosen):
        from render_sunfleck import Sunfleck

        self.chosen, self.sunfleck = chosen, Sunfleck()
        self.device_flags = ["--device", chosen.device] if chosen.device else []
        self.jobs = {}

    def run(self, *words, environment=None) -> str:
        try:
            done = subprocess.run([self.sunfleck.binary, *map(str, words)], capture_output=True, text=True, cwd=ROOT,
                                  env=environment or self.sunfleck.environment, timeout=self.chosen.timeout)
        except subprocess.TimeoutExpired as error:
            raise StepFailed(f"`sunfleck {' '.join(map(str, words))}` was given up after {error.timeout} s") from error
        if done.returncode != 0:
            last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
            raise StepFailed(f"`sunfleck {' '.join(map(str, words))}` ended with {done.returncode}: {last}")
        return done.stdout

    def render(self, scene, flags, environment=None) -> dict:
        with tempfile.TemporaryDirectory() as folder:
            return json.loads(self.run("render", scene, "-o", f"{folder}/a.exr", "--json", "--quiet", "--strict",
                                       *self.device_flags, *flags, environment=environment))

    def job(self, name) -> tuple[Path, list]:
        """The scene as a file, and its flags: so many samples that a rendering takes the budget."""
        from gltf import write_gltf
        from scenes import SCENES as ALL

        if name in self.jobs:
            return self.jobs[name]
        scene, size = ALL[name](), f"{self.chosen.resolution}x{self.chosen.resolution}"
        file = write_gltf(scene, self.chosen.out)
        flags = ["--resolution", size, "--max-bounces", str(scene.max_bounces), "--sampler", "independent"]
        for spp in (2**power for power in range(4, 17)):
            if self.render(file, [*flags, "--spp", str(spp)])["seconds"]["render"] >= self.chosen.budget:
                break
        self.jobs[name] = file, [*flags, "--spp", str(spp)]
        return self.jobs[name]

    def pairs(self, file, first, second, environment=None) -> list[tuple[dict, dict]]:
        """Reports of two sets of flags in turns; the first of each fills caches and counts for nothing."""
        out = []
        for index in range(self.chosen.pairs + 1):
            reports = {}
            for side in (0, 1) if index % 2 else (1, 0):
                flags = [*(first, second)[side], "--seed", str(index)]
                reports[side] = self.render(file, flags, environment)
            out.append((reports[0], reports[1]))
        return out[1:]


def fresh_caches(folder) -> dict:
    """An environment in which Sunfleck's caches, Mesa's and those of NVIDIA's driver are in `folder`; the calibration stays."""
    from python_environment import environment_folder

    names = ["XDG_CACHE_HOME", "__GL_SHADER_DISK_CACHE_PATH", *({"MESA_SHADER_CACHE_DIR"} & set(os.environ))]
    if environment_folder("calibration").is_dir():
        shutil.copytree(environment_folder("calibration"), Path(folder) / "sunfleck" / "calibration")
    return {**os.environ, **dict.fromkeys(names, folder)}


def calibration(bench) -> tuple[str, dict]:
    """`sunfleck devices --calibrate`; what it measures is kept, and `--trace auto` goes by it from then on."""
    devices = json.loads(bench.run("devices", "--calibrate", "--json"))["devices"]
    lines = []
    for device in (d for d in devices if d["calibration"]):
        scenes = device["calibration"]["scenes"]
        lines += [f"{device['index']}: {device['name']}; `--trace auto` takes {device['trace_auto']}: "
                  f"{device['trace_auto_reason']}.", "", f"| trace | arrays | {' | '.join(scenes)} (M paths/s) |",
                  "|---|---|" + "---|" * len(scenes)]
        for variant in device["calibration"]["variants"]:
            rates = " | ".join(f"{rate / 1e6:.3f}" for rate in variant["paths_per_second"])
            lines.append(f"| {variant['trace']} | {variant['array_form']} | {rates} |")
        lines.append("")
    return "\n".join(lines), devices


def beside_mitsuba(bench) -> tuple[str, dict]:
    from children import ChildFailed
    from speed import measure_scene, table

    there, absent = installed(["mitsuba"])
    chosen, results, failed = bench.chosen, [], []
    for name in chosen.scenes:
        spp = int(bench.job(name)[1][-1])
        options = SimpleNamespace(model=None, spp=spp, flags=" ".join(bench.device_flags), out=chosen.out, pairs=chosen.pairs,
                                  resolution=chosen.resolution, timeout=chosen.timeout)
        try:
            results.append(measure_scene(name, options, ("sunfleck", *there)))
        except ChildFailed as error:
            failed.append(f"**Failed**: {name}: {error}")
    if not results:
        raise StepFailed("; ".join(failed))
    notes = [f"**Absent**: {why}" for why in absent.values()] + failed
    return "\n\n".join(["; ".join(results[0]["versions"].values()), table(results), *notes]), results


def time_against_error(bench) -> tuple[str, dict]:
    folder = bench.chosen.out / "bench"
    report = json.loads(bench.run("bench", bench.chosen.suite, "-o", folder, "--json", "--quiet", *bench.device_flags))
    page = (folder / "README.md").read_text().partition("\n")[2]
    return re.sub(r"\]\((?=[\w-]+\.(?:json|svg)\))", "](bench/", page).strip(), report


def ray_queries(bench) -> tuple[str, dict]:
    from speed import interval, ratio

    if not bench.device["ray_query"]:
        return "The device has no ray queries.", None
    lines, data = ["| scene | speed of ray queries over that of our own BVH (95 %) |", "|---|---|"], {}
    for name in bench.chosen.scenes:
        file, flags = bench.job(name)
        pairs = bench.pairs(file, [*flags, "--trace", "ray-query"], [*flags, "--trace", "bvh"])
        data[name] = [[report["seconds"]["render"] for report in pair] for pair in pairs]
        lines.append(f"| {name} | {interval(ratio(data[name]))} |")
    return "\n".join(lines), data


def starts(bench) -> tuple[str, dict]:
    """Whole processes of `cornell` as a file, 256×256 at one sample: with empty caches, then with what the first left."""
    from gltf import write_gltf
    from scenes import SCENES as ALL

    file = write_gltf(ALL["cornell"](), bench.chosen.out)
    taken = {"cold": [], "warm": []}
    for _ in range(3):
        with tempfile.TemporaryDirectory() as folder:
            environment = fresh_caches(folder)
            for kind in taken:
                before = time.perf_counter()
                bench.render(file, ["--resolution", "256x256", "--spp", "1"], environment)
                taken[kind].append(time.perf_counter() - before)
    row = " | ".join(f"{min(seconds):.2f} ({', '.join(f'{s:.2f}' for s in seconds)})" for seconds in taken.values())
    return f"| cold: least of three (all), s | warm, s |\n|---|---|\n| {row} |", taken


def specialisation(bench) -> tuple[str, dict]:
    """Kernels that have what a scene needs beside the one with all BSDFs, lights and features, nothing compiled in."""
    from speed import interval, ratio

    lean, full = bench.chosen.out / "shaders", bench.chosen.out / "shaders-full"
    for folder in (lean, full):
        shutil.rmtree(folder, ignore_errors=True)
        bench.run("shaders", "export", folder)
    features = full / "include" / "features.glsl"
    text = re.sub(r"layout\(constant_id = [234]\) ", "", features.read_text())
    # Without the bits of what needs data that the scenes do not bring: an environment's image, a bound on light.
    text = text.replace("FEATURES = 0xffffffffu", f"FEATURES = {0xffffffff & ~(1 << 4 | 1 << 17)}u")
    features.write_text(text)
    lines = ["| scene | speed of the specialised kernel over that of the full one (95 %) | its compilation, no caches, s | "
             "the full one's |", "|---|---|---|---|"]
    data = {}
    for name in ("cornell",) if bench.chosen.short else ("cornell", "textured"):
        file, flags = bench.job("cornell")
        if bench.chosen.short:
            flags = [*flags[:-1], "16"]
        if name == "textured":
            file = ROOT / "scenes" / "textured.gltf"
        sides = [[*flags, "--no-bake", "--shaders", folder] for folder in (lean, full)]
        # lavapipe compiles a run of so few paths for narrow vectors, without which the full kernel takes it many minutes.
        pairs = bench.pairs(file, *sides, environment=dict(os.environ))
        speed, compiled = ratio([[report["seconds"]["render"] for report in pair] for pair in pairs]), []
        for side in sides:
            with tempfile.TemporaryDirectory() as folder:
                compiled.append(bench.render(file, side, fresh_caches(folder))["seconds"]["compile"])
        data[name] = {"speed": speed, "compile_seconds": compiled}
        lines.append(f"| {name} | {interval(speed)} | {compiled[0]:.2f} | {compiled[1]:.2f} |")
    return "\n".join(lines), data


STEPS = {"Calibration": calibration, "Million paths a second beside Mitsuba": beside_mitsuba,
         "Time against error": time_against_error, "Ray queries beside our own BVH": ray_queries,
         "Starts": starts, "Specialised kernels": specialisation}


def choose_device(bench) -> dict:
    """The device as `sunfleck devices` describes it, by the name that a render reports."""
    devices = json.loads(bench.run("devices", "--json"))["devices"]
    name = bench.render("cornell", ["--resolution", "8x8", "--spp", "1"])["device"]
    return next(device for device in devices if device["name"] == name)


def heading(bench) -> str:
    device, chosen = bench.device, bench.chosen
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    lines = ["# Sunfleck on this machine's GPU", "",
             f"{device['name']} ({device['kind']}); {device['driver']}; Vulkan {device['api_version']}; "
             f"{device['memory_bytes'] / 2**30:.1f} GiB; ray queries: {'yes' if device['ray_query'] else 'no'}. "
             f"{processor()}; {platform.platform()}; load average at the start {os.getloadavg()[0]:.1f}. "
             f"{bench.sunfleck.version} ({commit.stdout.strip() or 'no git'}), {datetime.date.today()}; "
             f"{chosen.resolution}×{chosen.resolution}, {chosen.pairs} pairs."]
    if device["kind"] == "CPU":
        lines += ["", "**This device is a CPU: the figures say nothing of a GPU.**"]
    if chosen.short:
        lines += ["", "**Short form: it shows that the steps work; its figures are worth nothing.**"]
    return "\n".join(lines)


def main() -> int:
    chosen = arguments()
    try:
        enter_environment(Path(__file__))
    except InstallationFailed as error:
        print(f"error: {error}", file=sys.stderr)
        return 4
    chosen.out.mkdir(parents=True, exist_ok=True)
    try:
        bench = Bench(chosen)
        bench.device = choose_device(bench)
    except subprocess.CalledProcessError as error:
        print(f"there is nothing to measure: {error.stderr.strip()}", file=sys.stderr)
        return 4
    except (StepFailed, OSError) as error:
        print(f"error: there is nothing to measure (was it built? `make build`): {error}", file=sys.stderr)
        return 4
    if bench.device["kind"] == "CPU":
        print(f"note: {bench.device['name']} is a CPU: the report will say nothing of a GPU", file=sys.stderr)
    else:
        os.environ["SUNFLECK_PEERS_GPU"] = "1"
    text, raw, failed = heading(bench), {"device": bench.device}, False
    for title, step in STEPS.items():
        print(f"{title} …", file=sys.stderr)
        try:
            section, raw[title] = step(bench)
        except StepFailed as error:
            section, failed = f"**Failed**: {error}", True
            print(f"error: {error}", file=sys.stderr)
        text += f"\n\n## {title}\n\n{section.strip()}"
        (chosen.out / "report.md").write_text(text + "\n")
        (chosen.out / "report.json").write_text(json.dumps(raw, indent=1))
    print(chosen.out / "report.md")
    return 3 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
