//! Placement: rebasing, baking, mirrored and singular transforms, attributes, the camera.

use crate::prepare_support::*;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use sunfleck::layout::*;
use sunfleck::prepare::{PrepareError, PrepareOptions, Prepared, PreparedTriangle, camera_constants, prepare};
use sunfleck::scene::{
    Bsdf, Camera, Filter, Image, Material, Projection, Scene, Texels, Texture, TextureBinding, Wrap,
};

const UNIT: TriangleVertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn triangles(prepared: &Prepared, mesh: usize) -> Vec<PreparedTriangle> {
    prepared.triangle_slots(&prepared.meshes[mesh]).map(|number| prepared.triangle(number)).collect()
}

fn geometric_normal(leaf: &PreparedTriangle) -> DVec3 {
    let [a, b, c] = leaf.vertices.map(|v| Vec3::from(v).as_dvec3());
    (b - a).cross(c - a).normalize()
}

fn vertex(prepared: &Prepared, index: u32) -> Vertex {
    let stride = prepared.constants.vertex_texels;
    let first = (prepared.constants.vertices + stride * index) as usize;
    // Normals and texture coordinates; what a vertex is stored without stays zero.
    let mut texels = [[0; 4]; 4];
    let stored = stride.min(2) as usize;
    texels[..stored].copy_from_slice(&prepared.arrays[SceneArray::Attributes as usize][first..first + stored]);
    bytemuck::cast(texels)
}

/// A triangle with the normals of its plane.
fn smooth_scene(transforms: &[DAffine3]) -> Scene {
    let mut scene = scene_of(&[UNIT], transforms);
    scene.meshes[0].primitives[0].normals = Some(vec![[0.0, 0.0, 1.0]; 3]);
    scene
}

#[test]
fn a_scene_far_away_keeps_its_detail() {
    let far = DVec3::new(1e9, -2e9, 3e9);
    let scene = scene_of(&[UNIT], &[DAffine3::from_translation(far)]);
    for camera in [far + DVec3::new(0.3, 0.2, 5.0), DVec3::ZERO, far + DVec3::new(0.5, 0.5, 0.0)] {
        let prepared = prepare(&scene, &PrepareOptions { camera, ..PrepareOptions::default() }).unwrap();
        let origin = prepared.origin;
        assert!((origin - far).abs().max_element() <= 1.0, "the origin is in the scene's bounds");
        for (vertex, expected) in triangles(&prepared, 0)[0].vertices.iter().zip(UNIT) {
            let world = Vec3::from(*vertex).as_dvec3() + origin - far;
            assert!((world - Vec3::from(expected).as_dvec3()).length() < 1e-6);
        }
    }
}

#[test]
fn inside_the_scene_the_origin_is_the_camera() {
    let scene = scene_of(&[UNIT, UNIT.map(|[x, y, z]| [x, y, z + 1e6])], &[DAffine3::IDENTITY]);
    let camera = DVec3::new(0.25, 0.25, 999_999.0);
    let prepared = prepare(&scene, &PrepareOptions { camera, ..PrepareOptions::default() }).unwrap();
    assert_eq!(prepared.origin, camera);
}

#[test]
fn coordinates_beyond_the_limit_are_refused_by_name() {
    let mut scene = scene_of(&[UNIT], &[DAffine3::from_scale(DVec3::splat(1e30))]);
    let error = prepare(&scene, &PrepareOptions::default()).unwrap_err();
    assert!(matches!(&error, PrepareError::TooFar { name, .. } if name == "node"), "{error}");
    scene.instances[0].object_to_world = DAffine3::from_scale(DVec3::splat(1e300));
    scene.meshes[0].primitives[0].positions[1] = [1e38; 3];
    assert!(matches!(prepare(&scene, &PrepareOptions::default()), Err(PrepareError::TooFar { .. })));
}

#[test]
fn a_mirrored_mesh_keeps_its_front_and_its_normals() {
    let transform = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 1.0));
    let baked = prepared(&smooth_scene(&[transform]));
    let leaf = triangles(&baked, 0)[0];
    // The front of the unit triangle is +Z, and mirroring in X leaves that side where it is.
    assert_eq!(geometric_normal(&leaf), DVec3::Z);
    let record = leaf.record;
    assert_eq!(record.kind, TRIANGLE_NORMALS);
    for index in record.vertices {
        assert_eq!(vertex(&baked, index).normal, [0.0, 0.0, 1.0]);
    }
    let kept = prepared(&smooth_scene(&[transform, DAffine3::from_translation(DVec3::Z)]));
    assert_eq!(kept.instances.iter().map(|i| i.record.mirrored).collect::<Vec<_>>(), [1, 0]);
    assert_eq!(geometric_normal(&triangles(&kept, 1)[0]), DVec3::Z);
}

/// The angle by which rounding its vertices to f32 can tilt the unit triangle under a transform: displacements of d turn
/// a plane by 3 d over the least height h of the triangle at most (Σ d |∇λ| over the barycentric λ, with |∇λ| ≤ 1/h), and
/// h by 2 d.
fn rounding_tilt(transform: &DAffine3) -> f64 {
    let corners = UNIT.map(|v| transform.transform_point3(Vec3::from(v).as_dvec3()));
    let largest = corners.iter().map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
    let displacement = 3f64.sqrt() * largest * 0.5 * f64::from(f32::EPSILON);
    let [a, b, c] = corners;
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let height = (b - a).cross(c - a).length() / longest;
    if height > 2.0 * displacement {
        (3.0 * displacement / (height - 2.0 * displacement)).atan()
    } else {
        std::f64::consts::PI
    }
}

#[test]
fn normals_stay_perpendicular_under_any_invertible_transform() {
    let mut random = Random(5);
    for _ in 0..200 {
        let scale = DVec3::new(10f64.powf(random.between(-1.0, 1.0) * 6.0), 0.01 + random.unit(), -random.unit() - 0.1);
        let mut transform = random_transform(&mut random, scale, 3.0);
        transform.matrix3 *= DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(0.2, -0.4, 1.0));
        let prepared = prepared(&smooth_scene(&[transform]));
        let leaf = triangles(&prepared, 0)[0];
        let record = leaf.record;
        assert_eq!(record.kind, TRIANGLE_NORMALS);
        let exact = transform.matrix3.inverse().transpose() * DVec3::Z;
        let normal = DVec3::from(vertex(&prepared, record.vertices[0]).normal.map(f64::from));
        assert!(normal.dot(exact.normalize()) > 1.0 - 1e-6, "{normal} {exact}");
        assert!((normal.length() - 1.0).abs() < 1e-6);
        let angle = normal.angle_between(geometric_normal(&leaf));
        assert!(angle < rounding_tilt(&transform) + 1e-6, "{angle} {transform:?}");
    }
}

#[test]
fn singular_transforms_are_baked_and_flat() {
    let flattened = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
    let prepared = prepared(&smooth_scene(&[flattened, flattened, DAffine3::IDENTITY]));
    assert_eq!(prepared.instances.len(), 0, "one invertible use is no reason for an instance");
    let flags: Vec<u32> = triangles(&prepared, 0).iter().map(|leaf| leaf.record.kind).collect();
    assert_eq!(flags.iter().filter(|&&f| f == TRIANGLE_NORMALS).count(), 1);
    assert_eq!(flags.len(), 3);
}

#[test]
fn badly_conditioned_transforms_are_baked() {
    for (scale, instances) in [(1.0, 2), (100.0, 2), (1e-2, 2), (1e4, 0), (1e-6, 0)] {
        let transform = DAffine3::from_scale(DVec3::new(1.0, scale, 1.0));
        assert_eq!(prepared(&scene_of(&[UNIT], &[transform; 2])).instances.len(), instances, "{scale}");
    }
    // A uniform scale is never bad.
    let tiny = DAffine3::from_scale(DVec3::splat(1e-9));
    assert_eq!(prepared(&scene_of(&[UNIT], &[tiny; 2])).instances.len(), 2);
}

#[test]
fn a_shared_mesh_far_off_its_own_zero_is_recentred() {
    let sources = random_triangles(&mut Random(3), 20, 1.0, 0.3).into_iter();
    let sources: Vec<TriangleVertices> = sources.map(|t| t.map(|[x, y, z]| [x + 4096.0, y, z])).collect();
    let back = DAffine3::from_rotation_translation(DQuat::from_rotation_y(1.0), DVec3::new(0.0, 3.0, 0.0))
        * DAffine3::from_translation(DVec3::NEG_X * 4096.0);
    let transforms = [back, DAffine3::from_translation(DVec3::Y * 5.0) * back];
    let prepared = prepared(&scene_of(&sources, &transforms));
    let rows = prepared.instances[0].record.object_to_world;
    let world = |v: [f32; 3]| {
        DVec3::from(rows.map(|r| (0..3).map(|k| f64::from(r[k]) * f64::from(v[k])).sum::<f64>() + f64::from(r[3])))
    };
    let exact = |v: [f32; 3]| back.transform_point3(Vec3::from(v).as_dvec3()) - prepared.origin;
    let kept = triangles(&prepared, 1);
    assert_eq!(kept.len(), sources.len());
    for triangle in kept {
        assert!(triangle.vertices.as_flattened().iter().all(|x| x.abs() < 4.0));
        let is_source = |source: &TriangleVertices| {
            source.iter().zip(triangle.vertices).all(|(&s, v)| (world(v) - exact(s)).length() < 1e-5)
        };
        assert_eq!(sources.iter().filter(|source| is_source(source)).count(), 1);
    }
}

#[test]
fn attributes_are_kept_only_where_used() {
    let mut scene = smooth_scene(&[DAffine3::IDENTITY]);
    scene.meshes[0].primitives[0].texcoords = Some(vec![[0.25, 0.5]; 3]);
    let untextured = prepared(&scene);
    assert_eq!(triangles(&untextured, 0)[0].record.kind, TRIANGLE_NORMALS);
    let texels = Texels::Rgba16(vec![[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12]]);
    scene.images.push(Image { name: String::new(), width: 3, height: 1, texels }.into());
    scene.textures.push(Texture {
        image: 0,
        wrap_u: Wrap::MirroredRepeat,
        wrap_v: Wrap::ClampToEdge,
        filter: Filter::Nearest,
    });
    let binding = Some(TextureBinding::new(0));
    scene.materials[0] =
        Material { base_color_texture: binding, metallic_roughness_texture: binding, ..Material::default() };
    let textured = prepared(&scene);
    assert_eq!(triangles(&textured, 0)[0].record.kind, TRIANGLE_NORMALS | TRIANGLE_TEXCOORDS);
    assert_eq!((vertex(&textured, 0).u, vertex(&textured, 2).v), (0.25, 0.5));
    // One image, two headers: colours are sRGB, roughness is not.
    let tables = &textured.arrays[SceneArray::Tables as usize];
    let first = textured.constants.textures as usize;
    let end = first + 2 * TEXTURE_TEXELS as usize;
    let headers: Vec<TextureHeader> = bytemuck::pod_collect_to_vec(&tables[first..end]);
    let common = TEXTURE_16_BIT | TEXTURE_NEAREST | 1 << TEXTURE_WRAP_U_SHIFT | 2 << TEXTURE_WRAP_V_SHIFT;
    assert_eq!((headers[0].sampling, headers[1].sampling), (common | TEXTURE_SRGB, common));
    assert_eq!((headers[0].first_word, headers[1].first_word), (0, 0));
    assert_eq!(
        textured.arrays[SceneArray::Texels as usize],
        [[0x2_0001, 0x4_0003, 0x6_0005, 0x8_0007], [0xa_0009, 0xc_000b, 0, 0]]
    );
    // Lambertian surfaces have no roughness to look up.
    scene.materials[0].bsdf = Bsdf::Lambertian;
    scene.materials[0].base_color_texture = None;
    assert!(!prepared(&scene).features.textures);
}

#[test]
fn unused_materials_are_left_out_and_features_are_listed() {
    let mut scene = scene_of(&[UNIT], &[DAffine3::IDENTITY]);
    scene.materials.insert(0, Material { bsdf: Bsdf::Glass, ..Material::default() });
    scene.meshes[0].primitives[0].material = 1;
    let prepared = prepared(&scene);
    assert_eq!(prepared.features.bsdfs, 1 << BSDF_LAMBERTIAN);
    assert_eq!(prepared.features.kept(), ["lambertian"]);
    assert!(prepared.features.dropped().contains(&"glass"));
    assert_eq!(triangles(&prepared, 0)[0].record.kind, 0);
}

#[test]
fn an_empty_scene_can_be_prepared() {
    let prepared = prepared(&Scene::default());
    assert_eq!((prepared.constants.light_count, prepared.constants.environment_light), (0, NONE));
    assert!(prepared.arrays.iter().all(|array| !array.is_empty()));
    assert_eq!(prepared.origin, DVec3::ZERO);
}

#[test]
fn the_camera_forgets_its_nodes_scale() {
    let projection = Projection::Perspective { yfov_radians: 1.0 };
    let rotation = DQuat::from_rotation_y(0.5);
    let position = DVec3::new(1e7, 2.0, 3.0);
    let camera = Camera {
        name: String::new(),
        camera_to_world: DAffine3::from_scale_rotation_translation(DVec3::new(3.0, 0.5, 7.0), rotation, position),
        projection,
        lens_radius: 0.0,
        focus_distance: 1.0,
    };
    let mut constants = RenderConstants::default();
    camera_constants(&camera, DVec3::new(1e7, 0.0, 0.0), 200, 100, &mut constants);
    let half_height = 0.5f64.tan();
    let close = |a: [f32; 3], b: DVec3| assert!((DVec3::from(a.map(f64::from)) - b).length() < 1e-6, "{a:?} {b}");
    close(constants.camera_origin, DVec3::new(0.0, 2.0, 3.0));
    close(constants.camera_right, rotation * DVec3::X * (2.0 * half_height));
    close(constants.camera_up, DVec3::Y * half_height);
    close(constants.camera_forward, rotation * DVec3::NEG_Z);
    assert_eq!((constants.width, constants.height, constants.projection), (200, 100, PROJECTION_PERSPECTIVE));
    let mirrored = Camera { camera_to_world: DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), ..camera };
    camera_constants(&mirrored, DVec3::ZERO, 1, 1, &mut constants);
    close(constants.camera_up, DVec3::Y * half_height);
    close(constants.camera_right, DVec3::NEG_X * half_height);
}
