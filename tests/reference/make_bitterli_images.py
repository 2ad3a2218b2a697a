#!/usr/bin/env python3
"""Renders Bitterli's veach-mis with Mitsuba 3: as its file says, and with Sunfleck's model of its metals.

    python3 tests/reference/make_bitterli_images.py FOLDER     (with veach-mis/scene.xml and veach-mis/TungstenRender.exr)

The first tells whether the reference image is what the file describes, the second is held against Sunfleck's
image of the translated scene by tests/gpu/bitterli.rs: veach_mis_ggx.exr, made like the other references. Printed are the means of regions
(docs/accuracy/bitterli.md). Lamps are true spheres here.
"""

import json
import math
import sys
import xml.etree.ElementTree as ElementTree
import zlib
from pathlib import Path

import bitterli
from known_factors import known_plugin
from make_references import Accumulator
from mitsuba_process import choose_mitsuba_variant, enter_environment

WIDTH, HEIGHT, TILE = 320, 180, 10
SEEDS, SPP = 32, 128
# name: left, right, top, bottom as parts of the image.
REGIONS = {
    "wall, left": (0.03, 0.22, 0.05, 0.7), "wall, right": (0.78, 0.97, 0.05, 0.7), "floor": (0.05, 0.95, 0.96, 0.995),
    "smooth plate, large lamp": (0.62, 0.68, 0.40, 0.48), "smooth plate, middle lamp": (0.485, 0.515, 0.42, 0.46),
    "glossy plate": (0.28, 0.72, 0.54, 0.61), "rough plate": (0.25, 0.75, 0.69, 0.73),
    "roughest plate": (0.2, 0.8, 0.81, 0.86), "all plates": (0.12, 0.88, 0.37, 0.93),
}


def colour(value):
    return {"type": "rgb", "value": list(value)}


def bsdf(element, with_ggx):
    values = bitterli.properties(element)
    if element.get("type") == "diffuse":
        return {"type": "twosided", "nested": {"type": "diffuse", "reflectance": colour(values["reflectance"])}}
    if not with_ggx:
        return {"type": "roughconductor", "distribution": "beckmann", "alpha": values["alpha"],
                **{name: colour(values[key]) for name, key in
                   (("eta", "eta"), ("k", "k"), ("specular_reflectance", "specularReflectance"))}}
    f0 = bitterli.reflectance(values)
    nested = {"type": "principled", "base_color": colour(f0), "metallic": 1.0, "roughness": math.sqrt(values["alpha"])}
    return {"type": "known", "kind": "metal", "alpha": values["alpha"], "colour": json.dumps(f0), "nested": nested}


def scene(mi, path, with_ggx):
    root = ElementTree.parse(path).getroot()
    bsdfs = {element.get("id"): element for element in root.findall("bsdf")}
    sensor = root.find("sensor")
    out = {"type": "scene", "integrator": {"type": "path", "max_depth": 2},
           "sensor": {"type": "perspective", "fov": bitterli.properties(sensor)["fov"],
                      "to_world": mi.ScalarTransform4f(bitterli.matrix(sensor)),
                      "sampler": {"type": "independent", "sample_count": 1},
                      "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"},
                               "pixel_format": "rgb", "component_format": "float32"}}}
    for index, element in enumerate(root.findall("shape")):
        shape = {"type": element.get("type"), "to_world": mi.ScalarTransform4f(bitterli.matrix(element)),
                 "bsdf": bsdf(bsdfs[element.find("ref").get("id")], with_ggx)}
        if shape["type"] == "sphere":
            shape["radius"] = bitterli.properties(element)["radius"]
        if element.find("emitter") is not None:
            shape["emitter"] = {"type": "area", "radiance": colour(bitterli.properties(element.find("emitter"))["radiance"])}
        out[f"shape{index}"] = shape
    return mi.load_dict(out)


def tiles(numpy, image):
    return image.astype(numpy.float64).reshape(HEIGHT // TILE, TILE, WIDTH // TILE, TILE, 3).mean(axis=(1, 3))


def region_means(image):
    """The mean green radiance of each region of an image of any size."""
    height, width = image.shape[:2]
    return {name: image[round(top * height):round(bottom * height), round(left * width):round(right * width), 1].mean()
            for name, (left, right, top, bottom) in REGIONS.items()}


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FOLDER")
    if not (Path(sys.argv[1]) / "veach-mis" / "scene.xml").is_file():
        sys.exit(f"error: {sys.argv[1]} has no veach-mis/scene.xml")
    enter_environment(__file__)
    import drjit
    import mitsuba as mi
    import numpy

    folder, out = Path(sys.argv[1]) / "veach-mis", Path(__file__).resolve().parent / "veach_mis_ggx.exr"
    mi.set_variant(choose_mitsuba_variant(mi))
    mi.register_bsdf("known", known_plugin(mi, drjit, numpy))
    tungsten = numpy.array(mi.Bitmap(str(folder / "TungstenRender.exr")).convert(
        mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)).astype(numpy.float64)
    columns = [region_means(tungsten)]
    for with_ggx in (False, True):
        rendered, mean, accumulator = scene(mi, folder / "scene.xml", with_ggx), 0, Accumulator(numpy)
        for index in range(SEEDS):
            image = numpy.array(mi.render(rendered, spp=SPP, seed=zlib.crc32(f"sunfleck veach-mis {with_ggx} {index}".encode())))
            mean = mean + image.astype(numpy.float64) / SEEDS
            accumulator.add(tiles(numpy, image))
        columns.append(region_means(mean))
    accumulator.write(mi, out, SPP, "path, max_depth 2")
    for name in REGIONS:
        tungsten, beckmann, ggx = (column[name] for column in columns)
        print(f"| {name} | {tungsten:.5f} | {beckmann:.5f} | {ggx:.5f} | {beckmann / tungsten:.4f} | {ggx / tungsten:.4f} |")


if __name__ == "__main__":
    main()
