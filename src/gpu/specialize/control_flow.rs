//! The control flow that is left once branches on constants are decided, kept structured (SPIR-V 1.6, section 2.11).

use super::instruction::op;
use super::module::{Function, Module, NONE, structured_order};
use super::propagate::Facts;

/// How a block ends.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Exit {
    /// As it did.
    Kept,
    /// By a branch to this block; a merge instruction is kept.
    Branch(usize),
    /// By a branch to this block; the merge instruction goes.
    Straight(usize),
    /// By a switch with this block as its only target: its merge block is broken out to.
    Switch(usize),
    /// It cannot be reached and is there as a merge block.
    Unreachable,
    /// It cannot be reached and is there as the continue target of the loop with this header.
    Continue(usize),
}

/// The blocks that are left of a function.
pub(super) struct ControlFlow {
    /// Each with its end, in their order.
    pub(super) blocks: Vec<(usize, Exit)>,
    /// Headers of loops whose continue targets cannot be reached.
    continues: Vec<usize>,
}

impl ControlFlow {
    /// `None` where a loop would lose its back edge.
    pub(super) fn find(module: &Module<'_>, facts: &Facts, function: &Function) -> Option<Self> {
        // Blocks that headers name, too, even if they cannot be reached.
        let order = structured_order(function.blocks.start, module.blocks.len(), |b| {
            let merges = module.merge_blocks(b).filter(|_| facts.reached[b]);
            merges.chain(facts.next[b].iter().rev().copied()).collect()
        });
        let mut exits = decide(module, facts, &order);
        for &b in order.iter().filter(|&&b| facts.reached[b]) {
            if matches!(exits[b], Exit::Straight(_)) {
                continue;
            }
            for (i, target) in module.merge_blocks(b).enumerate().filter(|(_, target)| !facts.reached[*target]) {
                exits[target] = if i == 0 { Exit::Unreachable } else { Exit::Continue(b) };
            }
        }
        let is_left = |&b: &usize| facts.reached[b] || matches!(exits[b], Exit::Unreachable | Exit::Continue(_));
        let blocks = order.iter().copied().filter(is_left).map(|b| (b, exits[b])).collect::<Vec<_>>();
        let continues =
            blocks.iter().filter_map(|(_, e)| if let Exit::Continue(header) = e { Some(*header) } else { None });
        let this = Self { continues: continues.collect(), blocks };
        this.loops_are_whole(module, facts).then_some(this)
    }

    /// Whether the continue target of loop `header` cannot be reached, so that a stand-in branches back.
    pub(super) fn replaces_continue(&self, header: usize) -> bool {
        self.continues.contains(&header)
    }

    /// Every loop has its one back edge still, and there is none to another block.
    fn loops_are_whole(&self, module: &Module<'_>, facts: &Facts) -> bool {
        let mut place = vec![NONE; module.blocks.len()];
        let mut back_edges = vec![0; module.blocks.len()];
        for (i, &(b, exit)) in self.blocks.iter().enumerate() {
            place[b] = i;
            let header = if let Exit::Continue(header) = exit { Some(header) } else { None };
            for &target in facts.next[b].iter().chain(&header) {
                back_edges[target] += usize::from(place[target] != NONE);
            }
        }
        self.blocks.iter().all(|&(b, _)| !facts.reached[b] || back_edges[b] == usize::from(module.is_loop(b)))
    }
}

/// How the blocks of `order` end: by block.
fn decide(module: &Module<'_>, facts: &Facts, order: &[usize]) -> Vec<Exit> {
    let mut exits = vec![Exit::Kept; module.blocks.len()];
    for &b in order {
        let terminator = &module.instructions[module.blocks[b].terminator];
        if let (&[target], op::BRANCH_CONDITIONAL | op::SWITCH) = (facts.next[b].as_slice(), terminator.opcode) {
            exits[b] = Exit::Branch(target);
        }
    }
    let nest = Nest::find(module, facts, order);
    // Inner constructs first: what they drop no longer stands between a block and an outer construct.
    for &b in order.iter().rev() {
        let merge = module.merge_blocks(b).next().filter(|_| !module.is_loop(b));
        if let (Exit::Branch(target), Some(merge)) = (exits[b], merge) {
            let broken_out_of = nest.previous[merge].iter().any(|&from| nest.breaks(module, facts, &exits, from, b));
            exits[b] = if broken_out_of { Exit::Switch(target) } else { Exit::Straight(target) };
        }
    }
    exits
}

/// The constructs that blocks lie in.
struct Nest {
    /// By block: the header of the innermost construct around it, or [`NONE`].
    around: Vec<usize>,
    /// By block: those that can branch to it.
    previous: Vec<Vec<usize>>,
}

impl Nest {
    fn find(module: &Module<'_>, facts: &Facts, order: &[usize]) -> Self {
        let count = module.blocks.len();
        let mut this = Self { around: vec![NONE; count], previous: vec![Vec::new(); count] };
        let mut known = vec![false; count];
        known[order[0]] = true;
        for &b in order.iter().filter(|&&b| facts.reached[b]) {
            for (i, target) in module.merge_blocks(b).enumerate() {
                this.around[target] = if i == 0 { this.around[b] } else { b };
                known[target] = true;
            }
            for &target in &facts.next[b] {
                this.previous[target].push(b);
                if !std::mem::replace(&mut known[target], true) {
                    this.around[target] = if module.blocks[b].merge.is_some() { b } else { this.around[b] };
                }
            }
        }
        this
    }

    /// Whether the branch of `from` to the merge block of selection `header` needs that selection: it leaves a construct
    /// within it, or is one way of a conditional branch that is no header.
    fn breaks(&self, module: &Module<'_>, facts: &Facts, exits: &[Exit], from: usize, header: usize) -> bool {
        let stands = |b: usize| module.blocks[b].merge.is_some() && !matches!(exits[b], Exit::Straight(_));
        if from == header {
            return false;
        }
        if stands(from) || facts.next[from].len() > 1 {
            return true;
        }
        let mut construct = self.around[from];
        // No deeper than there are blocks, even in a module that is not structured.
        for _ in 0..self.around.len() {
            if construct == NONE || construct == header || stands(construct) {
                break;
            }
            construct = self.around[construct];
        }
        construct != header
    }
}
