//! The lights that are sampled, and the distribution by which one is picked: proportional to power.

use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};

use super::acceleration::Acceleration;
use super::attributes::EmissiveTriangle;
use super::environment::{EnvironmentKind, PreparedEnvironment};
use super::geometry::Geometry;
use super::materials::MaterialTable;
use super::{COORDINATE_LIMIT, PrepareError, cdf, luminance};
use crate::layout::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_SPOT, LIGHT_TRIANGLE, Light, MATERIAL_DOUBLE_SIDED, NONE,
};
use crate::scene::{PunctualKind, PunctualLight, Scene};

/// The light table.
#[derive(Clone, Debug)]
pub(super) struct LightTable {
    pub(super) records: Vec<Light>,
    /// Power of each, in W (as luminance).
    pub(super) powers: Vec<f64>,
    /// Index of the environment or [`NONE`].
    pub(super) environment: u32,
}

impl LightTable {
    pub(super) fn cdf(&self) -> Vec<u32> {
        cdf::build(&self.powers)
    }

    /// Bit `1 << LIGHT_*` for each kind in the table.
    pub(super) fn kinds(&self) -> u32 {
        self.records.iter().fold(0, |bits, light| bits | 1 << light.kind)
    }

    fn push(&mut self, record: Light, power: f64) {
        self.records.push(record);
        self.powers.push(power);
    }
}

const NO_LIGHT: Light = Light {
    position: [0.0; 3],
    kind: 0,
    intensity: [0.0; 3],
    slot: NONE,
    direction: [0.0; 3],
    instance: NONE,
    cone_scale: 0.0,
    cone_offset: 0.0,
    unused: [0; 2],
};

/// Collects the lights: baked triangles (so that a baked leaf's light is its index), each instance's triangles, punctual
/// lights, and the environment if it is to be sampled. Sets the instances' `first_light`.
pub(super) fn gather(
    scene: &Scene,
    geometry: &Geometry,
    acceleration: &mut Acceleration,
    materials: &MaterialTable,
    environment: &PreparedEnvironment,
    sample_environment: bool,
) -> Result<LightTable, PrepareError> {
    let mut table = LightTable { records: Vec::new(), powers: Vec::new(), environment: NONE };
    for triangle in &geometry.world.emissive {
        let power = triangle_power(triangle, &DMat3::IDENTITY, materials);
        table.push(Light { kind: LIGHT_TRIANGLE, slot: triangle.slot, ..NO_LIGHT }, power);
    }
    add_instances(geometry, acceleration, materials, &mut table)?;
    let radius = bounding_radius(acceleration);
    for light in scene.lights.iter().filter(|light| light.intensity != [0.0; 3]) {
        table.push(punctual_record(light, geometry.origin)?, punctual_power(light, radius));
    }
    if sample_environment && environment.kind != EnvironmentKind::None {
        table.environment = table.records.len() as u32;
        // Radiance L from everywhere, through the disc πR² that the scene shows to each direction.
        let power = 4.0 * PI * PI * radius * radius * environment.mean_luminance;
        table.push(Light { kind: LIGHT_ENVIRONMENT, ..NO_LIGHT }, power);
    }
    Ok(table)
}

fn add_instances(
    geometry: &Geometry,
    acceleration: &mut Acceleration,
    materials: &MaterialTable,
    table: &mut LightTable,
) -> Result<(), PrepareError> {
    for (index, record) in acceleration.instances.iter_mut().enumerate() {
        let mesh = &geometry.shared[acceleration.instance_meshes[index] - 1].geometry;
        record.first_light = u32::try_from(table.records.len()).map_err(|_| PrepareError::TooManyLights)?;
        let linear = linear_part(&record.object_to_world);
        for triangle in &mesh.emissive {
            let power = triangle_power(triangle, &linear, materials);
            let instance = index as u32;
            table.push(Light { kind: LIGHT_TRIANGLE, slot: triangle.slot, instance, ..NO_LIGHT }, power);
        }
    }
    if table.records.len() > (u32::MAX / 8) as usize { Err(PrepareError::TooManyLights) } else { Ok(()) }
}

fn linear_part(rows: &[[f32; 4]; 3]) -> DMat3 {
    let row = |k: usize| Vec3::new(rows[k][0], rows[k][1], rows[k][2]).as_dvec3();
    DMat3::from_cols(row(0), row(1), row(2)).transpose()
}

/// Radius of a sphere around everything; 1 of a scene without extent, so that no power is zero.
fn bounding_radius(acceleration: &Acceleration) -> f64 {
    let radius = acceleration.bounds.to_f64().half_extent().length();
    if radius > 0.0 { radius } else { 1.0 }
}

/// A Lambertian emitter sends π·area·L to each side it emits from.
fn triangle_power(triangle: &EmissiveTriangle, linear: &DMat3, materials: &MaterialTable) -> f64 {
    let [a, b, c] = triangle.vertices.map(|v| *linear * Vec3::from(v).as_dvec3());
    let area = 0.5 * (b - a).cross(c - a).length();
    let double_sided = materials.records[triangle.material as usize].kind_flags & MATERIAL_DOUBLE_SIDED != 0;
    let sides = if double_sided { 2.0 } else { 1.0 };
    // An area that underflows must not make a light unpickable.
    (sides * PI * area * triangle.mean_luminance).max(f64::MIN_POSITIVE)
}

fn punctual_record(light: &PunctualLight, origin: DVec3) -> Result<Light, PrepareError> {
    let position = if light.kind == PunctualKind::Directional { DVec3::ZERO } else { light.position - origin };
    let fits = position.abs().max_element() <= COORDINATE_LIMIT;
    if !fits {
        return Err(PrepareError::TooFar { name: light.name.clone(), limit: COORDINATE_LIMIT });
    }
    let mut record = Light {
        position: position.as_vec3().into(),
        intensity: light.intensity,
        direction: light.direction.as_vec3().into(),
        ..NO_LIGHT
    };
    match light.kind {
        PunctualKind::Point => record.kind = LIGHT_POINT,
        PunctualKind::Directional => record.kind = LIGHT_DIRECTIONAL,
        PunctualKind::Spot { inner_cone_radians, outer_cone_radians } => {
            record.kind = LIGHT_SPOT;
            let (scale, offset) = spot_falloff(inner_cone_radians, outer_cone_radians);
            (record.cone_scale, record.cone_offset) = (scale as f32, offset as f32);
        }
    }
    Ok(record)
}

/// Scale and offset of a spot's falloff, clamp(cos θ·scale + offset, 0, 1)². The floor of 0.001 under the difference of
/// cosines is the extension's own: KHR_lights_punctual, "Inner and Outer Cone Angles", its reference code.
pub fn spot_falloff(inner_cone_radians: f64, outer_cone_radians: f64) -> (f64, f64) {
    let scale = 1.0 / (inner_cone_radians.cos() - outer_cone_radians.cos()).max(0.001);
    (scale, -outer_cone_radians.cos() * scale)
}

/// ∫ falloff dω over the sphere. Full inside the cosine where the ramp reaches 1, and the ramp's square integrates to a
/// third of its width: 2π·((1 − c₁) + (c₁ − c₀)/3).
pub fn spot_solid_angle(inner_cone_radians: f64, outer_cone_radians: f64) -> f64 {
    let (scale, offset) = spot_falloff(inner_cone_radians, outer_cone_radians);
    let ramp = |cos_theta: f64| cos_theta * scale + offset;
    let ramp_start = outer_cone_radians.cos();
    let ramp_end = (ramp_start + 1.0 / scale).min(1.0);
    // Where the floor of 0.001 pushes the ramp's end past the axis, only its beginning is there.
    let reached = ramp(ramp_end).clamp(0.0, 1.0);
    2.0 * PI * ((1.0 - ramp_end) + (ramp_end - ramp_start) * reached * reached / 3.0)
}

fn punctual_power(light: &PunctualLight, scene_radius: f64) -> f64 {
    let measure = match light.kind {
        PunctualKind::Point => 4.0 * PI,
        PunctualKind::Spot { inner_cone_radians, outer_cone_radians } => {
            spot_solid_angle(inner_cone_radians, outer_cone_radians)
        }
        PunctualKind::Directional => PI * scene_radius * scene_radius,
    };
    (measure * luminance(light.intensity)).max(f64::MIN_POSITIVE)
}
