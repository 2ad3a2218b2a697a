//! What vertices carry, through the shader's own functions against f64: interpolation, placement, vertex colours times
//! factor times texture.

use crate::common::kernel::{Random, TestKernel, empty_scene, floats};
use glam::{DAffine3, DMat3, DVec3, DVec4, Vec3};
use sunfleck::layout::NONE;
use sunfleck::prepare::{Prepared, srgb_to_linear};
use sunfleck::scene::{
    Bsdf, Filter, Image, Instance, Material, Mesh, Primitive, Scene, Texels, Texture, TextureBinding, Wrap,
};

/// A triangle with everything that a vertex can carry, made at random.
fn triangle(random: &mut Random) -> Primitive {
    let mut unit = || -> Vec3 { random.direction().as_vec3() };
    let normals = vec![[0.0, 0.0, 1.0], (unit() * 0.3 + Vec3::Z).normalize().into(), [0.6, 0.0, 0.8]];
    let tangents = [unit(), unit(), unit()].map(|t| [t.x, t.y, t.z, -1.0]).to_vec();
    let mut number = || random.unit() as f32;
    Primitive {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        normals: Some(normals),
        texcoords: Some((0..3).map(|_| [number(), number()]).collect()),
        texcoords_1: Some((0..3).map(|_| [number(), number()]).collect()),
        tangents: Some(tangents),
        colors: Some((0..3).map(|_| [number(), number(), number(), number()]).collect()),
        triangles: vec![[0, 1, 2]],
        material: 0,
    }
}

/// The triangle placed by each transform, with a base colour texture of one texel on set 1 and a normal map on set 0.
fn placed(primitive: Primitive, transforms: &[DMat3]) -> Scene {
    let mut scene =
        Scene { meshes: vec![Mesh { name: String::from("mesh"), primitives: vec![primitive] }], ..empty_scene() };
    let texels = Texels::Rgba16(vec![[6554, 13107, 65535, 32768]]);
    scene.images.push(Image { name: String::from("texel"), width: 1, height: 1, texels }.into());
    let wrap = Wrap::Repeat;
    scene.textures.push(Texture { image: 0, wrap_u: wrap, wrap_v: wrap, filter: Filter::Nearest });
    scene.materials.push(Material {
        bsdf: Bsdf::MetallicRoughness,
        base_color: [0.5, 0.75, 1.0],
        alpha: 0.5,
        metallic_roughness_texture: Some(TextureBinding { set: 1, ..TextureBinding::new(0) }),
        base_color_texture: Some(TextureBinding { set: 1, ..TextureBinding::new(0) }),
        normal_texture: Some(TextureBinding::new(0)),
        ..Material::default()
    });
    scene.instances = transforms
        .iter()
        .map(|&matrix| Instance {
            mesh: 0,
            object_to_world: DAffine3::from_mat3_translation(matrix, DVec3::new(0.0, 0.0, -3.0)),
            name: String::from("instance"),
        })
        .collect();
    scene
}

fn mix<const N: usize>(values: &[[f32; N]], weights: DVec3) -> [f64; N] {
    std::array::from_fn(|k| (0..3).map(|i| f64::from(values[i][k]) * weights[i]).sum())
}

fn near(what: &str, got: &[f64], expected: &[f64]) {
    let off = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 2e-6, "{what}: {got:?} instead of {expected:?}");
}

/// One call of the kernel at many points against the same in f64.
fn check(kernel: &TestKernel, slot: u32, instance: u32, primitive: &Primitive, matrix: &DMat3, points: &[DVec3]) {
    // Baked into a mirror, the second and the third corner have changed places.
    let turned = matrix.determinant() < 0.0 && instance == NONE;
    let input = |weights: &DVec3| {
        let (second, third) = if turned { (weights.z, weights.y) } else { (weights.y, weights.z) };
        [slot, instance, (second as f32).to_bits(), (third as f32).to_bits()]
    };
    let inputs: Vec<[u32; 4]> = points.iter().map(input).collect();
    let outputs: Vec<[f64; 4]> =
        kernel.run(&inputs, points.len(), 5).into_iter().map(|t| floats(t).map(f64::from)).collect();
    for (output, &weights) in outputs.chunks_exact(5).zip(points) {
        check_point(output, primitive, matrix, weights, instance != NONE);
    }
}

fn check_point(output: &[[f64; 4]], primitive: &Primitive, matrix: &DMat3, weights: DVec3, placed: bool) {
    let all = |values: &Option<Vec<[f32; 3]>>| DVec3::from(mix(values.as_ref().expect("they are there"), weights));
    let normal = (matrix.inverse().transpose() * all(&primitive.normals)).normalize();
    near("normal", &output[0][..3], &normal.to_array());
    let [u, v] = mix(primitive.texcoords.as_ref().expect("set 0"), weights);
    let [u_1, v_1] = mix(primitive.texcoords_1.as_ref().expect("set 1"), weights);
    near("texture coordinates", &output[1], &[u, v, u_1, v_1]);
    let [x, y, z, sign] = mix(primitive.tangents.as_ref().expect("tangents"), weights);
    let tangent = *matrix * DVec3::new(x, y, z);
    // Baked tangents are stored at unit length: between the corners they are averaged after the transform, not before.
    if placed || weights.max_element() == 1.0 {
        near("tangent", &output[2][..3], &tangent.normalize().to_array());
    }
    near("sign of the bitangent", &output[2][3..], &[sign * matrix.determinant().signum()]);
    let color = mix(primitive.colors.as_ref().expect("colours"), weights);
    near("colour", &output[3], &color);
    // The colour is sRGB, alpha is not.
    let texel = DVec3::new(6554.0, 13107.0, 65535.0) / 65535.0;
    let texel = DVec3::from(texel.to_array().map(srgb_to_linear)).extend(32768.0 / 65535.0);
    near("base colour", &output[4], &(DVec4::new(0.5, 0.75, 1.0, 0.5) * DVec4::from(color) * texel).to_array());
}

fn random_weights(random: &mut Random) -> DVec3 {
    let (a, b) = (random.unit(), random.unit());
    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
    // As the shader sees them: rounded to f32.
    let (b, c) = (f64::from(a as f32), f64::from(b as f32));
    DVec3::new(1.0 - b - c, b, c)
}

fn transforms() -> [DMat3; 2] {
    let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
    [turn * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 0.5)), turn * DMat3::from_diagonal(DVec3::new(-1.5, 1.0, 0.7))]
}

fn only_slot(prepared: &Prepared, mesh: usize) -> u32 {
    prepared.triangle_slots(&prepared.meshes[mesh]).next().expect("a triangle")
}

/// Two instances of one mesh, one of them mirrored, in object space.
#[test]
fn attributes_go_with_their_instance() {
    let mut random = Random(51);
    let primitive = triangle(&mut random);
    let kernel = TestKernel::with_scene("attributes.comp", &placed(primitive.clone(), &transforms()));
    assert_eq!((kernel.prepared.instances.len(), kernel.constants.vertex_texels), (2, 4));
    let slot = only_slot(&kernel.prepared, 1);
    for (index, instance) in kernel.prepared.instances.iter().enumerate() {
        let points: Vec<DVec3> = (0..64).map(|_| random_weights(&mut random)).collect();
        check(&kernel, slot, index as u32, &primitive, &transforms()[instance.source], &points);
    }
}

/// The same, baked into the world.
#[test]
fn attributes_are_baked() {
    let mut random = Random(52);
    for matrix in transforms() {
        let primitive = triangle(&mut random);
        let kernel = TestKernel::with_scene("attributes.comp", &placed(primitive.clone(), &[matrix]));
        let slot = only_slot(&kernel.prepared, 0);
        // At the corners, where the lengths of baked normals do not matter.
        check(&kernel, slot, NONE, &primitive, &matrix, &[DVec3::X, DVec3::Y, DVec3::Z]);
    }
}

/// A vertex takes no more texels than the scene needs.
#[test]
fn vertices_are_as_small_as_they_can_be() {
    let full = placed(triangle(&mut Random(53)), &[DMat3::IDENTITY]);
    let texels = |edit: &dyn Fn(&mut Primitive, &mut Material)| {
        let mut scene = full.clone();
        edit(&mut scene.meshes[0].primitives[0], &mut scene.materials[0]);
        TestKernel::with_scene("attributes.comp", &scene).constants.vertex_texels
    };
    let plain = |material: &mut Material| {
        material.base_color_texture = None;
        material.metallic_roughness_texture = None;
        material.normal_texture = None;
    };
    assert_eq!(texels(&|_, _| {}), 4);
    assert_eq!(texels(&|primitive, _| primitive.colors = None), 3);
    assert_eq!(texels(&|_, material| material.normal_texture = None), 3);
    assert_eq!(texels(&|_, material| plain(material)), 2);
    let bare = |primitive: &mut Primitive, material: &mut Material| {
        primitive.colors = None;
        plain(material);
    };
    assert_eq!(texels(&bare), 1);
}
