#!/usr/bin/env python3
"""Writes bsdf_balls.gltf and bsdf_balls.exr: twelve balls of twelve materials, and what Mitsuba 3 renders of them.

Where a model of Sunfleck differs from Mitsuba's on purpose, the Mitsuba side multiplies its own model by the known factor
(known_factors.py): the sampling, the density, the distribution and everything around them are Mitsuba's. The EXR is made like those of make_references.py. The mean radiance of every ball, with and
without the factors, is printed.
"""

import argparse
import json
import math
import sys
import zlib
from pathlib import Path

from make_references import Accumulator
from known_factors import known_plugin
from mitsuba_process import choose_mitsuba_variant, enter_environment

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "scenes"))
import generate  # noqa: E402

WIDTH, HEIGHT, TILE = 96, 72, 4
BOUNCES = 8
COPPER = (0.95, 0.64, 0.54)
SKY, LAMP = (0.25, 0.3, 0.4), (9.0, 8.0, 6.0)
# name, roughness, colour; four a row.
BALLS = [("conductor", 0.3, None), ("conductor", 0.5, None), ("conductor", 0.7, None), ("conductor", 1.0, None),
         ("metal", 0.4, COPPER), ("metal", 0.9, COPPER), ("dielectric", 0.3, None), ("dielectric", 0.7, None),
         ("diffuse", 0.0, COPPER), ("mirror", 0.0, None), ("glass", 0.0, None), ("thin", 0.0, None)]


def place(index):
    """The centre of a ball."""
    return [1.2 * (index % 4) - 1.8, 1.2 - 1.2 * (index // 4), 0.0]


def lamp():
    return generate.quad((-2, 3, 1), (2, 3, 1), (2, 3, 4), (-2, 3, 4))


def write_gltf(ball):
    scene = generate.Scene()
    scene.doc["asset"]["generator"] = "sunfleck tests/reference/make_bsdf_images.py"
    scene.environment(SKY)
    for index, (kind, roughness, colour) in enumerate(BALLS):
        metallic = 1 if kind in ("conductor", "metal") else 0
        black = kind == "dielectric"
        extras = {"bsdf": {"diffuse": "lambertian"}.get(kind, kind)} if kind in ("diffuse", "mirror", "glass") else None
        material = scene.material(kind, (0, 0, 0) if black else colour or (1, 1, 1), extras,
                                  metallic=metallic, roughness=roughness)
        if kind == "thin":
            scene.use("KHR_materials_transmission")
            scene.doc["materials"][material]["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": 1}}
        scene.place(f"{kind} {roughness}", ball, material, translation=place(index))
    scene.place("lamp", lamp(), scene.diffuse("lamp", (0, 0, 0), emission=LAMP))
    scene.camera((0, 0, 8), (0, 0, 0), 2 * math.degrees(math.atan(1.8 / 8)))
    generate.FOLDER = FOLDER
    scene.write("bsdf_balls")


def plugin(kind, roughness, colour, with_factors):
    rgb = {"type": "rgb", "value": list(colour or (1, 1, 1))}
    black = {"type": "rgb", "value": [0, 0, 0]}
    alpha = roughness**2
    nested = {
        "conductor": {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha},
        "metal": {"type": "principled", "base_color": rgb, "metallic": 1.0, "roughness": roughness},
        "dielectric": {"type": "principled", "base_color": black, "eta": 1.5, "roughness": roughness},
        "diffuse": {"type": "diffuse", "reflectance": rgb},
        "mirror": {"type": "conductor", "material": "none"},
        "glass": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0},
        "thin": {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0},
    }[kind]
    if with_factors and kind in ("conductor", "metal", "dielectric", "thin"):
        return {"type": "known", "kind": kind, "alpha": alpha, "colour": json.dumps(colour or (1, 1, 1)), "nested": nested}
    return nested


def mitsuba_mesh(mi, numpy, name, shape, bsdf, centre=(0, 0, 0), emission=None):
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    properties["face_normals"] = True
    if emission:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": list(emission)}})
    mesh = mi.Mesh(name, len(shape["positions"]), len(shape["triangles"]), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = (numpy.array(shape["positions"]) + numpy.array(centre)).ravel().astype(numpy.float32)
    parameters["faces"] = numpy.array(shape["triangles"], numpy.uint32).ravel()
    parameters.update()
    return mesh


def mitsuba_scene(mi, numpy, ball, with_factors):
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}, "pixel_format": "rgb",
            "component_format": "float32"}
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": BOUNCES + 1, "rr_depth": 1 << 20},
             "sky": {"type": "constant", "radiance": {"type": "rgb", "value": list(SKY)}},
             "sensor": {"type": "perspective", "fov": 2 * math.degrees(math.atan(1.8 / 8)), "fov_axis": "y", "film": film,
                        "to_world": mi.ScalarTransform4f().look_at([0, 0, 8], [0, 0, 0], [0, 1, 0]),
                        "sampler": {"type": "independent", "sample_count": 1}},
             "lamp": mitsuba_mesh(mi, numpy, "lamp", lamp(), {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0] * 3}},
                                  emission=LAMP)}
    for index, material in enumerate(BALLS):
        scene[f"ball{index}"] = mitsuba_mesh(mi, numpy, f"ball{index}", ball, plugin(*material, with_factors), place(index))
    return mi.load_dict(scene)


def tile_means(numpy, image):
    return image.astype(numpy.float64).reshape(HEIGHT // TILE, TILE, WIDTH // TILE, TILE, 3).mean(axis=(1, 3))


def render(mi, numpy, scene, seeds, spp):
    accumulator = Accumulator(numpy)
    for index in range(seeds):
        seed = zlib.crc32(f"sunfleck balls {index}".encode())
        accumulator.add(tile_means(numpy, numpy.array(mi.render(scene, spp=spp, seed=seed))))
    return accumulator


def ball_means(numpy, tiles):
    """The mean green radiance of the tiles around each ball."""
    return tiles[..., 1].reshape(3, 6, 4, 6).mean(axis=(1, 3)).ravel()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=64)
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel and seed")
    arguments = parser.parse_args()
    enter_environment(__file__)
    import drjit
    import mitsuba as mi
    import numpy

    mi.set_variant(choose_mitsuba_variant(mi))
    mi.register_bsdf("known", known_plugin(mi, drjit, numpy))
    ball = generate.sphere(2, 0.5, smooth=False)
    write_gltf(ball)
    images = {}
    for with_factors in (False, True):
        scene = mitsuba_scene(mi, numpy, ball, with_factors)
        images[with_factors] = render(mi, numpy, scene, arguments.seeds, arguments.spp)
    images[True].write(mi, FOLDER / "bsdf_balls.exr", arguments.spp, f"path, max_depth {BOUNCES + 1}, no roulette")
    plain, known = (ball_means(numpy, images[k].mean) for k in (False, True))
    for (kind, roughness, _), a, b in zip(BALLS, plain, known):
        print(f"| {kind} | {roughness} | {a:.5f} | {b:.5f} | {b / a:.4f} |")


if __name__ == "__main__":
    main()
