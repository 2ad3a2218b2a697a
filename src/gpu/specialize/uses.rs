//! What is used of the blocks that are left: what acts, what that needs, and so on.

use std::collections::HashMap;

use super::constants::Constants;
use super::control_flow::{ControlFlow, Exit};
use super::instruction::{Instruction, op};
use super::module::{Module, NONE};
use super::propagate::Facts;

/// Storage class: Function.
const FUNCTION_STORAGE: u32 = 7;
/// Decoration: BuiltIn.
const BUILT_IN: u32 = 11;
/// Capability: GroupNonUniform, which what follows needs.
const GROUP_NON_UNIFORM: u32 = 61;
/// OpGroupNonUniformElect and its kin.
const SUBGROUP_OPERATIONS: std::ops::RangeInclusive<u16> = op::GROUP_NON_UNIFORM_ELECT..=366;
/// Built-ins: SubgroupSize and its kin.
const SUBGROUP_BUILT_INS: std::ops::RangeInclusive<u32> = 36..=41;

/// Marks what is used.
pub(super) struct Uses<'a> {
    module: &'a Module<'a>,
    facts: &'a Facts,
    constants: &'a Constants,
    /// By instruction: it is global, or in a block that is left.
    left: Vec<bool>,
    /// By instruction.
    used: Vec<bool>,
    /// By added constant.
    pub(super) added: Vec<bool>,
    /// Stores by the variable of a function that they write: they are used if it is.
    stores: HashMap<u32, Vec<usize>>,
    pending: Vec<usize>,
}

impl<'a> Uses<'a> {
    /// Marks from what acts on, in the blocks that are left.
    pub(super) fn find(
        module: &'a Module<'a>,
        facts: &'a Facts,
        constants: &'a Constants,
        flows: &[(usize, ControlFlow)],
        selector: u32,
    ) -> Self {
        let mut this = Self {
            module,
            facts,
            constants,
            left: vec![false; module.instructions.len()],
            used: vec![false; module.instructions.len()],
            added: vec![false; constants.added.len()],
            stores: HashMap::new(),
            pending: Vec::new(),
        };
        this.left[..module.globals].fill(true);
        for (function, flow) in flows {
            let head = module.functions[*function].head(module);
            this.left[head].fill(true);
            for &(b, exit) in &flow.blocks {
                let last =
                    if exit == Exit::Kept { module.blocks[b].terminator + 1 } else { module.blocks[b].terminator };
                let is_whole = !matches!(exit, Exit::Unreachable | Exit::Continue(_));
                this.left[module.blocks[b].first..last].fill(is_whole);
            }
        }
        for i in 0..module.globals {
            this.mark_global(i);
        }
        for i in module.globals..module.instructions.len() {
            this.mark_local(i);
        }
        if selector != 0 {
            this.mark_id(selector);
        }
        while let Some(i) = this.pending.pop() {
            this.mark_operands(i);
        }
        if !this.needs_subgroups() {
            for (i, instruction) in module.instructions[..module.globals].iter().enumerate() {
                this.used[i] &= instruction.opcode != op::CAPABILITY
                    || module.operands(instruction) != [GROUP_NON_UNIFORM].as_slice();
            }
        }
        this
    }

    /// Whether anything that is left asks which lanes run together.
    fn needs_subgroups(&self) -> bool {
        self.module.instructions.iter().enumerate().any(|(i, instruction)| {
            match (instruction.opcode, self.module.operands(instruction)) {
                (op::DECORATE, &[target, BUILT_IN, which]) => {
                    SUBGROUP_BUILT_INS.contains(&which) && self.is_id_used(target)
                }
                (opcode, _) => SUBGROUP_OPERATIONS.contains(&opcode) && self.used[i],
            }
        })
    }

    fn mark_global(&mut self, i: usize) {
        let instruction = &self.module.instructions[i];
        match (instruction.opcode, self.module.operands(instruction)) {
            // What names an id does not use it; an object that is built in is there for the decoration.
            (op::DECORATE, &[target, BUILT_IN, _]) if self.is_constant(target) => self.mark_id(target),
            (op::DECORATE | op::MEMBER_DECORATE | op::NAME | op::MEMBER_NAME | op::TYPE_FORWARD_POINTER, _) => {}
            (op::LINE | op::NO_LINE | op::SOURCE | op::SOURCE_EXTENSION | op::ENTRY_POINT, _) => {}
            _ if instruction.pure => {}
            _ => self.mark(i),
        }
    }

    fn is_constant(&self, id: u32) -> bool {
        let place = self.module.definition.get(id as usize).copied().unwrap_or(NONE);
        self.module
            .instructions
            .get(place)
            .is_some_and(|i| (op::CONSTANT_TRUE..=op::SPEC_CONSTANT_OP).contains(&i.opcode))
    }

    fn mark_local(&mut self, i: usize) {
        let instruction = &self.module.instructions[i];
        match (instruction.opcode, self.local_variable(instruction)) {
            (op::STORE, Some(variable)) => self.stores.entry(variable).or_default().push(i),
            (op::LOOP_MERGE | op::SELECTION_MERGE | op::LINE | op::NO_LINE, _) => {}
            (op::FUNCTION_PARAMETER, _) => self.mark(i),
            _ if instruction.pure => {}
            _ => self.mark(i),
        }
    }

    /// The variable of a function that a store writes, if nothing but access chains lies between.
    fn local_variable(&self, store: &Instruction) -> Option<u32> {
        if store.opcode != op::STORE || store.is_unknown() {
            return None;
        }
        let mut pointer = self.module.operands(store)[0];
        let mut user = NONE;
        loop {
            // What is used stands before its use, so this ends.
            let place = self.module.definition[pointer as usize];
            let definition = self.module.instructions.get(place).filter(|_| place < user)?;
            let operands = self.module.operands(definition);
            match definition.opcode {
                op::VARIABLE => return (operands[0] == FUNCTION_STORAGE).then_some(pointer),
                op::ACCESS_CHAIN | op::IN_BOUNDS_ACCESS_CHAIN => (pointer, user) = (operands[0], place),
                _ => return None,
            }
        }
    }

    fn mark(&mut self, i: usize) {
        if self.left.get(i) == Some(&true) && !std::mem::replace(&mut self.used[i], true) {
            self.pending.push(i);
        }
    }

    fn mark_id(&mut self, id: u32) {
        match self.module.definition.get(id as usize) {
            Some(&i) => self.mark(i),
            None => {
                let index = id as usize - self.module.definition.len();
                self.added[index] = true;
                self.mark_id(self.constants.added[index].1);
            }
        }
    }

    /// Whether an instruction is used.
    pub(super) fn is_used(&self, i: usize) -> bool {
        self.used.get(i) == Some(&true)
    }

    /// Whether what defines an id is used.
    pub(super) fn is_id_used(&self, id: u32) -> bool {
        self.module.definition.get(id as usize).is_some_and(|&i| self.is_used(i))
    }

    /// The block that an instruction lies in: blocks stand in the order of their instructions.
    fn block_of(&self, i: usize) -> usize {
        self.module.blocks.partition_point(|block| block.terminator < i)
    }

    fn mark_operands(&mut self, i: usize) {
        let instruction = self.module.instructions[i];
        if instruction.result_type != 0 {
            self.mark_id(instruction.result_type);
        }
        match instruction.opcode {
            op::LABEL | op::BRANCH => {}
            // It becomes its value.
            op::SPEC_CONSTANT_OP if self.constants.bits(instruction.result).is_some() => {}
            op::BRANCH_CONDITIONAL | op::SWITCH => {
                self.mark_id(self.facts.of(self.module.operands(&instruction)[0]));
            }
            op::PHI => {
                for pair in self.module.operands(&instruction).chunks_exact(2) {
                    // A value that cannot be reached is unknown, and so is its block.
                    if self.facts.is_taken(self.module.block_of_label[pair[1] as usize], self.block_of(i)) {
                        self.mark_id(self.facts.of(pair[0]));
                    }
                }
            }
            op::VARIABLE => {
                self.stores.remove(&instruction.result).into_iter().flatten().for_each(|store| self.mark(store));
                instruction.id_places().for_each(|place| self.mark_id(self.module.words[place]));
            }
            _ if instruction.is_unknown() => {
                let bound = self.module.words[3];
                let words = &self.module.words[instruction.start + 1..instruction.end()];
                words.iter().filter(|&&word| word < bound).for_each(|&word| self.mark_id(word));
            }
            _ => instruction
                .id_places()
                .for_each(|place| self.mark_id(self.facts.operand(&instruction, self.module.words[place]))),
        }
    }
}
