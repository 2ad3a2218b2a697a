//! A small scene as code. Geometry: the bodies of `baked_nearest` and `baked_occluded` (shaders/include/trace_baked.glsl) are replaced by
//! straight code over the faces of a small scene, with its vertices as literals.
//!
//! What faces share is computed once: the projection of a vertex, the edge function of an edge (the neighbour takes it with
//! the other sign, which is exact), the distance along an axis. Tables: the functions of
//! shaders/include/baked_tables.glsl become choices among literals.

use super::code::Code;
use super::faces::{BakedTriangle, Face, faces};
use super::instruction::op;
use super::module::Module;
use super::search::{RayIds, Search, emit_search};

/// What of a scene is compiled in.
#[derive(Clone, Debug, Default, PartialEq, Hash)]
pub struct BakedScene {
    /// All triangles, or the large ones alone; none if no geometry is compiled in.
    pub triangles: Vec<BakedTriangle>,
    /// Every shadow ray ends on a triangle of the scene. It then crosses no plane that has all of the scene on one side.
    pub lamps_only: bool,
    /// Records by table, each of some texels.
    pub tables: Vec<BakedTable>,
    /// Words of the lights' CDF, one more than there are lights; none if it is not compiled in.
    pub light_cdf: Vec<u32>,
}

/// The records of a table: functions `NAME_0`, `NAME_1`, … return a record's texels.
#[derive(Clone, Debug, PartialEq, Hash)]
pub struct BakedTable {
    /// The functions' name without the number.
    pub name: &'static str,
    /// Records of as many texels each; at least one.
    pub records: Vec<Vec<[u32; 4]>>,
}

/// `spirv` with the scene in the places of its functions.
///
/// `None` if the module lacks them or what they need, or cannot be taken apart.
pub fn bake(spirv: &[u32], scene: &BakedScene) -> Option<Vec<u32>> {
    let module = Module::read(spirv)?;
    let mut code = Code::new(&module)?;
    let mut bodies = Vec::new();
    if !scene.triangles.is_empty() {
        bake_searches(&mut code, scene, &mut bodies)?;
    }
    for table in &scene.tables {
        for texel in 0..table.records.first()?.len() {
            let function = code.find_function(&format!("{}_{texel}(", table.name))?;
            let parameters = code.begin(function);
            let words = [0, 1, 2, 3].map(|i| {
                let words: Vec<u32> = table.records.iter().map(|record| record[texel][i]).collect();
                emit_choice(&mut code, parameters[0], &words)
            });
            let result = code.vector(&words);
            bodies.push((function, code.end(result)));
        }
    }
    if let [_, starts @ .., _] = &scene.light_cdf[..] {
        let function = code.find_function("baked_light_search(")?;
        let parameters = code.begin(function);
        let [zero, one] = [0, 1].map(|n| code.constant_uint(n));
        let mut index = zero;
        for &start in starts {
            let start = code.constant_uint(start);
            let reached = code.bool(op::U_LESS_THAN_EQUAL, &[start, parameters[0]]);
            let step = code.uint(op::SELECT, &[reached, one, zero]);
            index = code.uint(op::I_ADD, &[index, step]);
        }
        bodies.push((function, code.end(index)));
    }
    Some(code.splice(&bodies))
}

/// The word that `index` chooses: the most frequent one, unless it is that of another.
fn emit_choice(code: &mut Code<'_>, index: u32, words: &[u32]) -> u32 {
    let frequency = |word: &u32| words.iter().filter(|other| *other == word).count();
    let usual = *words.iter().rev().max_by_key(|word| frequency(word)).unwrap_or(&0);
    let mut chosen = code.constant_uint(usual);
    for (&word, i) in words.iter().zip(0..).filter(|(word, _)| **word != usual) {
        let [word, i] = [word, i].map(|n| code.constant_uint(n));
        let is_it = code.bool(op::I_EQUAL, &[index, i]);
        chosen = code.uint(op::SELECT, &[is_it, word, chosen]);
    }
    chosen
}

/// The two searches.
fn bake_searches(code: &mut Code<'_>, scene: &BakedScene, bodies: &mut Vec<(usize, Vec<u32>)>) -> Option<()> {
    let all = faces(&scene.triangles);
    let occluders: Vec<Face> = faces(&scene.triangles)
        .into_iter()
        .filter(|face| !(scene.lamps_only && face.supports(&scene.triangles)))
        .collect();
    for (name, search) in [("baked_nearest(", Search::Nearest), ("baked_occluded(", Search::Occluded)] {
        let function = code.find_function(name)?;
        let parameters = code.begin(function);
        let faces = if search == Search::Nearest { &all } else { &occluders };
        let ray = RayIds::new(code, &parameters, faces)?;
        let result = emit_search(code, &ray, faces, search);
        bodies.push((function, code.end(result)));
    }
    let numbers = scene.triangles.iter().map(|t| t.number + 1).max().unwrap_or(0);
    let tests = |faces: &[Face]| faces.iter().map(|face| face.triangles.len() as u32).sum();
    let constants = [
        ("baked_numbers(", numbers),
        ("baked_nearest_tests(", tests(&all)),
        ("baked_occluded_tests(", tests(&occluders)),
    ];
    for (name, number) in constants {
        let function = code.find_function(name)?;
        code.begin(function);
        let number = code.constant_uint(number);
        bodies.push((function, code.end(number)));
    }
    Some(())
}
