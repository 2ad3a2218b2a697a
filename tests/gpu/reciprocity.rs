//! Reciprocity of the shaders' BSDFs. Each lobe is a reciprocal model times a factor that depends on the direction of view
//! alone (docs/estimators.md): what of the base the reflection leaves, and what gives back the light of multiple
//! scattering. Freed of that factor, a value does not change when the directions are exchanged; between two media,
//! η²·f(wo, wi; η) = f(wi, wo; 1/η) (Veach 1997, eq. 5.14; PBR, 4th ed., §9.5.2).

use glam::DVec3;
use sunfleck::layout::BSDF_LAMBERTIAN;

use crate::common::bsdf::{Configuration, MetallicRoughness, direction, evaluate, evaluating_kernel};
use crate::common::dielectric_albedo::Table;

/// Cosines of both directions.
const COSINES: [f64; 5] = [1.0, 0.8, 0.4, 0.15, 0.05];
const ROUGHNESS: [f32; 6] = [1.0 / 64.0, 0.06, 0.2, 0.45, 0.7, 1.0];
/// Relative to the side of wo; above 1: the other way round, they are below.
const ETAS: [f32; 5] = [1.02, 1.1, 1.5, 2.0, 3.0];
/// Rounding of each value beside that of its half vector: some 30 operations of 2^-24, and table lookups of 2^-19.
const ARITHMETIC: f64 = 4e-6;

/// A value of the shader, freed of its factor, and the relative error that rounding may give it.
#[derive(Clone, Copy)]
struct Freed {
    value: DVec3,
    rounding: f64,
}

/// The largest excess of a difference over what rounding explains, of all pairs; at most 1 where the model is reciprocal.
fn worst(pairs: &[(Freed, Freed)]) -> f64 {
    let excess = |(a, b): &(Freed, Freed)| {
        let scale = a.value.max(b.value);
        let relative = (a.value - b.value).abs() / scale.max(DVec3::splat(1e-30));
        relative.max_element() / (a.rounding + b.rounding + 2.0 * ARITHMETIC)
    };
    // NaN is worst of all.
    pairs.iter().map(excess).fold(0.0, |worst: f64, x| if x <= worst { worst } else { x })
}

/// Both directions of each pair, above the surface.
fn directions() -> impl Iterator<Item = (DVec3, DVec3)> {
    COSINES.iter().enumerate().flat_map(|(i, &o)| {
        COSINES
            .iter()
            .enumerate()
            .map(move |(j, &w)| (direction(o, i as f64), direction(w, 2.0 + 0.7 * (i * 5 + j) as f64)))
    })
}

/// Values of (configuration, wi), each divided by `factor` of the configuration as seen from its wo.
fn freed(at: &[(Configuration, DVec3)], factor: impl Fn(&Configuration) -> DVec3) -> Vec<Freed> {
    let configurations: Vec<_> = at.iter().map(|(c, _)| *c).collect();
    let asked: Vec<_> = at.iter().enumerate().map(|(i, (_, wi))| (i, *wi)).collect();
    let values = evaluate(&evaluating_kernel(), &configurations, &asked);
    let freed = |((c, wi), value): (&(Configuration, DVec3), _)| {
        let value: crate::common::bsdf::Value = value;
        Freed { value: value.f / factor(c), rounding: rounding(c, *wi) }
    };
    at.iter().zip(values).map(freed).collect()
}

/// How much the rounding of directions changes D(h), relatively. Refracted, the half vector wo + η·wi may be as short as
/// |η − 1|, and cosines of facets are small where it lies at a slant.
fn rounding(c: &Configuration, wi: DVec3) -> f64 {
    if c.alpha == 0.0 || wi.y > 0.0 {
        return c.rounding(wi);
    }
    let eta = f64::from(c.eta);
    let h = (c.wo + wi * eta).normalize();
    let facets = c.wo.dot(h).abs().min(wi.dot(h).abs()).max(1e-30);
    let shift = 2.0_f64.powi(-23) * eta.max(1.0) / (c.wo + wi * eta).length();
    let stretch = f64::from(c.stretch.max(1.0 / c.stretch));
    shift * (2.0 * stretch / f64::from(c.alpha) / h.y.abs().max(0.05) + 4.0 / facets)
}

/// Exchanged directions above the surface.
fn exchanged(configurations: &[Configuration], factor: impl Fn(&Configuration) -> DVec3) -> Vec<(Freed, Freed)> {
    let mut at = Vec::new();
    for c in configurations {
        for (wo, wi) in directions() {
            at.extend([(Configuration { wo, ..*c }, wi), (Configuration { wo: wi, ..*c }, wo)]);
        }
    }
    freed(&at, factor).chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
}

fn metals() -> Vec<Configuration> {
    let of = |roughness| {
        [1.0, 1.5, 8.0].map(|stretch| Configuration {
            stretch,
            ..Configuration::metallic_roughness(roughness, 1.0, 1.5, 0.0, DVec3::Y)
        })
    };
    // Both roughnesses are ones that exist and that f32 resolves.
    let exists = |alpha: f32| alpha > 1.0 / 4096.0 && alpha <= 1.0;
    ROUGHNESS.into_iter().flat_map(of).filter(|c| c.alphas().into_iter().all(exists)).collect()
}

#[test]
fn lambertian_is_reciprocal() {
    let lambertian = Configuration::new(BSDF_LAMBERTIAN, [0.8, 0.5, 0.2], DVec3::Y);
    let pairs = exchanged(&[lambertian], |_| DVec3::ONE);
    assert!(worst(&pairs) <= 1.0, "{}", worst(&pairs));
}

/// Metal: D·V·F, isotropic and anisotropic.
#[test]
fn metals_are_reciprocal() {
    let compensation = |c: &Configuration| {
        let model = MetallicRoughness::new(c, c.wo);
        model.multiple_scattering(DVec3::from(c.color.map(f64::from)))
    };
    let pairs = exchanged(&metals(), compensation);
    println!("{} pairs, the worst {:.2} of its bound", pairs.len(), worst(&pairs));
    assert!(worst(&pairs) <= 1.0, "{}", worst(&pairs));
    // With the factor it is not, so the comparison sees one.
    assert!(worst(&exchanged(&metals(), |_| DVec3::ONE)) > 100.0);
}

/// The base, diffuse, under a dielectric without reflection (specular 0), and its thin transmission: wi below the surface.
#[test]
fn thin_transmission_is_reciprocal() {
    let sheet = |roughness| Configuration::metallic_roughness(roughness, 0.0, 1.5, 1.0, DVec3::Y);
    let mirrored = |w: DVec3| DVec3::new(w.x, -w.y, w.z);
    let mut at = Vec::new();
    for c in ROUGHNESS.map(sheet) {
        for (wo, wi) in directions() {
            at.extend([(Configuration { wo, ..c }, mirrored(wi)), (Configuration { wo: wi, ..c }, mirrored(wo))]);
        }
    }
    let base = |c: &Configuration| {
        let model = MetallicRoughness::new(c, c.wo);
        model.base_albedo() / crate::common::ggx_albedo::stored(c.wo, c.alphas().map(f64::from)).white
    };
    // Half vectors are those of the mirrored direction.
    let reflected: Vec<_> = freed(&at, base)
        .into_iter()
        .zip(&at)
        .map(|(freed, (c, wi))| Freed { rounding: c.rounding(*wi), ..freed })
        .collect();
    let pairs: Vec<_> = reflected.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    println!("{} pairs, the worst {:.2} of its bound", pairs.len(), worst(&pairs));
    assert!(worst(&pairs) <= 1.0, "{}", worst(&pairs));
}

fn boundary(roughness: f32, eta: f32, wo: DVec3) -> Configuration {
    let plain = Configuration::metallic_roughness(roughness, 0.0, eta, 1.0, wo);
    Configuration { solid: true, color: [1.0; 3], ..plain }
}

/// The reciprocal of what one scattering keeps, by the table.
fn given_back(c: &Configuration) -> DVec3 {
    let wo = DVec3::new(c.wo.x.hypot(c.wo.z), c.wo.y, 0.0);
    DVec3::splat(1.0 / Table::stored().look_up(wo, c.alpha.into(), c.eta.into())[0])
}

/// Rough glass: reflections on both sides.
#[test]
fn reflections_of_rough_glass_are_reciprocal() {
    let all = |roughness| {
        ETAS.into_iter().flat_map(move |eta| [eta, 1.0 / eta]).map(move |eta| boundary(roughness, eta, DVec3::Y))
    };
    let configurations: Vec<_> = ROUGHNESS.into_iter().flat_map(all).collect();
    let pairs = exchanged(&configurations, given_back);
    println!("{} pairs, the worst {:.2} of its bound", pairs.len(), worst(&pairs));
    assert!(worst(&pairs) <= 1.0, "{}", worst(&pairs));
    assert!(worst(&exchanged(&configurations, |_| DVec3::ONE)) > 100.0);
}

/// Rough glass: what is refracted, against the same way backwards. The frame is turned over, so that wo is above again.
#[test]
fn refractions_of_rough_glass_are_reciprocal() {
    let turned = |w: DVec3| DVec3::new(w.x, -w.y, w.z);
    let mut at = Vec::new();
    for roughness in ROUGHNESS {
        for eta in ETAS {
            for (wo, up) in directions() {
                let wi = turned(up);
                at.extend([
                    (boundary(roughness, eta, wo), wi),
                    (boundary(roughness, 1.0 / eta, turned(wi)), turned(wo)),
                ]);
            }
        }
    }
    let radiance = |c: &Configuration, power: i32| given_back(c) * f64::from(c.eta).powi(power);
    let pairs_with = |power: i32| {
        let freed = freed(&at, |c| radiance(c, power));
        freed.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect::<Vec<_>>()
    };
    // f ∝ 1/η on each side: η·f of the one way is f'/η' of the other.
    let pairs = pairs_with(-1);
    let met = pairs.iter().filter(|(a, _)| a.value.x > 0.0).count();
    println!("{met} of {} pairs refract, the worst {:.2} of its bound", pairs.len(), worst(&pairs));
    assert!(met > pairs.len() / 8, "{met} of {} pairs refract", pairs.len());
    assert!(worst(&pairs) <= 1.0, "{}", worst(&pairs));
    // Power instead of radiance is noticed.
    assert!(worst(&pairs_with(1)) > 100.0);
}
