//! The albedo tables of GGX (src/prepare/ggx_albedo.bin, ggx_albedo_anisotropic.bin) hold what the quadrature gives.
//! SUNFLECK_WRITE_GGX_ALBEDO=1 makes the files anew.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use crate::common::ggx_albedo::{Albedo, albedo, anisotropic_entry, entry, stored};
use crate::common::random::Random;
use glam::DVec3;
use rayon::prelude::*;
use sunfleck::layout::{GGX_ALBEDO_SIZE, GGX_ANISOTROPIC_SIZES};

/// Nodes along each axis of the disk; with half of them the table changes by less than 3e-5.
const ORDER: usize = 160;

fn coordinate(i: usize) -> f64 {
    i as f64 / (GGX_ALBEDO_SIZE - 1) as f64
}

#[test]
fn the_table_holds_what_the_quadrature_gives() {
    let size = GGX_ALBEDO_SIZE as usize;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/prepare/ggx_albedo.bin");
    if std::env::var_os("SUNFLECK_WRITE_GGX_ALBEDO").is_some() {
        let node = |i: usize| entry(coordinate(i % size), coordinate(i / size), ORDER);
        let nodes: Vec<[f32; 2]> = (0..size * size).into_par_iter().map(node).collect();
        std::fs::write(&path, bytemuck::cast_slice(&nodes)).expect("the table can be written");
    }
    let bytes = std::fs::read(&path).expect("the table is there");
    let stored: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(stored.len(), 2 * size * size);
    // Every 37th node: 37 and the size have no common divisor, so that all rows and columns have their turn.
    (0..size * size).into_par_iter().step_by(37).for_each(|i| {
        let fresh = entry(coordinate(i % size), coordinate(i / size), ORDER / 2 + 7);
        for (k, (a, b)) in stored[2 * i..2 * i + 2].iter().zip(fresh).enumerate() {
            assert!((a - b).abs() < 2e-4 * b.abs().max(1.0), "node {i}, value {k}: {a} is stored, {b} is right");
        }
    });
}

/// Nodes along each axis of the disk for unequal roughness; with three quarters of them the albedo changes by less than
/// 5e-4, and the offset by less than 0.1 (at the horizon, where its unit is short).
const ANISOTROPIC_ORDER: usize = 128;

fn anisotropic_coordinates(i: usize) -> [f64; 4] {
    let mut rest = i;
    GGX_ANISOTROPIC_SIZES.map(|size| {
        let at = rest % size as usize;
        rest /= size as usize;
        at as f64 / f64::from(size - 1)
    })
}

#[test]
fn the_anisotropic_table_holds_what_the_quadrature_gives() {
    let nodes = GGX_ANISOTROPIC_SIZES.iter().product::<u32>() as usize;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/prepare/ggx_albedo_anisotropic.bin");
    if std::env::var_os("SUNFLECK_WRITE_GGX_ALBEDO").is_some() {
        let node = |i: usize| anisotropic_entry(anisotropic_coordinates(i), ANISOTROPIC_ORDER);
        let nodes: Vec<[i16; 2]> = (0..nodes).into_par_iter().map(node).collect();
        std::fs::write(&path, bytemuck::cast_slice(&nodes)).expect("the table can be written");
    }
    let bytes = std::fs::read(&path).expect("the table is there");
    let stored: Vec<i16> = bytes.chunks_exact(2).map(|b| i16::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(stored.len(), 2 * nodes);
    // Every 97th node: 97 and the sizes have no common divisor, so that all of each coordinate have their turn.
    (0..nodes).into_par_iter().step_by(97).for_each(|i| {
        let at = anisotropic_coordinates(i);
        let fresh = anisotropic_entry(at, 3 * ANISOTROPIC_ORDER / 4);
        for (k, (a, b)) in stored[2 * i..2 * i + 2].iter().zip(fresh).enumerate() {
            let tolerance = [8, 410][k];
            let difference = (i32::from(*a) - i32::from(b)).abs();
            assert!(difference <= tolerance, "node {at:?}, value {k}: {a} is stored, {b} is right");
        }
    });
}

/// Between its nodes the table is never so low that a white metal would give back more than it gets by a thousandth, nor so
/// high that it would lose a hundredth, at any ratio of the roughnesses, angle and azimuth; and so for a white dielectric, whose
/// base gets what the table says that its lobe leaves.
#[test]
fn the_anisotropic_table_is_good_between_its_nodes() {
    let octaves = [1.0_f64, 1.5, 2.0, 4.0, 8.0, 16.0, 64.0, 4096.0];
    for ratios in octaves.windows(2) {
        let mut random = Random(ratios[1].to_bits());
        let mut draw = || random.unit();
        let points: Vec<_> = (0..1 << 12)
            .map(|i| {
                let larger = if i % 2 == 0 { draw() } else { draw().powi(2) }.max(2.0_f64.powi(-12));
                let ratio = 1.0 / (ratios[0] + (ratios[1] - ratios[0]) * draw());
                let alpha = [larger, (larger * ratio).max(2.0_f64.powi(-12))];
                // Everywhere, near the horizon, and where shadows begin.
                let cosine = [draw(), draw().powi(3), larger * draw(), alpha[1] * draw()][i % 4].max(1e-5);
                // Everywhere, and along the grooves.
                let azimuth = FRAC_PI_2 * if i % 3 == 0 { (1.0 - 2.0 * ratio * draw()).max(0.0) } else { draw() };
                (alpha, cosine, azimuth)
            })
            .collect();
        let errors: Vec<[f64; 3]> = points
            .into_par_iter()
            .map(|(alpha, cosine, azimuth)| {
                let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
                let wo = DVec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin());
                let (exact, stored) = (albedo(wo, alpha, 80), stored(wo, alpha));
                // What comes back from a white metal is the true albedo over the stored one.
                let metal = exact.white / stored.white - 1.0;
                // A white dielectric's base gets what the stored albedo of its lobe leaves; one that transmits spreads it
                // by the same microfacets.
                let f0 = 0.04;
                let lobe = |a: Albedo| f0 * (a.white - a.schlick) + a.schlick;
                let factor = 1.0 + f0 * (1.0 - stored.white) / stored.white;
                let (reflected, left) = (lobe(exact) * factor, 1.0 - lobe(stored) * factor);
                [metal, reflected + left - 1.0, reflected + left * exact.white / stored.white - 1.0]
            })
            .collect();
        for (k, what) in ["metal", "dielectric", "thin dielectric"].into_iter().enumerate() {
            let limits = errors.iter().fold([0.0_f64; 2], |[low, high], e| [low.min(e[k]), high.max(e[k])]);
            let [low, high] = ratios else { unreachable!("pairs") };
            println!("ratio {low} to {high}, {what}: 1 {:+.2e} to 1 {:+.2e} come back", limits[0], limits[1]);
            assert!(limits[0] >= -1e-2 && limits[1] <= 1e-3, "ratio {low} to {high}: {limits:?}");
        }
    }
}

/// Analytic cases: at normal incidence and α = 1 normals are distributed by the cosine and the albedo is 1 − ln 2; a smooth
/// surface keeps everything.
#[test]
fn the_quadrature_agrees_with_analytic_values() {
    let rough = albedo(DVec3::Y, [1.0, 1.0], ORDER).white;
    assert!((rough - (1.0 - 2.0_f64.ln())).abs() < 1e-4, "{rough}");
    let smooth = albedo(DVec3::new(0.6, 0.8, 0.0), [1e-4, 1e-4], ORDER);
    assert!((smooth.white - 1.0).abs() < 1e-4 && (smooth.schlick - 0.2_f64.powi(5)).abs() < 1e-6, "{smooth:?}");
}
