#!/usr/bin/env python3
"""Translates scenes of Benedikt Bitterli's collection, in their form for Mitsuba 0.5, to glTF.

    python3 tests/reference/bitterli.py FOLDER/veach-mis/scene.xml veach-mis.gltf

Covered is what the scenes cornell-box and veach-mis use: rectangles, cubes and spheres; `diffuse` and `roughconductor`;
area lights; a perspective camera. Anything else is an error. Standard library only.

- A sphere becomes 20·4³ flat triangles, scaled to the sphere's area: by Cauchy's formula its projection then has the
  sphere's area too, in the mean over directions.
- A `roughconductor` becomes a metal of GGX with roughness √alpha, whatever its distribution, and its reflectance at
  normal incidence, specularReflectance·((eta − 1)² + k²)/((eta + 1)² + k²).
"""

import json
import math
import sys
import xml.etree.ElementTree as ElementTree
from base64 import b64encode
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scenes"))
import generate  # noqa: E402

SPHERE_SUBDIVISIONS = 3


class NotCovered(Exception):
    """The scene has something that is not translated, or lacks something; the message names it."""


def numbers(text):
    return [float(x) for x in text.replace(",", " ").split()]


def properties(element):
    """The parameters of an element by name: numbers, colours as lists, texts."""
    found = {}
    for child in element:
        if child.tag in ("float", "integer"):
            found[child.get("name")] = float(child.get("value"))
        elif child.tag == "rgb":
            found[child.get("name")] = numbers(child.get("value"))
        elif child.tag == "string":
            found[child.get("name")] = child.get("value")
    return found


def part(element, tag):
    """The child that an element must have."""
    found = element.find(tag)
    if found is None:
        raise NotCovered(f"a {element.tag} without <{tag}>")
    return found


def matrix(element):
    """The transform `toWorld` as four rows; the identity where there is none."""
    rows = [[float(i == j) for j in range(4)] for i in range(4)]
    transform = element.find("transform")
    steps = [] if transform is None else list(transform)
    if len(steps) > 1:
        raise NotCovered("a transform of several steps")
    for step in steps:
        if step.tag == "matrix":
            flat = numbers(step.get("value"))
            rows = [flat[4 * i:4 * i + 4] for i in range(4)]
        elif step.tag == "translate":
            for row, offset in zip(rows, numbers(step.get("value"))):
                row[3] = offset
        else:
            raise NotCovered(f"the transform {step.tag}")
    return rows


def columns(rows):
    """As glTF orders a matrix."""
    return [rows[i][j] for j in range(4) for i in range(4)]


def surface_area(shape):
    def double_area(triangle):
        a, b, c = (shape["positions"][i] for i in triangle)
        return math.hypot(*generate.cross([y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]))
    return 0.5 * sum(map(double_area, shape["triangles"]))


def shape(element):
    kind = element.get("type")
    if kind == "rectangle":
        return generate.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    if kind == "cube":
        return generate.box()
    if kind == "sphere":
        inscribed = surface_area(generate.sphere(SPHERE_SUBDIVISIONS, 1.0, smooth=False))
        radius = properties(element)["radius"] * math.sqrt(4 * math.pi / inscribed)
        return generate.sphere(SPHERE_SUBDIVISIONS, radius, smooth=False)
    raise NotCovered(f"the shape {kind}")


def reflectance(values):
    """A conductor's, at normal incidence."""
    return [s * ((e - 1)**2 + k * k) / ((e + 1)**2 + k * k)
            for s, e, k in zip(values["specularReflectance"], values["eta"], values["k"])]


def material(scene, bsdf, emission):
    """`emission` is a radiance or None."""
    name, kind, values = bsdf.get("id"), bsdf.get("type"), properties(bsdf)
    if kind == "diffuse":
        return scene.diffuse(name, values["reflectance"], emission=emission)
    if kind == "roughconductor":
        return scene.material(name, reflectance(values), emission=emission, metallic=1, roughness=math.sqrt(values["alpha"]))
    raise NotCovered(f"the BSDF {kind}")


def add_shape(scene, element, bsdfs):
    name, emitter = part(element, "ref").get("id"), element.find("emitter")
    if emitter is not None and emitter.get("type") != "area":
        raise NotCovered(f"the emitter {emitter.get('type')}")
    emission = None if emitter is None else properties(emitter)["radiance"]
    scene.place(name, shape(element), material(scene, bsdfs[name], emission), matrix=columns(matrix(element)))


def add_camera(scene, sensor):
    """The field of view is the horizontal one. Mitsuba's camera looks along +Z with +X to the left, glTF's along −Z."""
    film = properties(part(sensor, "film"))
    aspect = film["width"] / film["height"]
    yfov = 2 * math.atan(math.tan(math.radians(properties(sensor)["fov"]) / 2) / aspect)
    scene.doc["cameras"] = [{"type": "perspective", "perspective": {"yfov": yfov, "aspectRatio": aspect, "znear": 0.01}}]
    turned = [[-row[0], row[1], -row[2], row[3]] for row in matrix(sensor)]
    scene.node(name="camera", camera=0, matrix=columns(turned))


def translate(path):
    root = ElementTree.parse(path).getroot()
    bsdfs = {bsdf.get("id"): bsdf for bsdf in root.findall("bsdf")}
    scene = generate.Scene()
    scene.doc["asset"]["generator"] = "sunfleck tests/reference/bitterli.py"
    add_camera(scene, part(root, "sensor"))
    for element in root.findall("shape"):
        add_shape(scene, element, bsdfs)
    uri = "data:application/octet-stream;base64," + b64encode(scene.data).decode()
    scene.doc["buffers"] = [{"byteLength": len(scene.data), "uri": uri}]
    return scene.doc


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} SCENE.xml OUT.gltf")
    try:
        text = json.dumps(translate(sys.argv[1]), indent=1)
    except (NotCovered, OSError, ElementTree.ParseError) as error:
        sys.exit(f"error: {sys.argv[1]}: {error}")
    except KeyError as error:
        sys.exit(f"error: {sys.argv[1]}: there is no {error}")
    Path(sys.argv[2]).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
