//! Specialisation of SPIR-V before a driver sees it: specialisation constants get their values, branches on them are
//! decided, and what can no longer be reached or is not used goes. Drivers translate a module first and drop dead code
//! afterwards, if at all.
//!
//! It works on plain words with a small table of instructions; what is not in the table is left alone and taken to
//! use every id that it could mention. A module that cannot be understood is not touched.

mod bake;
mod code;
mod constants;
mod control_flow;
mod emit;
mod faces;
mod fold;
mod instruction;
mod module;
mod propagate;
mod search;
mod uses;

pub use bake::{BakedScene, BakedTable, bake};
pub use faces::BakedTriangle;

use constants::Constants;
use control_flow::{ControlFlow, Exit};
use emit::Emitter;
use instruction::op;
use module::Module;
use propagate::Facts;
use uses::Uses;

/// Decoration: Binding.
const BINDING: u32 = 33;

/// `spirv` with `values` (id and value) for its specialisation constants and without what they leave dead; constants
/// that are not named keep their defaults.
///
/// `None` if the module holds something that this cannot take apart: then specialisation is left to the driver.
pub fn specialize(spirv: &[u32], values: &[(u32, u32)]) -> Option<Vec<u32>> {
    let module = Module::read(spirv)?;
    let mut constants = Constants::read(&module, values);
    let facts = Facts::find(&module, &mut constants)?;
    let mut flows = Vec::new();
    for (f, function) in module.functions.iter().enumerate().filter(|(f, _)| facts.called[*f]) {
        flows.push((f, ControlFlow::find(&module, &facts, function)?));
    }
    let has_empty_switch = flows.iter().any(|(_, f)| f.blocks.iter().any(|(_, exit)| matches!(exit, Exit::Switch(_))));
    let selector = if has_empty_switch { constants.scalar(constants.integer_type()?, 0) } else { 0 };
    let uses = Uses::find(&module, &facts, &constants, &flows, selector);
    let words = Vec::with_capacity(spirv.len());
    let mut emitter = Emitter { module: &module, facts: &facts, constants: &constants, uses: &uses, selector, words };
    emitter.emit_globals();
    for (function, flow) in &flows {
        emitter.emit_function(*function, flow);
    }
    Some(emitter.words)
}

/// The numbers of the bindings that a module declares, of all descriptor sets, ascending. `None` if it is no module.
pub fn declared_bindings(spirv: &[u32]) -> Option<Vec<u32>> {
    let module = Module::read(spirv)?;
    let globals = module.instructions[..module.globals].iter();
    let mut numbers: Vec<u32> = globals
        .filter(|instruction| instruction.opcode == op::DECORATE)
        .filter_map(|instruction| match module.operands(instruction) {
            &[_, BINDING, number] => Some(number),
            _ => None,
        })
        .collect();
    numbers.sort_unstable();
    numbers.dedup();
    Some(numbers)
}
