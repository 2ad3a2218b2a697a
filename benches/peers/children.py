"""The renderers' child processes: one a renderer and scene, each in the virtual environment of its program."""

import json
import selectors
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "scripts"))
from python_environment import environment, mitsuba_environment  # noqa: E402

BPY = "4.5.15"
LUXCORE = "2.11.2"


def report_environment() -> Path:
    """For this program itself and for reading Sunfleck's EXRs."""
    return environment("peers-report", ["numpy", "scipy", "matplotlib", "OpenEXR"])


# name -> (its interpreter, its adapter). PyPI has `bpy` 4.5 for Python 3.11 alone.
RENDERERS = {
    "sunfleck": (report_environment, "render_sunfleck.py"),
    "mitsuba": (mitsuba_environment, "render_mitsuba.py"),
    "cycles": (lambda: environment(f"cycles-{BPY}", [f"bpy=={BPY}"], "python3.11"), "render_cycles.py"),
    "luxcore": (lambda: environment(f"luxcore-{LUXCORE}", [f"pyluxcore=={LUXCORE}", "numpy"]), "render_luxcore.py"),
}

# What a renderer has no match for. LuxCore's one GGX metal (`disney`, metallic 1) is darker by 13 % where lamps are sampled
# than where its own samples meet them. None of its scenes here has an environment, so its adapter knows none; instances are
# for speed.py, which asks Mitsuba alone.
LACKS = {"luxcore": {"metal", "environment", "instances"}, "cycles": {"instances"}}


def needs(scene) -> set:
    kinds = {mesh.material.kind for mesh in scene.meshes}
    if scene.environment is not None:
        kinds.add("environment")
    if any(mesh.places is not None for mesh in scene.meshes):
        kinds.add("instances")
    return kinds


class ChildFailed(Exception):
    """A renderer ended, or did not answer in time; the message says which and where its log is."""


class Child:
    """One renderer with one scene loaded; `seconds` holds what starting and loading took."""

    def __init__(self, name, scene, folder, resolution, options, timeout):
        interpreter, script = RENDERERS[name]
        self.name, self.folder, self.timeout = name, folder, timeout
        self.log = open(folder / f"{name}-{scene}.log", "w")
        command = [str(interpreter()), str(HERE / script), repr(time.time())]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log)
        try:
            answer = self.ask({"load": scene, "folder": str(folder), "resolution": resolution, "options": options})
        except ChildFailed:
            self.close()
            raise
        self.seconds, self.version = answer["seconds"], answer["version"]

    def ask(self, request) -> dict:
        failure = f"{self.name}: see {self.log.name}"
        try:
            self.process.stdin.write((json.dumps(request) + "\n").encode())
            self.process.stdin.flush()
        except BrokenPipeError as error:
            raise ChildFailed(f"{failure} (it ended)") from error
        with selectors.DefaultSelector() as selector:
            selector.register(self.process.stdout, selectors.EVENT_READ)
            if not selector.select(self.timeout):
                raise ChildFailed(f"{failure} (no answer in {self.timeout} s)")
        line = self.process.stdout.readline()
        if not line:
            code = self.process.wait()
            last = Path(self.log.name).read_text(errors="replace").strip().splitlines()[-1:]
            raise ChildFailed(": ".join([f"{failure} (it ended with {code})"] + last))
        return json.loads(line)

    def render(self, spp, seed):
        import numpy  # not at the top: this file is also read before the environment that has numpy is entered

        path = self.folder / f"{self.name}.npy"
        answer = self.ask({"render": True, "spp": spp, "seed": seed, "image": str(path)})
        self.version = answer["seconds"].pop("version", self.version)
        image = numpy.load(path)
        if not numpy.isfinite(image).all():
            raise ChildFailed(f"{self.name}: {(~numpy.isfinite(image)).sum()} values of its image are not finite")
        return image, answer["seconds"]

    def close(self):
        self.process.kill()
        self.process.wait()
        self.log.close()
