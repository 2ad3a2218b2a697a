//! The light BVH's builder: what a node says holds for every light below it.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::common::random::Random;
use glam::DVec3;
use proptest::prelude::*;
use sunfleck::layout::{CDF_TOTAL, LIGHT_BVH_LEAF, LightNode};
use sunfleck::prepare::light_bvh::{LightBvh, PlacedLight, build};
use sunfleck::prepare::light_cone::{LightCone, unpacked_axis};

/// Lights of all kinds; `clustered` puts them in few places, several at the same.
fn lights(seed: u64, count: usize, clustered: bool) -> Vec<PlacedLight> {
    let mut random = Random(seed);
    let places: Vec<DVec3> = (0..3).map(|_| random.point(100.0)).collect();
    let light = |_| {
        let place = if clustered { places[random.below(3)] } else { random.point(100.0) };
        let intensity = 10.0_f64.powf(random.between(-12.0, 0.0));
        let axis = random.direction();
        let (points, cone) = match random.below(4) {
            0 => ([place; 3], LightCone::EVERYWHERE),
            1 => ([place; 3], LightCone::spot(axis, 0.2, random.between(0.2, 1.5))),
            kind => {
                let [a, b] = [random.direction(), random.direction()].map(|d| place + d);
                let normal = (a - place).cross(b - place).try_normalize().unwrap_or(axis);
                ([place, a, b], LightCone::lambertian(normal, kind == 3))
            }
        };
        PlacedLight { points, error: 1e-6, intensity, cone }
    };
    (0..count).map(light).collect()
}

/// The child that says this of all lights below it.
fn check_child(node: &LightNode, child: usize, total: f64, below: &[&PlacedLight]) {
    let center = DVec3::new(node.x[child].into(), node.y[child].into(), node.z[child].into());
    let radius = f64::from(node.radius[child]);
    let word = node.cones[child];
    let half = |value: u32, of: f64| 2.0 * (f64::from(value) / of).min(1.0).asin();
    let (spread, emission) = (half(word >> 8 & 0xff, 255.0), half(word >> 1 & 0x7f, 127.0));
    let [x, y] = [node.axes[child], node.axes[child] >> 16].map(|v| v as u16 as i16);
    let axis = unpacked_axis(x, y);
    for light in below {
        for point in light.points {
            assert!(point.distance(center) + light.error <= radius, "{point} is outside of {center} ± {radius}");
        }
        let cone = light.cone;
        let off = |axis: DVec3| axis.angle_between(cone.axis) + cone.spread;
        let nearest = if word & 1 != 0 { off(axis).min(off(-axis)) } else { off(axis) };
        assert!(nearest.min(PI) <= spread + 1e-7, "a normal {nearest} off an axis that spreads by {spread}");
        assert!(cone.emission <= emission, "{} beyond {emission}", cone.emission);
        assert!(word & 1 != 0 || !cone.two_sided);
    }
    let intensity: f64 = below.iter().map(|light| light.intensity).sum::<f64>() / total;
    let stored = f64::from(f32::from_bits(word & 0xffff_0000));
    assert!(stored >= intensity * (1.0 - 1e-6) && stored <= (intensity * 1.01).max(6e-20), "{stored} for {intensity}");
    assert_eq!(node.lights[child] as usize, below.len());
}

/// Checks what is below a node and returns its lights.
fn check_node(tree: &LightBvh, lights: &[PlacedLight], total: f64, number: usize, level: u32, trail: u32) -> Vec<u32> {
    assert!(level < 16, "a trail has room for sixteen digits");
    let node = &tree.nodes[number];
    let mut all = Vec::new();
    for child in (0..4).filter(|&child| node.lights[child] > 0) {
        let trail = trail | (child as u32) << (2 * level);
        let below = if node.children[child] & LIGHT_BVH_LEAF != 0 {
            let light = node.children[child] & !LIGHT_BVH_LEAF;
            assert_eq!(tree.trails[light as usize], trail);
            vec![light]
        } else {
            check_node(tree, lights, total, node.children[child] as usize, level + 1, trail)
        };
        let refs: Vec<_> = below.iter().map(|&light| &lights[light as usize]).collect();
        check_child(node, child, total, &refs);
        all.extend(below);
    }
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_node_bounds_what_is_below_it(seed in any::<u64>(), count in 1..200usize, clustered in any::<bool>()) {
        let lights = lights(seed, count, clustered);
        let tree = build(&lights);
        let total = lights.iter().map(|light| light.intensity).sum();
        let mut below = check_node(&tree, &lights, total, 0, 0, 0);
        below.sort_unstable();
        prop_assert_eq!(below, (0..count as u32).collect::<Vec<_>>());
    }
}

/// A geometric sequence of places makes splits of one light each; trails stay short enough.
#[test]
fn trees_are_not_too_deep() {
    let mut far = lights(7, 300, false);
    for (i, light) in far.iter_mut().enumerate() {
        light.points = [DVec3::X * 1.2_f64.powi(i as i32 / 2); 3];
    }
    let total = far.iter().map(|light| light.intensity).sum();
    assert_eq!(check_node(&build(&far), &far, total, 0, 0, 0).len(), 300);
    assert!(u64::from(CDF_TOTAL) > 1 << 30);
}

#[test]
fn the_union_of_cones_contains_both() {
    let mut random = Random(3);
    for _ in 0..2000 {
        let mut cone = || LightCone {
            axis: random.direction(),
            spread: random.between(0.0, PI),
            emission: random.between(0.0, FRAC_PI_2),
            two_sided: random.unit() < 0.3,
        };
        let (a, b) = (cone(), cone());
        let both = a.union(b);
        for part in [a, b] {
            let off = |axis: DVec3| axis.angle_between(part.axis) + part.spread;
            let nearest = if both.two_sided { off(both.axis).min(off(-both.axis)) } else { off(both.axis) };
            assert!(nearest.min(PI) <= both.spread + 1e-9, "{part:?} is not in {both:?}");
            assert!(part.emission <= both.emission && (both.two_sided || !part.two_sided));
        }
    }
    let opposite = LightCone::lambertian(DVec3::Y, false).union(LightCone::lambertian(DVec3::NEG_Y, false));
    assert_eq!(opposite.spread, PI);
    let sheet = LightCone::lambertian(DVec3::Y, true).union(LightCone::lambertian(DVec3::NEG_Y, true));
    assert_eq!(sheet.spread, 0.0, "both sides of a sheet");
}
