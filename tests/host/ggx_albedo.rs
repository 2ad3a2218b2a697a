//! The albedo table of GGX (src/prepare/ggx_albedo.bin) holds what the quadrature gives.
//! SUNFLECK_WRITE_GGX_ALBEDO=1 makes the file anew.

use std::path::Path;

use crate::common::ggx_albedo::{albedo, entry};
use glam::DVec3;
use rayon::prelude::*;
use sunfleck::layout::GGX_ALBEDO_SIZE;

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

/// Analytic cases: at normal incidence and α = 1 normals are distributed by the cosine and the albedo is 1 − ln 2; a smooth
/// surface keeps everything.
#[test]
fn the_quadrature_agrees_with_analytic_values() {
    let rough = albedo(DVec3::Y, [1.0, 1.0], ORDER).white;
    assert!((rough - (1.0 - 2.0_f64.ln())).abs() < 1e-4, "{rough}");
    let smooth = albedo(DVec3::new(0.6, 0.8, 0.0), [1e-4, 1e-4], ORDER);
    assert!((smooth.white - 1.0).abs() < 1e-4 && (smooth.schlick - 0.2_f64.powi(5)).abs() < 1e-6, "{smooth:?}");
}
