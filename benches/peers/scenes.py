"""The scenes of the comparison, each described once and neutrally; every renderer's adapter translates this.

All meshes are flat-shaded triangles in world space, +Y up, so that no renderer's idea of smooth normals or instances
enters. Materials are of four kinds: `diffuse`, `metal` (GGX, Schlick's Fresnel, alpha = roughness²), `glass` (smooth
dielectric, exact Fresnel), and any of them may emit from its front. Numbers are seeded: the scenes are the same always.
"""

import math
from dataclasses import dataclass, field

import numpy


@dataclass
class Material:
    name: str
    kind: str = "diffuse"
    colour: tuple = (0.5, 0.5, 0.5)  # albedo, or reflectance at normal incidence
    roughness: float = 1.0
    ior: float = 1.5
    emission: tuple = (0.0, 0.0, 0.0)  # radiance of the front
    black_back: bool = False


@dataclass
class Mesh:
    material: Material
    positions: numpy.ndarray  # float32, N × 3
    triangles: numpy.ndarray  # uint32, M × 3
    places: numpy.ndarray | None = None  # K × 4 × 4: instances; None is one, where the positions say


@dataclass
class Scene:
    name: str
    title: str
    position: tuple
    target: tuple
    yfov_degrees: float
    max_bounces: int  # scattering events of a path
    meshes: list = field(default_factory=list)
    environment: numpy.ndarray | None = None  # float32, height × width × 3, latitude/longitude, north on top

    def add(self, material, shape, places=None) -> None:
        positions, triangles = shape
        self.meshes.append(Mesh(material, numpy.asarray(positions, numpy.float32), numpy.asarray(triangles, numpy.uint32),
                                places))

    def triangle_count(self) -> int:
        """Instances counted one by one."""
        return sum(len(m.triangles) * (1 if m.places is None else len(m.places)) for m in self.meshes)

    def camera_to_world(self) -> numpy.ndarray:
        """4 × 4; the camera looks down its −Z."""
        back = unit(numpy.subtract(self.position, self.target))
        right = unit(numpy.cross((0, 1, 0), back))
        matrix = numpy.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, numpy.cross(back, right), back, self.position
        return matrix


def unit(vector) -> numpy.ndarray:
    return numpy.asarray(vector, float) / numpy.linalg.norm(vector)


def rotation(axis: str, degrees: float) -> numpy.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return numpy.array({"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]]}[axis])


def rectangle(centre, to_world=None, half=(1, 1)):
    """[−1, 1]² in the plane z = 0, its front towards +Z, scaled, then turned by `to_world`, then moved."""
    corners = numpy.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (*half, 1)
    turn = numpy.eye(3) if to_world is None else to_world
    return corners @ turn.T + centre, [[0, 1, 2], [0, 2, 3]]


def box(centre, half, turn_y=0.0):
    corners = numpy.array([[(1 if i >> axis & 1 else -1) * half[axis] for axis in range(3)] for i in range(8)])
    faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    triangles = [t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])]
    return corners @ rotation("y", turn_y).T + centre, triangles


def sphere(centre, radius, n=48, bumps=0.0):
    """n latitudes, 2n longitudes, no triangle twice: 4n(n − 1) triangles, fronts outwards. `bumps` 1 is the bumpy sphere."""
    theta = numpy.linspace(0, math.pi, n + 1)[1:-1, None]
    phi = numpy.linspace(0, 2 * math.pi, 2 * n, endpoint=False)[None, :]
    r = radius * (1 + bumps * (0.12 * numpy.sin(13 * phi) * numpy.sin(11 * theta)
                               + 0.03 * numpy.sin(57 * phi) * numpy.sin(61 * theta)))
    ring = numpy.stack([r * numpy.sin(theta) * numpy.cos(phi), r * numpy.cos(theta) + 0 * phi,
                        r * numpy.sin(theta) * numpy.sin(phi)], axis=-1).reshape(-1, 3)
    points = numpy.concatenate([ring, [[0, radius, 0], [0, -radius, 0]]])
    north, south, m = len(ring), len(ring) + 1, 2 * n
    i, j = numpy.meshgrid(numpy.arange(n - 2), numpy.arange(m), indexing="ij")
    a, b = i * m + j, i * m + (j + 1) % m
    quads = numpy.concatenate([numpy.stack([a, b, a + m], -1), numpy.stack([b, b + m, a + m], -1)]).reshape(-1, 3)
    k, last = numpy.arange(m), (n - 2) * m
    caps = [numpy.stack([numpy.full(m, north), (k + 1) % m, k], -1),
            numpy.stack([numpy.full(m, south), last + k, last + (k + 1) % m], -1)]
    return points + centre, numpy.concatenate([quads, *caps])


WHITE = (0.885809, 0.698859, 0.666422)


def cornell(boxes=True) -> Scene:
    """Mitsuba's `cornell_box()`, which is Sunfleck's built-in `cornell`: one-sided surfaces and all."""
    white = Material("white", colour=WHITE, black_back=True)
    green = Material("green", colour=(0.105421, 0.37798, 0.076425), black_back=True)
    red = Material("red", colour=(0.570068, 0.0430135, 0.0443706), black_back=True)
    lamp = Material("lamp", colour=WHITE, black_back=True, emission=(18.387, 13.9873, 6.75357))
    scene = Scene("cornell", "Cornell box", (0, 0, 3.9), (0, 0, 0), 39.3077, 7)
    scene.add(lamp, rectangle((0, 0.99, 0.01), rotation("x", 90), (0.23, 0.19)))
    scene.add(white, rectangle((0, -1, 0), rotation("x", -90)))
    scene.add(white, rectangle((0, 1, 0), rotation("x", 90)))
    scene.add(white, rectangle((0, 0, -1)))
    scene.add(green, rectangle((1, 0, 0), rotation("y", -90)))
    scene.add(red, rectangle((-1, 0, 0), rotation("y", 90)))
    if boxes:
        scene.add(white, box((0.335, -0.7, 0.38), (0.3, 0.3, 0.3), -17))
        scene.add(white, box((-0.33, -0.4, -0.28), (0.3, 0.61, 0.3), 18.25))
    return scene


def cornell_moved() -> Scene:
    """The Cornell box with every vertex moved by up to 4 cm, what was one point as one: no face is planar or along an axis."""
    scene = cornell()
    scene.name, scene.title = "cornell_moved", "Cornell box, vertices moved"
    random = numpy.random.default_rng(3)
    moved: dict = {}
    for mesh in scene.meshes:
        keys = [tuple(numpy.round(p, 4)) for p in mesh.positions.tolist()]
        offsets = [moved.setdefault(key, random.uniform(-0.04, 0.04, 3)) for key in keys]
        mesh.positions = (mesh.positions + offsets).astype(numpy.float32)
    return scene


def bumpy(name, title, n) -> Scene:
    """The box with a bumpy sphere of 4n(n − 1) triangles in place of the two boxes."""
    scene = cornell(boxes=False)
    scene.name, scene.title = name, title
    scene.add(scene.meshes[1].material, sphere((0, -0.3, 0), 0.6, n=n, bumps=1))
    return scene


def million() -> Scene:
    return bumpy("million", "A mesh of a million triangles", 500)


def bumpy_9k() -> Scene:
    return bumpy("bumpy_9k", "A mesh of 9,800 triangles", 50)


def bumpy_159k() -> Scene:
    return bumpy("bumpy_159k", "A mesh of 159,200 triangles", 200)


def bumpy_2m() -> Scene:
    return bumpy("bumpy_2m", "A mesh of 1,957,200 triangles", 700)


def bumpy_10m() -> Scene:
    return bumpy("bumpy_10m", "A mesh of ten million triangles", 1582)


def instanced(name, title, n, across) -> Scene:
    """A plain with across² bumpy spheres of 4n(n − 1) triangles, turned and scaled by chance, under a square lamp."""
    scene = Scene(name, title, (0, 5.5, 15), (0, -0.6, 2), 40, 7)
    grey, clay = Material("grey", colour=(0.5, 0.5, 0.5)), Material("clay", colour=(0.7, 0.5, 0.4))
    scene.add(grey, rectangle((0, -1, 0), rotation("x", -90), (16, 16)))
    lamp = Material("lamp", colour=(0, 0, 0), emission=(6, 6, 6))
    scene.add(lamp, rectangle((0, 12, 4), rotation("x", 90), (4, 4)))
    random, places = numpy.random.default_rng(3), numpy.tile(numpy.eye(4), (across * across, 1, 1))
    for k, place in enumerate(places):
        size = random.uniform(0.5, 1.0) * 8 / across
        turn = rotation("y", random.uniform(0, 360)) @ rotation("x", random.uniform(0, 360))
        place[:3, :3] = turn * size
        place[:3, 3] = (16 * (k % across + 0.5) / across - 8, size - 1, 16 * (k // across + 0.5) / across - 8)
    scene.add(clay, sphere((0, 0, 0), 1.0, n=n, bumps=1), places)
    return scene


def instances() -> Scene:
    return instanced("instances", "A thousand instances of a mesh of 9,800 triangles", 50, 32)


def billion() -> Scene:
    return instanced("billion", "A billion instanced triangles", 500, 32)


def plates() -> Scene:
    """After Veach 1997, figure 9.2: four lights of equal power, four metal plates from nearly a mirror to rough."""
    scene = Scene("plates", "Glossy plates, lights of four sizes", (0, 2, 15), (0, -2.6, 2.0), 36, 4)
    grey = Material("grey", colour=(0.4, 0.4, 0.4))
    scene.add(grey, rectangle((0, -5.5, 0), rotation("x", -90), (12, 12)))
    scene.add(grey, rectangle((0, 0, -4), None, (12, 12)))
    # The lamps hang above the picture: seen directly, the edge of the smallest would be nearly all of the error.
    row = numpy.array([0, 5, 0])
    for x, radius in zip((-3.75, -1.25, 1.25, 3.75), (0.03, 0.1, 0.3, 0.9)):
        radiance = 8.0 / radius**2
        lamp = Material(f"lamp of radius {radius}", colour=(0, 0, 0), emission=(radiance,) * 3)
        scene.add(lamp, sphere(row + (x, 0, 0), radius, n=16))
    for index, roughness in enumerate((0.08, 0.15, 0.25, 0.4)):
        centre = numpy.array([0, -2.2 - 0.75 * index, 0.4 + 1.35 * index])
        normal = unit(unit(numpy.subtract(scene.position, centre)) + unit(row - centre))
        turn = numpy.stack([(1, 0, 0), numpy.cross(normal, (1, 0, 0)), normal], axis=1)
        metal = Material(f"plate of roughness {roughness}", "metal", (0.7, 0.75, 0.8), roughness)
        scene.add(metal, rectangle(centre, turn, (4, 0.6)))
    return scene


def sky(width=2048, height=1024, peak_to_mean=1e5) -> numpy.ndarray:
    """A blue gradient over dark ground and a sun of 3 × 3 texels, whose radiance is `peak_to_mean` times the mean."""
    v = (numpy.arange(height) + 0.5) / height
    up = numpy.cos(math.pi * v)[:, None, None]
    zenith = numpy.array([0.9, 0.9, 1.0]) - numpy.clip(up, 0, 1) * numpy.array([0.6, 0.4, 0.1])
    image = numpy.where(up > 0, zenith, 0.15)
    image = numpy.broadcast_to(image, (height, width, 3)).copy()
    row, column = int(0.28 * height), int(0.12 * width)
    weight = numpy.broadcast_to(numpy.sin(math.pi * v)[:, None], (height, width))
    share = weight[row:row + 3, column:column + 3].sum() / weight.sum()
    luminance = image @ (0.2126, 0.7152, 0.0722)
    base = (luminance * weight).sum() / weight.sum()
    # peak = P·mean and mean = base + share·peak give peak = P·base/(1 − P·share).
    image[row:row + 3, column:column + 3] = peak_to_mean * base / (1 - peak_to_mean * share)
    return image.astype(numpy.float32)


def sun() -> Scene:
    scene = Scene("sun", "Glossy and diffuse spheres under a sky with a sun", (0, 1.8, 6), (0, 0.6, 0), 40, 4)
    scene.environment = sky()
    scene.add(Material("floor", colour=(0.5, 0.45, 0.4)), rectangle((0, 0, 0), rotation("x", -90), (6, 6)))
    scene.add(Material("gold", "metal", (0.9, 0.7, 0.3), 0.3), sphere((-1.3, 0.6, 0), 0.6))
    scene.add(Material("clay", colour=(0.6, 0.3, 0.2)), sphere((0, 0.6, 0.2), 0.6))
    scene.add(Material("steel", "metal", (0.7, 0.7, 0.75), 0.15), sphere((1.3, 0.6, 0), 0.6))
    return scene


def caustic() -> Scene:
    scene = Scene("caustic", "A glass sphere's caustic", (0, 2.2, 4.5), (0, 0.3, 0), 34, 8)
    scene.add(Material("floor", colour=(0.6, 0.6, 0.6)), rectangle((0, 0, 0), rotation("x", -90), (4, 4)))
    scene.add(Material("glass", "glass", (1, 1, 1), 0.0, 1.5), sphere((0, 0.75, 0), 0.6))
    lamp = Material("lamp", colour=(0, 0, 0), emission=(120, 110, 90))
    scene.add(lamp, rectangle((1.2, 3.4, -0.6), rotation("x", 90), (0.25, 0.25)))
    return scene


def lights() -> Scene:
    """A room with 1000 square lamps whose powers are spread over three decades, and posts that hide them."""
    random = numpy.random.default_rng(1)
    scene = Scene("lights", "A thousand lights", (0, 1.6, 5.8), (0, 1.3, 0), 50, 4)
    wall = Material("wall", colour=(0.6, 0.6, 0.6))
    for centre, turn in (((0, 0, 0), rotation("x", -90)), ((0, 6, 0), rotation("x", 90)), ((0, 0, -6), numpy.eye(3)),
                         ((6, 0, 0), rotation("y", -90)), ((-6, 0, 0), rotation("y", 90))):
        scene.add(wall, rectangle(centre, turn, (6, 6)))
    post = Material("post", colour=(0.3, 0.35, 0.5))
    for x in (-3.2, -1.1, 1.1, 3.2):
        scene.add(post, box((x, 1.3, -1.5 + 0.4 * abs(x)), (0.25, 1.3, 0.25), 20 * x))
    shades = numpy.array([[1.0, 0.8, 0.6], [0.6, 0.8, 1.0], [1.0, 0.5, 0.5], [0.6, 1.0, 0.6]])
    groups: dict = {}
    for index in range(1000):
        centre = random.uniform((-5.5, 2.8, -5.5), (5.5, 5.8, 4.0))
        turn = rotation("y", random.uniform(0, 360)) @ rotation("x", 90 + random.uniform(-60, 60))
        groups.setdefault((index // 4 % 25, index % 4), []).append(rectangle(centre, turn, (0.03, 0.03)))
    for (step, shade), quads in sorted(groups.items()):
        radiance = 0.8 * 1000 ** (step / 24) * shades[shade]
        lamp = Material(f"lamp {step} {shade}", colour=(0, 0, 0), emission=tuple(radiance))
        scene.add(lamp, (numpy.concatenate([q[0] for q in quads]),
                         numpy.concatenate([numpy.array(q[1]) + 4 * k for k, q in enumerate(quads)])))
    return scene


def emitters(lit=10_000) -> Scene:
    """A hall of 40 × 40 m with square lamps everywhere in the air, their powers spread over three decades, among posts and
    screens that hide them. Every lamp's front turns away from the camera: the edges of the lamps themselves, which no
    choice of light can help, stay out of the error. Of the 10,000 lamps `lit` are on."""
    count = 10_000
    random = numpy.random.default_rng(2)
    position = numpy.array([4, 3.6, 18.5])
    scene = Scene("emitters", "Ten thousand emitters", tuple(position.tolist()), (1, 1.0, 4), 50, 4)
    wall = Material("wall", colour=(0.6, 0.6, 0.6))
    for centre, turn, half in (((0, 0, 0), rotation("x", -90), (20, 20)), ((0, 6, 0), rotation("x", 90), (20, 20)),
                               ((0, 3, -20), numpy.eye(3), (20, 3)), ((0, 3, 20), rotation("y", 180), (20, 3)),
                               ((20, 3, 0), rotation("y", -90), (20, 3)), ((-20, 3, 0), rotation("y", 90), (20, 3))):
        scene.add(wall, rectangle(centre, turn, half))
    post = Material("post", colour=(0.3, 0.35, 0.5))
    screen = Material("screen", colour=(0.6, 0.45, 0.3))
    for x in range(-16, 17, 8):
        for z in range(-16, 17, 8):
            scene.add(post, box((x, 3, z), (0.4, 3, 0.4), 15 * (x + z)))
            scene.add(screen, box((x + 4, 1.1, z + 1), (2.2, 1.1, 0.1), 7 * x - 5 * z))
    shades = numpy.array([[1.0, 0.8, 0.6], [0.6, 0.8, 1.0], [1.0, 0.5, 0.5], [0.6, 1.0, 0.6]])
    groups: dict = {}
    for index in range(count):
        centre = random.uniform((-19.5, 0.5, -19.5), (19.5, 5.8, 19.5))
        turn = rotation("y", random.uniform(0, 360)) @ rotation("x", random.uniform(-90, 90))
        if turn[:, 2] @ (position - centre) > 0:
            turn = turn @ rotation("y", 180)
        step, shade = index // 4 % 25, index % 4
        key = (step, shade) if index * lit // count != (index - 1) * lit // count else (-1, 0)
        groups.setdefault(key, []).append(rectangle(centre, turn, (0.03, 0.03)))
    for (step, shade), quads in sorted(groups.items()):
        radiance = 0.4 * 1000 ** (step / 24) * shades[shade] * (count / lit) if step >= 0 else numpy.zeros(3)
        lamp = Material(f"lamp {step} {shade}", colour=(0, 0, 0), emission=tuple(radiance.tolist()))
        scene.add(lamp, (numpy.concatenate([q[0] for q in quads]),
                         numpy.concatenate([numpy.array(q[1]) + 4 * k for k, q in enumerate(quads)])))
    return scene


SCENES = {make.__name__: make for make in (cornell, cornell_moved, plates, sun, caustic, lights, emitters, million, bumpy_9k,
                                            bumpy_159k, bumpy_2m, bumpy_10m, instances, billion)}
# What run.py renders without --scenes; the others are for speed.py.
COMPARED = ("cornell", "plates", "sun", "caustic", "lights", "emitters", "million")
