"""Mitsuba 3's side: the neutral scene as Mitsuba's objects, path integrator, box filter of one pixel."""

import os
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[2] / "scripts")]
import drjit
import mitsuba as mi
import numpy
from python_environment import choose_mitsuba_variant
from scenes import SCENES
from worker import serve

NO_ROULETTE = 1 << 20
# What a wavefront may hold; more samples are rendered in several passes, as Mitsuba does by itself above 2^32.
LANES = 1 << 24


def bsdf(material) -> dict:
    colour = {"type": "rgb", "value": list(material.colour)}
    if material.kind == "glass":
        return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
    if material.kind == "metal":
        # `principled` with metallic 1 is GGX with Schlick's Fresnel and alpha = roughness², as glTF says.
        inner = {"type": "principled", "base_color": colour, "metallic": 1.0, "roughness": material.roughness}
    else:
        inner = {"type": "diffuse", "reflectance": colour}
    return inner if material.black_back else {"type": "twosided", "nested": inner}


def shape(index: int, mesh):
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf(mesh.material))
    properties["face_normals"] = True
    if any(mesh.material.emission):
        radiance = {"type": "rgb", "value": list(mesh.material.emission)}
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    out = mi.Mesh(f"mesh{index}", len(mesh.positions), len(mesh.triangles), props=properties)
    parameters = mi.traverse(out)
    parameters["vertex_positions"] = numpy.ascontiguousarray(mesh.positions).ravel()
    parameters["faces"] = numpy.ascontiguousarray(mesh.triangles).ravel()
    parameters.update()
    return out


def placed(index: int, mesh) -> dict:
    """The mesh, or its instances."""
    if mesh.places is None:
        return {f"mesh{index}": shape(index, mesh)}
    group = f"group{index}"
    out = {group: {"type": "shapegroup", "mesh": shape(index, mesh)}}
    for k, place in enumerate(mesh.places):
        out[f"{group}-{k}"] = {"type": "instance", "to_world": mi.ScalarTransform4f(place),
                               "group": {"type": "ref", "id": group}}
    return out


class Mitsuba:
    def __init__(self):
        mi.set_variant(choose_mitsuba_variant(mi))
        self.version = f"Mitsuba {mi.__version__} {mi.variant()}"
        drjit.set_thread_count(os.cpu_count())
        drjit.set_flag(drjit.JitFlag.KernelHistory, True)

    def prepare(self, name, folder, resolution, options):
        self.model = options.get("model")
        self.neutral = None if self.model else SCENES[name]()
        self.folder, self.resolution = folder, resolution
        self.sampler = options.get("sampler", "multijitter")

    def load(self):
        if self.model:
            from model import Model

            bounces, objects = self.model["max_bounces"], Model(self.model["file"]).objects()
            camera_to_world, yfov = numpy.array(self.model["camera_to_world"]), self.model["yfov_degrees"]
            environment = self.model["environment"]
        else:
            scene, objects = self.neutral, {}
            for i, mesh in enumerate(scene.meshes):
                objects |= placed(i, mesh)
            bounces, camera_to_world, yfov = scene.max_bounces, scene.camera_to_world(), scene.yfov_degrees
            environment = scene.environment is not None and f"{self.folder}/{scene.name}.hdr"
        to_world = mi.ScalarTransform4f(camera_to_world @ numpy.diag([-1, 1, -1, 1]))  # Mitsuba looks down +Z
        film = {"type": "hdrfilm", "width": self.resolution, "height": self.resolution, "rfilter": {"type": "box"},
                "pixel_format": "rgb", "component_format": "float32"}
        objects |= {"type": "scene", "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": NO_ROULETTE},
                    "sensor": {"type": "perspective", "fov": yfov, "fov_axis": "y", "near_clip": 1e-3,
                               "to_world": to_world, "film": film,
                               "sampler": {"type": self.sampler, "sample_count": 1}}}
        if environment:
            # Sunfleck's u is atan2(z, x)/2π, Mitsuba's atan2(x, −z)/2π: a quarter turn about +Y.
            turn = mi.ScalarTransform4f(numpy.array([[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]]))
            objects["environment"] = {"type": "envmap", "filename": environment, "to_world": turn}
        self.scene = mi.load_dict(objects)
        drjit.sync_thread()

    def render(self, spp, seed):
        passes = max(1, self.resolution**2 * spp // LANES)
        drjit.kernel_history_clear()
        before = time.perf_counter()
        image = sum(numpy.array(mi.render(self.scene, spp=spp // passes, seed=seed * 1024 + k), numpy.float64)
                    for k in range(passes)) / passes
        wall = time.perf_counter() - before
        compiling = sum(kernel["codegen_time"] + kernel["backend_time"] for kernel in drjit.kernel_history()
                        if "codegen_time" in kernel and "backend_time" in kernel) / 1000
        return image, {"compile": compiling, "render": wall - compiling}


if __name__ == "__main__":
    serve(Mitsuba, float(sys.argv[1]))
