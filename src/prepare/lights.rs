//! The lights that are sampled, and how one of them is picked: by a tree, or by a table over power or over all alike.

use std::f64::consts::PI;

use glam::{DMat3, DVec3, Vec3};

use super::acceleration::Acceleration;
use super::attributes::EmissiveTriangle;
use super::environment::{EnvironmentKind, PreparedEnvironment};
use super::geometry::Geometry;
use super::light_bvh::{self, LightBvh, PlacedLight};
use super::light_cone::LightCone;
use super::materials::MaterialTable;
use super::{COORDINATE_LIMIT, LightChoice, PrepareError, PrepareOptions, cdf, luminance};
use crate::layout::{
    InstanceRecord, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_SPOT, LIGHT_TRIANGLE, Light,
    MATERIAL_DOUBLE_SIDED, NONE, emits_from_both_sides,
};
use crate::scene::{PunctualKind, PunctualLight, Scene};

/// The light table: first the lights that have a place, then the others.
#[derive(Clone, Debug)]
pub(super) struct LightTable {
    pub(super) records: Vec<Light>,
    /// Power of each, in W (as luminance).
    pub(super) powers: Vec<f64>,
    /// Those that have a place, as the tree sees them.
    placed: Vec<PlacedLight>,
    /// Index of the environment or [`NONE`].
    pub(super) environment: u32,
    /// How one is picked.
    pub(super) choice: LightChoice,
    /// The tree, if one is picked by it.
    pub(super) bvh: LightBvh,
}

/// Fewer lights than these are picked by a table: two triangles are one lamp as a rule, of which the tree tells the halves
/// apart. In `cornell` it takes a quarter more time for the same error (docs/benchmarks).
const FEWEST_FOR_BVH: usize = 3;

impl LightTable {
    /// What picks a light, as a CDF: see [`crate::layout::Light`].
    pub(super) fn cdf(&self) -> Vec<u32> {
        match self.choice {
            LightChoice::Power => cdf::build(&self.powers),
            LightChoice::Uniform => cdf::build(&vec![1.0; self.powers.len()]),
            LightChoice::Bvh => cdf::build(&self.shares()),
        }
    }

    /// Probabilities of the lights without a place, then of the tree. Power says how much light there is, not where it
    /// arrives: half of the probability goes by it, and half to all alike, so that none is picked less than half as often
    /// as either would.
    fn shares(&self) -> Vec<f64> {
        let (near, far) = self.powers.split_at(self.placed.len());
        let powers: Vec<f64> = far.iter().copied().chain([near.iter().sum()]).collect();
        let (total, count) = (powers.iter().sum::<f64>(), powers.len() as f64);
        powers.iter().map(|power| 0.5 * power / total + 0.5 / count).collect()
    }

    /// Bit `1 << LIGHT_*` for each kind in the table.
    pub(super) fn kinds(&self) -> u32 {
        self.records.iter().fold(0, |bits, light| bits | 1 << light.kind)
    }

    /// Lights in the tree.
    pub(super) fn near_lights(&self) -> u32 {
        if self.choice == LightChoice::Bvh { self.placed.len() as u32 } else { 0 }
    }

    fn push(&mut self, record: Light, power: f64) {
        self.records.push(record);
        self.powers.push(power);
    }

    fn push_placed(&mut self, record: Light, power: f64, placed: PlacedLight) {
        self.push(record, power);
        self.placed.push(placed);
    }

    /// Decides how a light is picked, and builds the tree if it is by one.
    fn choose(&mut self, choice: LightChoice) {
        let few = self.placed.len() < FEWEST_FOR_BVH;
        // The tree's share is 2³¹ / (2·(far + 1)) counts at least, of which every light wants one.
        let far = self.records.len() - self.placed.len();
        let many = self.placed.len() > (1 << 29) / (far + 1);
        self.choice = if choice == LightChoice::Bvh && (few || many) { LightChoice::Power } else { choice };
        if self.choice == LightChoice::Bvh {
            self.bvh = light_bvh::build(&self.placed);
            for (record, &trail) in self.records.iter_mut().zip(&self.bvh.trails) {
                record.trail = trail;
            }
        }
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
    trail: 0,
    material: 0,
};

/// Collects the lights: baked triangles (so that a baked leaf's light is its index), each instance's triangles, punctual
/// lights, and the environment if it is to be sampled. Sets the instances' `first_light`.
pub(super) fn gather(
    scene: &Scene,
    geometry: &Geometry,
    acceleration: &mut Acceleration,
    materials: &MaterialTable,
    environment: &PreparedEnvironment,
    options: &PrepareOptions,
) -> Result<LightTable, PrepareError> {
    let mut table = LightTable {
        records: Vec::new(),
        powers: Vec::new(),
        placed: Vec::new(),
        environment: NONE,
        choice: options.light_choice,
        bvh: LightBvh::default(),
    };
    for triangle in &geometry.world.emissive {
        table.add_triangle(triangle, &World::BAKED, NONE, materials);
    }
    add_instances(geometry, acceleration, materials, &mut table)?;
    let radius = bounding_radius(acceleration);
    let lit = |light: &&PunctualLight| light.intensity != [0.0; 3];
    let (far, near): (Vec<_>, Vec<_>) =
        scene.lights.iter().filter(lit).partition(|light| light.kind == PunctualKind::Directional);
    for light in near {
        let record = punctual_record(light, geometry.origin)?;
        table.push_placed(record, punctual_power(light, radius), placed_punctual(light, &record));
    }
    for light in far {
        table.push(punctual_record(light, geometry.origin)?, punctual_power(light, radius));
    }
    if options.sample_environment && environment.kind != EnvironmentKind::None {
        table.environment = table.records.len() as u32;
        // Radiance L from everywhere, through the disc πR² that the scene shows to each direction.
        let power = 4.0 * PI * PI * radius * radius * environment.mean_luminance;
        table.push(Light { kind: LIGHT_ENVIRONMENT, ..NO_LIGHT }, power);
    }
    table.choose(options.light_choice);
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
        let world = World::of(record);
        for triangle in &mesh.emissive {
            table.add_triangle(triangle, &world, index as u32, materials);
        }
    }
    if table.records.len() > (u32::MAX / 8) as usize { Err(PrepareError::TooManyLights) } else { Ok(()) }
}

/// Where an instance's triangles are, as the shader computes it.
struct World {
    linear: DMat3,
    translation: DVec3,
    mirrored: bool,
    /// The shader's transform rounds.
    rounds: bool,
}

impl World {
    const BAKED: Self = Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO, mirrored: false, rounds: false };

    fn of(record: &InstanceRecord) -> Self {
        let translation = DVec3::from(record.object_to_world.map(|row| f64::from(row[3])));
        Self { linear: linear_part(&record.object_to_world), translation, mirrored: record.mirrored != 0, rounds: true }
    }

    /// The corner, and a bound on how far from it the shader's is: a point of the triangle and its transform take eleven
    /// roundings of numbers that the sum of the magnitudes bounds, each of 2⁻²⁴.
    fn place(&self, corner: [f32; 3]) -> (DVec3, f64) {
        let corner = Vec3::from(corner).as_dvec3();
        let magnitude = if self.rounds {
            let columns = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis].map(DVec3::abs);
            columns[0] * corner.x.abs()
                + columns[1] * corner.y.abs()
                + columns[2] * corner.z.abs()
                + self.translation.abs()
        } else {
            corner.abs()
        };
        (self.linear * corner + self.translation, magnitude.length() / 1_048_576.0)
    }
}

impl LightTable {
    fn add_triangle(&mut self, triangle: &EmissiveTriangle, world: &World, instance: u32, materials: &MaterialTable) {
        let corners = triangle.vertices.map(|corner| world.place(corner));
        let points = corners.map(|(point, _)| point);
        let normal = (points[1] - points[0]).cross(points[2] - points[0]);
        let flags = materials.records[triangle.material as usize].kind_flags;
        let two_sided = emits_from_both_sides(flags);
        // An area that underflows must not make a light unpickable.
        let intensity = (0.5 * normal.length() * triangle.mean_luminance).max(f64::MIN_POSITIVE);
        // A Lambertian emitter sends π·area·L to each side it emits from.
        let power = PI * intensity * if flags & MATERIAL_DOUBLE_SIDED != 0 { 2.0 } else { 1.0 };
        let normal = normal.try_normalize().unwrap_or(DVec3::Y) * if world.mirrored { -1.0 } else { 1.0 };
        let placed = PlacedLight {
            points,
            error: corners.iter().map(|(_, error)| *error).fold(0.0, f64::max),
            intensity,
            cone: LightCone::lambertian(normal, two_sided),
        };
        let record =
            Light { kind: LIGHT_TRIANGLE, slot: triangle.slot, material: triangle.material, instance, ..NO_LIGHT };
        self.push_placed(record, power, placed);
    }
}

fn placed_punctual(light: &PunctualLight, record: &Light) -> PlacedLight {
    let cone = match light.kind {
        PunctualKind::Spot { inner_cone_radians, outer_cone_radians } => {
            LightCone::spot(light.direction, inner_cone_radians, outer_cone_radians)
        }
        _ => LightCone::EVERYWHERE,
    };
    let position = Vec3::from(record.position).as_dvec3();
    let intensity = luminance(light.intensity).max(f64::MIN_POSITIVE);
    PlacedLight { points: [position; 3], error: 0.0, intensity, cone }
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
