//! `sunfleck info`: what is in a scene, and what of it is skipped.

use std::collections::BTreeMap;

use clap::Args;
use serde_json::{Value, json};
use sunfleck::scene::{AlphaMode, Environment, Lobe, Material, Projection, PunctualKind, Scene, load};

use sunfleck::gpu::{DeviceKind, TraceBackend};
use sunfleck::prepare::Prepared;
use sunfleck::render::{Bake, BakeReport, BvhQuality, Settings, prepare_scene};

use super::{devices, parse, print_json, print_warnings};

/// Say what is in a scene, what was added to it and what is skipped.
#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// A .gltf, .glb or .obj file, or the name of a built-in scene.
    scene: String,
    /// How long the BVH may take to build, for how fast rays go through it.
    #[arg(long, value_name = "NAME", default_value_t, value_parser = parse::named::<BvhQuality>(BvhQuality::NAMES))]
    bvh_quality: BvhQuality,
    /// Print one JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Materials that people are shown.
const MATERIALS_SHOWN: usize = 24;

/// Describes the scene.
pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<()> {
    let mut scene = load::resolve(&args.scene).map_err(sunfleck::Error::from)?;
    scene.frame_if_no_camera();
    scene.light_if_dark();
    let settings = Settings { bvh_quality: args.bvh_quality, ..Settings::default() };
    let prepared = prepare_scene(&scene, &scene.cameras[0], &settings)?;
    print_for_people(&scene);
    print_prepared(&prepared);
    if let Some(environment) = sunfleck::gpu::driver_environment() {
        eprintln!("  lavapipe     {environment}");
    }
    if args.json {
        let mut object = describe(&scene);
        object["prepared"] = describe_prepared(&prepared);
        object["driver_environment"] = devices::environment_json();
        print_json(&object)?;
    }
    Ok(())
}

/// Counts of a scene. A triangle counts once in its mesh and once for each instance of it.
struct Counts {
    primitives: usize,
    triangles: usize,
    vertices: usize,
    instanced_triangles: usize,
    emissive_triangles: usize,
    materials_by_bsdf: BTreeMap<&'static str, usize>,
    image_bytes: usize,
}

impl Counts {
    fn of(scene: &Scene) -> Self {
        let primitives = || scene.meshes.iter().flat_map(|mesh| &mesh.primitives);
        let placed = || scene.instances.iter().flat_map(|instance| &scene.meshes[instance.mesh].primitives);
        let mut materials_by_bsdf = BTreeMap::new();
        for material in &scene.materials {
            *materials_by_bsdf.entry(material.bsdf.name()).or_insert(0) += 1;
        }
        Self {
            primitives: primitives().count(),
            triangles: primitives().map(|p| p.triangles.len()).sum(),
            vertices: primitives().map(|p| p.positions.len()).sum(),
            instanced_triangles: placed().map(|p| p.triangles.len()).sum(),
            emissive_triangles: placed()
                .filter(|p| scene.materials.get(p.material).is_some_and(|m| m.is_emissive()))
                .map(|p| p.triangles.len())
                .sum(),
            materials_by_bsdf,
            image_bytes: scene.images.iter().map(|image| image_bytes(image)).sum(),
        }
    }
}

fn image_bytes(image: &sunfleck::scene::Image) -> usize {
    match &image.texels {
        sunfleck::scene::Texels::Rgba8(texels) => size_of_val(texels.as_slice()),
        sunfleck::scene::Texels::Rgba16(texels) => size_of_val(texels.as_slice()),
    }
}

fn describe(scene: &Scene) -> Value {
    let counts = Counts::of(scene);
    let cameras: Vec<_> = scene.cameras.iter().enumerate().map(|(i, c)| camera(i, c)).collect();
    let lights: Vec<_> = scene.lights.iter().map(|l| json!({"name": l.name, "kind": light_kind(l.kind)})).collect();
    let images: Vec<_> = scene
        .images
        .iter()
        .map(|i| json!({"name": i.name, "width": i.width, "height": i.height, "bytes": image_bytes(i)}))
        .collect();
    json!({
        "scene": scene.name,
        "meshes": scene.meshes.len(),
        "primitives": counts.primitives,
        "triangles": counts.triangles,
        "vertices": counts.vertices,
        "instances": scene.instances.len(),
        "instanced_triangles": counts.instanced_triangles,
        "emissive_triangles": counts.emissive_triangles,
        "materials": scene.materials.len(),
        "materials_by_bsdf": counts.materials_by_bsdf,
        "material_list": scene.materials.iter().map(material).collect::<Vec<_>>(),
        "textures": scene.textures.len(),
        "images": images,
        "image_bytes": counts.image_bytes,
        "lights": lights,
        "environment": environment(&scene.environment),
        "cameras": cameras,
        "notes": scene.notes,
        "warnings": scene.warnings,
    })
}

fn material(material: &Material) -> Value {
    let alpha = match material.alpha_mode {
        AlphaMode::Opaque => "opaque",
        AlphaMode::Mask { .. } => "mask",
        AlphaMode::Blend => "blend",
    };
    json!({
        "name": material.name,
        "bsdf": material.bsdf.name(),
        "lobes": material.lobes().into_iter().map(Lobe::name).collect::<Vec<_>>(),
        "textures": material.texture_uses(),
        "alpha": alpha,
    })
}

/// One line a material: its lobes, its textures, and alpha if it has a meaning.
fn print_materials(materials: &[Material]) {
    for (index, material) in materials.iter().enumerate().take(MATERIALS_SHOWN) {
        let lobes: Vec<_> = material.lobes().into_iter().map(Lobe::name).collect();
        let mut line = if lobes.is_empty() { String::from("black") } else { lobes.join(", ") };
        let textures = material.texture_uses();
        if !textures.is_empty() {
            line += &format!("; textures: {}", textures.join(", "));
        }
        match material.alpha_mode {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { cutoff } => line += &format!("; alpha mask at {cutoff}"),
            AlphaMode::Blend => line += "; alpha blend",
        }
        eprintln!("  material {index:<3} '{}': {line}", material.name);
    }
    if materials.len() > MATERIALS_SHOWN {
        eprintln!("               and {} more (--json lists them all)", materials.len() - MATERIALS_SHOWN);
    }
}

fn camera(index: usize, camera: &sunfleck::scene::Camera) -> Value {
    let projection = match camera.projection {
        Projection::Perspective { yfov_radians } => {
            json!({"kind": "perspective", "yfov_degrees": yfov_radians.to_degrees()})
        }
        Projection::Orthographic { ymag } => json!({"kind": "orthographic", "ymag": ymag}),
    };
    let position = camera.camera_to_world.translation.to_array();
    json!({"index": index, "name": camera.name, "projection": projection, "position": position})
}

fn light_kind(kind: PunctualKind) -> &'static str {
    match kind {
        PunctualKind::Point => "point",
        PunctualKind::Spot { .. } => "spot",
        PunctualKind::Directional => "directional",
    }
}

fn environment(environment: &Environment) -> Value {
    match environment {
        Environment::None => json!({"kind": "none"}),
        Environment::Constant(radiance) => json!({"kind": "constant", "radiance": radiance}),
        Environment::Image { name, width, height, strength, rotation_radians, .. } => json!({
            "kind": "image",
            "name": name,
            "width": width,
            "height": height,
            "strength": strength,
            "rotation_degrees": rotation_radians.to_degrees(),
        }),
    }
}

/// Names of the scene arrays, in their order.
const ARRAYS: [&str; 5] = ["slots", "attributes", "tables", "texels", "environment"];

fn describe_prepared(prepared: &Prepared) -> Value {
    let s = &prepared.statistics;
    let arrays: serde_json::Map<_, _> =
        ARRAYS.iter().zip(s.array_bytes).map(|(name, bytes)| ((*name).to_owned(), json!(bytes))).collect();
    json!({
        "triangles": s.triangles,
        "placed_triangles": s.placed_triangles,
        "instances": s.instances,
        "lights": s.lights,
        "light_choice": prepared.features.light_choice.name(),
        "light_bvh_nodes": s.light_nodes,
        "bvh": {
            "inner_nodes": s.inner_slots,
            "depth": s.depth,
            "sah_cost": s.sah_cost,
            "bytes": s.array_bytes[0],
            "build_seconds": s.bvh_seconds,
        },
        "gpu_bytes_per_triangle": bytes_per_triangle(prepared),
        "gpu_bytes": s.array_bytes.iter().sum::<u64>(),
        "gpu_bytes_by_array": arrays,
        "kept": prepared.features.kept(),
        "dropped": prepared.features.dropped(),
        "baked_on_cpu": baked_on_cpu(prepared),
    })
}

/// Slots and attributes over the triangles stored; null without any.
fn bytes_per_triangle(prepared: &Prepared) -> Option<f64> {
    let s = &prepared.statistics;
    (s.triangles > 0).then(|| (s.array_bytes[0] + s.array_bytes[1]) as f64 / s.triangles as f64)
}

/// What a software device has compiled into its kernel.
fn baked_on_cpu(prepared: &Prepared) -> BakeReport {
    Bake::choose(prepared, DeviceKind::Cpu, TraceBackend::Bvh, true).planned()
}

fn print_prepared(prepared: &Prepared) {
    let s = &prepared.statistics;
    let total = s.array_bytes.iter().sum::<u64>();
    eprintln!("  on the GPU   {total} bytes: {}", {
        let parts: Vec<_> = ARRAYS.iter().zip(s.array_bytes).map(|(name, bytes)| format!("{name} {bytes}")).collect();
        parts.join(", ")
    });
    eprintln!(
        "  BVH          {} triangles, {} shared instances; {} inner nodes, depth {}, SAH cost {:.1}, {:.3} s",
        s.triangles, s.instances, s.inner_slots, s.depth, s.sah_cost, s.bvh_seconds
    );
    if let Some(bytes) = bytes_per_triangle(prepared) {
        eprintln!("               {} bytes; with attributes {bytes:.1} a triangle", s.array_bytes[0]);
    }
    eprintln!(
        "  lights       {} sampled, picked by {}{}",
        s.lights,
        prepared.features.light_choice,
        if s.light_nodes > 0 { format!(" of {} nodes", s.light_nodes) } else { String::new() }
    );
    eprintln!("  kernel needs {}", prepared.features.kept().join(", "));
    eprintln!("  left out     {}", prepared.features.dropped().join(", "));
    eprintln!("  compiled in  {}, on CPU devices", baked_on_cpu(prepared));
}

fn print_for_people(scene: &Scene) {
    let counts = Counts::of(scene);
    let by_bsdf: Vec<_> = counts.materials_by_bsdf.iter().map(|(name, count)| format!("{count} {name}")).collect();
    eprintln!("{}", scene.name);
    eprintln!(
        "  meshes       {} of {} primitives, {} triangles, {} vertices",
        scene.meshes.len(),
        counts.primitives,
        counts.triangles,
        counts.vertices
    );
    eprintln!("  instances    {}, {} triangles", scene.instances.len(), counts.instanced_triangles);
    eprintln!("  materials    {} ({})", scene.materials.len(), by_bsdf.join(", "));
    print_materials(&scene.materials);
    let megabytes = counts.image_bytes as f64 / 1e6;
    eprintln!("  textures     {} of {} images, {megabytes:.1} MB decoded", scene.textures.len(), scene.images.len());
    let count = |wanted: &str| scene.lights.iter().filter(|l| light_kind(l.kind) == wanted).count();
    let [point, spot, directional] = ["point", "spot", "directional"].map(count);
    let emissive = counts.emissive_triangles;
    eprintln!("  lights       {emissive} emissive triangles, {point} point, {spot} spot, {directional} directional");
    match &scene.environment {
        Environment::None => eprintln!("  environment  none"),
        Environment::Constant([r, g, b]) => eprintln!("  environment  constant radiance {r} {g} {b}"),
        Environment::Image { name, width, height, .. } => eprintln!("  environment  {name}, {width}x{height}"),
    }
    for (index, camera) in scene.cameras.iter().enumerate() {
        let kind = match camera.projection {
            Projection::Perspective { yfov_radians } => format!("perspective, {:.4}° high", yfov_radians.to_degrees()),
            Projection::Orthographic { ymag } => format!("orthographic, {} m high", 2.0 * ymag),
        };
        eprintln!("  camera {index}     '{}': {kind}", camera.name);
    }
    scene.notes.iter().for_each(|note| eprintln!("note: {note}"));
    print_warnings(&scene.warnings);
}
