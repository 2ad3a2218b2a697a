#!/usr/bin/env python3
"""Writes the scenes of this folder: `python3 scenes/generate.py`. Standard library only; the output is deterministic.

Each scene is one .gltf file whose buffers and images are data URIs. What each is for stands in README.md.
"""

import base64
import json
import math
import random
import struct
import zlib
from pathlib import Path

FOLDER = Path(__file__).parent


class Scene:
    """A glTF document under construction."""

    def __init__(self):
        self.data = bytearray()
        self.shapes = {}
        self.doc = {
            "asset": {"version": "2.0", "generator": "sunfleck scenes/generate.py"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data):
        self.data.extend(bytes(-len(self.data) % 4))
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.data.extend(data)
        self.doc["bufferViews"].append(view)
        return len(self.doc["bufferViews"]) - 1

    def accessor(self, kind, component, rows, bounds=False):
        code = {5126: "f", 5125: "I", 5123: "H"}[component]
        flat = [x for row in rows for x in row]
        data = struct.pack(f"<{len(flat)}{code}", *flat)
        accessor = {"bufferView": self.view(data), "componentType": component, "type": kind}
        accessor["count"] = len(rows)
        if bounds:
            rounded = [struct.unpack("<f", struct.pack("<f", x))[0] for x in flat]
            width = len(rows[0])
            accessor["min"] = [min(rounded[i::width]) for i in range(width)]
            accessor["max"] = [max(rounded[i::width]) for i in range(width)]
        self.doc["accessors"].append(accessor)
        return len(self.doc["accessors"]) - 1

    def material(self, name, color=(1, 1, 1), extras=None, emission=None, metallic=None, roughness=None, ior=None,
                 double_sided=False, texture=None, alpha=None, cutoff=None, transmission=None, attenuation=None,
                 anisotropy=None):
        """`alpha` makes it BLEND, `cutoff` MASK; `attenuation`, a colour and the distance for it, makes it a volume;
        `anisotropy` is (strength, rotation) or (strength, rotation, texture)."""
        factor = [*color, 1 if alpha is None else alpha]
        material = {"name": name, "pbrMetallicRoughness": {"baseColorFactor": factor}}
        if alpha is not None:
            material["alphaMode"] = "BLEND"
        if cutoff is not None:
            material["alphaMode"] = "MASK"
            material["alphaCutoff"] = cutoff
        pbr = material["pbrMetallicRoughness"]
        if metallic is not None:
            pbr["metallicFactor"] = metallic
            pbr["roughnessFactor"] = roughness
        if texture is not None:
            pbr["baseColorTexture"] = {"index": texture}
        extensions = {}
        if emission:
            strength = max(1.0, *emission)
            material["emissiveFactor"] = [e / strength for e in emission]
            if strength > 1:
                extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
        if ior is not None:
            extensions["KHR_materials_ior"] = {"ior": ior}
        if transmission is not None:
            extensions["KHR_materials_transmission"] = {"transmissionFactor": transmission}
        if attenuation is not None:
            color, distance = attenuation
            volume = {"thicknessFactor": 1}
            if distance is not None:
                volume.update(attenuationColor=list(color), attenuationDistance=distance)
            extensions["KHR_materials_volume"] = volume
        if anisotropy is not None:
            strength, rotation, *texture = anisotropy
            extension = {"anisotropyStrength": strength, "anisotropyRotation": rotation}
            if texture:
                extension["anisotropyTexture"] = {"index": texture[0]}
            extensions["KHR_materials_anisotropy"] = extension
        if extensions:
            material["extensions"] = extensions
            self.use(*extensions)
        if extras:
            material["extras"] = {"sunfleck": extras}
        if double_sided:
            material["doubleSided"] = True
        self.doc["materials"].append(material)
        return len(self.doc["materials"]) - 1

    def diffuse(self, name, color, **more):
        return self.material(name, color, {"bsdf": "lambertian"}, **more)

    def use(self, *extensions):
        used = self.doc.setdefault("extensionsUsed", [])
        used.extend(e for e in extensions if e not in used)

    def texture(self, png, nearest=False, name="checker"):
        images = self.doc.setdefault("images", [])
        images.append({"uri": "data:image/png;base64," + base64.b64encode(png).decode(), "name": name})
        samplers = self.doc.setdefault("samplers", [])
        samplers.append({"magFilter": 9728 if nearest else 9729, "wrapS": 10497, "wrapT": 10497})
        textures = self.doc.setdefault("textures", [])
        textures.append({"source": len(images) - 1, "sampler": len(samplers) - 1})
        return len(textures) - 1

    def mesh(self, name, *parts):
        """Each part is (shape, material); a shape has positions, triangles and maybe normals, tangents and texcoords."""
        primitives = [{**self.geometry(shape), "material": material} for shape, material in parts]
        self.doc["meshes"].append({"name": name, "primitives": primitives})
        return len(self.doc["meshes"]) - 1

    def geometry(self, shape):
        """The accessors of a shape; those of one shape are written once."""
        if id(shape) not in self.shapes:
            attributes = {"POSITION": self.accessor("VEC3", 5126, shape["positions"], True)}
            if "normals" in shape:
                attributes["NORMAL"] = self.accessor("VEC3", 5126, shape["normals"])
            if "tangents" in shape:
                attributes["TANGENT"] = self.accessor("VEC4", 5126, shape["tangents"])
            if "texcoords" in shape:
                attributes["TEXCOORD_0"] = self.accessor("VEC2", 5126, shape["texcoords"])
            component = 5123 if len(shape["positions"]) < 65535 else 5125
            indices = [(i,) for triangle in shape["triangles"] for i in triangle]
            # The shape is kept beside its accessors, so that its id stays its own.
            accessors = {"attributes": attributes, "indices": self.accessor("SCALAR", component, indices)}
            self.shapes[id(shape)] = (shape, accessors)
        return self.shapes[id(shape)][1]

    def node(self, **node):
        self.doc["nodes"].append(node)
        self.doc["scenes"][0]["nodes"].append(len(self.doc["nodes"]) - 1)

    def place(self, name, shape, material, **transform):
        self.node(name=name, mesh=self.mesh(name, (shape, material)), **transform)

    def camera(self, eye, target, yfov_degrees, lens=None):
        cameras = self.doc.setdefault("cameras", [])
        camera = {"type": "perspective", "perspective": {"yfov": math.radians(yfov_degrees), "znear": 0.01}}
        if lens:
            camera["extras"] = {"sunfleck": lens}
        cameras.append(camera)
        self.node(name="camera", camera=len(cameras) - 1, translation=list(eye), rotation=look_at(eye, target))

    def light(self, kind, intensity, color=(1, 1, 1), **transform):
        self.use("KHR_lights_punctual")
        extensions = self.doc.setdefault("extensions", {"KHR_lights_punctual": {"lights": []}})
        lights = extensions["KHR_lights_punctual"]["lights"]
        light = {"type": kind, "intensity": intensity, "color": list(color)}
        if kind == "spot":
            light["spot"] = {"innerConeAngle": 0.3, "outerConeAngle": 0.5}
        lights.append(light)
        reference = {"KHR_lights_punctual": {"light": len(lights) - 1}}
        self.node(name=kind, extensions=reference, **transform)

    def environment(self, color):
        self.doc["scenes"][0]["extras"] = {"sunfleck": {"environment": {"color": list(color)}}}

    def write(self, name):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.doc["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        (FOLDER / f"{name}.gltf").write_text(json.dumps(self.doc, indent=1) + "\n", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------- geometry


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def normalize(v):
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]


def look_at(eye, target):
    """The quaternion (x, y, z, w) that turns −Z from `eye` to `target`, +Y up."""
    back = normalize([e - t for e, t in zip(eye, target)])
    up = [0, 1, 0] if abs(back[1]) < 0.999 else [0, 0, -1]
    right = normalize(cross(up, back))
    up = cross(back, right)
    m = [[right[i], up[i], back[i]] for i in range(3)]
    # The largest of the four components first, for accuracy (Shepperd).
    trace = m[0][0] + m[1][1] + m[2][2]
    if trace > 0:
        s = 2 * math.sqrt(1 + trace)
        q = [(m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, s / 4]
    else:
        i = max(range(3), key=lambda i: m[i][i])
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2 * math.sqrt(1 + m[i][i] - m[j][j] - m[k][k])
        q = [0, 0, 0, (m[k][j] - m[j][k]) / s]
        q[i], q[j], q[k] = s / 4, (m[j][i] + m[i][j]) / s, (m[k][i] + m[i][k]) / s
    return normalize_quaternion(q)


def normalize_quaternion(q):
    length = math.sqrt(sum(x * x for x in q))
    return [x / length for x in q]


def quad(a, b, c, d, tiles=1):
    """Counter-clockwise from its front."""
    return {
        "positions": [a, b, c, d],
        "triangles": [(0, 1, 2), (0, 2, 3)],
        "texcoords": [(0, tiles), (tiles, tiles), (tiles, 0), (0, 0)],
    }


def floor(size, y=0.0, tiles=1):
    return quad((-size, y, size), (size, y, size), (size, y, -size), (-size, y, -size), tiles)


def box(half=(1, 1, 1), inwards=False):
    """An axis-aligned box, flat, its faces outwards or inwards."""
    corners = [[h if i >> axis & 1 else -h for axis, h in enumerate(half)] for i in range(8)]
    faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    if inwards:
        triangles = [(a, c, b) for a, b, c in triangles]
    return {"positions": corners, "triangles": triangles}


def sphere(level, radius=1.0, smooth=True):
    """An icosahedron subdivided `level` times: 20 · 4^level triangles, all of nearly the same size."""
    g = (1 + math.sqrt(5)) / 2
    vertices = [normalize(v) for v in (
        (-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
        (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1))]
    triangles = [
        (0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
        (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
        (8, 6, 7), (9, 8, 1)]
    for _ in range(level):
        middles = {}

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(vertices)
                vertices.append(normalize([x + y for x, y in zip(vertices[a], vertices[b])]))
            return middles[key]

        split = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = split
    shape = {"positions": [[radius * x for x in v] for v in vertices], "triangles": triangles}
    if smooth:
        shape["normals"] = vertices
    return shape


def checker_png(size, dark, light):
    """A checkerboard of 2×2 fields."""
    return png(size, lambda x, y: light if (x * 2 // size + y * 2 // size) % 2 == 0 else dark)


def disc_png(size, color):
    """A disc that fills the square, opaque inside and clear outside."""
    middle = (size - 1) / 2
    inside = lambda x, y: math.hypot(x - middle, y - middle) < size / 2
    return png(size, lambda x, y: (*color, 255 if inside(x, y) else 0))


def png(size, texel):
    """A square image of 8 bits a channel; texel(x, y) is RGB or RGBA."""
    rows = bytearray()
    for y in range(size):
        rows.append(0)
        for x in range(size):
            rows.extend(texel(x, y))
    color_type = {3: 2, 4: 6}[len(texel(0, 0))]

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", size, size, 8, color_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b"")


# ------------------------------------------------------------------------------------------------------------ scenes


def cornell_walls(scene):
    white = scene.diffuse("white", (0.73, 0.73, 0.73))
    red = scene.diffuse("red", (0.63, 0.06, 0.05))
    green = scene.diffuse("green", (0.14, 0.45, 0.09))
    scene.place("floor", floor(1, -1), white)
    scene.place("ceiling", quad((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)), white)
    scene.place("back", quad((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)), white)
    scene.place("left", quad((-1, -1, 1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1)), red)
    scene.place("right", quad((1, -1, -1), (1, -1, 1), (1, 1, 1), (1, 1, -1)), green)


def lamp(scene, size, y, emission, name="lamp"):
    material = scene.diffuse(name, (0, 0, 0), emission=emission)
    scene.place(name, quad((-size, y, -size), (size, y, -size), (size, y, size), (-size, y, size)), material)


def cornell_spheres():
    scene = Scene()
    cornell_walls(scene)
    lamp(scene, 0.3, 0.995, (17, 14, 9))
    ball = sphere(4, 0.36)
    scene.place("mirror", ball, scene.material("mirror", (0.95, 0.95, 0.95), {"bsdf": "mirror"}),
                translation=[-0.5, -0.64, -0.45])
    scene.place("glass", ball, scene.material("glass", (1, 1, 1), {"bsdf": "glass"}, ior=1.5),
                translation=[0.45, -0.64, 0.3])
    small = sphere(4, 0.25)
    scene.place("refract", small, scene.material("refract", (0.9, 0.97, 1), {"bsdf": "refract"}, ior=1.33),
                translation=[-0.2, -0.75, 0.55])
    scene.camera((0, 0, 3.9), (0, 0, 0), 39.3)
    scene.write("cornell_spheres")


def furnace_box(name, albedo):
    scene = Scene()
    wall = scene.diffuse("wall", (albedo,) * 3, emission=(1, 1, 1))
    scene.place("box", box((1, 1.2, 1.5), inwards=True), wall)
    scene.camera((0.3, -0.2, 0.7), (-0.4, 0.3, -1), 60)
    scene.write(name)


def furnace_sphere(bsdf):
    scene = Scene()
    scene.environment((1, 1, 1))
    ior = 1.5 if bsdf in ("refract", "glass") else None
    scene.place("sphere", sphere(3, 1, smooth=False), scene.material("white", (1, 1, 1), {"bsdf": bsdf}, ior=ior))
    scene.camera((0, 0, 4), (0, 0, 0), 40)
    scene.write(f"furnace_sphere_{bsdf}")


def punctual():
    scene = Scene()
    scene.place("floor", floor(4), scene.diffuse("floor", (0.7, 0.7, 0.7)))
    scene.place("box", box((0.5, 0.5, 0.5)), scene.diffuse("box", (0.8, 0.5, 0.2)), translation=[0.2, 0.5, 0],
                rotation=[0, math.sin(0.25), 0, math.cos(0.25)])
    scene.light("point", 6, (1, 0.8, 0.6), translation=[-1.5, 1.5, 1.0])
    scene.light("spot", 20, (0.6, 0.8, 1), translation=[1.5, 3, 1.5], rotation=look_at((1.5, 3, 1.5), (0.8, 0, 0.5)))
    scene.light("directional", 0.6, rotation=look_at((2, 3, -1), (0, 0, 0)))
    scene.camera((0, 2.2, 5), (0, 0.4, 0), 40)
    scene.write("punctual")


def environment():
    scene = Scene()
    scene.environment((0.5, 0.7, 1.0))
    scene.place("floor", floor(6), scene.diffuse("floor", (0.5, 0.5, 0.5)))
    ball = sphere(4, 0.7)
    scene.place("diffuse", ball, scene.diffuse("diffuse", (0.8, 0.3, 0.2)), translation=[-1.6, 0.7, 0])
    scene.place("glossy", ball, scene.material("glossy", (0.2, 0.5, 0.8), metallic=0, roughness=0.3),
                translation=[0, 0.7, 0])
    scene.place("metal", ball, scene.material("metal", (0.95, 0.75, 0.4), metallic=1, roughness=0.2),
                translation=[1.6, 0.7, 0])
    scene.camera((0, 1.8, 6), (0, 0.6, 0), 35, {"lens_radius": 0.05, "focus_distance": 6.1})
    scene.write("environment")


def instances():
    scene = Scene()
    scene.environment((0.2, 0.25, 0.3))
    scene.place("floor", floor(5), scene.diffuse("floor", (0.6, 0.6, 0.6)))
    lamp(scene, 1.0, 5.0, (12, 11, 10))
    # A shape without symmetry shows every wrong transform: a sphere with a box at its side.
    ball, side = sphere(2, 0.5), box((0.35, 0.12, 0.2))
    side["positions"] = [[x + 0.6, y + 0.2, z + 0.1] for x, y, z in side["positions"]]
    parts = ((ball, scene.diffuse("ball", (0.7, 0.3, 0.2))), (side, scene.diffuse("side", (0.2, 0.4, 0.7))))
    mesh = scene.mesh("shape", *parts)
    draw = random.Random(1)
    for i in range(49):
        rotation = normalize_quaternion([draw.gauss(0, 1) for _ in range(4)])
        scale = [draw.uniform(0.3, 0.9) for _ in range(3)]
        if i % 3 == 0:
            scale[i % 2] *= -1
        position = [1.2 * (i % 7 - 3), 0.8, 1.2 * (i // 7 - 3)]
        scene.node(name=f"instance {i}", mesh=mesh, translation=position, rotation=rotation, scale=scale)
    scene.camera((0, 6, 9), (0, 0.2, 0), 40)
    scene.write("instances")


def textured():
    scene = Scene()
    scene.environment((0.3, 0.3, 0.3))
    checker = checker_png(16, (40, 60, 120), (230, 220, 180))
    near, smooth = scene.texture(checker, nearest=True), scene.texture(checker)
    scene.place("floor", floor(3, 0, tiles=6), scene.diffuse("floor", (1, 1, 1), texture=near))
    wall = quad((-3, 0, -2), (3, 0, -2), (3, 3, -2), (-3, 3, -2), 3)
    scene.place("wall", wall, scene.material("wall", (0.9, 0.6, 0.5), metallic=0, roughness=0.5, texture=smooth))
    lamp(scene, 0.6, 3.5, (10, 10, 10))
    scene.camera((0, 1.8, 5), (0, 1, 0), 45)
    scene.write("textured")


def alpha():
    scene = Scene()
    scene.environment((0.25, 0.3, 0.35))
    scene.place("floor", floor(4), scene.diffuse("floor", (0.7, 0.7, 0.7)))
    # A fence of discs by a mask: coloured and there inside of the discs, clear outside.
    discs = scene.texture(disc_png(32, (200, 120, 60)), name="disc")
    fence = quad((-2.5, 0, -1), (2.5, 0, -1), (2.5, 2, -1), (-2.5, 2, -1), 4)
    scene.place("fence", fence, scene.diffuse("fence", (1, 1, 1), texture=discs, cutoff=0.5))
    # One sheet three times: each lets 60 % through.
    sheet = scene.mesh("sheet", (quad((-0.6, 0, 0), (0.6, 0, 0), (0.6, 1.2, 0), (-0.6, 1.2, 0), 1),
                                 scene.material("sheet", (0.2, 0.4, 0.8), metallic=0, roughness=0.6, alpha=0.4)))
    for i in range(3):
        scene.node(name=f"sheet {i}", mesh=sheet, translation=[-1 + 0.4 * i, 0, 1 + 0.3 * i])
    # A lamp that is half there, and another that is a glowing disc.
    half = scene.diffuse("half a lamp", (0, 0, 0), emission=(8, 7, 6), double_sided=True, alpha=0.5)
    scene.place("half a lamp", quad((0.8, 2.2, 0), (2, 2.2, 0), (2, 2.2, 1), (0.8, 2.2, 1), 1), half)
    glow = scene.diffuse("disc", (0, 0, 0), emission=(2, 4, 8), double_sided=True, texture=discs, alpha=1)
    scene.place("disc", quad((0.8, 0, 0.8), (1.8, 0, 0.8), (1.8, 1, 0.8), (0.8, 1, 0.8), 1), glow)
    scene.camera((0, 1.8, 6), (0, 0.8, 0), 40)
    scene.write("alpha")


def metallic_roughness():
    scene = Scene()
    scene.environment((0.4, 0.45, 0.5))
    lamp(scene, 1.5, 4.0, (8, 7.5, 7))
    scene.place("floor", floor(6, -2.6), scene.diffuse("floor", (0.4, 0.4, 0.4)))
    ball = sphere(3, 0.45)
    for row in range(5):
        for column in range(5):
            name = f"metallic {row / 4} roughness {column / 4}"
            material = scene.material(name, (0.9, 0.5, 0.25), metallic=row / 4, roughness=column / 4)
            scene.place(name, ball, material, translation=[column - 2, row - 2, 0])
    scene.camera((0, 0, 9), (0, 0, 0), 36)
    scene.write("metallic_roughness")


CLEAR = ((1, 1, 1), None)


def volumes():
    """Solid glass, smooth and rough, that absorbs, with water and with a lamp in it; a thin wall beside it."""
    scene = Scene()
    scene.environment((0.35, 0.4, 0.5))
    lamp(scene, 1.5, 4.0, (8, 7.5, 7))
    tiles = scene.texture(checker_png(16, (60, 60, 70), (200, 195, 185)))
    scene.place("floor", floor(5, -0.5, 8), scene.diffuse("floor", (1, 1, 1), texture=tiles))
    ball, inner, bulb = sphere(4, 0.5), sphere(3, 0.38), sphere(2, 0.12)

    def glass(name, roughness=0.0, ior=1.5, color=(1, 1, 1), transmission=1, attenuation=CLEAR):
        return scene.material(name, color, metallic=0, roughness=roughness, ior=ior, transmission=transmission,
                              attenuation=attenuation)

    clear = glass("clear glass")
    amber = ((0.9, 0.45, 0.1), 0.4)
    row = [clear, glass("frosted glass", 0.45), glass("amber", attenuation=amber),
           glass("frosted amber", 0.4, attenuation=amber), glass("half of it milky", 0.35, 1.6, (0.3, 0.6, 0.9), 0.5)]
    for i, material in enumerate(row):
        scene.place(scene.doc["materials"][material]["name"], ball, material, translation=[1.15 * (i - 2), 0, 0])
    scene.place("glass of water", ball, clear, translation=[-1.2, 0, 1.3])
    scene.place("water", inner, glass("water", ior=1.33, attenuation=((0.5, 0.8, 0.9), 0.5)), translation=[-1.2, 0, 1.3])
    # What lies in a medium is lit through it.
    scene.place("lamp glass", ball, glass("smoke", 0.55, 1.3, attenuation=((0.6, 0.55, 0.5), 0.5)), translation=[0, 0, 1.3])
    scene.place("bulb", bulb, scene.diffuse("bulb", (0, 0, 0), emission=(30, 26, 20)), translation=[0, 0.2, 1.3])
    scene.place("pearl", bulb, scene.diffuse("pearl", (0.9, 0.9, 0.9)), translation=[0.05, -0.2, 1.35])
    thin = scene.material("thin wall", (0.9, 1, 0.9), metallic=0, roughness=0.25, transmission=1)
    scene.place("thin wall", ball, thin, translation=[1.2, 0, 1.3])
    scene.camera((0, 2.2, 5.6), (0, -0.05, 0.4), 36)
    scene.write("volumes")


def polar_sphere(rings, sectors, radius):
    """A smooth sphere with tangents along its circles of latitude, counter-clockwise from above."""
    positions, normals, tangents, triangles = [], [], [], []
    for ring in range(rings + 1):
        polar = math.pi * ring / rings
        for sector in range(sectors + 1):
            s, c = math.sin(math.tau * sector / sectors), math.cos(math.tau * sector / sectors)
            normal = (math.sin(polar) * s, math.cos(polar), math.sin(polar) * c)
            normals.append(normal)
            positions.append([radius * x for x in normal])
            tangents.append((c, 0, -s, 1))
    for ring in range(rings):
        for sector in range(sectors):
            a = ring * (sectors + 1) + sector
            b = a + sectors + 1
            if ring > 0:
                triangles.append((a, b, a + 1))
            if ring < rings - 1:
                triangles.append((a + 1, b, b + 1))
    return {"positions": positions, "normals": normals, "tangents": tangents, "triangles": triangles}


def circular_grooves(size):
    """An anisotropy texture: rough away from the centre, across grooves that run around it."""

    def texel(x, y):
        right, up = 2 * x + 1 - size, size - 1 - 2 * y
        length = math.hypot(right, up)
        return (round(127.5 + 127.5 * right / length), round(127.5 + 127.5 * up / length), 255)

    return png(size, texel)


def anisotropy():
    scene = Scene()
    scene.environment((0.25, 0.28, 0.32))
    lamp(scene, 0.6, 4.0, (40, 38, 35))
    scene.place("floor", floor(6, -2.0), scene.diffuse("floor", (0.4, 0.4, 0.4)))
    ball = polar_sphere(24, 48, 0.45)
    for row in range(3):
        for column in range(5):
            strength, rotation = column / 4, row * math.pi / 4
            name = f"strength {strength} rotation {45 * row}"
            material = scene.material(name, (0.9, 0.75, 0.55), metallic=1, roughness=0.25,
                                      anisotropy=(strength, rotation))
            scene.place(name, ball, material, translation=[1.05 * (column - 2), 1.05 * (row - 0.6), 0])
    grooves = scene.texture(circular_grooves(32), name="circular grooves")
    brushed = scene.material("brushed plate", (0.8, 0.8, 0.85), metallic=1, roughness=0.2, anisotropy=(1, 0, grooves))
    plate = quad((-1.4, -1.9, 2.4), (1.4, -1.9, 2.4), (1.4, -1.3, 0.6), (-1.4, -1.3, 0.6))
    plate["normals"] = [normalize((0, 1.8, 0.6))] * 4
    plate["tangents"] = [(1, 0, 0, 1)] * 4
    scene.place("plate", plate, brushed)
    scene.camera((0, 0.3, 9), (0, -0.1, 0), 34)
    scene.write("anisotropy")


def many_lights():
    scene = Scene()
    scene.place("floor", floor(4), scene.diffuse("floor", (0.7, 0.7, 0.7)))
    scene.place("box", box((0.7, 0.7, 0.7)), scene.diffuse("box", (0.5, 0.5, 0.5)), translation=[0, 0.7, 0])
    draw = random.Random(2)
    for i in range(64):
        power = 10 ** draw.uniform(-1, 2)
        color = [power * draw.uniform(0.2, 1) for _ in range(3)]
        material = scene.diffuse(f"light {i}", (0, 0, 0), emission=color, double_sided=i % 4 == 0)
        size = draw.uniform(0.02, 0.12)
        corners = [[size * draw.gauss(0, 1) for _ in range(3)] for _ in range(3)]
        position = [draw.uniform(-2.5, 2.5), draw.uniform(0.4, 2.5), draw.uniform(-2.5, 2.5)]
        scene.place(f"light {i}", {"positions": corners, "triangles": [(0, 1, 2)]}, material, translation=position)
    scene.camera((0, 3, 6.5), (0, 0.6, 0), 40)
    scene.write("many_lights")


def caustic():
    scene = Scene()
    scene.place("floor", floor(3), scene.diffuse("floor", (0.8, 0.8, 0.8)))
    scene.place("glass", sphere(4, 0.5), scene.material("glass", (1, 1, 1), {"bsdf": "glass"}, ior=1.5),
                translation=[0, 0.8, 0])
    lamp(scene, 0.15, 3.0, (120, 115, 100))
    scene.camera((0, 2, 4), (0, 0.4, 0), 40)
    scene.write("caustic")


def near_lamps():
    scene = Scene()
    scene.place("floor", floor(2), scene.diffuse("floor", (0.5, 0.5, 0.5)))
    scene.place("wall", quad((-2, 0, -0.5), (2, 0, -0.5), (2, 2, -0.5), (-2, 2, -0.5)), scene.diffuse("wall", (0.5, 0.4, 0.3)))
    # A panel a hand above the floor that touches the wall, and a thin strip that stands on the floor.
    panel = scene.diffuse("panel", (0, 0, 0), emission=(1, 0.9, 0.8))
    scene.place("panel", quad((-0.7, 0.1, -0.5), (0.3, 0.1, -0.5), (0.3, 0.1, 0.5), (-0.7, 0.1, 0.5)), panel)
    strip = scene.diffuse("strip", (0, 0, 0), emission=(2, 3, 4), double_sided=True)
    scene.place("strip", quad((0.8, 0, 0.3), (0.83, 0, 0.3), (0.83, 1, 0.3), (0.8, 1, 0.3)), strip)
    scene.camera((0, 1.2, 3.2), (0, 0.3, 0), 40)
    scene.write("near_lamps")


if __name__ == "__main__":
    cornell_spheres()
    furnace_box("furnace_box", 0.5)
    furnace_box("furnace_box_08", 0.8)
    for kind in ("lambertian", "mirror", "refract", "glass"):
        furnace_sphere(kind)
    punctual()
    environment()
    instances()
    textured()
    alpha()
    metallic_roughness()
    volumes()
    anisotropy()
    many_lights()
    caustic()
    near_lamps()
