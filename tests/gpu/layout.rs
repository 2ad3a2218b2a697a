//! src/layout/ and shaders/include/layout.glsl are the same: blocks by reflection of the SPIR-V, records of the scene
//! arrays by a kernel that decodes them, constants by the texts.

use std::any::type_name_of_val;
use std::collections::BTreeMap;
use std::mem::offset_of;
use std::path::Path;

use crate::common::gpu;
use crate::common::kernel::{Random, TestKernel, floats};
use spirq::ReflectConfig;
use spirq::ty::{StructType, Type};
use spirq::var::Variable;
use sunfleck::gpu::shader_compiler;
use sunfleck::layout::{self, AovSums, Atom, BlockResult, RayCounters, RenderConstants, SliceConstants};

/// Name, offset and type of a field as GLSL has it: an array on the Rust side is one field an element on the other.
type Field = (String, usize, String);

/// The fields of a Rust struct, in order.
macro_rules! rust_fields {
    ($type:ty: $($field:ident),* $(,)?) => {{
        let value: $type = bytemuck::Zeroable::zeroed();
        vec![$((stringify!($field).to_owned(), offset_of!($type, $field), rust_type(&value.$field))),*]
    }};
}

fn rust_type<T>(value: &T) -> String {
    match type_name_of_val(value) {
        "[f32; 3]" => "vec3<f32>".to_owned(),
        "[u32; 3]" => "vec3<u32>".to_owned(),
        name => name.to_owned(),
    }
}

fn shader_fields(block: &StructType) -> Vec<Field> {
    let member = |m: &spirq::ty::StructMember| {
        (m.name.clone().unwrap_or_default(), m.offset.expect("laid out"), format!("{}", m.ty))
    };
    block.members.iter().map(member).collect()
}

/// Splits the named field into scalars with the given suffixes.
fn split(fields: &mut Vec<Field>, name: &str, suffixes: &[&str], scalar: &str) {
    let at = fields.iter().position(|f| f.0 == name).expect("the field exists");
    let offset = fields[at].1;
    let parts =
        suffixes.iter().zip(0..).map(|(s, i): (_, usize)| (format!("{name}{s}"), offset + 4 * i, scalar.into()));
    fields.splice(at..=at, parts);
}

struct Blocks {
    constants: StructType,
    slice: StructType,
    atoms: (StructType, usize),
    results: (StructType, usize),
    aovs: (StructType, usize),
    counters: (StructType, usize),
    lane_stride: usize,
}

fn array_of_structs(block: &Type) -> (StructType, usize) {
    let Type::Struct(outer) = block else { panic!("no block: {block}") };
    let Type::Array(array) = &outer.members[0].ty else { panic!("no array in {block}") };
    let Type::Struct(element) = &*array.element_ty else { panic!("no struct in {block}") };
    (element.clone(), array.stride.expect("laid out"))
}

/// spirq knows few operations on specialisation constants, and no block depends on one: those with a boolean result
/// (OpSpecConstantOp) become OpConstantTrue.
fn without_boolean_constants(spirv: &[u32]) -> Vec<u32> {
    const TYPE_BOOL: u32 = 20;
    const CONSTANT_TRUE: u32 = 41;
    const SPEC_CONSTANT_OP: u32 = 52;
    let mut words = spirv[..5].to_vec();
    let mut rest = &spirv[5..];
    let mut boolean = None;
    while let Some(&first) = rest.first() {
        let (instruction, others) = rest.split_at((first >> 16) as usize);
        match first & 0xffff {
            TYPE_BOOL => boolean = Some(instruction[1]),
            SPEC_CONSTANT_OP if Some(instruction[1]) == boolean => {
                words.extend([3 << 16 | CONSTANT_TRUE, instruction[1], instruction[2]]);
                rest = others;
                continue;
            }
            _ => {}
        }
        words.extend_from_slice(instruction);
        rest = others;
    }
    words
}

/// Reflects the blocks of the path-tracing kernel, compiled without optimisation so that all members keep their names.
fn reflect() -> Blocks {
    let defines = [("TRACE_BACKEND", "0".to_owned()), ("ARRAY_FORM", "0".to_owned())];
    let spirv = shader_compiler::compile(gpu::sources(), "path_trace.comp", &defines).expect("it compiles");
    let entries = ReflectConfig::new()
        .spv(without_boolean_constants(&spirv))
        .ref_all_rscs(true)
        .reflect()
        .expect("the SPIR-V is readable");
    let vars = &entries.first().expect("an entry point").vars;
    let binding = |number: u32| {
        let found = vars.iter().find_map(|var| match var {
            Variable::Descriptor { desc_bind, ty, .. } if desc_bind.bind() == number => Some(ty),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("binding {number} is there"))
    };
    let push = vars.iter().find_map(|var| match var {
        Variable::PushConstant { ty, .. } => Some(ty),
        _ => None,
    });
    let only_member = |ty: &Type| {
        let Type::Struct(outer) = ty else { panic!("no block: {ty}") };
        let Type::Struct(inner) = &outer.members[0].ty else { panic!("no struct in {ty}") };
        inner.clone()
    };
    Blocks {
        constants: only_member(binding(0)),
        results: array_of_structs(binding(1)),
        aovs: array_of_structs(binding(5)),
        counters: array_of_structs(binding(6)),
        lane_stride: array_of_structs(binding(2)).1,
        slice: only_member(push.expect("push constants")),
        atoms: array_of_structs(binding(9)),
    }
}

fn render_constants_fields() -> Vec<Field> {
    rust_fields!(RenderConstants: camera_origin, lens_radius, camera_right, focus_distance, camera_up, projection,
        camera_forward, vertex_texels, width, height, seed, max_bounces, light_bvh, light_bvh_counts, vertices, root_slot,
        materials, textures, lights, instances, light_cdf_word, light_count, environment_light, environment_width,
        environment_height, environment_marginal_word, environment_conditional_word, ggx_albedo, environment_radiance,
        environment_cos, scene_center, environment_sin, near_lights, clamp_indirect,
        zero, environment_rgbe, rest_root_slot, emission_rays, unused_0, unused_1)
}

#[test]
fn blocks_have_the_same_offsets_on_both_sides() {
    let blocks = reflect();
    assert_eq!(shader_fields(&blocks.constants), render_constants_fields());
    assert_eq!(Type::Struct(blocks.constants).nbyte(), Some(size_of::<RenderConstants>()));

    let slice = rust_fields!(SliceConstants: lanes, atoms, most_samples, ray_budget, resume, prints);
    assert_eq!(shader_fields(&blocks.slice), slice);
    assert_eq!(Type::Struct(blocks.slice).nbyte(), Some(size_of::<SliceConstants>()));

    assert_eq!(shader_fields(&blocks.atoms.0), rust_fields!(Atom: pixel, first_sample, end_sample));
    assert_eq!(blocks.atoms.1, size_of::<Atom>(), "stride of the atoms");

    let mut result = rust_fields!(BlockResult: sum, luminance_squared, compensation, rays_and_samples,
        non_finite_and_capped);
    split(&mut result, "sum", &["_r", "_g", "_b"], "f32");
    split(&mut result, "compensation", &["_r", "_g", "_b"], "f32");
    assert_eq!(shader_fields(&blocks.results.0), result);
    assert_eq!(blocks.results.1, size_of::<BlockResult>(), "stride of the results");
    assert_eq!(blocks.lane_stride, layout::LANE_STATE_BYTES, "stride of the lane states");

    let aovs = rust_fields!(AovSums: albedo, hits, normal, depth, position, visits);
    assert_eq!(shader_fields(&blocks.aovs.0), aovs);
    assert_eq!(blocks.aovs.1, size_of::<AovSums>(), "stride of the AOVs");

    let mut counters = rust_fields!(RayCounters: rays, search_steps, nodes, search_vectors, triangles, shading_vectors,
        vector_width, shadings, unused);
    split(&mut counters, "unused", &["_0", "_1"], "u32");
    assert_eq!(shader_fields(&blocks.counters.0), counters);
    assert_eq!(blocks.counters.1, size_of::<RayCounters>(), "stride of the counters");
}

/// The comparison sees a field that moves.
#[test]
fn a_moved_field_is_noticed() {
    let mut fields = render_constants_fields();
    fields.swap(4, 6);
    assert_ne!(shader_fields(&reflect().constants), fields);
}

/// `name = value` of all lines that start with `prefix`, as text.
fn parse_constants(text: &str, prefix: &str) -> BTreeMap<String, String> {
    let lines = text.lines().filter_map(|line| line.strip_prefix(prefix)?.split_once('='));
    let name = |name: &str| name.trim().trim_end_matches(": u32").to_owned();
    lines.map(|(left, right)| (name(left), right.trim().trim_end_matches(';').to_owned())).collect()
}

/// A number, or `1 << n`, `(1 << n) - 1` or `u32::MAX`.
fn value(text: &str) -> u32 {
    if text == "u32::MAX" {
        return u32::MAX;
    }
    if let Some(mask) = text.strip_prefix('(').and_then(|t| t.strip_suffix(") - 1")) {
        return value(mask) - 1;
    }
    if let Some(shift) = text.strip_prefix("1 << ") {
        return 1 << value(shift);
    }
    let digits = text.trim_end_matches('u');
    let parsed = match digits.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    parsed.unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// All files of src/layout/, one behind another.
fn rust_text() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/layout");
    let files = std::fs::read_dir(folder).expect("src/layout").map(|entry| entry.expect("an entry").path());
    files.map(|file| std::fs::read_to_string(file).expect("a file of src/layout")).collect()
}

#[test]
fn constants_have_the_same_values_on_both_sides() {
    let rust = parse_constants(&rust_text(), "pub const ");
    let rust: BTreeMap<_, _> =
        rust.iter().filter(|(name, _)| !name.contains(':')).map(|(n, v)| (n, value(v))).collect();
    let shader = parse_constants(&gpu::sources()["include/layout.glsl"], "const uint ");
    let shader: BTreeMap<_, _> = shader.iter().map(|(n, v)| (n, value(v))).collect();
    assert!(rust.len() > 30, "the constants are found: {rust:?}");
    assert_eq!(rust, shader);
    // The parser reads what the compiler does.
    assert_eq!(rust[&"TRIANGLE_INDEX_MASK".to_owned()], layout::TRIANGLE_INDEX_MASK);
    assert_eq!(rust[&"MATERIAL_SCHLICK".to_owned()], layout::MATERIAL_SCHLICK);
    assert_eq!(rust[&"NONE".to_owned()], layout::NONE);
}

const RECORDS: usize = 5;

/// Random words that are normal floats too, so that no driver may change them on the way.
fn random_records<T: bytemuck::Pod>(random: &mut Random) -> Vec<T> {
    let word = |random: &mut Random| (random.between(1.0, 2.0) as f32).to_bits();
    let words: Vec<u32> = (0..RECORDS * size_of::<T>() / 4).map(|_| word(random)).collect();
    bytemuck::pod_collect_to_vec(&words)
}

/// Rust records packed as `prepare` does, and the same decoded by the shader.
#[test]
fn records_survive_the_way_to_the_shader() {
    let mut random = Random(1);
    let mut kernel = TestKernel::new("records.comp");
    let materials: Vec<layout::Material> = random_records(&mut random);
    let lights: Vec<layout::Light> = random_records(&mut random);
    let mut headers: Vec<layout::TextureHeader> = random_records(&mut random);
    headers.iter_mut().for_each(|header| header.sampling |= layout::TEXTURE_TRANSFORMED | layout::TEXTURE_MIPS);
    let instances: Vec<layout::InstanceRecord> = random_records(&mut random);
    let leaves: Vec<layout::LeafSlot> = random_records(&mut random);
    let vertices: Vec<layout::Vertex> = random_records(&mut random);
    let texels: Vec<[u32; 4]> = random_records(&mut random);
    let triangle =
        |i: u32| layout::Triangle { vertices: [RECORDS as u32 - 1 - i; 3], kind: layout::TRIANGLE_ATTRIBUTES | i };
    let triangles: Vec<layout::Triangle> = (0..RECORDS as u32).map(triangle).collect();

    let constants = &mut kernel.constants;
    let [slots, attributes, tables, image, environment] = &mut kernel.prepared.arrays;
    *slots = bytemuck::cast_slice(&leaves).to_vec();
    *attributes = bytemuck::cast_slice(&triangles).to_vec();
    constants.vertices = attributes.len() as u32;
    attributes.extend_from_slice(bytemuck::cast_slice(&vertices));
    constants.vertex_texels = (size_of::<layout::Vertex>() / 16) as u32;
    tables.clear();
    let mut append = |texels: &[[u32; 4]]| {
        let first = tables.len() as u32;
        tables.extend_from_slice(texels);
        first
    };
    constants.materials = append(bytemuck::cast_slice(&materials));
    constants.textures = append(bytemuck::cast_slice(&headers));
    constants.lights = append(bytemuck::cast_slice(&lights));
    constants.instances = append(bytemuck::cast_slice(&instances));
    *image = texels.clone();
    *environment = texels.iter().rev().copied().collect();

    let outputs = kernel.run(&[[0; 4]], RECORDS, 32);
    for (i, output) in outputs.chunks_exact(32).enumerate() {
        assert_eq!(&output[..8], bytemuck::cast_slice::<_, [u32; 4]>(&[materials[i]]), "material");
        let light = layout::Light { trail: 0, ..lights[i] };
        assert_eq!(&output[8..12], bytemuck::cast_slice::<_, [u32; 4]>(&[light]), "light");
        let header = layout::TextureHeader { unused: 0, ..headers[i] };
        assert_eq!(&output[12..15], bytemuck::cast_slice::<_, [u32; 4]>(&[header]), "texture header");
        assert_eq!(&output[15..22], bytemuck::cast_slice::<_, [u32; 4]>(&[instances[i]]), "instance");
        assert_eq!(output[22..25], decoded_leaf(&leaves[i]), "leaf slot");
        check_vertex(&vertices[RECORDS - 1 - i], &output[25..29]);
        assert_eq!(output[25][3], triangles[i].kind, "kind");
        assert_eq!(output[29], texels[i], "words");
        assert_eq!(output[30], texels[i], "texels");
        assert_eq!(output[31], texels[RECORDS - 1 - i], "environment");
    }
}

/// Three vertices, and the coordinates of the fourth.
fn decoded_leaf(leaf: &layout::LeafSlot) -> [[u32; 4]; 3] {
    let [a, b, c, d] = leaf.vertices.map(|vertex| vertex.map(f32::to_bits));
    [(a, d[0]), (b, d[1]), (c, d[2])].map(|([x, y, z], word)| [x, y, z, word])
}

fn check_vertex(vertex: &layout::Vertex, decoded: &[[u32; 4]]) {
    let [normal, texcoords, tangent, color] = [0, 1, 2, 3].map(|i| floats(decoded[i]));
    for (name, stored, [x, y, z, _]) in [("normal", vertex.normal, normal), ("tangent", vertex.tangent, tangent)] {
        let unit = glam::Vec3::from(stored).normalize();
        assert!((glam::Vec3::new(x, y, z) - unit).length() < 1e-6, "{name} {unit} became {x} {y} {z}");
    }
    assert_eq!(texcoords, [vertex.u, vertex.v, vertex.u_1, vertex.v_1], "texture coordinates");
    assert_eq!(tangent[3], vertex.bitangent_sign, "sign of the bitangent");
    assert_eq!(color, vertex.color, "colour");
}
