"""A copy of a scene file, turned before the camera that Sunfleck adds, or with a camera of a narrower field of view.

The camera in the copy stands where Sunfleck's own would. Textures and buffers are linked beside the copy; lights turn
with the scene.
"""

import json
import math
import struct
import subprocess
from pathlib import Path

# From the scene's centre to the camera that Sunfleck adds (VIEW_DIRECTION in src/scene/complete.rs).
VIEW_DIRECTION = (0.55, 0.35, 1.0)
CAMERA = "gallery"


def staged_copy(scene: Path, scratch: Path, program: Path, staging: dict) -> Path:
    """The copy in `scratch`. `staging` may hold, in degrees:

    turn    counter-clockwise as seen from above
    facing  the side of the model that looks straight at the camera, in its place: 0 is +Z, 180 is -Z; glTF only
    yfov    the vertical field of view, of a camera named CAMERA; glTF only
    """
    for sibling in scene.parent.iterdir():
        if sibling.name != scene.name:
            (scratch / sibling.name).symlink_to(sibling.resolve())
    copy = scratch / scene.name
    data = scene.read_bytes()
    if scene.suffix.lower() == ".obj":
        copy.write_bytes(turn_obj(data, math.radians(staging["turn"])))
        return copy
    document, rest = read_gltf(data)
    if "facing" in staging:
        turn_nodes(document, rotation(math.radians(staging["facing"]), 0.0))
        turn_nodes(document, rotation(*view_angles()))
    else:
        turn_nodes(document, rotation(math.radians(staging.get("turn", 0)), 0.0))
    copy.write_bytes(write_gltf(document, rest))
    if "yfov" in staging:
        add_camera(document, framing_position(copy, program), math.radians(staging["yfov"]))
        copy.write_bytes(write_gltf(document, rest))
    return copy


def view_angles() -> tuple[float, float]:
    """Yaw and pitch, in radians, that turn +Z to the direction of the camera."""
    x, y, z = VIEW_DIRECTION
    return math.atan2(x, z), -math.atan2(y, math.hypot(x, z))


def rotation(yaw_radians: float, pitch_radians: float) -> list[float]:
    """The turn about +Y after the one about +X, as a quaternion x, y, z, w."""
    sy, cy = math.sin(yaw_radians / 2), math.cos(yaw_radians / 2)
    sp, cp = math.sin(pitch_radians / 2), math.cos(pitch_radians / 2)
    return [cy * sp, sy * cp, -sy * sp, cy * cp]


def read_gltf(data: bytes) -> tuple[dict, bytes | None]:
    """The document, and the chunks after it in a .glb (glTF 2.0, section 4.4: the first chunk is the JSON)."""
    if data[:4] != b"glTF":
        return json.loads(data), None
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + length]), data[20 + length:]


def write_gltf(document: dict, rest: bytes | None) -> bytes:
    text = json.dumps(document).encode()
    if rest is None:
        return text
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + rest
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def turn_nodes(document: dict, quaternion: list[float]) -> None:
    """Puts the roots of the scene that is shown under a node which turns them."""
    scene = document["scenes"][document.get("scene", 0)]
    document["nodes"].append({"name": "turntable", "rotation": quaternion, "children": scene["nodes"]})
    scene["nodes"] = [len(document["nodes"]) - 1]


def framing_position(scene: Path, program: Path) -> list[float]:
    """Where Sunfleck puts the camera that it adds."""
    done = subprocess.run([str(program), "info", str(scene), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        raise ValueError(f"info: exit code {done.returncode}: {done.stderr.strip()[-300:]}")
    camera = json.loads(done.stdout)["cameras"][0]
    if camera["name"] != "framed":
        raise ValueError(f"the scene has its own camera, {camera['name']!r}; leave yfov out of the list")
    return camera["position"]


def add_camera(document: dict, position: list[float], yfov_radians: float) -> None:
    document.setdefault("cameras", []).append(
        {"name": CAMERA, "type": "perspective", "perspective": {"yfov": yfov_radians, "znear": 0.01}})
    document["nodes"].append({"name": CAMERA, "camera": len(document["cameras"]) - 1, "translation": position,
                              "rotation": rotation(*view_angles())})
    document["scenes"][document.get("scene", 0)]["nodes"].append(len(document["nodes"]) - 1)


def turn_obj(data: bytes, radians: float) -> bytes:
    """Turns positions and normals; what follows the three numbers (weights, colours) stays."""
    c, s = math.cos(radians), math.sin(radians)
    lines = []
    for line in data.decode().splitlines():
        word, *rest = line.split() or [""]
        if word in ("v", "vn") and len(rest) >= 3:
            x, y, z = map(float, rest[:3])
            line = " ".join([word, repr(c * x + s * z), repr(y), repr(c * z - s * x), *rest[3:]])
        lines.append(line)
    return ("\n".join(lines) + "\n").encode()
