"""A glTF file as Mitsuba's objects, for speed.py --model: geometry, normals, texture coordinates, and metallic-roughness
materials with their textures (base colour, metallic-roughness, normal, alpha) as `principled`, its nearest kin.

What is not read: emission, extensions, skins, sparse accessors, a second set of texture coordinates.
"""

import base64
import json
from pathlib import Path

import mitsuba as mi
import numpy

COMPONENTS = {5120: numpy.int8, 5121: numpy.uint8, 5122: numpy.int16, 5123: numpy.uint16, 5125: numpy.uint32, 5126: numpy.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Model:
    def __init__(self, path):
        self.folder = Path(path).parent
        data, self.chunk = Path(path).read_bytes(), None
        if data[:4] == b"glTF":
            length = int.from_bytes(data[12:16], "little")
            self.chunk, data = data[28 + length:], data[20:20 + length]
        self.document = json.loads(data)
        self.buffers = [self.resource(buffer) for buffer in self.document["buffers"]]
        self.images = {}

    def resource(self, holder) -> bytes:
        """What a buffer or an image refers to."""
        if "bufferView" in holder:
            view = self.document["bufferViews"][holder["bufferView"]]
            start = view.get("byteOffset", 0)
            return self.buffers[view["buffer"]][start:start + view["byteLength"]]
        if "uri" not in holder:
            return self.chunk
        if holder["uri"].startswith("data:"):
            return base64.b64decode(holder["uri"].partition(",")[2])
        return (self.folder / holder["uri"]).read_bytes()

    def accessor(self, index) -> numpy.ndarray:
        a = self.document["accessors"][index]
        view = self.document["bufferViews"][a["bufferView"]]
        kind, width = numpy.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        rows = numpy.ndarray((a["count"], width), kind, self.buffers[view["buffer"]], start, (stride, kind.itemsize))
        return rows / numpy.iinfo(kind).max if a.get("normalized") else rows

    def image(self, texture_index) -> numpy.ndarray:
        """height × width × channels, 0 to 1, as stored."""
        source = self.document["textures"][texture_index]["source"]
        if source not in self.images:
            stream = mi.MemoryStream()
            stream.write(self.resource(self.document["images"][source]))
            stream.seek(0)
            pixels = numpy.array(mi.Bitmap(stream))
            self.images[source] = pixels.reshape(*pixels.shape[:2], -1).astype(numpy.float32) / numpy.iinfo(pixels.dtype).max
        return self.images[source]

    def bsdf(self, index) -> dict:
        material = self.document["materials"][index] if index is not None else {}
        pbr = material.get("pbrMetallicRoughness", {})
        factor = numpy.array(pbr.get("baseColorFactor", [1, 1, 1, 1]), numpy.float32)
        opacity = factor[3]
        base = {"type": "rgb", "value": factor[:3].tolist()}
        if "baseColorTexture" in pbr:
            pixels = self.image(pbr["baseColorTexture"]["index"])
            if pixels.shape[2] == 4:
                opacity = factor[3] * pixels[..., 3:]
            base = texture(linear(pixels[..., :3]) * factor[:3])
        rough, metal = pbr.get("roughnessFactor", 1.0), pbr.get("metallicFactor", 1.0)
        if "metallicRoughnessTexture" in pbr:
            pixels = self.image(pbr["metallicRoughnessTexture"]["index"])
            rough, metal = texture(rough * pixels[..., 1:2]), texture(metal * pixels[..., 2:3])
        out = {"type": "principled", "base_color": base, "roughness": rough, "metallic": metal}
        if "normalTexture" in material:
            out = {"type": "normalmap", "normalmap": texture(self.image(material["normalTexture"]["index"])[..., :3]), "bsdf": out}
        out = {"type": "twosided", "nested": out}
        mode = material.get("alphaMode", "OPAQUE")
        if mode == "OPAQUE":
            return out
        if mode == "MASK":
            opacity = numpy.asarray(opacity >= material.get("alphaCutoff", 0.5), numpy.float32)
        opacity = texture(opacity) if numpy.ndim(opacity) else float(opacity)
        return {"type": "mask", "opacity": opacity, "nested": out}

    def placed_primitives(self):
        """World matrix and primitive, of every mesh of the scene."""
        nodes = self.document["nodes"]
        waiting = [(i, numpy.eye(4)) for i in self.document["scenes"][self.document.get("scene", 0)]["nodes"]]
        while waiting:
            index, parent = waiting.pop()
            node = nodes[index]
            to_world = parent @ local_matrix(node)
            waiting += [(child, to_world) for child in node.get("children", [])]
            if "mesh" in node:
                for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                    yield to_world, primitive

    def objects(self) -> dict:
        bsdfs = {}
        out = {}
        for k, (to_world, primitive) in enumerate(self.placed_primitives()):
            material = primitive.get("material")
            if material not in bsdfs:
                bsdfs[material] = mi.load_dict(self.bsdf(material))
            attributes = primitive["attributes"]
            positions = self.accessor(attributes["POSITION"]) @ to_world[:3, :3].T + to_world[:3, 3]
            faces = self.accessor(primitive["indices"]) if "indices" in primitive else numpy.arange(len(positions))
            if numpy.linalg.det(to_world[:3, :3]) < 0:
                faces = faces.reshape(-1, 3)[:, ::-1]
            properties = mi.Properties()
            properties["bsdf"] = bsdfs[material]
            properties["face_normals"] = "NORMAL" not in attributes
            mesh = mi.Mesh(f"mesh{k}", len(positions), faces.size // 3, has_vertex_normals="NORMAL" in attributes,
                           has_vertex_texcoords="TEXCOORD_0" in attributes, props=properties)
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = positions.astype(numpy.float32).ravel()
            parameters["faces"] = faces.astype(numpy.uint32).ravel()
            if "NORMAL" in attributes:
                normals = self.accessor(attributes["NORMAL"]) @ numpy.linalg.inv(to_world[:3, :3])
                normals /= numpy.linalg.norm(normals, axis=1, keepdims=True)
                parameters["vertex_normals"] = normals.astype(numpy.float32).ravel()
            if "TEXCOORD_0" in attributes:
                parameters["vertex_texcoords"] = self.accessor(attributes["TEXCOORD_0"]).astype(numpy.float32).ravel()
            parameters.update()
            out[f"mesh{k}"] = mesh
        return out


def local_matrix(node) -> numpy.ndarray:
    if "matrix" in node:
        return numpy.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    turn = numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    matrix = numpy.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * node.get("scale", [1, 1, 1]), node.get("translation", [0, 0, 0])
    return matrix


def linear(srgb) -> numpy.ndarray:
    return numpy.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def texture(pixels) -> dict:
    return {"type": "bitmap", "bitmap": mi.Bitmap(numpy.ascontiguousarray(pixels, numpy.float32)), "raw": True}
