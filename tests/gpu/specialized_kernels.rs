//! Every kernel that a scene of ours asks for, specialised: valid, without specialisation constants, without functions
//! that are not called, and without unreachable code; and what is left out of it has no part in the image.

use std::collections::HashSet;

use crate::common::gpu;
use crate::common::mutation::write_sources;
use crate::common::scenes::{all_scenes, scene, short_form};
use crate::common::spirv::{assert_valid, bytes, instructions, validator_is_there, words};
use sunfleck::film::aov::Aov;
use sunfleck::gpu::specialize::{declared_bindings, specialize};
use sunfleck::gpu::{ArrayForm, TraceBackend, embedded, shader_compiler};
use sunfleck::render::{KernelKey, Settings, prepare_scene};

const ENTRY_POINT: u32 = 15;
const SPEC_CONSTANTS: std::ops::RangeInclusive<u32> = 48..=52;
const FUNCTION: u32 = 54;
const FUNCTION_CALL: u32 = 57;
const LABEL: u32 = 248;
const BRANCH: u32 = 249;

fn key(name: &str, trace: TraceBackend, form: ArrayForm) -> Vec<(u32, u32)> {
    key_with(name, trace, form, &gpu::settings(16, 16))
}

fn key_with(name: &str, trace: TraceBackend, form: ArrayForm, settings: &Settings) -> Vec<(u32, u32)> {
    let scene = scene(name);
    let camera = &scene.cameras[0];
    let prepared = prepare_scene(&scene, camera, settings).expect("the scene fits");
    let mut key = KernelKey::new(&prepared, camera, settings, trace, (form, 31));
    key.emission_rays = name == "cornell";
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

/// Lines of the shaders that are there for AOVs and statistics alone have one of these.
const EXTRAS: [&str; 6] =
    ["if (HAS_STATISTICS", "if (COUNTS_VISITS", "if (HAS_AOVS", "if (HAS_COST", "if (HAS_EXTRAS", "include/aov.glsl"];

/// What the functions do. A branch that is decided leaves a jump to the next block, which is nothing.
fn opcodes(spirv: &[u32]) -> Vec<u32> {
    let code = instructions(spirv).into_iter().map(|(opcode, _)| opcode);
    code.skip_while(|opcode| *opcode != FUNCTION).filter(|opcode| ![LABEL, BRANCH].contains(opcode)).collect()
}

/// Without AOVs and statistics, the kernel has the very instructions of one in whose sources nobody has thought of them, and no
/// trace of them before its functions: no binding, no capability, no built-in variable.
#[test]
fn aovs_and_statistics_leave_nothing_behind() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    write_sources(folder.path(), |name, text| {
        if !(name.starts_with("include/trace_") || ["include/queue.glsl", "path_trace.comp"].contains(&name)) {
            return text.to_owned();
        }
        let is_extra = |line: &&str| EXTRAS.iter().any(|extra| line.contains(extra));
        text.lines().filter(|line| !is_extra(line)).collect::<Vec<_>>().join("\n")
    });
    let sources = shader_compiler::read_sources(folder.path()).expect("written");
    for trace in [TraceBackend::Bvh, TraceBackend::RayQuery] {
        let defines = [("TRACE_BACKEND", (trace as u32).to_string()), ("ARRAY_FORM", String::from("0"))];
        let plain = shader_compiler::compile(&sources, "path_trace.comp", &defines).expect("it compiles");
        let embedded = words(embedded::PATH_TRACE[trace as usize][0]);
        for name in ["cornell_spheres", "alpha"] {
            let values = key(name, trace, ArrayForm::TexelBuffer);
            let [mine, plain] = [&embedded, &plain].map(|spirv| specialize(spirv, &values).expect("understood"));
            let differs = opcodes(&mine).iter().zip(&opcodes(&plain)).position(|(a, b)| a != b);
            assert_eq!((opcodes(&mine).len(), differs), (opcodes(&plain).len(), None), "{name}, {trace}");
            let bindings = declared_bindings(&mine).expect("a module");
            let left_out = [AOV_BINDING, COUNTER_BINDING, EMISSION_BINDING];
            assert!(left_out.iter().all(|binding| !bindings.contains(binding)), "{name}: {bindings:?}");
            assert!(!asks_for_subgroups(&mine), "{name}, {trace}");
            let settings = Settings { aovs: Aov::ALL.to_vec(), statistics: true, ..gpu::settings(16, 16) };
            let everything = key_with(name, trace, ArrayForm::TexelBuffer, &settings);
            let full = specialize(&embedded, &everything).expect("understood");
            assert!(asks_for_subgroups(&full) && opcodes(&full).len() > opcodes(&mine).len());
            assert_specialized(name, &full);
            let bindings = declared_bindings(&full).expect("a module");
            assert!(bindings.contains(&AOV_BINDING) && bindings.contains(&COUNTER_BINDING), "{name}: {bindings:?}");
            if validator_is_there() {
                assert_valid(name, &bytes(&full));
            }
        }
    }
}

const AOV_BINDING: u32 = 5;
const COUNTER_BINDING: u32 = 6;
const EMISSION_BINDING: u32 = 8;

/// A capability (OpCapability GroupNonUniform), a built-in (SubgroupSize), or an instruction (OpGroupNonUniformElect).
fn asks_for_subgroups(spirv: &[u32]) -> bool {
    let asks = |opcode: u32, operands: &[u32]| matches!((opcode, operands), (17, [61]) | (333, _) | (71, [_, 11, 36]));
    instructions(spirv).iter().any(|(opcode, operands)| asks(*opcode, operands))
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
