//! Builds the trees of all meshes into one slot array, world first.

use std::sync::Arc;

use glam::DVec3;

use super::attributes::MeshGeometry;
use super::bounds::{Bounds, DBounds};
use super::bvh::{self, BvhQuality, Primitive, Slot, Tree};
use super::geometry::{Geometry, SharedMesh};
use super::instances::Matrices;
use super::kept::Kept;
use super::large_faces;
use super::{COORDINATE_LIMIT, PrepareError, PreparedMesh};
use crate::layout::{InstanceRecord, InstanceSlot, SLOT_INSTANCE, TRIANGLE_INDEX_MASK, TRIANGLE_LIGHT, Triangle};

/// A shared mesh's tree covers itself with this many boxes: rotated, they bound an instance tighter than one would.
const COVER_BOXES: usize = 64;

/// The slots and what stands in them.
#[derive(Debug)]
pub(super) struct Acceleration {
    pub(super) slots: Vec<Slot>,
    /// By their numbers: two a slot, zero where there is none.
    pub(super) triangles: Vec<Triangle>,
    /// The world, then the shared meshes in order.
    pub(super) meshes: Vec<PreparedMesh>,
    /// Instances of the shared meshes, in order; `first_light` is not set.
    pub(super) instances: Vec<InstanceRecord>,
    /// Mesh of each instance.
    pub(super) instance_meshes: Vec<usize>,
    /// Index into `Scene::instances` of each.
    pub(super) instance_sources: Vec<usize>,
    /// World boxes of the instances.
    pub(super) instance_bounds: Vec<Bounds>,
    /// Box of everything.
    pub(super) bounds: Bounds,
}

impl Acceleration {
    fn new() -> Self {
        Self {
            slots: Vec::new(),
            triangles: Vec::new(),
            meshes: Vec::new(),
            instances: Vec::new(),
            instance_meshes: Vec::new(),
            instance_sources: Vec::new(),
            instance_bounds: Vec::new(),
            bounds: Bounds::EMPTY,
        }
    }
}

/// Builds all trees and notes the slots of emissive triangles in `geometry`. `camera` is in rebased space.
pub(super) fn build(
    geometry: &mut Geometry,
    camera: DVec3,
    quality: BvhQuality,
    kept: &Kept,
) -> Result<Acceleration, PrepareError> {
    let trees: Vec<Arc<Tree>> =
        geometry.shared.iter().map(|mesh| kept.tree(primitives(&mesh.geometry), quality)).collect();
    let mut acceleration = Acceleration::new();
    place_instances(&mut acceleration, geometry, &trees, camera)?;

    let mut primitives = primitives(&geometry.world);
    let first_instance = primitives.len() as u32;
    primitives.extend((first_instance..).zip(&acceleration.instance_bounds).map(|(i, b)| Primitive::new(i, b)));
    let large = large_faces::choose(&geometry.world.leaves, &primitives);
    let mut apart: Vec<Primitive> = large.iter().map(|&index| primitives[index as usize]).collect();
    if !large.is_empty() {
        primitives.retain(|primitive| large.binary_search(&primitive.index()).is_err());
    }
    let rest = kept.tree(primitives, quality);
    let around = (!apart.is_empty()).then(|| {
        apart.push(Primitive::new(bvh::NESTED, &rest.bounds()));
        kept.tree(apart, quality)
    });
    acceleration.bounds = around.as_ref().unwrap_or(&rest).bounds();
    append(&mut acceleration, around.as_deref(), &rest, &mut geometry.world)?;
    for (tree, mesh) in trees.iter().zip(&mut geometry.shared) {
        append(&mut acceleration, None, tree, &mut mesh.geometry)?;
    }
    for (instance, &mesh) in acceleration.instances.iter_mut().zip(&acceleration.instance_meshes) {
        instance.root_slot = acceleration.meshes[mesh].root_slot;
    }
    Ok(acceleration)
}

fn primitives(mesh: &MeshGeometry) -> Vec<Primitive> {
    mesh.leaves.iter().zip(0..).map(|(leaf, i)| Primitive::new(i, &Bounds::around(leaf.slot.vertices))).collect()
}

/// Makes the records and the world boxes of all instances.
fn place_instances(
    acceleration: &mut Acceleration,
    geometry: &Geometry,
    trees: &[Arc<Tree>],
    camera: DVec3,
) -> Result<(), PrepareError> {
    let mut all = Bounds::around(geometry.world.leaves.iter().flat_map(|leaf| leaf.slot.vertices)).to_f64();
    let mut placed: Vec<(Matrices, DBounds)> = Vec::new();
    for (index, (SharedMesh { placements, .. }, tree)) in geometry.shared.iter().zip(trees).enumerate() {
        let cover = tree.cover(COVER_BOXES);
        if cover.is_empty() {
            continue;
        }
        for placement in placements {
            let matrices = Matrices::new(&placement.transform);
            let bounds = matrices.exact_bounds(&cover);
            all = all.union(bounds);
            placed.push((matrices, bounds));
            acceleration.instances.push(matrices.record());
            acceleration.instance_meshes.push(index + 1);
            acceleration.instance_sources.push(placement.source);
        }
    }
    // Rays start at the camera or on a surface.
    let reach = all.min.abs().max(all.max.abs()).max(camera.abs()).max_element();
    for (matrices, bounds) in placed {
        let widened = bounds.widened(matrices.rounding_reach(reach));
        let fits = widened.min.abs().max(widened.max.abs()).max_element() <= COORDINATE_LIMIT;
        if !fits {
            return Err(PrepareError::TooFar { name: "an instance".to_owned(), limit: COORDINATE_LIMIT });
        }
        acceleration.instance_bounds.push(widened.outward());
    }
    Ok(())
}

/// Writes a tree behind what is there: leaves of `mesh`, and beyond them instances. The tree of the large leaves stands around
/// it, if there are any.
fn append(
    acceleration: &mut Acceleration,
    around: Option<&Tree>,
    tree: &Tree,
    mesh: &mut MeshGeometry,
) -> Result<(), PrepareError> {
    let first_slot = acceleration.slots.len() as u32;
    let (leaves, emissive) = (&mesh.leaves, &mut mesh.emissive);
    let triangles = &mut acceleration.triangles;
    let mut put = |number: u32, triangle: &Triangle| {
        if triangles.len() <= number as usize {
            triangles.resize(number as usize + 1, Triangle::default());
        }
        triangles[number as usize] = *triangle;
        if triangle.kind & TRIANGLE_LIGHT != 0 {
            emissive[(triangle.kind & TRIANGLE_INDEX_MASK) as usize].slot = number;
        }
    };
    let leaf = |primitive, slot| {
        let Some(leaf) = leaves.get(primitive as usize) else {
            let instance = primitive - leaves.len() as u32;
            return bytemuck::cast(InstanceSlot { instance, kind: SLOT_INSTANCE, ..InstanceSlot::default() });
        };
        put(2 * slot, &leaf.first);
        if let Some(second) = &leaf.second {
            put(2 * slot + 1, second);
        }
        bytemuck::cast(leaf.slot)
    };
    let slots = &mut acceleration.slots;
    let written = match around {
        None => tree.append(slots, leaf),
        Some(around) => around.append_around(tree, slots, leaf),
    }?;
    let large_leaves = around.map_or(0, |around| around.leaves() - 1);
    if cfg!(debug_assertions) {
        let valid = bvh::validate(&acceleration.slots, written.root_slot, &acceleration.instance_bounds);
        let expected = tree.leaves() + large_leaves;
        match valid {
            Ok(contents) => assert_eq!(contents.leaf_slots.len() + contents.instance_slots.len(), expected),
            Err(error) => panic!("the tree of {} is broken: {error}", mesh.name),
        }
    }
    acceleration.meshes.push(PreparedMesh {
        name: mesh.name.clone(),
        root_slot: written.root_slot,
        rest_root_slot: written.nested_root_slot,
        large_leaves: large_leaves as u32,
        slots: first_slot..acceleration.slots.len() as u32,
        triangles: mesh.triangles,
        depth: written.depth,
        inner_slots: written.inner_slots,
        sah_cost: written.sah_cost,
    });
    Ok(())
}
