//! The module that is left.

use super::constants::Constants;
use super::control_flow::{ControlFlow, Exit};
use super::instruction::{Instruction, op};
use super::module::{HEADER, Module};
use super::propagate::Facts;
use super::uses::Uses;

/// Decoration: SpecId.
const SPEC_ID: u32 = 1;

/// Writes what is left of a module.
pub(super) struct Emitter<'a> {
    pub(super) module: &'a Module<'a>,
    pub(super) facts: &'a Facts,
    pub(super) constants: &'a Constants,
    pub(super) uses: &'a Uses<'a>,
    /// What a switch without a choice selects by.
    pub(super) selector: u32,
    pub(super) words: Vec<u32>,
}

pub(super) fn head(opcode: u16, len: usize) -> u32 {
    (u32::try_from(len).unwrap_or(u32::MAX) << 16) | u32::from(opcode)
}

impl Emitter<'_> {
    /// Header and everything before the functions.
    pub(super) fn emit_globals(&mut self) {
        self.words.extend_from_slice(&self.module.words[..HEADER]);
        self.words[3] = self.constants.bound();
        for i in 0..self.module.globals {
            self.emit_global(i);
        }
        let added = self.constants.added.iter().zip(&self.uses.added).filter(|(_, used)| **used);
        for (&(id, ty, bits), _) in added {
            self.words.extend(self.constants.words(id, ty, bits));
        }
    }

    fn emit_global(&mut self, i: usize) {
        let instruction = &self.module.instructions[i];
        match (instruction.opcode, self.module.operands(instruction)) {
            (op::DECORATE, &[_, SPEC_ID, _]) => {}
            (op::DECORATE | op::MEMBER_DECORATE | op::NAME | op::MEMBER_NAME | op::TYPE_FORWARD_POINTER, words) => {
                if words.first().is_some_and(|&target| self.uses.is_id_used(target)) {
                    self.copy(instruction);
                }
            }
            (op::ENTRY_POINT, words) => self.emit_entry_point(words),
            _ if !self.uses.is_used(i) => {}
            (op::SPEC_CONSTANT_TRUE..=op::SPEC_CONSTANT_OP, _) => self.emit_frozen(instruction),
            _ => self.copy(instruction),
        }
    }

    /// Only the variables that are left are part of the interface.
    fn emit_entry_point(&mut self, words: &[u32]) {
        // Execution model, function, and a name that ends with a word whose last byte is 0.
        let name_end = (2..words.len()).find(|&i| words[i] >> 24 == 0).map_or(words.len(), |i| i + 1);
        let interface = words[name_end..].iter().copied().filter(|&id| self.uses.is_id_used(id));
        let kept: Vec<u32> = words[..name_end].iter().copied().chain(interface).collect();
        self.words.push(head(op::ENTRY_POINT, kept.len() + 1));
        self.words.extend(kept);
    }

    fn emit_frozen(&mut self, instruction: &Instruction) {
        let (id, ty) = (instruction.result, instruction.result_type);
        match self.constants.bits(id) {
            Some(bits) => self.words.extend(self.constants.words(id, ty, bits)),
            None => {
                let start = self.words.len();
                self.copy(instruction);
                match instruction.opcode {
                    op::SPEC_CONSTANT => self.words[start] = head(op::CONSTANT, instruction.len),
                    op::SPEC_CONSTANT_COMPOSITE => self.words[start] = head(op::CONSTANT_COMPOSITE, instruction.len),
                    _ => {}
                }
            }
        }
    }

    /// Copies an instruction with what stands for its operands.
    fn copy(&mut self, instruction: &Instruction) {
        let start = self.words.len();
        self.words.extend_from_slice(&self.module.words[instruction.start..instruction.end()]);
        for place in instruction.id_places() {
            let operand = self.facts.operand(instruction, self.module.words[place]);
            self.words[start + place - instruction.start] = operand;
        }
    }

    /// A function with the blocks that are left of it.
    pub(super) fn emit_function(&mut self, function: usize, flow: &ControlFlow) {
        let function = &self.module.functions[function];
        for i in function.head(self.module) {
            self.copy(&self.module.instructions[i]);
        }
        for &(b, exit) in &flow.blocks {
            self.words.extend([head(op::LABEL, 2), self.module.blocks[b].label]);
            if !matches!(exit, Exit::Unreachable | Exit::Continue(_)) {
                self.emit_body(b, flow);
            }
            self.emit_exit(b, exit);
        }
        self.words.push(head(op::FUNCTION_END, 1));
    }

    fn emit_body(&mut self, b: usize, flow: &ControlFlow) {
        let block = &self.module.blocks[b];
        for i in block.first..block.terminator {
            let instruction = &self.module.instructions[i];
            if !self.uses.is_used(i) {
                continue;
            }
            if instruction.opcode == op::PHI {
                self.emit_phi(instruction, b, flow);
            } else {
                self.copy(instruction);
            }
        }
    }

    /// The edges that are left; along one from a continue target that cannot be reached the value stays.
    fn emit_phi(&mut self, instruction: &Instruction, b: usize, flow: &ControlFlow) {
        let mut pairs = Vec::new();
        for pair in self.module.operands(instruction).chunks_exact(2) {
            if self.facts.is_taken(self.module.block_of_label[pair[1] as usize], b) {
                pairs.extend([self.facts.operand(instruction, pair[0]), pair[1]]);
            }
        }
        if let Some(target) = self.module.merge_blocks(b).nth(1).filter(|_| flow.replaces_continue(b)) {
            pairs.extend([instruction.result, self.module.blocks[target].label]);
        }
        self.words.extend([head(op::PHI, pairs.len() + 3), instruction.result_type, instruction.result]);
        self.words.extend(pairs);
    }

    fn emit_exit(&mut self, b: usize, exit: Exit) {
        let block = &self.module.blocks[b];
        if let (Some(merge), Exit::Kept | Exit::Branch(_) | Exit::Switch(_)) = (block.merge, exit) {
            self.copy(&self.module.instructions[merge]);
        }
        match exit {
            Exit::Kept => self.copy(&self.module.instructions[block.terminator]),
            Exit::Branch(target) | Exit::Straight(target) | Exit::Continue(target) => {
                self.words.extend([head(op::BRANCH, 2), self.module.blocks[target].label]);
            }
            Exit::Switch(target) => {
                self.words.extend([head(op::SWITCH, 3), self.selector, self.module.blocks[target].label]);
            }
            Exit::Unreachable => self.words.push(head(op::UNREACHABLE, 1)),
        }
    }
}
