//! The albedo table of rough dielectrics (src/prepare/dielectric_albedo.bin) holds what the quadrature gives.
//! SUNFLECK_WRITE_DIELECTRIC_ALBEDO=1 makes the file anew (some minutes).

use std::path::Path;

use crate::common::dielectric_albedo::{Table, albedo, parameters};
use crate::common::half_vector_bins::gauss_legendre;
use crate::common::random::Random;
use glam::DVec3;
use rayon::prelude::*;
use sunfleck::layout::DIELECTRIC_ALBEDO_SIZE;

/// Nodes along each axis of the disk.
const ORDER: usize = 64;

/// By how much a value may be too small, relatively.
const TOO_SMALL: f64 = 7e-4;

/// What is added in the end, relatively, for all other points.
const MARGIN: f64 = 6e-4;

/// The quadrature at a point of the table's coordinates.
fn exact(coordinates: [f64; 3], inside: bool, rule: &[(f64, f64)]) -> [f64; 2] {
    let (wo, alpha, eta) = parameters(coordinates, inside);
    albedo(wo, alpha, eta, rule)
}

/// What is scattered is divided by what the table says, so that a value too small makes light. Nodes are therefore raised
/// until no value at sixteen points of every cell is more than a little too small, the worst first.
fn write(path: &Path) {
    let nodes: Vec<_> = Table::nodes().collect();
    let (fine, coarse) = (&gauss_legendre(ORDER), &gauss_legendre(40));
    let mut table = Table(nodes.par_iter().map(|&(_, at, inside)| exact(at, inside, fine)).collect());
    let step = DIELECTRIC_ALBEDO_SIZE.map(|n| 1.0 / f64::from(n - 1));
    let mut between: Vec<([f64; 3], bool, [f64; 2])> = nodes
        .par_iter()
        .filter(|(_, at, _)| (0..3).all(|k| at[k] + 0.5 * step[k] < 1.0))
        .flat_map(|&(_, at, inside)| {
            (0..16_usize).into_par_iter().map(move |i| {
                // Closer at the beginning of a cell along x: from the horizon on, albedos change like a root.
                let along = [[0.08, 0.2, 0.4, 0.75][i % 4], [0.3, 0.7][i / 4 % 2], [0.3, 0.7][i / 8]];
                let point = std::array::from_fn(|k| at[k] + along[k] * step[k]);
                (point, inside, exact(point, inside, coarse))
            })
        })
        .collect();
    println!("nodes are made");
    let deficit =
        |(point, inside, exact): &([f64; 3], bool, [f64; 2])| exact[0] - table.interpolate(*point, *inside)[0];
    between.sort_by(|a, b| deficit(b).total_cmp(&deficit(a)));
    for (point, inside, exact) in &between {
        let now = table.interpolate(*point, *inside);
        let exact = exact.map(|e| e * (1.0 - TOO_SMALL));
        for (i, weight) in Table::corners(*point, *inside) {
            let of_all: f64 = Table::corners(*point, *inside).iter().map(|(_, w)| w * w).sum();
            for k in 0..2 {
                table.0[i][k] = (table.0[i][k] + (exact[k] - now[k]).max(0.0) * weight / of_all).min(1.0);
            }
        }
    }
    let bytes: Vec<u8> = table
        .0
        .iter()
        .flatten()
        .flat_map(|value| ((value * (1.0 + MARGIN) * 65535.0).round().min(65535.0) as u16).to_le_bytes())
        .collect();
    std::fs::write(path, bytes).expect("the table can be written");
}

#[test]
fn the_table_holds_what_the_quadrature_gives() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/prepare/dielectric_albedo.bin");
    if std::env::var_os("SUNFLECK_WRITE_DIELECTRIC_ALBEDO").is_some() {
        write(&path);
        println!("written: build again, then run again");
        return;
    }
    let mut random = Random(1);
    let rule = gauss_legendre(64);
    let points: Vec<([f64; 3], bool)> =
        (0..4000).map(|i| (std::array::from_fn(|_| random.unit()), i % 2 == 0)).collect();
    let errors: Vec<(f64, [f64; 3], bool)> = points
        .into_par_iter()
        .map(|(at, inside)| {
            (Table::stored().interpolate(at, inside)[0] / exact(at, inside, &rule)[0] - 1.0, at, inside)
        })
        .collect();
    // At the horizon itself nothing is lost, and no node can be larger than 1: only within 10⁻⁴ of it a value is smaller.
    for (error, at, inside) in errors.iter().filter(|(_, at, _)| at[0] > 0.01) {
        assert!(*error > -1e-3, "{error:+.2e} at {at:?}, inside {inside}");
    }
    for inside in [false, true] {
        let mut of_side: Vec<f64> = errors.iter().filter(|e| e.2 == inside).map(|e| e.0).collect();
        of_side.sort_by(f64::total_cmp);
        let quantile = |q: f64| of_side[((of_side.len() - 1) as f64 * q) as usize];
        let [least, median, most, largest] = [0.0, 0.5, 0.99, 1.0].map(quantile);
        println!("inside {inside}: {least:+.2e}, median {median:+.2e}, 99 % below {most:+.2e}, largest {largest:+.2e}");
        // What is too large in the table is lost; indices close to 1, seen at grazing angles from inside, lose most.
        assert!(least > -1.5e-3 && most < 0.02 && largest < if inside { 0.1 } else { 0.05 });
    }
}

/// Without roughness nothing is lost; and at normal incidence on a surface of α = 1 that does not refract (η without end
/// reflects everything), the albedo is 1 − ln 2.
#[test]
fn the_quadrature_agrees_with_analytic_values() {
    for eta in [1.5, 1.0 / 1.5] {
        let [all, _] = albedo(DVec3::new(0.6, 0.8, 0.0), 1e-4, eta, &gauss_legendre(ORDER));
        assert!((all - 1.0).abs() < 1e-4, "{all}");
    }
    let [all, _] = albedo(DVec3::Y, 1.0, 1e9, &gauss_legendre(160));
    assert!((all - (1.0 - 2.0_f64.ln())).abs() < 1e-4, "{all}");
}
