//! The BVH: valid for every kind of input, and it finds the hits that brute force finds.

use crate::prepare_support::*;
use glam::{DAffine3, DVec3, Vec3};
use sunfleck::layout::{InnerSlot, LeafSlot};
use sunfleck::prepare::bounds::Bounds;
use sunfleck::prepare::bvh::{self, BvhQuality, MAX_DEPTH, Primitive, Slot, Tree, decode, inner_slot, validate};
use sunfleck::prepare::{PrepareOptions, Prepared, prepare};
use sunfleck::scene::load;

/// Builds trees of every quality over triangles alone and validates them; gives the default one.
fn build(triangles: &[TriangleVertices]) -> (Vec<Slot>, bvh::TreeContents) {
    build_with(triangles, BvhQuality::Fast);
    build_with(triangles, BvhQuality::High);
    build_with(triangles, BvhQuality::Default)
}

fn build_with(triangles: &[TriangleVertices], quality: BvhQuality) -> (Vec<Slot>, bvh::TreeContents) {
    let mut primitives: Vec<Primitive> =
        triangles.iter().zip(0..).map(|(&t, i)| Primitive::new(i, &Bounds::around(t))).collect();
    let tree = Tree::build(&mut primitives, quality);
    let (mut slots, mut found) = (Vec::new(), Vec::new());
    let appended = tree
        .append(&mut slots, |primitive, _| {
            let [a, b, c] = triangles[primitive as usize];
            found.push(primitive);
            bytemuck::cast(LeafSlot { vertices: [a, b, c, a] })
        })
        .unwrap();
    assert_eq!(appended.root_slot, 0);
    let contents = validate(&slots, 0, &[]).unwrap();
    assert_eq!(contents.depth, appended.depth);
    assert_eq!(contents.inner_slots, appended.inner_slots as usize);
    assert_eq!(contents.leaf_slots.len(), triangles.len());
    found.sort_unstable();
    assert!(found.iter().copied().eq(0..triangles.len() as u32), "every triangle exactly once");
    (slots, contents)
}

/// Rays towards the triangles must find what brute force finds. Returns the mean number of inner slots visited.
fn check_hits(triangles: &[TriangleVertices], rays: usize, seed: u64) -> f64 {
    let (slots, _) = build(triangles);
    let mut random = Random(seed);
    let bounds = Bounds::around(triangles.iter().flatten().copied()).to_f64();
    let mut total_visits = 0;
    let mut hits = 0;
    for _ in 0..rays {
        let origin = bounds.center() + random.point(1.0) * bounds.half_extent() * 2.0;
        let target = triangles[random.below(triangles.len())];
        let [a, b, c] = target.map(|v| Vec3::from(v).as_dvec3());
        let (mut u, mut v) = (random.unit(), random.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let direction = a + (b - a) * u + (c - a) * v - origin;
        let expected = triangles.iter().filter_map(|t| intersect(origin, direction, t)).fold(f64::INFINITY, f64::min);
        let (hit, visits) = traverse(&slots, 0, &[], (origin, direction));
        total_visits += visits;
        hits += usize::from(hit.is_some());
        assert_eq!(hit.map_or(f64::INFINITY, |hit| hit.t), expected, "{origin} {direction}");
    }
    assert!(hits * 2 > rays, "the test must hit something: {hits} of {rays}");
    total_visits as f64 / rays as f64
}

#[test]
fn random_meshes_are_hit_as_by_brute_force() {
    let mut random = Random(1);
    for count in [1, 2, 3, 4, 5, 7, 16, 100, 1500] {
        let triangles = random_triangles(&mut random, count, 1.0, 0.2);
        check_hits(&triangles, 300, count as u64);
    }
}

#[test]
fn a_tree_visits_few_slots() {
    let triangles = random_triangles(&mut Random(7), 20_000, 1.0, 0.02);
    let (_, contents) = build(&triangles);
    let visits = check_hits(&triangles, 200, 8);
    assert!(visits < 80.0, "{visits} inner slots a ray");
    assert!(contents.depth <= 14, "depth {}", contents.depth);
}

#[test]
fn high_quality_costs_less() {
    // Small triangles among a few that are as large as the whole.
    let mut triangles = random_triangles(&mut Random(17), 20_000, 1.0, 0.01);
    triangles.extend(random_triangles(&mut Random(19), 2_000, 1.0, 0.3));
    let cost = |quality| build_with(&triangles, quality).1.sah_cost;
    let [fast, default, high] = [BvhQuality::Fast, BvhQuality::Default, BvhQuality::High].map(cost);
    println!("SAH cost: fast {fast:.2}, default {default:.2}, high {high:.2}");
    assert!(high <= default && default < 0.99 * fast, "{fast} {default} {high}");
}

#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let triangles = random_triangles(&mut Random(18), 30_000, 1.0, 0.05);
    for quality in [BvhQuality::Default, BvhQuality::High] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| build_with(&triangles, quality).0)
        };
        let one = with(1);
        assert!(one == with(3) && one == with(8), "{quality}");
    }
}

#[test]
fn scales_from_tiny_to_huge() {
    for exponent in [-60, -30, -10, 0, 10, 30, 58] {
        let scale = 2f64.powi(exponent);
        let mut random = Random(exponent as u64);
        let triangles = random_triangles(&mut random, 300, scale, 0.2 * scale);
        check_hits(&triangles, 200, 2);
    }
}

#[test]
fn detail_beside_huge_extent() {
    let mut random = Random(3);
    let mut triangles = random_triangles(&mut random, 200, 1e-3, 1e-4);
    triangles.extend(random_triangles(&mut random, 200, 1e9, 1e8));
    check_hits(&triangles, 300, 4);
}

#[test]
fn far_from_zero() {
    let mut random = Random(3);
    let triangles: Vec<TriangleVertices> = random_triangles(&mut random, 500, 1.0, 0.1)
        .into_iter()
        .map(|t| t.map(|[x, y, z]| [x + 1e5, y - 3e6, z + 0.5]))
        .collect();
    build(&triangles);
}

#[test]
fn slivers_and_axis_aligned_planes() {
    let mut random = Random(5);
    let mut triangles: Vec<TriangleVertices> = (0..400)
        .map(|_| {
            let a = random.point(1.0);
            let b = a + random.direction() * 10.0;
            [a, b, b + random.point(1.0) * 1e-4].map(|v| v.as_vec3().into())
        })
        .collect();
    for axis in 0..3 {
        triangles.extend(random_triangles(&mut random, 100, 1.0, 0.1).into_iter().map(|t| {
            t.map(|mut v| {
                v[axis] = 0.0;
                v
            })
        }));
    }
    check_hits(&triangles, 500, 6);
}

#[test]
fn a_million_identical_triangles_are_halved() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let (_, contents) = build(&vec![triangle; 1_000_000]);
    assert!(contents.depth <= 21, "{}", contents.depth);
}

#[test]
fn depth_is_bounded_for_exponentially_spaced_triangles() {
    // Each split by cost can peel off only a few: the geometric series looks the same at every scale.
    let triangles: Vec<TriangleVertices> = (0..4000)
        .map(|i| {
            let x = 2f64.powf(f64::from(i - 2000) / 20.0) as f32;
            [[x, 0.0, 0.0], [x * 1.001, x * 1e-3, 0.0], [x, 0.0, x * 1e-3]]
        })
        .filter(|t| t[0][0] < 1e18)
        .collect();
    let (_, contents) = build(&triangles);
    assert!(contents.depth <= MAX_DEPTH);
}

#[test]
fn walls_stand_apart_from_the_rest_and_in_the_whole() {
    let prepared = prepared(&load::resolve("bumpy").unwrap());
    let (world, slots) = (&prepared.meshes[0], slots(&prepared));
    // Five walls; the lamp is none.
    assert_eq!(world.large_leaves, 5);
    let [whole, rest] = [world.root_slot, world.rest_root_slot].map(|root| validate(&slots, root, &[]).unwrap());
    assert_eq!((whole.depth, whole.inner_slots), (world.depth, world.inner_slots as usize));
    assert!((whole.sah_cost / world.sah_cost - 1.0).abs() < 0.05, "{} {}", whole.sah_cost, world.sah_cost);
    let mut leaves = [whole.leaf_slots, rest.leaf_slots];
    leaves.iter_mut().for_each(|leaves| leaves.sort_unstable());
    // The large ones come first.
    assert_eq!(leaves[0][5..], leaves[1]);
    let constants = &prepared.constants;
    assert_eq!((constants.root_slot, constants.rest_root_slot), (world.root_slot, world.rest_root_slot));
    assert_ne!(world.root_slot, world.rest_root_slot);
}

#[test]
fn points_and_empty_input() {
    let point = [[0.25; 3]; 3];
    build(&[point]);
    build(&vec![point; 100]);
    let tree = Tree::build(&mut [], BvhQuality::High);
    let mut slots = Vec::new();
    let appended = tree.append(&mut slots, |_, _| unreachable!()).unwrap();
    let contents = validate(&slots, appended.root_slot, &[]).unwrap();
    assert_eq!((contents.depth, contents.inner_slots), (1, 1));
    assert_eq!(contents.leaf_slots.len(), 0);
}

#[test]
fn quantised_boxes_contain_and_are_tight() {
    let mut random = Random(11);
    for _ in 0..20_000 {
        // Corners at all distances from zero and from each other.
        let at = random.point(1.0) * 10f64.powf(random.between(-1.0, 1.0) * 12.0);
        let size = 10f64.powf(random.between(-1.0, 1.0) * 12.0);
        let children: Vec<Bounds> = (0..1 + random.below(4))
            .map(|_| Bounds::around([0, 1].map(|_| (at + random.point(1.0) * size).as_vec3().into())))
            .collect();
        let slot = inner_slot(&children, 3);
        for (index, child) in children.iter().enumerate() {
            for axis in 0..3 {
                let [lower, upper] = decode(&slot, index, axis);
                let step = 2f64.powi(((slot.exponents >> (8 * axis)) & 0xff) as i32 - 127);
                let (lower, upper) = (lower.0 + lower.1, upper.0 + upper.1);
                // Sums of such sizes may round in f64; validate() tests exactly.
                let rounding = 1e-15 * child.min[axis].abs().max(child.max[axis].abs()) as f64;
                assert!(lower <= child.min[axis] as f64 + rounding && upper >= child.max[axis] as f64 - rounding);
                assert!(lower > child.min[axis] as f64 - step - rounding);
                assert!(upper < child.max[axis] as f64 + step + rounding);
                let origin = slot.origin[axis];
                assert!(origin + step as f32 > origin, "the step changes the coordinate");
                assert!((step as f32).is_normal());
            }
        }
    }
}

#[test]
fn validate_finds_what_is_broken() {
    let triangles = random_triangles(&mut Random(2), 50, 1.0, 0.1);
    let (slots, _) = build(&triangles);
    let break_root = |change: &dyn Fn(&mut InnerSlot)| {
        let mut broken = slots.clone();
        let mut root: InnerSlot = bytemuck::cast(broken[0]);
        change(&mut root);
        broken[0] = bytemuck::cast(root);
        validate(&broken, 0, &[]).unwrap_err()
    };
    assert!(break_root(&|root| root.child_group = 0).contains("two parents"));
    assert!(break_root(&|root| root.child_group = 1 << 20).contains("out of range"));
    assert!(break_root(&|root| root.origin[0] += 0.5).contains("does not contain"));
    assert!(break_root(&|root| (root.lower, root.upper) = ([u32::MAX; 3], [0; 3])).contains("should be empty"));
    assert!(break_root(&|root| root.upper[1] -= 1).contains("does not contain"));
}

#[test]
fn instances_are_hit_as_baked_triangles() {
    let mut random = Random(21);
    let triangles = random_triangles(&mut random, 60, 1.0, 0.4);
    let transforms: Vec<DAffine3> = (0..12)
        .map(|i| {
            let scale = DVec3::new(if i % 3 == 0 { -1.0 } else { 1.0 }, 0.5, 2.0) * (1.0 + random.unit());
            random_transform(&mut random, scale, 6.0)
        })
        .collect();
    let scene = scene_of(&triangles, &transforms);
    let kept = prepared(&scene);
    let options = PrepareOptions { bake_instances: true, ..PrepareOptions::default() };
    let baked = prepare(&scene, &options).unwrap();
    assert_eq!((kept.instances.len(), baked.instances.len()), (12, 0));
    assert_eq!(kept.statistics.placed_triangles, baked.statistics.placed_triangles);
    assert_eq!(kept.origin, baked.origin);
    let records: Vec<_> = kept.instances.iter().map(|i| i.record).collect();
    let (kept_slots, baked_slots) = (slots(&kept), slots(&baked));
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = (random.point(1.0) * 10.0, random.direction());
        let a = traverse(&kept_slots, 0, &records, ray).0;
        let b = traverse(&baked_slots, 0, &[], ray).0;
        // Grazing rays may differ in the last place of f32; a hit apart from an edge may not.
        if let (Some(a), Some(b)) = (a, b) {
            assert!((a.t - b.t).abs() < 1e-4, "{a:?} {b:?}");
            hits += 1;
        }
        assert!(a.is_some() == b.is_some(), "{a:?} {b:?} {ray:?}");
    }
    assert!(hits > 200, "{hits}");
}

/// The closest hit that f32 rays in object space find in any instance, boxes aside.
fn closest_in_instances(prepared: &Prepared, ray: (DVec3, DVec3)) -> Option<f64> {
    let mut closest: Option<f64> = None;
    for instance in &prepared.instances {
        let (origin, direction) = to_object(&instance.record, ray.0, ray.1);
        for slot in prepared.triangle_slots(&prepared.meshes[instance.mesh]) {
            if let Some(t) = intersect(origin, direction, &prepared.triangle(slot).vertices) {
                closest = Some(closest.map_or(t, |least| least.min(t)));
            }
        }
    }
    closest
}

#[test]
fn instance_boxes_allow_for_the_rounding_of_rays() {
    // Of the instance at the least corner of the scene, quantisation leaves the least box planes exact. Rays graze the
    // box's edge at least x and z, where the triangle has an edge too: they hit it in object space though they pass the
    // exact box by a rounding. Without the allowance of `rounding_reach` this test fails.
    let triangle = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.5, 1.0]];
    let scale = DVec3::new(1e-2, 1.0, 3.0);
    let transforms = [DVec3::new(-1234.5, -2345.6, -345.6), DVec3::new(1.0, 2.0, 3.0)]
        .map(|at| DAffine3::from_scale_rotation_translation(scale, glam::DQuat::IDENTITY, at));
    let prepared = prepared(&scene_of(&[triangle], &transforms));
    assert_eq!(prepared.instances.len(), 2);
    let records: Vec<_> = prepared.instances.iter().map(|i| i.record).collect();
    let slots = slots(&prepared);
    let mut random = Random(33);
    let mut found = 0;
    for _ in 0..4000 {
        let target = transforms[0].transform_point3(DVec3::Y * random.unit()) - prepared.origin;
        let away = DVec3::new(0.5 + random.unit(), random.between(-1.0, 1.0), -0.5 - random.unit()) * 1000.0;
        let origin = (target + if random.unit() < 0.5 { away } else { -away }).as_vec3().as_dvec3();
        let ray = (origin, (target - origin).normalize().as_vec3().as_dvec3());
        let expected = closest_in_instances(&prepared, ray);
        let hit = traverse(&slots, 0, &records, ray).0;
        assert_eq!(hit.map(|hit| hit.t), expected);
        found += usize::from(hit.is_some());
    }
    assert!(found > 1000, "{found}");
}
