//! Every kernel that a scene of ours asks for, specialised: valid, without specialisation constants, without functions
//! that are not called, and without unreachable code; and what is left out of it has no part in the image.

use std::collections::HashSet;

use crate::common::gpu;
use crate::common::mutation::write_sources;
use crate::common::scenes::{all_scenes, scene, short_form};
use crate::common::spirv::{assert_valid, bytes, instructions, validator_is_there, words};
use sunfleck::gpu::specialize::specialize;
use sunfleck::gpu::{ArrayForm, TraceBackend, embedded};
use sunfleck::render::{KernelKey, Settings, prepare_scene};

const ENTRY_POINT: u32 = 15;
const SPEC_CONSTANTS: std::ops::RangeInclusive<u32> = 48..=52;
const FUNCTION: u32 = 54;
const FUNCTION_CALL: u32 = 57;

fn key(name: &str, trace: TraceBackend, form: ArrayForm) -> Vec<(u32, u32)> {
    let scene = scene(name);
    let (camera, settings) = (&scene.cameras[0], gpu::settings(16, 16));
    let prepared = prepare_scene(&scene, camera, &settings).expect("the scene fits");
    let key = KernelKey::new(&prepared, camera, &settings, trace, (form, 31));
    key.specialization().into_iter().chain([(0, 64)]).collect()
}

fn assert_specialized(name: &str, spirv: &[u32]) {
    let all = instructions(spirv);
    assert!(
        all.iter().all(|(opcode, _)| !SPEC_CONSTANTS.contains(opcode)),
        "{name}: a specialisation constant is left"
    );
    let called: HashSet<u32> = all
        .iter()
        .filter_map(|(opcode, operands)| match *opcode {
            ENTRY_POINT => Some(operands[1]),
            FUNCTION_CALL => Some(operands[2]),
            _ => None,
        })
        .collect();
    let functions: HashSet<u32> = all.iter().filter(|(opcode, _)| *opcode == FUNCTION).map(|(_, o)| o[1]).collect();
    assert_eq!(called, functions, "{name}: functions that are called, and those that are there");
}

#[test]
fn every_kernel_of_our_scenes_is_valid_and_has_nothing_left_to_specialize() {
    let validates = validator_is_there();
    let mut seen = HashSet::new();
    for scene in all_scenes().into_iter().chain([String::from("cornell")]) {
        for (trace, forms) in [TraceBackend::Bvh, TraceBackend::RayQuery].into_iter().zip(&embedded::PATH_TRACE) {
            let all_forms = [ArrayForm::TexelBuffer, ArrayForm::StorageBuffer, ArrayForm::DeviceAddress];
            for (form, spirv) in all_forms.into_iter().zip(forms) {
                let values = key(&scene, trace, form);
                if !seen.insert((trace, form, values.clone())) {
                    continue;
                }
                let name = format!("{scene}, {trace}, {form}");
                let whole = words(spirv);
                let specialized = specialize(&whole, &values).unwrap_or_else(|| panic!("{name}: is not understood"));
                assert!(specialized.len() < whole.len(), "{name}: nothing went");
                assert_specialized(&name, &specialized);
                if validates {
                    assert_valid(&name, &bytes(&specialized));
                }
                // There is nothing left to do but what is the same again.
                let again = specialize(&specialized, &[]).unwrap_or_else(|| panic!("{name}: again"));
                assert_eq!(specialized.len(), again.len(), "{name}: specialising again takes more away");
            }
        }
    }
}

/// Bits of FEATURES that need data which a scene without them does not bring: an environment's image, a bound on light.
const NEED_DATA: u32 = 1 << 4 | 1 << 17;

/// The image is, bit for bit, that of the kernel with every feature switched on.
#[test]
fn what_a_scene_does_not_need_has_no_part_in_its_image() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    write_sources(folder.path(), |name, text| {
        if name != "include/features.glsl" {
            return text.to_owned();
        }
        let all = (2..=4).fold(text.to_owned(), |text, id| text.replace(&format!("layout(constant_id = {id}) "), ""));
        all.replace("FEATURES = 0xffffffffu", &format!("FEATURES = {}u", !NEED_DATA))
    });
    let film = |name: &str, settings: &Settings| {
        let film = gpu::run(&mut gpu::path_tracer(&scene(name), settings), 4, 8).film;
        film.pixels().iter().map(|pixel| pixel.rgb.map(f64::to_bits)).collect::<Vec<_>>()
    };
    // The kernel with everything takes a software driver many seconds to compile.
    for name in if short_form() { &["cornell"][..] } else { &["cornell", "alpha", "volumes"] } {
        let lean = gpu::settings(32, 32);
        let full = Settings { shaders_dir: Some(folder.path().to_owned()), ..lean.clone() };
        assert_eq!(film(name, &lean), film(name, &full), "{name}");
    }
}
