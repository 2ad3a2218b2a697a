"""Cycles' side (PyPI `bpy`): the neutral scene as Blender's objects and shader nodes, on the CPU.

Nothing is clamped, adapted, denoised or filtered: what is compared is the path tracer, with its default sampler and
its light tree. Y stays up: Blender's own Z-up only matters for the environment, which is turned for it.
"""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import bpy
import numpy
from mathutils import Matrix
from scenes import SCENES
from worker import REFERENCE_SEED, serve


def nodes_of(tree):
    tree.nodes.clear()

    def node(kind, **inputs):
        made = tree.nodes.new(kind)
        for name, value in inputs.items():
            slot = made.inputs[name.replace("_", " ")]
            if hasattr(value, "links"):
                tree.links.new(value, slot)
            else:
                slot.default_value = value
        return made
    return node


def blender_material(material):
    out = bpy.data.materials.new(material.name)
    out.use_nodes = True
    node, colour = nodes_of(out.node_tree), (*map(float, material.colour), 1.0)
    if material.kind == "glass":
        surface = node("ShaderNodeBsdfGlass", Color=colour, Roughness=0.0, IOR=material.ior)
    elif material.kind == "metal":
        # Principled with metallic 1 and a white tint: Schlick's Fresnel (F82 with no dip), alpha = roughness².
        surface = node("ShaderNodeBsdfPrincipled", Base_Color=colour, Metallic=1.0, Roughness=material.roughness)
        surface.distribution = "GGX"
    else:
        surface = node("ShaderNodeBsdfDiffuse", Color=colour, Roughness=0.0)
    shader = surface.outputs[0]
    if any(material.emission):
        strength = float(max(material.emission))
        emission = node("ShaderNodeEmission", Color=(*(x / strength for x in material.emission), 1.0),
                        Strength=strength)
        front = node("ShaderNodeMixShader", Fac=node("ShaderNodeNewGeometry").outputs["Backfacing"])
        out.node_tree.links.new(emission.outputs[0], front.inputs[1])
        shader = add(node, out.node_tree, shader, front.outputs[0])
        out.cycles.emission_sampling = "FRONT"
    if material.black_back:
        mix = node("ShaderNodeMixShader", Fac=node("ShaderNodeNewGeometry").outputs["Backfacing"])
        out.node_tree.links.new(shader, mix.inputs[1])
        shader = mix.outputs[0]
    node("ShaderNodeOutputMaterial", Surface=shader)
    return out


def add(node, tree, first, second):
    both = node("ShaderNodeAddShader")
    tree.links.new(first, both.inputs[0])
    tree.links.new(second, both.inputs[1])
    return both.outputs[0]


def blender_mesh(index, mesh, material):
    out = bpy.data.meshes.new(f"mesh{index}")
    count = len(mesh.triangles)
    out.vertices.add(len(mesh.positions))
    out.vertices.foreach_set("co", mesh.positions.ravel())
    out.loops.add(3 * count)
    out.loops.foreach_set("vertex_index", mesh.triangles.astype(numpy.int32).ravel())
    out.polygons.add(count)
    out.polygons.foreach_set("loop_start", numpy.arange(0, 3 * count, 3, dtype=numpy.int32))
    out.update(calc_edges=True)
    out.shade_flat()
    out.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"mesh{index}", out))


def environment(path):
    """Sunfleck's u is atan2(z, x)/2π about +Y, Blender's ½ − atan2(y, x)/2π about +Z: (x, y, z) becomes (−x, z, y)."""
    world = bpy.data.worlds.new("world")
    bpy.context.scene.world = world
    world.use_nodes = True
    node = nodes_of(world.node_tree)
    parts = node("ShaderNodeSeparateXYZ", Vector=node("ShaderNodeTexCoord").outputs["Generated"]).outputs
    minus_x = node("ShaderNodeMath")
    minus_x.operation = "MULTIPLY"
    world.node_tree.links.new(parts["X"], minus_x.inputs[0])
    minus_x.inputs[1].default_value = -1.0
    turned = node("ShaderNodeCombineXYZ", X=minus_x.outputs[0], Y=parts["Z"], Z=parts["Y"])
    image = node("ShaderNodeTexEnvironment", Vector=turned.outputs[0])
    image.image = bpy.data.images.load(str(path))
    image.image.colorspace_settings.name = "Linear Rec.709"
    background = node("ShaderNodeBackground", Color=image.outputs[0], Strength=1.0)
    node("ShaderNodeOutputWorld", Surface=background.outputs[0])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = image.image.size[0]


class Cycles:
    def __init__(self):
        self.version = f"Cycles of bpy {bpy.app.version_string}"

    def prepare(self, name, folder, resolution, options):
        self.neutral, self.folder, self.resolution = SCENES[name](), Path(folder), resolution

    def settings(self):
        scene, neutral = bpy.context.scene, self.neutral
        scene.render.engine = "CYCLES"
        scene.render.resolution_x = scene.render.resolution_y = self.resolution
        scene.render.resolution_percentage = 100
        scene.render.use_persistent_data = True
        scene.render.threads_mode, scene.render.threads = "FIXED", os.cpu_count()
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_mode = "RGB"
        scene.render.image_settings.color_depth = "32"
        scene.view_settings.view_transform = "Raw"
        scene.render.use_compositing = scene.render.use_sequencer = False
        cycles = scene.cycles
        cycles.device = "CPU"
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.caustics_reflective = cycles.caustics_refractive = True
        cycles.blur_glossy = cycles.light_sampling_threshold = 0.0
        # Cycles counts indirect bounces: 0 is direct light alone, which is one scattering event.
        for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
            setattr(cycles, name, neutral.max_bounces - 1)

    def load(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.settings()
        scene, neutral = bpy.context.scene, self.neutral
        for index, mesh in enumerate(neutral.meshes):
            blender_mesh(index, mesh, blender_material(mesh.material))
        if neutral.environment is not None:
            environment(self.folder / f"{neutral.name}.hdr")
        camera = bpy.data.cameras.new("camera")
        camera.sensor_fit, camera.angle, camera.clip_start = "VERTICAL", numpy.radians(neutral.yfov_degrees), 1e-3
        holder = bpy.data.objects.new("camera", camera)
        holder.matrix_world = Matrix(neutral.camera_to_world().tolist())
        scene.collection.objects.link(holder)
        scene.camera = holder
        self.render(1, 0)  # Cycles builds its BVH at the first rendering and keeps it

    def render(self, spp, seed):
        scene = bpy.context.scene
        scene.cycles.samples, scene.cycles.seed = spp, seed
        # Sample 0 goes through the pixel's centre: a bias at edges, of weight 1/spp, which a reference must not have.
        scene.cycles.sample_offset = 1 if seed >= REFERENCE_SEED else 0
        out = self.folder / f"cycles-{self.neutral.name}.exr"
        scene.render.filepath = str(out)
        ended = []
        bpy.app.handlers.render_post[:] = [lambda *_: ended.append(time.perf_counter())]
        before = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        picture = bpy.data.images.load(str(out), check_existing=False)
        picture.colorspace_settings.name = "Non-Color"
        width, height = picture.size
        pixels = numpy.empty(width * height * 4, numpy.float32)
        picture.pixels.foreach_get(pixels)
        bpy.data.images.remove(picture)
        return pixels.reshape(height, width, 4)[::-1, :, :3], {"compile": 0.0, "render": ended[0] - before}


if __name__ == "__main__":
    serve(Cycles, float(sys.argv[1]))
