//! Conditional constant propagation (Wegman and Zadeck, "Constant propagation with conditional branches", 1991), with
//! copies: every value gets a representative, which is a constant, another value that it equals, or itself.
//!
//! Blocks count as reached once an edge to them can be taken; a phi looks only at such edges. Starting from "nothing is
//! reached, nothing is known" the representatives are swept in the order of the blocks until none changes.

use super::constants::Constants;
use super::fold::fold;
use super::instruction::{Instruction, op};
use super::module::{Block, Module, structured_order};

/// More sweeps than this are a sign of a module that no compiler writes.
const MOST_SWEEPS: usize = 100;

/// What can be reached, and what every value is.
pub(super) struct Facts {
    /// By id: its representative; 0 while nothing is known.
    pub(super) representative: Vec<u32>,
    /// By block: it can be reached.
    pub(super) reached: Vec<bool>,
    /// By function: it can be called.
    pub(super) called: Vec<bool>,
    /// By block: the blocks that it can branch to, each once; none if it cannot be reached.
    pub(super) next: Vec<Vec<usize>>,
    /// By block: its place in the order of its function.
    place: Vec<usize>,
}

impl Facts {
    /// Propagates from the entry points on.
    pub(super) fn find(module: &Module<'_>, constants: &mut Constants) -> Option<Self> {
        let count = module.blocks.len();
        let mut facts = Self {
            representative: constants.representatives(module),
            reached: vec![false; count],
            called: vec![false; module.functions.len()],
            next: vec![Vec::new(); count],
            place: vec![usize::MAX; count],
        };
        let orders: Vec<Vec<usize>> = module.functions.iter().map(|f| facts.order(module, f.blocks.start)).collect();
        for i in module.instructions[..module.globals].iter().filter(|i| i.opcode == op::ENTRY_POINT) {
            facts.call(module, *module.words.get(i.start + 2).filter(|_| i.len > 2)?);
        }
        for _ in 0..MOST_SWEEPS {
            let mut changed = false;
            for (function, order) in orders.iter().enumerate() {
                if facts.called[function] {
                    changed |= facts.sweep(module, constants, order);
                }
            }
            if !changed {
                return facts.is_complete(module).then_some(facts);
            }
        }
        None
    }

    /// Every value that can be reached is known.
    fn is_complete(&self, module: &Module<'_>) -> bool {
        let known = |block: &Block| {
            let mut values = module.instructions[block.first..block.terminator].iter().map(|i| i.result);
            values.all(|id| id == 0 || self.of(id) != 0)
        };
        module.blocks.iter().zip(&self.reached).all(|(block, &reached)| !reached || known(block))
    }

    fn order(&mut self, module: &Module<'_>, entry: usize) -> Vec<usize> {
        let order = structured_order(entry, module.blocks.len(), |b| {
            let after = module.labels(module.blocks[b].terminator).into_iter().rev().map(|label| module.block(label));
            module.merge_blocks(b).chain(after).collect()
        });
        for (place, &block) in order.iter().enumerate() {
            self.place[block] = place;
        }
        order
    }

    fn call(&mut self, module: &Module<'_>, function: u32) -> bool {
        let called = module.functions.iter().position(|f| module.instructions[f.first].result == function);
        called.is_some_and(|f| {
            let entry = module.functions[f].blocks.start;
            !std::mem::replace(&mut self.called[f], true) | !std::mem::replace(&mut self.reached[entry], true)
        })
    }

    fn sweep(&mut self, module: &Module<'_>, constants: &mut Constants, order: &[usize]) -> bool {
        let mut changed = false;
        for &b in order {
            if !self.reached[b] {
                continue;
            }
            let block = &module.blocks[b];
            for instruction in &module.instructions[block.first..block.terminator] {
                if instruction.opcode == op::FUNCTION_CALL {
                    changed |= self.call(module, module.operands(instruction)[0]);
                }
                if instruction.result != 0 {
                    let value = self.evaluate(module, constants, instruction, b);
                    changed |= std::mem::replace(&mut self.representative[instruction.result as usize], value) != value;
                }
            }
            let mut next = self.successors(module, constants, b);
            next.sort_unstable();
            next.dedup();
            for &target in &next {
                changed |= !std::mem::replace(&mut self.reached[target], true);
            }
            self.next[b] = next;
        }
        changed
    }

    /// The representative of an id; 0 while nothing is known.
    pub(super) fn of(&self, id: u32) -> u32 {
        self.representative[id as usize]
    }

    /// What stands for operand `id` of an instruction: types are left as they are.
    pub(super) fn operand(&self, instruction: &Instruction, id: u32) -> u32 {
        match (instruction.is_type(), self.of(id)) {
            (true, _) | (_, 0) => id,
            (false, representative) => representative,
        }
    }

    /// The targets that a block can branch to; none while its condition is not known.
    ///
    /// A branch back to the header of a loop is never decided: each loop keeps its one back edge.
    fn successors(&self, module: &Module<'_>, constants: &Constants, b: usize) -> Vec<usize> {
        let terminator = &module.instructions[module.blocks[b].terminator];
        let all: Vec<usize> = module.labels(module.blocks[b].terminator).into_iter().map(|l| module.block(l)).collect();
        if !matches!(terminator.opcode, op::BRANCH_CONDITIONAL | op::SWITCH)
            || all.iter().any(|&next| module.is_loop(next) && self.place[next] <= self.place[b])
        {
            return all;
        }
        let operands = module.operands(terminator);
        match (self.of(operands[0]), constants.bits(self.of(operands[0]))) {
            (0, _) => Vec::new(),
            (_, None) => all,
            (_, Some(bits)) if terminator.opcode == op::BRANCH_CONDITIONAL => vec![all[usize::from(bits == 0)]],
            (_, Some(bits)) => {
                let case = operands[2..].chunks_exact(2).position(|case| case[0] == bits);
                vec![all[case.map_or(0, |i| i + 1)]]
            }
        }
    }

    fn evaluate(&self, module: &Module<'_>, constants: &mut Constants, i: &Instruction, b: usize) -> u32 {
        let operands = module.operands(i);
        match i.opcode {
            op::PHI => self.phi(module, i, b),
            op::COPY_OBJECT => self.of(operands[0]),
            op::SELECT => match (self.of(operands[0]), self.of(operands[1]), self.of(operands[2])) {
                (0, ..) => 0,
                (_, a, b) if a == b => a,
                (c, a, b) => constants.bits(c).map_or(i.result, |bits| if bits != 0 { a } else { b }),
            },
            op::COMPOSITE_EXTRACT => {
                let start = self.of(operands[0]);
                if start == 0 { 0 } else { constants.extract(module, start, &operands[1..]).unwrap_or(i.result) }
            }
            op::LOGICAL_AND | op::LOGICAL_OR => self.logical(module, constants, i),
            _ if i.pure && constants.is_scalar(i.result_type) && (109..=205).contains(&i.opcode) => {
                let values: Vec<u32> = operands.iter().map(|&id| self.of(id)).collect();
                if values.contains(&0) {
                    return 0;
                }
                let bits: Option<Vec<u32>> = values.iter().map(|&value| constants.bits(value)).collect();
                let folded = bits.and_then(|bits| fold(i.opcode, &bits));
                folded.map_or(i.result, |bits| constants.scalar(i.result_type, bits))
            }
            _ => i.result,
        }
    }

    /// What all edges that can be taken bring, if it is the same.
    fn phi(&self, module: &Module<'_>, i: &Instruction, b: usize) -> u32 {
        let mut value = 0;
        for pair in module.operands(i).chunks_exact(2) {
            let from = module.block_of_label[pair[1] as usize];
            let brought = self.of(pair[0]);
            if !self.is_taken(from, b) || brought == 0 || brought == i.result || brought == value {
                continue;
            }
            if value != 0 {
                return i.result;
            }
            value = brought;
        }
        value
    }

    /// Whether the edge between two blocks can be taken.
    pub(super) fn is_taken(&self, from: usize, to: usize) -> bool {
        self.next.get(from).is_some_and(|next| next.contains(&to))
    }

    /// One side decides, or leaves it to the other.
    fn logical(&self, module: &Module<'_>, constants: &mut Constants, i: &Instruction) -> u32 {
        let operands = module.operands(i);
        let (a, b) = (self.of(operands[0]), self.of(operands[1]));
        let decides = u32::from(i.opcode == op::LOGICAL_OR);
        let sides = [(a, b), (b, a)].map(|(one, other)| constants.bits(one).map(|bits| (bits, other)));
        match sides {
            _ if !constants.is_scalar(i.result_type) => i.result,
            [Some((bits, _)), _] | [_, Some((bits, _))] if bits == decides => constants.scalar(i.result_type, bits),
            [Some((_, other)), _] | [_, Some((_, other))] => other,
            _ if a == 0 || b == 0 => 0,
            _ => i.result,
        }
    }
}
