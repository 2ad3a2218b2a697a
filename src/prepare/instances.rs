//! Placed meshes: which transforms may stay instances, their f32 matrices, and boxes that rounding cannot leave.

use glam::{DAffine3, DMat3, DVec3};

use super::bounds::{Bounds, DBounds};
use crate::layout::InstanceRecord;

/// Largest condition number ‖M‖·‖M⁻¹‖ (Frobenius; 3 for a rotation) of an instance's linear part.
///
/// The shader takes rays to object space in f32. A rounding there, u·‖M⁻¹‖·|p|, comes back to the world as
/// u·‖M‖·‖M⁻¹‖·|p|: the condition number times the error of a baked vertex. With u = 2⁻²⁴ this bound keeps 14 bits, a
/// pixel of a 16,384 wide picture; what is worse conditioned is baked.
const MAX_CONDITION: f64 = 1024.0;

/// Entries of a matrix or of its inverse outside this range are too near to f32's limits for products of them.
const MAX_NORM: f64 = (1u64 << 60) as f64;

/// Whether a mesh placed so can be traversed in object space.
pub(super) fn can_stay_instance(transform: &DAffine3) -> bool {
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let forward = norm(&transform.matrix3);
    if transform.matrix3.determinant() == 0.0 {
        return false;
    }
    let backward = norm(&transform.matrix3.inverse());
    // A NaN anywhere makes a comparison false.
    forward <= MAX_NORM && backward <= MAX_NORM && forward * backward <= MAX_CONDITION
}

/// The f32 matrices of an instance: the inverse is that of the rounded matrix, so that the two belong together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Matrices {
    /// Object to rebased world, exactly representable in f32.
    pub(super) object_to_world: DAffine3,
    /// Its inverse in f64.
    pub(super) world_to_object: DAffine3,
}

impl Matrices {
    pub(super) fn new(transform: &DAffine3) -> Self {
        let rounded = DAffine3::from_cols_array(&transform.to_cols_array().map(|x| f64::from(x as f32)));
        Self { object_to_world: rounded, world_to_object: rounded.inverse() }
    }

    /// Whether the winding's front is the other side in the world.
    pub(super) fn mirrored(&self) -> bool {
        self.object_to_world.matrix3.determinant() < 0.0
    }

    pub(super) fn record(&self) -> InstanceRecord {
        InstanceRecord {
            object_to_world: rows(&self.object_to_world),
            world_to_object: rows(&self.world_to_object),
            root_slot: 0,
            first_light: 0,
            mirrored: self.mirrored().into(),
            unused: 0,
        }
    }

    /// World box of an instance whose mesh lies in the boxes `cover`, without the allowance for rounding.
    pub(super) fn exact_bounds(&self, cover: &[Bounds]) -> DBounds {
        cover
            .iter()
            .map(|bounds| bounds.to_f64().transformed(&self.object_to_world))
            .fold(DBounds::EMPTY, DBounds::union)
    }

    /// How far a hit found in object space can lie from the world ray at the same parameter, on each axis. `reach` bounds
    /// the coordinates of ray origins and hits.
    ///
    /// Let u = 2⁻²⁴, W the exact inverse of M, o and d the ray. The object-space origin is three products and three sums
    /// of rounded entries: |δo′| ≤ 5u·|W|(|o| + |t|), for M's translation t, since the inverse's is −Wt. The direction:
    /// |s·δd′| ≤ 4u·|W||s·d| with |s·d| ≤ 2·reach between origin and hit. Back in the world the sum is multiplied by |M|;
    /// 13·reach + 5|t| is rounded up to 16.
    pub(super) fn rounding_reach(&self, reach: f64) -> DVec3 {
        const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
        let absolute = |m: &DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let moved =
            absolute(&self.world_to_object.matrix3) * (DVec3::splat(reach) + self.object_to_world.translation.abs());
        absolute(&self.object_to_world.matrix3) * moved * (16.0 * UNIT_ROUNDOFF)
    }
}

fn rows(transform: &DAffine3) -> [[f32; 4]; 3] {
    let (m, t) = (transform.matrix3.transpose(), transform.translation);
    [(m.x_axis, t.x), (m.y_axis, t.y), (m.z_axis, t.z)]
        .map(|(row, translation)| [row.x as f32, row.y as f32, row.z as f32, translation as f32])
}
