//! Lights, and what picks one: the CDF and the light BVH.

use bytemuck::{Pod, Zeroable};

/// [`Light`] `kind`: emissive triangle.
pub const LIGHT_TRIANGLE: u32 = 0;
/// [`Light`] `kind`: point.
pub const LIGHT_POINT: u32 = 1;
/// [`Light`] `kind`: spot.
pub const LIGHT_SPOT: u32 = 2;
/// [`Light`] `kind`: directional.
pub const LIGHT_DIRECTIONAL: u32 = 3;
/// [`Light`] `kind`: the environment.
pub const LIGHT_ENVIRONMENT: u32 = 4;

/// A light that can be sampled. Lights are picked by the CDF at `light_cdf_word`; with a light BVH its bins are the lights
/// without a place, which come last, then the tree. The first texel is all that a triangle needs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Light {
    /// One of `LIGHT_*`.
    pub kind: u32,
    /// Number of the triangle ([`LIGHT_TRIANGLE`]), see [`LeafSlot`](super::LeafSlot).
    pub slot: u32,
    /// Instance of the triangle or [`NONE`](super::NONE).
    pub instance: u32,
    /// Material of the triangle.
    pub material: u32,
    /// Position (point, spot).
    pub position: [f32; 3],
    /// Spot: falloff = clamp(cos θ · scale + offset, 0, 1)².
    pub cone_scale: f32,
    /// Radiant intensity or, for a directional light, irradiance.
    pub intensity: [f32; 3],
    /// See `cone_scale`.
    pub cone_offset: f32,
    /// Direction the light travels (spot, directional), unit.
    pub direction: [f32; 3],
    /// The way to its leaf in the light BVH: two bits a node, the root's lowest.
    pub trail: u32,
}

/// Texels a light takes.
pub const LIGHT_TEXELS: u32 = 4;

/// A node of the light BVH: its four children, structure by structure.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct LightNode {
    /// Centres of spheres around the lights (rebased world space).
    pub x: [f32; 4],
    /// See `x`.
    pub y: [f32; 4],
    /// See `x`.
    pub z: [f32; 4],
    /// Their radii, > 0.
    pub radius: [f32; 4],
    /// The upper half of the f32 of the largest intensity to any direction, relative to all lights'; below it the sines of
    /// half the angles by which normals lie off the axis (8 bits, of 255) and by which light lies off a normal (7 bits, of
    /// 127), and a bit that is set if light also goes the other way. All rounded up.
    pub cones: [u32; 4],
    /// Axis of the normals: x and y on the octahedron |x| + |y| + |z| = 1 in 16 bits each, of 32767, x the lower.
    pub axes: [u32; 4],
    /// Number of the child's node, or [`LIGHT_BVH_LEAF`] and its light.
    pub children: [u32; 4],
    /// How many lights the child has; 0 if there is no child.
    pub lights: [u32; 4],
}

/// Texels a node of the light BVH takes.
pub const LIGHT_BVH_TEXELS: u32 = 8;
/// [`LightNode::children`]: it is a light.
pub const LIGHT_BVH_LEAF: u32 = 1 << 31;

/// A CDF of n bins is n+1 words, from 0 to this total; bin i has probability (cdf\[i+1\] − cdf\[i\]) / total.
pub const CDF_TOTAL: u32 = 1 << 31;
