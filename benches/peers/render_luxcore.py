"""LuxCore's side (PyPI `pyluxcore`): the neutral scene as LuxCore's properties, its path tracer on the CPU.

Nothing is clamped, adapted or denoised, and no path is ended by roulette. Its default sampler (Sobol') and its default
choice of lights stay.
"""

import contextlib
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import numpy

# It lists its libraries on standard output, which is for answers.
with contextlib.redirect_stdout(sys.stderr):
    import pyluxcore
from scenes import SCENES
from worker import serve

NO_ROULETTE = 1 << 20
# Seconds between two looks at whether a rendering is finished: LuxCore tells nobody when it is.
POLL = 0.002


def properties(values: dict):
    out = pyluxcore.Properties()
    for key, value in values.items():
        out.Set(pyluxcore.Property(key, value if isinstance(value, list) else [value]))
    return out


def floats(values) -> list:
    return [float(value) for value in values]


def material_properties(name: str, material) -> dict:
    key = f"scene.materials.{name}"
    if material.kind == "glass":
        return {f"{key}.type": "glass", f"{key}.kt": floats(material.colour), f"{key}.kr": floats(material.colour),
                f"{key}.interiorior": material.ior, f"{key}.exteriorior": 1.0}
    out = {f"{key}.type": "matte", f"{key}.kd": floats(material.colour)}
    if any(material.emission):
        # No power and no efficiency: the emission is the radiance. By itself LuxCore samples no lamp of more than 256
        # triangles.
        out |= {f"{key}.emission": floats(material.emission), f"{key}.emission.power": 0.0,
                f"{key}.emission.efficiency": 0.0, f"{key}.emission.directlightsampling.type": "ENABLED"}
    return out


def with_black_back(name: str, material) -> tuple[dict, str]:
    """Properties, and the name of the material that the mesh gets."""
    out = material_properties(name, material)
    if not material.black_back or any(material.emission):
        return out, name
    key, black = f"scene.materials.{name}-sides", f"{name}-back"
    out |= {f"scene.materials.{black}.type": "matte", f"scene.materials.{black}.kd": [0.0, 0.0, 0.0],
            f"{key}.type": "twosided", f"{key}.frontmaterial": name, f"{key}.backmaterial": black}
    return out, f"{name}-sides"


class LuxCore:
    def __init__(self):
        pyluxcore.Init(lambda message: print(message, file=sys.stderr))
        self.version = f"LuxCore {pyluxcore.Version()}"

    def prepare(self, name, folder, resolution, options):
        self.neutral, self.resolution = SCENES[name](), resolution

    def load(self):
        neutral, self.scene = self.neutral, pyluxcore.Scene()
        to_world = neutral.camera_to_world()
        # A square picture, so the smaller field of view is the vertical one. Row y of LuxCore's film is what its camera sees
        # at height − 1 − y with a fraction in y: the picture lies one pixel too low, which the window takes back.
        step = 2 / self.resolution
        values = {"scene.camera.type": "perspective", "scene.camera.lookat.orig": floats(neutral.position),
                  "scene.camera.lookat.target": floats(neutral.target), "scene.camera.up": floats(to_world[:3, 1]),
                  "scene.camera.fieldofview": neutral.yfov_degrees, "scene.camera.cliphither": 1e-3,
                  "scene.camera.screenwindow": [-1.0, 1.0, -1.0 - step, 1.0 - step]}
        for index, mesh in enumerate(neutral.meshes):
            points = [tuple(point) for point in mesh.positions.astype(float).tolist()]
            triangles = [tuple(triangle) for triangle in mesh.triangles.tolist()]
            self.scene.DefineMesh(f"mesh{index}", points, triangles, None, None, None, None)
            more, material = with_black_back(f"material{index}", mesh.material)
            values |= more | {f"scene.objects.object{index}.shape": f"mesh{index}",
                              f"scene.objects.object{index}.material": material}
        self.scene.Parse(properties(values))
        self.render(1, 0)  # LuxCore builds its BVH at the first rendering and keeps it

    def settings(self, spp, seed) -> dict:
        # LuxCore counts the vertices after the camera's: the lamp that is met is one.
        depth = self.neutral.max_bounces + 1
        depths = {f"path.pathdepth.{kind}": depth for kind in ("total", "diffuse", "glossy", "specular")}
        return depths | {
            "renderengine.type": "PATHCPU", "renderengine.seed": seed + 1, "sampler.type": "SOBOL",
            "sampler.sobol.adaptive.strength": 0.0, "native.threads.count": os.cpu_count(),
            "path.russianroulette.depth": NO_ROULETTE, "path.clamping.variance.maxvalue": 0.0,
            "film.width": self.resolution, "film.height": self.resolution, "film.filter.type": "BOX",
            "film.filter.width": 0.5, "film.imagepipeline.0.type": "NOP", "film.noiseestimation.warmup": 1 << 30,
            "batch.haltspp": [spp, 0]}

    def render(self, spp, seed):
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(self.settings(spp, seed)), self.scene))
        before = time.perf_counter()
        session.Start()
        while not session.HasDone():
            time.sleep(POLL)
            session.UpdateStats()
        seconds = time.perf_counter() - before
        session.Stop()
        film = session.GetFilm()
        pixels = numpy.empty(film.GetWidth() * film.GetHeight() * 3, numpy.float32)
        film.GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels)
        done = session.GetStats().Get("stats.renderengine.pass").GetFloat()
        if done > 1.5 * spp + 1:
            raise RuntimeError(f"{done} samples per pixel in place of {spp}")
        return pixels.reshape(film.GetHeight(), film.GetWidth(), 3)[::-1], {"compile": 0.0, "render": seconds}


if __name__ == "__main__":
    serve(LuxCore, float(sys.argv[1]))
