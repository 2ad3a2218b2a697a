"""Writes a scene of scenes.py as one .gltf with one .bin beside it (and the environment as .hdr): Sunfleck's side.

    gltf.py SCENE FOLDER [NUMBER]     NUMBER: of lamps that are on, for the scene `emitters`
"""

import json
import math
import sys
from pathlib import Path

import numpy


def write_hdr(path: Path, image: numpy.ndarray) -> None:
    """Radiance's RGBE, uncompressed (Ward 1991, "Real pixels"); eight bits of mantissa for the largest channel."""
    largest = image.max(axis=2)
    mantissa, exponent = numpy.frexp(largest)
    factor = numpy.where(largest > 0, mantissa * 256 / numpy.maximum(largest, 1e-38), 0)
    texels = numpy.concatenate([numpy.floor(image * factor[..., None]), (exponent + 128)[..., None]], axis=2)
    with open(path, "wb") as file:
        file.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {image.shape[0]} +X {image.shape[1]}\n".encode())
        file.write(texels.astype(numpy.uint8).tobytes())


def write_environment(scene, folder: Path) -> Path:
    path = folder / f"{scene.name}.hdr"
    write_hdr(path, scene.environment)
    return path


def material_to_gltf(material) -> dict:
    out = {"name": material.name,
           "pbrMetallicRoughness": {"baseColorFactor": [*map(float, material.colour), 1.0]}, "extensions": {}}
    extras = {}
    if material.kind == "metal":
        out["pbrMetallicRoughness"] |= {"metallicFactor": 1.0, "roughnessFactor": material.roughness}
    else:
        extras["bsdf"] = {"diffuse": "lambertian", "glass": "glass"}[material.kind]
    if material.kind == "glass":
        out["extensions"]["KHR_materials_ior"] = {"ior": material.ior}
    if material.black_back:
        extras["black_back"] = True
    if any(material.emission):
        # emissiveFactor must not pass 1, so its largest channel becomes the strength.
        strength = float(max(material.emission))
        out["emissiveFactor"] = [float(x) / strength for x in material.emission]
        out["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    if extras:
        out["extras"] = {"sunfleck": extras}
    return out


def write_gltf(scene, folder: Path) -> Path:
    data, views, accessors, primitives, materials = bytearray(), [], [], [], []

    def accessor(array, kind, component, **bounds) -> int:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data.extend(array.tobytes())
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind, **bounds,
                          "count": len(array) if kind == "VEC3" else array.size})
        return len(accessors) - 1

    nodes, meshes = [{"camera": 0, "matrix": scene.camera_to_world().T.ravel().tolist()}], []
    for mesh in scene.meshes:
        bounds = {"min": mesh.positions.min(axis=0).tolist(), "max": mesh.positions.max(axis=0).tolist()}
        primitive = {"attributes": {"POSITION": accessor(mesh.positions, "VEC3", 5126, **bounds)},
                     "indices": accessor(mesh.triangles, "SCALAR", 5125), "material": len(materials)}
        materials.append(material_to_gltf(mesh.material))
        if mesh.places is None:
            primitives.append(primitive)
            continue
        nodes += [{"mesh": len(meshes), "matrix": place.T.ravel().tolist()} for place in mesh.places]
        meshes.append({"primitives": [primitive]})
    nodes.append({"mesh": len(meshes)})
    meshes.append({"primitives": primitives})
    camera = {"type": "perspective",
              "perspective": {"yfov": math.radians(scene.yfov_degrees), "aspectRatio": 1.0, "znear": 0.01}}
    document = {
        "asset": {"version": "2.0", "generator": "sunfleck benches/peers"}, "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes, "materials": materials, "cameras": [camera],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{"uri": f"{scene.name}.bin", "byteLength": len(data)}],
        "extensionsUsed": ["KHR_materials_ior", "KHR_materials_emissive_strength"],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{scene.name}.bin").write_bytes(data)
    path = folder / f"{scene.name}.gltf"
    path.write_text(json.dumps(document))
    return path


if __name__ == "__main__":
    from scenes import SCENES

    if len(sys.argv) < 3 or sys.argv[1] not in SCENES:
        print(f"{__doc__}\nscenes: {', '.join(SCENES)}", file=sys.stderr)
        sys.exit(2)
    chosen, target = SCENES[sys.argv[1]](*map(int, sys.argv[3:])), Path(sys.argv[2])
    print(write_gltf(chosen, target))
    if chosen.environment is not None:
        print(write_environment(chosen, target))
