//! The table tests/reference/mitsuba_bsdfs.json: values of Mitsuba's BSDFs, made by make_bsdf_table.py there.

use std::path::Path;

use glam::DVec3;
use serde_json::Value as Json;

/// A material of the table.
#[derive(Clone, Debug)]
pub struct Case<Row> {
    /// The plugin and what tells the case from its neighbours.
    pub name: String,
    /// Mitsuba's name of the model.
    pub plugin: String,
    /// GGX along x and z, where the model has it.
    pub alpha: [f32; 2],
    pub color: [f32; 3],
    pub metallic: f32,
    /// Index of the far side relative to that of wo's side.
    pub eta: f32,
    pub rows: Vec<Row>,
}

/// A value of a continuous lobe.
#[derive(Clone, Copy, Debug)]
pub struct Continuous {
    pub wo: DVec3,
    pub wi: DVec3,
    /// Without the cosine, in 1/sr.
    pub f: DVec3,
    /// Per solid angle.
    pub pdf: f64,
}

/// A smooth boundary seen from a direction.
#[derive(Clone, Copy, Debug)]
pub struct Smooth {
    pub wo: DVec3,
    pub reflectance: f64,
    /// What the transmitted sample is multiplied by; 0 where reflection is total.
    pub weight: f64,
    /// Where it goes.
    pub through: DVec3,
}

/// The continuous models, and the smooth ones.
pub fn table() -> (Vec<Case<Continuous>>, Vec<Case<Smooth>>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/mitsuba_bsdfs.json");
    let text = std::fs::read_to_string(&path).expect("the table is there");
    let table: Json = serde_json::from_str(&text).expect("the table is JSON");
    let continuous = |row: &[f64]| Continuous { wo: at(row, 0), wi: at(row, 3), f: at(row, 6), pdf: row[9] };
    let smooth = |row: &[f64]| Smooth { wo: at(row, 0), reflectance: row[3], weight: row[4], through: at(row, 5) };
    (cases(&table["continuous"], continuous), cases(&table["smooth"], smooth))
}

fn at(row: &[f64], first: usize) -> DVec3 {
    DVec3::from_slice(&row[first..])
}

fn numbers(json: &Json) -> Option<Vec<f64>> {
    json.as_array()?.iter().map(Json::as_f64).collect()
}

fn cases<Row>(json: &Json, row: impl Fn(&[f64]) -> Row) -> Vec<Case<Row>> {
    let text = |case: &Json, key: &str| case[key].as_str().expect("a text").to_owned();
    let number = |case: &Json, key: &str| case[key].as_f64();
    let case = |case: &Json| Case {
        name: text(case, "name"),
        plugin: text(case, "plugin"),
        alpha: numbers(&case["alpha"]).map_or([0.0; 2], |a| [a[0] as f32, a[1] as f32]),
        color: numbers(&case["color"]).map_or([1.0; 3], |c| [c[0] as f32, c[1] as f32, c[2] as f32]),
        metallic: number(case, "metallic").unwrap_or(0.0) as f32,
        eta: number(case, "eta").or(number(case, "ior")).unwrap_or(1.5) as f32,
        rows: case["rows"]
            .as_array()
            .expect("rows")
            .iter()
            .map(|r| row(&numbers(r).expect("a row of numbers")))
            .collect(),
    };
    json.as_array().expect("a list of cases").iter().map(case).collect()
}
