//! `sample_light`: lights are picked by their CDF, points are uniform on far triangles and by solid angle on near ones, densities are those of the solid angle,
//! and the light that arrives is what radiometry says: Lambert's formula for polygons, KHR_lights_punctual for the rest.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use crate::common::irradiance::polygon_irradiance;
use crate::common::kernel::{Random, TestKernel, empty_scene, floats, vector, vector_texel};
use crate::common::statistics::{Estimate, chi_square_test, normal_upper_tail, sidak};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use sunfleck::layout::{self, CDF_TOTAL, NONE, SceneArray};
use sunfleck::render::LightChoice;
use sunfleck::scene::{Environment, Instance, Material, Mesh, Primitive, PunctualKind, PunctualLight, Scene};

/// Level of each test here.
const ALPHA: f64 = 0.01;
const SAMPLES: usize = 1 << 15;
const EMISSION: [f32; 3] = [5.0, 2.0, 1.0];

fn material(double_sided: bool) -> Material {
    Material { emission: EMISSION, double_sided, ..Material::lambertian("lamp", [0.5; 3]) }
}

/// A rectangle of 2 × 1.2 in the plane y = 1.5 with a corner above the origin, its front downwards.
fn rectangle() -> Primitive {
    Primitive {
        positions: vec![[0.0, 1.5, 0.0], [2.0, 1.5, 0.0], [2.0, 1.5, 1.2], [0.0, 1.5, 1.2]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Primitive::default()
    }
}

fn scene_of(mesh: Primitive, placements: &[DAffine3], double_sided: bool) -> Scene {
    let place = |m: &DAffine3| Instance { mesh: 0, object_to_world: *m, name: String::from("lamp") };
    Scene {
        meshes: vec![Mesh { name: String::from("lamp"), primitives: vec![mesh] }],
        materials: vec![material(double_sided)],
        instances: placements.iter().map(place).collect(),
        ..empty_scene()
    }
}

/// Two placements that stay instances: turned and stretched, and mirrored.
fn placements() -> [DAffine3; 2] {
    let stretch = DMat3::from_diagonal(DVec3::new(1.5, 1.0, 0.4));
    let turned = DMat3::from_rotation_x(0.4) * DMat3::from_rotation_y(0.9) * stretch;
    let mirrored = DMat3::from_rotation_z(-0.3) * DMat3::from_diagonal(DVec3::new(-0.8, 1.1, 0.7));
    [
        DAffine3::from_mat3_translation(turned, DVec3::new(0.3, 0.6, -0.2)),
        DAffine3::from_mat3_translation(mirrored, DVec3::new(0.5, 0.2, 0.4)),
    ]
}

fn punctual(kind: PunctualKind, position: DVec3, direction: DVec3) -> PunctualLight {
    PunctualLight { name: String::new(), kind, intensity: [3.0, 2.0, 1.0], position, direction }
}

/// What `sample_light` gave.
#[derive(Clone, Copy, Debug)]
struct Sample {
    direction: DVec3,
    distance: f64,
    radiance: DVec3,
    pdf: f64,
    slot: u32,
    instance: u32,
    light: usize,
    pdf_again: f64,
}

/// Samples lights from points in world space.
fn sample(kernel: &TestKernel, from: &[DVec3], seed: u64) -> Vec<Sample> {
    let mut random = Random(seed);
    let mut word = || (random.bits() >> 32) as u32;
    let mut inputs = Vec::new();
    for point in from {
        inputs.push(vector_texel(*point - kernel.prepared.origin, word()));
        inputs.push([word(), word(), 0, 0]);
        inputs.push([word(), word(), word(), word()]);
    }
    let outputs = kernel.run(&inputs, from.len(), 3);
    let decode = |t: &[[u32; 4]]| Sample {
        direction: vector(t[0]),
        distance: floats(t[0])[3].into(),
        radiance: vector(t[1]),
        pdf: floats(t[1])[3].into(),
        slot: t[2][0],
        instance: t[2][1],
        light: t[2][2] as usize,
        pdf_again: f32::from_bits(t[2][3]).into(),
    };
    outputs.chunks_exact(3).map(decode).collect()
}

fn light_records(kernel: &TestKernel) -> Vec<layout::Light> {
    let tables: &[[u32; 4]] = &kernel.prepared.arrays[SceneArray::Tables as usize];
    let first = kernel.constants.lights as usize;
    let count = kernel.constants.light_count as usize;
    bytemuck::pod_collect_to_vec(&tables[first..first + count * layout::LIGHT_TEXELS as usize])
}

fn pick_probability(kernel: &TestKernel, light: usize) -> f64 {
    let words = kernel.prepared.arrays[SceneArray::Tables as usize].as_flattened();
    let cdf = &words[kernel.constants.light_cdf_word as usize..];
    f64::from(cdf[light + 1] - cdf[light]) / f64::from(CDF_TOTAL)
}

/// World vertices of a triangle, its front counter-clockwise.
fn world_triangle(kernel: &TestKernel, slot: u32, instance: u32) -> [DVec3; 3] {
    let [a, b, c] = kernel.prepared.triangle(slot).vertices.map(|v| Vec3::from(v).as_dvec3());
    if instance == NONE {
        return [a, b, c].map(|v| v + kernel.prepared.origin);
    }
    let record = kernel.prepared.instances[instance as usize].record;
    let [x, y, z] = record.object_to_world.map(|row| row.map(f64::from));
    let place = |v: DVec3| {
        let row = |r: [f64; 4]| r[0] * v.x + r[1] * v.y + r[2] * v.z + r[3];
        DVec3::new(row(x), row(y), row(z)) + kernel.prepared.origin
    };
    let [a, b, c] = [a, b, c].map(place);
    if record.mirrored == 0 { [a, b, c] } else { [a, c, b] }
}

/// All triangle lights in world space.
fn world_lights(kernel: &TestKernel) -> Vec<[DVec3; 3]> {
    light_records(kernel).iter().map(|light| world_triangle(kernel, light.slot, light.instance)).collect()
}

fn everything() -> Scene {
    let up = DVec3::new(0.0, 3.0, 1.0);
    let spot = PunctualKind::Spot { inner_cone_radians: 0.2, outer_cone_radians: 0.9 };
    let mut scene = scene_of(rectangle(), &placements(), true);
    let floor = Primitive {
        positions: vec![[-3.0, -1.0, -3.0], [-3.0, -1.0, 3.0], [3.0, -1.0, -3.0]],
        triangles: vec![[0, 1, 2]],
        ..Primitive::default()
    };
    scene.meshes.push(Mesh { name: String::from("floor"), primitives: vec![floor] });
    scene.instances.push(Instance { mesh: 1, object_to_world: DAffine3::IDENTITY, name: String::from("floor") });
    scene.lights = vec![
        punctual(PunctualKind::Point, up, DVec3::NEG_Y),
        punctual(spot, up, DVec3::NEG_Y),
        punctual(PunctualKind::Directional, up, DVec3::new(0.6, -0.8, 0.0)),
    ];
    scene.environment = Environment::Constant([0.5; 3]);
    scene
}

/// The kernel with a scene whose environment, if any, is constant; lights are picked by power.
fn kernel(scene: &Scene) -> TestKernel {
    TestKernel::with_choice("light.comp", scene, LightChoice::Power).specialize(4, !16)
}

#[test]
fn lights_are_picked_by_their_probability() {
    let kernel = kernel(&everything());
    let lights = light_records(&kernel);
    assert_eq!(
        lights.len(),
        2 + 2 + 1 + 3 + 1,
        "two instances of two triangles, one baked, three punctual, the environment"
    );
    let samples = sample(&kernel, &vec![DVec3::new(0.2, 0.1, 0.3); SAMPLES], 1);
    let mut observed = vec![0; lights.len()];
    for s in &samples {
        observed[s.light] += 1;
        let light = &lights[s.light];
        let is_triangle = light.kind == layout::LIGHT_TRIANGLE;
        let triangle = if is_triangle { (light.slot, light.instance) } else { (NONE, NONE) };
        assert_eq!((s.slot, s.instance), triangle, "{s:?}");
        assert_eq!(s.pdf > 0.0, is_triangle || light.kind == layout::LIGHT_ENVIRONMENT, "{s:?}");
    }
    let expected: Vec<f64> = (0..lights.len()).map(|i| pick_probability(&kernel, i) * SAMPLES as f64).collect();
    assert!((expected.iter().sum::<f64>() - SAMPLES as f64).abs() < 1e-3 && expected.iter().all(|e| *e > 0.0));
    let result = chi_square_test(&observed, &expected, SAMPLES as u64);
    assert!(result.p_value > ALPHA, "{observed:?} instead of {expected:?}: {result:?}");
    let wrong: Vec<f64> = expected.iter().rev().copied().collect();
    assert!(chi_square_test(&observed, &wrong, SAMPLES as u64).p_value < ALPHA, "a wrong CDF is noticed");
}

/// The weights of the second and third vertex.
fn barycentric([a, b, c]: [DVec3; 3], point: DVec3) -> (f64, f64) {
    let normal = (b - a).cross(c - a);
    let weight = |e: DVec3| e.dot(normal) / normal.length_squared();
    (weight((point - a).cross(c - a)), weight((b - a).cross(point - a)))
}

#[test]
fn points_are_uniform_on_triangles() {
    const BINS: usize = 8;
    let kernel = kernel(&scene_of(rectangle(), &placements(), true));
    let from = DVec3::new(0.4, -9.0, 0.1);
    let mut bins: BTreeMap<(u32, u32), Vec<u64>> = BTreeMap::new();
    for s in sample(&kernel, &vec![from; 2 * SAMPLES], 2) {
        let triangle = world_triangle(&kernel, s.slot, s.instance);
        let (v, w) = barycentric(triangle, from + s.direction * s.distance);
        assert!(v > -1e-5 && w > -1e-5 && v + w < 1.0 + 1e-5, "outside of the triangle: {s:?}: {v}, {w}");
        // Areas grow with the square of the distance from the first vertex.
        let bin = |x: f64| ((x * BINS as f64) as usize).min(BINS - 1);
        let counts = bins.entry((s.slot, s.instance)).or_insert_with(|| vec![0; BINS * BINS]);
        counts[bin((v + w).powi(2)) * BINS + bin(w / (v + w))] += 1;
    }
    assert_eq!(bins.len(), 4);
    for (triangle, observed) in &bins {
        let total: u64 = observed.iter().sum();
        let uniform = vec![total as f64 / observed.len() as f64; observed.len()];
        let result = chi_square_test(observed, &uniform, total);
        assert!(result.p_value > sidak(ALPHA, bins.len()), "{triangle:?}: {result:?}");
        // Weights that are linear in the numbers crowd at the first vertex: the test sees it.
        let crowded = |i: usize| ((i / BINS + 1) as f64).sqrt() - ((i / BINS) as f64).sqrt();
        let crowded: Vec<f64> =
            (0..observed.len()).map(|i| total as f64 * crowded(i) / (8.0_f64.sqrt() * 8.0)).collect();
        assert!(chi_square_test(observed, &crowded, total).p_value < ALPHA);
    }
}

/// Solid angle of a triangle (Van Oosterom and Strackee 1983, eq. 8), and whether `triangle_is_near`.
fn solid_angle(triangle: [DVec3; 3], from: DVec3) -> (f64, bool) {
    let [a, b, c] = triangle.map(|v| v - from);
    let edge = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    let nearest = a.length_squared().min(b.length_squared()).min(c.length_squared());
    // Written so that it keeps its digits near the plane.
    let volume = a.dot((b - a).cross(c - a)).abs();
    let [x, y, z] = [a, b, c].map(DVec3::length);
    (2.0 * volume.atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y), edge >= nearest)
}

/// In f64: pick / area · distance² / cos where the triangle is far, pick / solid angle where it is near; the radiance is
/// divided by it; and a ray that finds the point finds it again.
#[test]
fn densities_are_per_solid_angle() {
    let kernel = kernel(&scene_of(rectangle(), &placements(), true));
    let mut random = Random(3);
    let from: Vec<DVec3> = (0..4096).map(|_| random.point(4.0)).collect();
    let mut seen = [0; 2];
    for (s, from) in sample(&kernel, &from, 4).iter().zip(&from) {
        let [a, b, c] = world_triangle(&kernel, s.slot, s.instance);
        let normal = (b - a).cross(c - a);
        let area = 0.5 * normal.length();
        let cosine = s.direction.dot(normal.normalize()).abs();
        let by_area = 1.0 / area * s.distance * s.distance / cosine;
        let (solid_angle, near) = solid_angle([a, b, c], *from);
        let pdf = pick_probability(&kernel, s.light) * if near { 1.0 / solid_angle } else { by_area };
        seen[usize::from(near)] += 1;
        // Positions within some metres carry errors of 2^-21, which the cosine of a grazing direction amplifies.
        let tolerance = 4e-6 * (1.0 + 4.0 / cosine);
        assert!(((s.pdf - pdf) / pdf).abs() < tolerance, "{s:?} from {from}: {pdf}");
        assert!(((s.pdf_again - s.pdf) / s.pdf).abs() < tolerance, "{s:?} from {from}");
        let radiance = s.radiance * s.pdf;
        assert!((radiance - DVec3::new(5.0, 2.0, 1.0)).abs().max_element() < 1e-5, "{s:?}: {radiance}");
    }
    assert!(seen[0] > 500 && seen[1] > 500, "far and near ones: {seen:?}");
}

/// A triangle in four, recursively, by the middles of its edges.
fn parts([a, b, c]: [DVec3; 3], levels: u32) -> Vec<[DVec3; 3]> {
    if levels == 0 {
        return vec![[a, b, c]];
    }
    let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
    let quarters = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
    quarters.into_iter().flat_map(|t| parts(t, levels - 1)).collect()
}

/// The part that holds a point of the plane: the one of which its least weight is largest.
fn part_of(parts: &[[DVec3; 3]], point: DVec3) -> usize {
    let least = |t: &[DVec3; 3]| {
        let (v, w) = barycentric(*t, point);
        v.min(w).min(1.0 - v - w)
    };
    (0..parts.len()).max_by(|&i, &j| least(&parts[i]).total_cmp(&least(&parts[j]))).expect("there are parts")
}

/// Near lamps, a lamp that touches the point, beside its edge and its corner, a sliver along and across the view, one that
/// is seen nearly edge-on: each part of them is drawn in proportion to its solid angle, and the density is 1 over the whole.
#[test]
fn near_lamps_are_sampled_by_solid_angle() {
    let triangle = |a: [f32; 3], b: [f32; 3], c: [f32; 3]| Primitive {
        positions: vec![a, b, c],
        triangles: vec![[0, 1, 2]],
        ..Primitive::default()
    };
    let plain = [[0.0, 1.0, 0.0], [1.0, 1.0, 0.25], [0.25, 1.0, 1.0]];
    let cases = [
        (plain, DVec3::new(0.4, 0.5, 0.4), "near"),
        (plain, DVec3::new(0.4, 1.0 - 1.0 / 1024.0, 0.4), "touching"),
        (plain, DVec3::new(0.4, 1.0 - 1.0 / 65536.0, 0.4), "touching more closely"),
        (plain, DVec3::new(0.5, 0.99, 0.12), "below an edge"),
        (plain, DVec3::new(0.01, 0.98, 0.0), "at the first corner"),
        (plain, DVec3::new(0.99, 0.98, 0.25), "at the second corner"),
        (plain, DVec3::new(0.26, 1.02, 0.99), "at the third corner, behind"),
        (plain, DVec3::new(-0.5, 0.99, 0.4), "nearly edge-on"),
        ([[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1e-3]], DVec3::new(0.3, 0.8, 0.1), "a sliver"),
        ([[0.0, 1.0, 0.0], [0.0, 1.0, 1e-3], [1.0, 1.0, 0.0]], DVec3::new(0.0, 0.8, 0.1), "a sliver, turned"),
        ([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1e-3]], DVec3::new(0.9, 0.9, 0.0), "a sliver, its tip near"),
    ];
    for (corners, from, name) in cases {
        let [a, b, c] = corners;
        let kernel = kernel(&scene_of(triangle(a, b, c), &[DAffine3::IDENTITY], true));
        let samples = sample(&kernel, &vec![from; SAMPLES], 8);
        // As the shader knows the point: in f32, about the scene's own origin.
        let from = (from - kernel.prepared.origin).as_vec3().as_dvec3() + kernel.prepared.origin;
        let lamp = world_lights(&kernel)[0];
        let (whole, near) = solid_angle(lamp, from);
        assert!(near, "{name}");
        let parts = parts(lamp, 2);
        let mut observed = vec![0; parts.len()];
        for s in &samples {
            assert!((s.pdf * whole - 1.0).abs() < 1e-4, "{name}: {} instead of {}", s.pdf, 1.0 / whole);
            assert!((s.pdf_again / s.pdf - 1.0).abs() < 1e-6, "{name}: {s:?}");
            observed[part_of(&parts, from + s.direction * s.distance)] += 1;
        }
        let expected: Vec<f64> = parts.iter().map(|t| solid_angle(*t, from).0 / whole * SAMPLES as f64).collect();
        let result = chi_square_test(&observed, &expected, SAMPLES as u64);
        assert!(result.p_value > sidak(ALPHA, cases.len()), "{name}: {observed:?}, not {expected:?}: {result:?}");
    }
}

/// Lamps as thin as floats allow, points in their plane, on an edge and at a vertex: no density that is not finite, and the
/// irradiance is what it should be where there is any.
#[test]
fn degenerate_views_of_lamps_are_finite() {
    for width in [1e-3_f32, 1e-6, 1e-12, 1e-20] {
        let sliver = Primitive {
            positions: vec![[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.5, 1.0, width]],
            triangles: vec![[0, 1, 2]],
            ..Primitive::default()
        };
        let kernel = kernel(&scene_of(sliver, &[DAffine3::IDENTITY], true));
        if light_records(&kernel).is_empty() {
            continue;
        }
        let points = [[0.5, 0.5, 0.0], [0.0, 1.0, 0.0], [0.5, 1.0, 0.0], [0.5, 1.0, 0.3], [0.5, 1.0 - 1e-6, 0.0]];
        for point in points.map(DVec3::from) {
            for s in sample(&kernel, &vec![point; 1024], 9) {
                let fine = s.pdf.is_finite() && s.radiance.is_finite() && s.pdf_again.is_finite();
                assert!(fine && s.direction.is_finite() && s.pdf >= 0.0, "width {width} at {point}: {s:?}");
            }
        }
        let lamp = world_lights(&kernel)[0];
        let exact = 2.0 * polygon_irradiance(&lamp, points.map(DVec3::from)[0], DVec3::Y);
        let estimate = sampled_irradiance(&kernel, points.map(DVec3::from)[0], DVec3::Y, 12);
        assert!(p_value(&estimate, exact) > sidak(ALPHA, 4), "width {width}: {estimate:?} instead of {exact}");
    }
}

/// Irradiance of all triangles that turn their front to the point, or of all that emit to both sides.
fn analytic_irradiance(kernel: &TestKernel, point: DVec3, normal: DVec3, double_sided: bool) -> f64 {
    let lights = world_lights(kernel).into_iter();
    let faces = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a).dot(point - *a) > 0.0;
    lights.filter(|t| double_sided || faces(t)).map(|t| polygon_irradiance(&t, point, normal)).sum()
}

fn sampled_irradiance(kernel: &TestKernel, point: DVec3, normal: DVec3, seed: u64) -> Estimate {
    let samples = sample(kernel, &vec![point; SAMPLES], seed);
    let values: Vec<f64> = samples.iter().map(|s| s.radiance.y * s.direction.dot(normal).max(0.0)).collect();
    Estimate::from_values(&values)
}

fn p_value(estimate: &Estimate, exact: f64) -> f64 {
    2.0 * normal_upper_tail(estimate.deviation(&Estimate::exact(exact)))
}

#[test]
fn irradiance_agrees_with_lamberts_formula() {
    // The form factor of a rectangle at a point under its corner (Howell, A Catalog of Radiation Heat Transfer
    // Configuration Factors, C-11).
    let (x, y) = (2.0_f64 / 1.5, 1.2_f64 / 1.5);
    let term = |a: f64, b: f64| a / a.hypot(1.0) * (b / a.hypot(1.0)).atan();
    let factor = (term(x, y) + term(y, x)) / (2.0 * PI);
    let corner = kernel(&scene_of(rectangle(), &[DAffine3::IDENTITY], false));
    let lambert = analytic_irradiance(&corner, DVec3::ZERO, DVec3::Y, false);
    // The corners are rounded to f32.
    assert!((lambert - PI * factor).abs() < 1e-7, "{lambert} and {}", PI * factor);

    let point = DVec3::new(0.3, -0.5, 0.2);
    let mut cases = vec![(corner, DVec3::ZERO)];
    // From below, from above (the back), and from both sides of instances, of which one is mirrored.
    for (double_sided, point) in [(false, point), (true, point), (true, -point + 4.0 * DVec3::Y)] {
        cases.push((kernel(&scene_of(rectangle(), &placements(), double_sided)), point));
    }
    for (i, (kernel, point)) in cases.iter().enumerate() {
        let normal = if point.y > 1.0 { DVec3::NEG_Y } else { DVec3::Y };
        let exact = 2.0 * analytic_irradiance(kernel, *point, normal, i >= 2);
        let estimate = sampled_irradiance(kernel, *point, normal, 10 + i as u64);
        assert!(exact > 0.01, "case {i} has light");
        assert!(p_value(&estimate, exact) > sidak(ALPHA, cases.len()), "case {i}: {estimate:?} instead of {exact}");
        assert!(p_value(&estimate, 1.03 * exact) < ALPHA, "case {i}: an error of 3 % is noticed: {estimate:?}");
    }
}

#[test]
fn a_one_sided_lamp_is_dark_behind() {
    let kernel = kernel(&scene_of(rectangle(), &[DAffine3::IDENTITY], false));
    for s in sample(&kernel, &[DVec3::new(0.5, 3.0, 0.5); 256], 5) {
        assert_eq!((s.radiance, s.pdf), (DVec3::ZERO, 0.0));
    }
}

/// Irradiance π·L from a constant environment.
#[test]
fn a_constant_environment_gives_pi() {
    let kernel = kernel(&Scene { environment: Environment::Constant([1.0, 2.0, 3.0]), ..empty_scene() });
    let estimate = sampled_irradiance(&kernel, DVec3::ZERO, DVec3::new(0.6, 0.0, -0.8), 6);
    assert!(p_value(&estimate, 2.0 * PI) > ALPHA, "{estimate:?}");
}

/// I/d², the spot's falloff as KHR_lights_punctual has it, and a directional light's irradiance: exactly, not on average.
#[test]
fn punctual_lights_follow_the_extension() {
    let mut random = Random(7);
    let axis = DVec3::new(0.48, -0.6, 0.64);
    let (inner, outer) = (0.3_f64, 0.7_f64);
    let position = DVec3::new(1.0, 2.0, -1.0);
    let kinds = [
        PunctualKind::Point,
        PunctualKind::Spot { inner_cone_radians: inner, outer_cone_radians: outer },
        PunctualKind::Directional,
    ];
    // From a millimetre to a million metres, in all directions but more often near the cone.
    let around = |random: &mut Random| {
        let aside = if random.unit() < 0.5 { 0.6 } else { 3.0 };
        let direction = (axis + aside * random.unit() * random.direction()).normalize();
        position + direction * 10.0_f64.powf(random.between(-3.0, 6.0))
    };
    let from: Vec<DVec3> = (0..4096).map(|_| around(&mut random)).map(|p| p.as_vec3().as_dvec3()).collect();
    for kind in kinds {
        let kernel = kernel(&Scene { lights: vec![punctual(kind, position, axis)], ..empty_scene() });
        // A scene of one light has its zero there: positions are rounded relative to it.
        for (s, from) in sample(&kernel, &from, 8).iter().zip(&from) {
            let offset = (*from - kernel.prepared.origin).as_vec3().as_dvec3() + kernel.prepared.origin - position;
            let cosine = offset.normalize().dot(axis);
            let angular = ((cosine - outer.cos()) / (inner.cos() - outer.cos()).max(0.001)).clamp(0.0, 1.0);
            let factor = match kind {
                PunctualKind::Point => 1.0 / offset.length_squared(),
                PunctualKind::Spot { .. } => angular * angular / offset.length_squared(),
                PunctualKind::Directional => 1.0,
            };
            let towards = if kind == PunctualKind::Directional { -axis } else { -offset.normalize() };
            assert!((s.direction - towards).length() < 1e-6, "{s:?}");
            let (got, expected) = (s.radiance.x, 3.0 * factor);
            // The falloff's square root has a rounding of 2^-24 over the difference of the cosines.
            let tolerance = 2e-6 * expected + 3.0 * 4e-6 * angular / offset.length_squared();
            assert!((got - expected).abs() <= tolerance, "{kind:?}: {got} instead of {expected} from {from}");
            assert_eq!((s.pdf, s.slot), (0.0, NONE), "a delta light has no density");
        }
    }
}
