//! The light BVH: a four-wide tree over the lights that have a place, by which one is chosen for where its light is to
//! arrive (shaders/include/light_bvh.glsl).
//!
//! Nodes are split by the surface area orientation heuristic of Conty Estevez and Kulla 2018, "Importance Sampling of Many
//! Lights with Adaptive Tree Splitting", §4.4, with the squared diagonal of a box for its area: what is stored is the
//! sphere around the lights, and lamps on a line have no area.

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;

use glam::DVec3;

use super::bounds::DBounds;
use super::light_cone::LightCone;
use crate::layout::{LIGHT_BVH_LEAF, LightNode};

/// A light that has a place.
#[derive(Clone, Debug)]
pub struct PlacedLight {
    /// Convex hull: a triangle, or a point thrice.
    pub points: [DVec3; 3],
    /// Bound on how far off the points may be where the shader computes them.
    pub error: f64,
    /// Largest radiant intensity to any direction, as luminance, > 0.
    pub intensity: f64,
    /// Where the light goes.
    pub cone: LightCone,
}

impl PlacedLight {
    fn bounds(&self) -> DBounds {
        self.points.iter().fold(DBounds::EMPTY, |bounds, &p| bounds.union(DBounds { min: p, max: p }))
    }
}

/// The tree, its root first, and each light's way to its leaf (see [`crate::layout::Light::trail`]).
#[derive(Clone, Debug, Default)]
pub struct LightBvh {
    /// The nodes.
    pub nodes: Vec<LightNode>,
    /// By light.
    pub trails: Vec<u32>,
}

/// A trail has room for this many nodes.
const LEVELS: u32 = 16;
/// Places that a split is looked for at, along each axis.
const BUCKETS: usize = 12;
/// Three of the position, three of the normal.
const AXES: usize = 6;

/// Builds the tree over at least one and at most 2³⁰ lights.
pub fn build(lights: &[PlacedLight]) -> LightBvh {
    assert!(!lights.is_empty() && lights.len() <= 1 << 30, "{} lights", lights.len());
    let total = lights.iter().map(|light| light.intensity).sum();
    let mut builder = Builder {
        lights,
        total,
        order: (0..lights.len() as u32).collect(),
        tree: LightBvh { nodes: Vec::new(), trails: vec![0; lights.len()] },
    };
    builder.node(0..lights.len(), 0, 0);
    builder.tree
}

/// What the heuristic knows of some lights.
#[derive(Clone, Copy)]
struct Group {
    bounds: DBounds,
    cone: Option<LightCone>,
    intensity: f64,
}

impl Group {
    const EMPTY: Self = Self { bounds: DBounds::EMPTY, cone: None, intensity: 0.0 };

    fn of(light: &PlacedLight) -> Self {
        Self { bounds: light.bounds(), cone: Some(light.cone), intensity: light.intensity }
    }

    fn union(self, other: Self) -> Self {
        let cone = match (self.cone, other.cone) {
            (Some(a), Some(b)) => Some(a.union(b)),
            (a, b) => a.or(b),
        };
        Self { bounds: self.bounds.union(other.bounds), cone, intensity: self.intensity + other.intensity }
    }

    /// How badly one bound describes them all: 0 of nothing.
    fn cost(&self) -> f64 {
        let Some(cone) = self.cone else { return 0.0 };
        let diagonal = 2.0 * self.bounds.half_extent();
        self.intensity * cone.measure() * diagonal.length_squared()
    }
}

struct Builder<'a> {
    lights: &'a [PlacedLight],
    /// Intensity of all.
    total: f64,
    /// Lights, those of a node side by side.
    order: Vec<u32>,
    tree: LightBvh,
}

impl Builder<'_> {
    fn light(&self, position: usize) -> &PlacedLight {
        &self.lights[self.order[position] as usize]
    }

    fn group(&self, range: Range<usize>) -> Group {
        range.fold(Group::EMPTY, |group, i| group.union(Group::of(self.light(i))))
    }

    /// Makes the node of some lights, which `level` others stand above, and returns its number.
    fn node(&mut self, range: Range<usize>, level: u32, trail: u32) -> u32 {
        let number = self.tree.nodes.len() as u32;
        self.tree.nodes.push(LightNode::default());
        let mut node = LightNode { radius: [1.0; 4], ..LightNode::default() };
        for (child, part) in self.parts(range, level).into_iter().enumerate() {
            self.encode(&mut node, child, part.clone());
            let trail = trail | (child as u32) << (2 * level);
            node.children[child] = if part.len() == 1 {
                let light = self.order[part.start];
                self.tree.trails[light as usize] = trail;
                LIGHT_BVH_LEAF | light
            } else {
                self.node(part, level + 1, trail)
            };
        }
        self.tree.nodes[number as usize] = node;
        number
    }

    /// Up to four parts: the one of the highest cost is split until there are as many.
    fn parts(&mut self, range: Range<usize>, level: u32) -> Vec<Range<usize>> {
        let mut parts = vec![(self.group(range.clone()).cost(), range.clone())];
        while parts.len() < 4 {
            let splittable = parts.iter().enumerate().filter(|(_, (_, part))| part.len() > 1);
            let Some((worst, _)) = splittable.max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0)) else { break };
            let (_, part) = parts.swap_remove(worst);
            let middle = self.split(part.clone());
            for half in [part.start..middle, middle..part.end] {
                parts.push((self.group(half.clone()).cost(), half));
            }
        }
        let mut parts: Vec<_> = parts.into_iter().map(|(_, part)| part).collect();
        // What is below a part must fit into the digits that are left of a trail.
        let room = 4_usize.pow(LEVELS - 1 - level);
        if parts.iter().any(|part| part.len() > room) {
            let quarter = |i: usize| range.start + range.len() * i / 4;
            parts = (0..4).map(|i| quarter(i)..quarter(i + 1)).collect();
        }
        parts
    }

    /// Reorders some lights, at least two, and returns where the second part begins. What is near and what faces the same
    /// way belong together: splits are across positions and across normals.
    fn split(&mut self, range: Range<usize>) -> usize {
        let key = |light: &PlacedLight, axis: usize| {
            if axis < 3 { light.bounds().center()[axis] } else { light.cone.axis[axis - 3] }
        };
        let mut extents = [(f64::INFINITY, f64::NEG_INFINITY); AXES];
        for i in range.clone() {
            let light = self.light(i);
            for (axis, (low, high)) in extents.iter_mut().enumerate() {
                let key = key(light, axis);
                (*low, *high) = (low.min(key), high.max(key));
            }
        }
        let bucket = |light: &PlacedLight, axis: usize| {
            let (low, high) = extents[axis];
            (((key(light, axis) - low) / (high - low) * BUCKETS as f64) as usize).min(BUCKETS - 1)
        };
        let length = |axis: usize| extents[axis].1 - extents[axis].0;
        let longest = (0..3).map(length).fold(0.0, f64::max);
        let mut best: Option<(f64, usize, usize)> = None;
        for axis in (0..AXES).filter(|&axis| length(axis) > 0.0) {
            let mut groups = [Group::EMPTY; BUCKETS];
            for i in range.clone() {
                let light = self.light(i);
                let group = &mut groups[bucket(light, axis)];
                *group = group.union(Group::of(light));
            }
            // Thin slabs are held against a split across a long box.
            let regularity = if axis < 3 { longest / length(axis) } else { 1.0 };
            for middle in 1..BUCKETS {
                let side = |groups: &[Group]| groups.iter().fold(Group::EMPTY, |a, &b| a.union(b)).cost();
                let cost = regularity * (side(&groups[..middle]) + side(&groups[middle..]));
                let both = [&groups[..middle], &groups[middle..]].map(|g| g.iter().any(|g| g.cone.is_some()));
                if both == [true; 2] && best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, middle));
                }
            }
        }
        let Some((_, axis, middle)) = best else { return range.start + range.len() / 2 };
        let lights = self.lights;
        let (first, second): (Vec<u32>, Vec<u32>) =
            self.order[range.clone()].iter().partition(|&&i| bucket(&lights[i as usize], axis) < middle);
        self.order[range.start..range.start + first.len()].copy_from_slice(&first);
        self.order[range.start + first.len()..range.end].copy_from_slice(&second);
        range.start + first.len()
    }

    /// Writes what a part is like into a child of a node.
    fn encode(&self, node: &mut LightNode, child: usize, part: Range<usize>) {
        let group = self.group(part.clone());
        let center = group.bounds.center().as_vec3();
        (node.x[child], node.y[child], node.z[child]) = (center.x, center.y, center.z);
        let reach = |light: &PlacedLight| {
            let farthest = light.points.iter().map(|p| p.distance(center.as_dvec3())).fold(0.0, f64::max);
            farthest + light.error
        };
        let radius = part.clone().map(|i| reach(self.light(i))).fold(0.0, f64::max);
        node.radius[child] = stored_radius(radius);
        // Far below what f32 resolves beside it a light counts as the brighter it could be mistaken for.
        let relative = ((group.intensity / self.total) as f32).max(1.0 / 18_446_744_073_709_551_616.0);
        let intensity = (relative.to_bits() + 0xffff) & 0xffff_0000;
        let cone = group.cone.expect("a part has lights");
        let (axis, spread) = cone.packed_axis();
        node.axes[child] = axis;
        let emission = ((0.5 * cone.emission).sin() * 127.0).ceil() as u32;
        node.cones[child] = intensity | spread << 8 | emission << 1 | u32::from(cone.two_sided);
        node.lights[child] = part.len() as u32;
    }
}

/// Larger by more than the eight roundings with which the shader compares it to a distance, and large enough for its square
/// to be a normal number.
fn stored_radius(radius: f64) -> f32 {
    let enlarged = (radius * (1.0 + 1.0 / 1_048_576.0)) as f32;
    enlarged.next_up().max(1.0 / 1_152_921_504_606_846_976.0)
}

/// The measure of a cone in the heuristic: ∫ over the sphere of the cosine of the angle from the nearest normal, as far as
/// there is light (Conty Estevez and Kulla 2018, equation 1).
pub(super) fn cone_measure(spread: f64, emission: f64) -> f64 {
    let end = (spread + emission).min(PI);
    let (sin, cos) = spread.sin_cos();
    2.0 * PI * (1.0 - cos) + FRAC_PI_2 * (2.0 * end * sin - (spread - 2.0 * end).cos() - 2.0 * spread * sin + cos)
}
