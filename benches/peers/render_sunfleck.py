"""Sunfleck's side: the scene as .gltf, and `sunfleck render --json` once a request; its own report gives the times."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import OpenEXR
from gltf import write_gltf
from scenes import SCENES
from worker import serve

ROOT = Path(__file__).resolve().parents[2]


def release_binary() -> Path:
    """Where `cargo build --release` put the binary: the target folder may be moved by the environment or a config file."""
    command = ["cargo", "metadata", "--format-version", "1", "--no-deps", "--offline"]
    metadata = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout)
    return Path(metadata["target_directory"]) / "release" / "sunfleck"


class Sunfleck:
    def __init__(self):
        self.binary = release_binary()
        self.version = self.ask("--version").strip()
        # Short runs would be compiled quickly to run slowly; here compiling does not count, so all are compiled to run fast.
        prepared = json.loads(self.ask("devices", "--json"))["driver_environment"]
        self.environment = {**os.environ, **prepared["set"]}

    def ask(self, *arguments) -> str:
        return subprocess.run([self.binary, *arguments], capture_output=True, text=True, check=True).stdout

    def prepare(self, name, folder, resolution, options):
        self.folder, self.resolution = Path(folder), resolution
        self.name, self.flags, model = name, list(options.get("flags", [])), options.get("model")
        if model:
            self.file, environment, bounces = model["file"], model["environment"], model["max_bounces"]
        else:
            neutral = SCENES[name]()
            self.file, bounces = write_gltf(neutral, self.folder), neutral.max_bounces
            environment = neutral.environment is not None and self.folder / f"{name}.hdr"
        self.flags += ["--max-bounces", str(bounces)] + (["--env", str(environment)] if environment else [])

    def load(self):
        """Nothing is kept between renderings: loading is part of each process, and reported with it."""

    def render(self, spp, seed):
        out = self.folder / f"sunfleck-{self.name}.exr"
        command = [self.binary, "render", self.file, "-o", out, "--resolution", f"{self.resolution}x{self.resolution}",
                   "--spp", str(spp), "--seed", str(seed), "--json", "--quiet", "--strict", *self.flags]
        before = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, env=self.environment)
        wall = time.perf_counter() - before
        if done.returncode != 0:
            raise RuntimeError(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stderr}")
        report = json.loads(done.stdout)
        seconds = report["seconds"]
        load = seconds["load"] + seconds["prepare"] + seconds["upload"]
        start = wall - load - seconds["compile"] - seconds["render"]
        self.version = f"{self.version.split(' on ')[0]} on {report['driver']}, trace {report['trace']}"
        with OpenEXR.File(str(out)) as file:
            image = file.channels()["RGB"].pixels
        return image, {"start": start, "load": load, "compile": seconds["compile"], "render": seconds["render"],
                       "version": self.version, "rays_per_path": report["rays"] / report["paths"]}


if __name__ == "__main__":
    serve(Sunfleck, float(sys.argv[1]))
