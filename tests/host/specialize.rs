//! Specialisation of small modules: what is folded, what goes, and that control flow stays structured.

use crate::common::spirv::{assert_valid, bytes, instructions, validator_is_there};
use sunfleck::gpu::shader_compiler::{Sources, compile};
use sunfleck::gpu::specialize::{declared_bindings, specialize};

const CONSTANT: u32 = 43;
const SPEC_CONSTANT_TRUE: u32 = 48;
const SPEC_CONSTANT_OP: u32 = 52;
const FUNCTION: u32 = 54;
const LOAD: u32 = 61;
const STORE: u32 = 62;
const LOOP_MERGE: u32 = 246;
const BRANCH_CONDITIONAL: u32 = 250;
const SWITCH: u32 = 251;

/// A compute shader with the specialisation constants A (id 1), B (id 2), both 1 by default, a buffer `data`, and the
/// functions and statements given; with A and B as given.
fn module(functions: &str, body: &str, (a, b): (u32, u32)) -> Vec<u32> {
    let source = format!(
        "#version 460
         #extension GL_KHR_shader_subgroup_basic : require
         layout(local_size_x_id = 0) in;
         layout(constant_id = 1) const uint A = 1u;
         layout(constant_id = 2) const uint B = 1u;
         layout(set = 0, binding = 0, std430) buffer Block {{ uint data[]; }};
         {functions}
         void main() {{ uint lane = gl_GlobalInvocationID.x; {body} }}"
    );
    let sources = Sources::from([(String::from("test.comp"), source)]);
    let spirv = compile(&sources, "test.comp", &[]).unwrap_or_else(|e| panic!("{e}"));
    let result = specialize(&spirv, &[(0, 32), (1, a), (2, b)]).expect("understood");
    if validator_is_there() {
        assert_valid(&format!("{functions} {body} before"), &bytes(&spirv));
        assert_valid(&format!("{functions} {body} after"), &bytes(&result));
    }
    result
}

/// The same, and no specialisation constant is left.
fn specialized(functions: &str, body: &str, values: (u32, u32)) -> Vec<u32> {
    let result = module(functions, body, values);
    assert_eq!(count(&result, SPEC_CONSTANT_TRUE..=SPEC_CONSTANT_OP), 0, "{functions} {body}");
    result
}

fn count(spirv: &[u32], opcodes: impl std::ops::RangeBounds<u32>) -> usize {
    instructions(spirv).iter().filter(|(opcode, _)| opcodes.contains(opcode)).count()
}

fn one(opcode: u32) -> std::ops::RangeInclusive<u32> {
    opcode..=opcode
}

fn has_constant(spirv: &[u32], value: u32) -> bool {
    instructions(spirv).iter().any(|&(opcode, operands)| opcode == CONSTANT && operands[2] == value)
}

/// Each operator against Rust's, on operands that tell signed from unsigned.
#[test]
fn operators_are_folded() {
    let (a, b) = (0xffff_fff1_u32, 7_u32);
    let (x, y) = (a as i32, b as i32);
    // GLSL's % of negative operands is undefined; glslang makes it SMod, which takes the divisor's sign.
    let logic = "const bool P = A > B; const bool Q = A < B; const bool BOTH = P && Q; const bool EITHER = P || Q;";
    let cases = [
        ("A + B", a.wrapping_add(b)),
        ("A - B", a.wrapping_sub(b)),
        ("A * B", a.wrapping_mul(b)),
        ("A / B", a / b),
        ("A % B", a % b),
        ("uint(int(A) / int(B))", (x / y) as u32),
        ("uint(int(A) % int(B))", x.rem_euclid(y) as u32),
        ("uint(-int(B))", (-y) as u32),
        ("A & 0xffu", a & 0xff),
        ("A | 0x100000u", a | 0x10_0000),
        ("A ^ B", a ^ b),
        ("~B", !b),
        ("A << B", a << b),
        ("A >> B", a >> b),
        ("uint(int(A) >> B)", (x >> b) as u32),
        ("A > B ? 1001u : 1002u", 1001),
        ("int(A) > int(B) ? 1001u : 1002u", 1002),
        ("EITHER ? 1001u : 1002u", 1001),
        ("BOTH ? 1001u : 1002u", 1002),
        ("(A == 0xfffffff1u) == !(B >= 8u) ? 1001u : 1002u", 1001),
        ("(A != 0xfffffff1u) != (int(A) <= -16) ? 1001u : 1002u", 1002),
    ];
    for (expression, value) in cases {
        let constant = format!("{logic} const uint R = {expression};");
        let result = specialized(&constant, "data[lane] = R;", (a, b));
        assert!(has_constant(&result, value), "{expression} is not {value:#x}");
        assert_eq!(count(&result, 124..=205), 0, "{expression}: nothing is left to compute");
    }
}

#[test]
fn a_division_by_zero_is_left_alone() {
    let result = specialized("", "if (B != 0u) data[lane] = A / B;", (3, 0));
    assert_eq!(count(&result, one(STORE)), 0);
    let result = module("const uint R = A / B;", "data[lane] = R;", (3, 0));
    assert_eq!(count(&result, one(SPEC_CONSTANT_OP)), 1);
}

#[test]
fn the_dead_arm_goes_with_what_it_alone_uses() {
    let function = "uint far(uint x) { return x * 12345u; }";
    let body = "uint x = lane; if (A == 2u) x += far(x); else x += 54321u; data[lane] = x;";
    let result = specialized(function, body, (1, 1));
    assert!(has_constant(&result, 54321) && !has_constant(&result, 12345));
    assert_eq!(count(&result, one(FUNCTION)), 1);
    assert_eq!(count(&result, one(BRANCH_CONDITIONAL)), 0);
    let other = specialized(function, body, (2, 1));
    assert!(!has_constant(&other, 54321) && has_constant(&other, 12345));
    assert_eq!(count(&other, one(FUNCTION)), 2);
}

#[test]
fn a_switch_takes_its_case_or_the_default() {
    let body = "uint x = lane; switch (A) { case 1u: x *= 111u; break; case 2u: x *= 222u; case 3u: x *= 333u; break; \
                default: x *= 444u; } data[lane] = x;";
    for (a, kept) in [(1, vec![111]), (2, vec![222, 333]), (3, vec![333]), (9, vec![444])] {
        let result = specialized("", body, (a, 1));
        let found: Vec<u32> = [111, 222, 333, 444].into_iter().filter(|&v| has_constant(&result, v)).collect();
        assert_eq!(found, kept, "A = {a}");
        assert_eq!(count(&result, one(SWITCH)), 0, "A = {a}");
    }
}

/// A `break` out of an `if` needs the switch as the construct that it leaves.
#[test]
fn a_switch_that_is_broken_out_of_stays() {
    let body = "uint x = lane; switch (A) { case 1u: if (x > 5u) { x *= 111u; break; } x *= 222u; break; \
                default: x *= 444u; } data[lane] = x;";
    let result = specialized("", body, (1, 1));
    assert_eq!(count(&result, one(SWITCH)), 1);
    assert!(has_constant(&result, 111) && has_constant(&result, 222) && !has_constant(&result, 444));
}

#[test]
fn loops_stay_structured() {
    let bodies = [
        // The body leaves at once: the continue target and the back edge cannot be reached.
        "for (uint i = 0u; i < 9u; i++) { data[i] = 3u; if (A == 1u) break; data[i] = 4u; }",
        // The condition is decided, either way.
        "uint i = 0u; while (A == 1u) { data[i] = 3u; if (i++ > lane) break; }",
        "uint i = 0u; while (A == 2u) { data[i] = 3u; if (i++ > lane) break; }",
        // The branch back is decided: a loop that runs once.
        "uint i = 0u; do { data[i++] = 3u; if (i > lane) continue; data[i] = 4u; } while (A == 2u);",
        // A loop without an end.
        "for (uint i = 0u;; i++) { if (A == 1u) { if (i > lane) return; } data[i] = 3u; }",
        "for (;;) { data[lane] = 3u; if (A == 1u) return; }",
        // Both are left from a nested loop, one by what cannot happen.
        "for (uint i = 0u; i < 9u; i++) { for (uint j = 0u; j < 9u; j++) { if (A == 2u) break; if (j > i) continue; \
         switch (B) { case 1u: if (data[j] == 7u) continue; break; case 2u: return; } data[j] += 1u; } }",
        "uint x = 0u; for (uint i = 0u; i < lane; i++) { if (A == 2u) { x = 7u; continue; } x += i; } data[lane] = x;",
    ];
    for body in bodies {
        for values in [(1, 1), (2, 1), (1, 2), (2, 2)] {
            let result = specialized("", body, values);
            let again = specialize(&result, &[]).expect("understood");
            assert_eq!(result.len(), again.len(), "{body}: specialising again takes more away");
        }
    }
    let gone = specialized("", bodies[2], (1, 1));
    assert_eq!(count(&gone, one(STORE)), 0, "nothing is done: {}", gone.len());
    assert_eq!(count(&specialized("", bodies[0], (2, 1)), one(LOOP_MERGE)), 1);
}

#[test]
fn stores_that_nothing_loads_go() {
    let result =
        specialized("", "uint unused[3]; unused[lane % 3u] = data[lane]; unused[0] = 5u; data[0] = 6u;", (1, 1));
    assert_eq!((count(&result, one(LOAD)), count(&result, one(STORE))), (0, 1));
}

#[test]
fn what_is_no_module_is_not_touched() {
    assert_eq!(specialize(&[], &[]), None);
    assert_eq!(specialize(&[1, 2, 3, 4, 5, 6], &[]), None);
    let whole = specialized("", "data[lane] = A;", (1, 1));
    for len in 5..whole.len() {
        // No panic, whatever comes of it.
        specialize(&whole[..len], &[]);
    }
}

/// Words changed at random: no panic, no endless loop.
#[test]
fn broken_modules_do_no_harm() {
    let body = "uint x = lane; for (uint i = 0u; i < A; i++) { if (x > 5u) { x *= 111u; break; } switch (B) { case 1u: x++; } } \
                data[lane] = x;";
    let whole = specialized("", body, (3, 1));
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    for _ in 0..5_000 {
        let mut broken = whole.clone();
        for _ in 0..1 + next() % 3 {
            let place = 5 + next() as usize % (broken.len() - 5);
            broken[place] = if next() % 2 == 0 { next() % broken[3] } else { broken[place] ^ (1 << (next() % 32)) };
        }
        specialize(&broken, &[]);
    }
}

/// A binding, a built-in variable and a capability go with the code that needed them.
#[test]
fn bindings_and_capabilities_go_with_their_code() {
    const CAPABILITY: u32 = 17;
    const GROUP_NON_UNIFORM: u32 = 61;
    const ELECT: u32 = 333;
    let needs = |spirv: &[u32]| {
        instructions(spirv).iter().any(|(opcode, operands)| *opcode == CAPABILITY && operands[0] == GROUP_NON_UNIFORM)
    };
    let other = "layout(set = 0, binding = 7, std430) buffer Other { uint more[]; };";
    for (body, elects) in
        [("if (A == 1u && subgroupElect()) more[0] = lane;", 1), ("if (A == 1u) more[0] = gl_SubgroupSize;", 0)]
    {
        let body = format!("data[0] = lane; {body}");
        let kept = specialized(other, &body, (1, 1));
        assert_eq!((declared_bindings(&kept), needs(&kept)), (Some(vec![0, 7]), true), "{body}");
        assert_eq!(count(&kept, one(ELECT)), elects);
        let dropped = specialized(other, &body, (0, 1));
        assert_eq!((declared_bindings(&dropped), needs(&dropped)), (Some(vec![0]), false), "{body}");
        assert_eq!(count(&dropped, one(ELECT)), 0);
    }
    assert_eq!(declared_bindings(&[1, 2, 3]), None);
}
