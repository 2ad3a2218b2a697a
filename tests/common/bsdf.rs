//! The BSDFs for tests: configurations, calls of shaders/test/bsdf.comp, and the models in f64.

use std::f64::consts::PI;

use glam::DVec3;
use sunfleck::layout::{BSDF_METALLIC_ROUGHNESS, MATERIAL_SCHLICK, MATERIAL_VOLUME};
use sunfleck::scene::{Bsdf, Volume};

use super::ggx_albedo::{self, Albedo};
use super::kernel::{TestKernel, floats, texel, vector, vector_texel};
use super::microfacets::{ggx_distribution, smith_lambda};
use super::scenes::scene;

/// Flags of a sample, as in shaders/include/bsdf.glsl.
pub const SCATTERED_DELTA: u32 = 1;
pub const SCATTERED_THROUGH: u32 = 2;

/// A BSDF's parameters and a direction to look from; numbers are those that the shader gets.
#[derive(Clone, Copy, Debug)]
pub struct Configuration {
    pub kind: u32,
    pub schlick: bool,
    pub color: [f32; 3],
    pub metallic: f32,
    /// Geometric mean of the roughness along x and z.
    pub alpha: f32,
    /// √(αx/αz).
    pub stretch: f32,
    pub ior: f32,
    pub eta: f32,
    pub transmission: f32,
    pub specular: f32,
    pub specular_color: f32,
    /// The boundary of a volume.
    pub solid: bool,
    pub wo: DVec3,
}

impl Configuration {
    pub fn new(kind: u32, color: [f32; 3], wo: DVec3) -> Self {
        Self {
            kind,
            schlick: false,
            color,
            metallic: 0.0,
            alpha: 0.0,
            stretch: 1.0,
            ior: 1.5,
            eta: 1.5,
            transmission: 0.0,
            specular: 1.0,
            specular_color: 1.0,
            solid: false,
            wo,
        }
    }

    pub fn metallic_roughness(roughness: f32, metallic: f32, ior: f32, transmission: f32, wo: DVec3) -> Self {
        let alpha = roughness * roughness;
        let color = [0.9, 0.7, 0.4];
        Self { metallic, alpha, ior, eta: ior, transmission, ..Self::new(BSDF_METALLIC_ROUGHNESS, color, wo) }
    }

    /// Roughness along x and z.
    pub fn alphas(&self) -> [f32; 2] {
        [self.alpha * self.stretch, self.alpha / self.stretch]
    }

    fn texels(&self) -> [[u32; 4]; 4] {
        let [r, g, b] = self.color.map(f32::to_bits);
        let [alpha_x, alpha_z] = self.alphas();
        let schlick = if self.schlick { MATERIAL_SCHLICK } else { 0 };
        let solid = if self.solid { MATERIAL_VOLUME } else { 0 };
        [
            [r, g, b, self.kind | schlick | solid],
            texel(self.metallic, alpha_x, self.ior, self.eta),
            texel(self.transmission, alpha_z, self.specular, self.specular_color),
            vector_texel(self.wo, 0),
        ]
    }

    /// How much the rounding of directions to f32 can change D(h), relatively: the half vector's slope is known to
    /// 2^-24 / cos θh·(cos θo + cos θi)/2, and d ln D / d slope is at most 2/α.
    pub fn rounding(&self, wi: DVec3) -> f64 {
        let alpha = self.alphas().map(f64::from).into_iter().fold(f64::INFINITY, f64::min);
        if alpha == 0.0 { 0.0 } else { 2.0 / alpha * 2.0_f64.powi(-23) / (self.wo.y + wi.y.abs()).max(1e-30) }
    }
}

/// The direction at an angle of the given cosine to +Y, rounded to f32.
pub fn direction(cosine: f64, azimuth: f64) -> DVec3 {
    let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
    round(DVec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin()))
}

/// To f32 and back.
pub fn round(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

/// What `bsdf_scatter` gave.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub wi: DVec3,
    pub weight: DVec3,
    pub pdf: f64,
    pub flags: u32,
}

impl Sample {
    pub fn is_delta(&self) -> bool {
        self.flags & SCATTERED_DELTA != 0
    }

    pub fn is_absorbed(&self) -> bool {
        self.weight == DVec3::ZERO
    }
}

/// What `bsdf_evaluate` and `bsdf_pdf` gave for (wo, wi), and with the two exchanged.
#[derive(Clone, Copy, Debug)]
pub struct Value {
    pub f: DVec3,
    pub pdf: f64,
    pub reverse_f: DVec3,
}

fn inputs(configurations: &[Configuration], samples: usize, seed: u32) -> Vec<[u32; 4]> {
    let mut inputs = vec![[configurations.len() as u32, samples as u32, seed, 0]];
    inputs.extend(configurations.iter().flat_map(Configuration::texels));
    inputs
}

/// `samples` samples of each configuration, one after the other.
pub fn scatter(kernel: &TestKernel, configurations: &[Configuration], samples: usize, seed: u32) -> Vec<Sample> {
    let outputs = kernel.run(&inputs(configurations, samples, seed), configurations.len() * samples, 2);
    let sample =
        |t: &[[u32; 4]]| Sample { wi: vector(t[0]), weight: vector(t[1]), pdf: floats(t[1])[3].into(), flags: t[0][3] };
    outputs.chunks_exact(2).map(sample).collect()
}

/// The shader's values at pairs of (index of the configuration, wi). `kernel` defines EVALUATE.
pub fn evaluate(kernel: &TestKernel, configurations: &[Configuration], at: &[(usize, DVec3)]) -> Vec<Value> {
    let value = |t: &[[u32; 4]]| Value { f: vector(t[0]), pdf: floats(t[0])[3].into(), reverse_f: vector(t[1]) };
    let batch = |at: &[(usize, DVec3)]| {
        let mut inputs = inputs(configurations, 1, 0);
        inputs.extend(at.iter().map(|(index, wi)| vector_texel(*wi, *index as u32)));
        kernel.run(&inputs, at.len(), 2).chunks_exact(2).map(value).collect::<Vec<_>>()
    };
    // Few enough for every device's largest buffer and dispatch.
    at.chunks(1 << 20).flat_map(batch).collect()
}

pub fn luminance(c: DVec3) -> f64 {
    c.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// `bsdf_kernel` for `evaluate`.
pub fn evaluating_kernel() -> TestKernel {
    bsdf_kernel().define("EVALUATE", 1)
}

/// shaders/test/bsdf.comp with a scene that has all albedo tables: of anisotropic metals and of a rough volume.
pub fn bsdf_kernel() -> TestKernel {
    let mut scene = scene("anisotropy");
    for material in scene.materials.iter_mut().filter(|m| m.bsdf == Bsdf::MetallicRoughness) {
        material.volume = Some(Volume { attenuation_color: [1.0; 3], attenuation_distance: f32::INFINITY });
    }
    TestKernel::with_scene("bsdf.comp", &scene)
}

/// The metallic-roughness model of shaders/include/bsdf_metallic_roughness.glsl in f64, with the albedo of its table.
pub struct MetallicRoughness {
    alpha: [f64; 2],
    transmission: f64,
    color: DVec3,
    metallic: f64,
    /// The dielectric's reflectance along the normal and at grazing incidence.
    dielectric: [f64; 2],
    base: DVec3,
    albedo: Albedo,
}

impl MetallicRoughness {
    /// As seen from `wo`.
    pub fn new(c: &Configuration, wo: DVec3) -> Self {
        let color = DVec3::from(c.color.map(f64::from));
        let [ior, metallic, specular] = [c.ior, c.metallic, c.specular].map(f64::from);
        let dielectric = (((ior - 1.0) / (ior + 1.0)).powi(2) * f64::from(c.specular_color)).min(1.0) * specular;
        let alpha = c.alphas().map(f64::from);
        Self {
            alpha,
            transmission: c.transmission.into(),
            color,
            metallic,
            dielectric: [dielectric, specular],
            base: color * (1.0 - metallic),
            albedo: if c.alpha == 0.0 {
                Albedo { white: 1.0, schlick: (1.0 - wo.y).powi(5) }
            } else {
                ggx_albedo::stored(wo, alpha)
            },
        }
    }

    /// What is given back of the light that one scattering of reflectance `f0` loses.
    pub fn multiple_scattering(&self, f0: DVec3) -> DVec3 {
        DVec3::ONE + f0 * ((1.0 - self.albedo.white) / self.albedo.white)
    }

    /// Fresnel terms along the normal and at grazing incidence, times their factors.
    fn specular_term(&self) -> [DVec3; 2] {
        let [f0, f90] = self.dielectric.map(DVec3::splat);
        let of_dielectric = self.multiple_scattering(f0) * (1.0 - self.metallic);
        let of_metal = self.multiple_scattering(self.color) * self.metallic;
        [f0 * of_dielectric + self.color * of_metal, f90 * of_dielectric + of_metal]
    }

    /// Albedo of the specular lobe.
    pub fn specular_albedo(&self) -> DVec3 {
        let Albedo { white, schlick } = self.albedo;
        let [f0, f90] = self.specular_term();
        f0 * (white - schlick) + f90 * schlick
    }

    /// Albedo of the diffuse and the transmitting lobe together.
    pub fn base_albedo(&self) -> DVec3 {
        let Albedo { white, schlick } = self.albedo;
        let [f0, f90] = self.dielectric;
        let kept = (f0 * (white - schlick) + f90 * schlick) * (1.0 + f0 * (1.0 - white) / white);
        self.base * (1.0 - kept)
    }

    /// Weight of the smooth transmission before its probability is divided out.
    pub fn through(&self) -> DVec3 {
        self.base_albedo() * self.transmission
    }

    /// Probabilities of the specular, the diffuse and the transmitting lobe.
    pub fn lobes(&self) -> DVec3 {
        let base = luminance(self.base_albedo());
        let weights =
            DVec3::new(luminance(self.specular_albedo()), base * (1.0 - self.transmission), base * self.transmission);
        weights / weights.element_sum()
    }

    fn distribution(&self, h: DVec3) -> f64 {
        ggx_distribution(h, self.alpha)
    }

    fn lambda(&self, w: DVec3) -> f64 {
        smith_lambda(w, self.alpha)
    }

    /// Density of reflections by bounded visible normals (Eto and Tokuyoshi 2023, eq. 8).
    fn reflection_pdf(&self, wo: DVec3, h: DVec3) -> f64 {
        let smallest = self.alpha[0].min(self.alpha[1]).min(1.0);
        let s = 1.0 + wo.x.hypot(wo.z);
        let bound = (1.0 - smallest * smallest) * s * s / (s * s + smallest * smallest * wo.y * wo.y);
        self.distribution(h) / (2.0 * wo.y * (bound + 1.0 + 2.0 * self.lambda(wo)))
    }

    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let lobes = self.lobes();
        let up = DVec3::new(wi.x, wi.y.abs(), wi.z);
        let microfacets = if self.alpha[0] > 0.0 { self.reflection_pdf(wo, (wo + up).normalize()) } else { 0.0 };
        if wi.y < 0.0 { lobes.z * microfacets } else { lobes.y * wi.y / PI + lobes.x * microfacets }
    }

    pub fn evaluate(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let up = DVec3::new(wi.x, wi.y.abs(), wi.z);
        let h = (wo + up).normalize();
        let microfacets = if self.alpha[0] > 0.0 {
            self.distribution(h) / (4.0 * wo.y * up.y * (1.0 + self.lambda(wo) + self.lambda(up)))
        } else {
            0.0
        };
        if wi.y < 0.0 {
            return self.base_albedo() * (self.transmission * microfacets / self.albedo.white);
        }
        let [f0, f90] = self.specular_term();
        let fresnel = f0 + (f90 - f0) * (1.0 - wo.dot(h)).powi(5);
        self.base_albedo() * ((1.0 - self.transmission) / PI) + fresnel * microfacets
    }
}
