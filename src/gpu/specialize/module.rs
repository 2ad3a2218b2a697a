//! A module taken apart: its instructions, its functions and their blocks.

use super::instruction::{Instruction, op};

/// Words of the header: magic number, version, generator, bound of the ids, schema.
pub(super) const HEADER: usize = 5;
const MAGIC: u32 = 0x0723_0203;
/// Upper bound of ids (SPIR-V 1.6, section 2.17, universal limits).
const MOST_IDS: usize = 0x40_0000;
/// No instruction, or no block.
pub(super) const NONE: usize = usize::MAX;

/// A basic block: the instructions from behind its label to its end.
pub(super) struct Block {
    /// Id of its label.
    pub(super) label: u32,
    /// First instruction behind the label.
    pub(super) first: usize,
    /// The last instruction.
    pub(super) terminator: usize,
    /// The merge instruction, if it is a header.
    pub(super) merge: Option<usize>,
}

/// A function: where it begins, and its blocks.
pub(super) struct Function {
    /// OpFunction.
    pub(super) first: usize,
    /// Its blocks, the entry first.
    pub(super) blocks: std::ops::Range<usize>,
}

impl Function {
    /// OpFunction and its parameters.
    pub(super) fn head(&self, module: &Module<'_>) -> std::ops::Range<usize> {
        let mut last = self.first + 1;
        while module.instructions[last].opcode == op::FUNCTION_PARAMETER {
            last += 1;
        }
        self.first..last
    }
}

/// A module taken apart.
pub(super) struct Module<'a> {
    pub(super) words: &'a [u32],
    pub(super) instructions: Vec<Instruction>,
    /// Instructions before the first function.
    pub(super) globals: usize,
    pub(super) functions: Vec<Function>,
    pub(super) blocks: Vec<Block>,
    /// By id: the instruction that defines it, or [`NONE`].
    pub(super) definition: Vec<usize>,
    /// By the id of a label: its block, or [`NONE`].
    pub(super) block_of_label: Vec<usize>,
}

impl<'a> Module<'a> {
    /// Takes a module apart; `None` if it is not one, or holds control flow that is not known.
    pub(super) fn read(words: &'a [u32]) -> Option<Self> {
        if words.len() < HEADER || words[0] != MAGIC {
            return None;
        }
        let bound = usize::try_from(words[3]).ok().filter(|&bound| bound <= MOST_IDS)?;
        let mut module = Self {
            words,
            instructions: Vec::with_capacity(words.len() / 4),
            globals: 0,
            functions: Vec::new(),
            blocks: Vec::new(),
            definition: vec![NONE; bound],
            block_of_label: vec![NONE; bound],
        };
        let mut place = HEADER;
        while place < words.len() {
            let instruction = Instruction::read(words, place, words[3])?;
            place = instruction.end();
            if instruction.result != 0 {
                module.definition[instruction.result as usize] = module.instructions.len();
            }
            module.instructions.push(instruction);
        }
        module.find_functions()?;
        module.is_understood().then_some(module)
    }

    fn find_functions(&mut self) -> Option<()> {
        let count = self.instructions.len();
        let of = |list: &[Instruction], i: usize| list.get(i).map(|x: &Instruction| x.opcode);
        self.globals = (0..count).find(|&i| self.instructions[i].opcode == op::FUNCTION).unwrap_or(count);
        let mut i = self.globals;
        while i < count {
            let (first, first_block) = (i, self.blocks.len());
            (of(&self.instructions, i)? == op::FUNCTION).then_some(())?;
            i += 1;
            while matches!(of(&self.instructions, i)?, op::FUNCTION_PARAMETER | op::LINE | op::NO_LINE) {
                i += 1;
            }
            while of(&self.instructions, i)? != op::FUNCTION_END {
                i = self.find_block(i)?;
            }
            self.functions.push(Function { first, blocks: first_block..self.blocks.len() });
            i += 1;
            while matches!(of(&self.instructions, i), Some(op::LINE | op::NO_LINE)) {
                i += 1;
            }
        }
        Some(())
    }

    /// The block whose label is instruction `i`; returns the instruction behind it.
    fn find_block(&mut self, mut i: usize) -> Option<usize> {
        while matches!(self.instructions.get(i)?.opcode, op::LINE | op::NO_LINE) {
            i += 1;
        }
        let label = self.instructions.get(i).filter(|x| x.opcode == op::LABEL)?.result;
        let (first, mut merge) = (i + 1, None);
        self.block_of_label[label as usize] = self.blocks.len();
        for (i, instruction) in self.instructions.iter().enumerate().skip(first) {
            match instruction.opcode {
                op::LOOP_MERGE | op::SELECTION_MERGE => merge = Some(i),
                op::BRANCH..=op::UNREACHABLE => {
                    self.blocks.push(Block { label, first, terminator: i, merge });
                    return Some(i + 1);
                }
                op::LABEL | op::FUNCTION | op::FUNCTION_END => return None,
                _ => {}
            }
        }
        None
    }

    /// Every id of a known instruction is defined by a known one or by an unknown one that cannot be a label; switches
    /// choose by 32 bits.
    fn is_understood(&self) -> bool {
        let wide = |i: &&Instruction| i.opcode == op::TYPE_INT && self.words[i.operands] > 32;
        let has_switch = self.instructions.iter().any(|i| i.opcode == op::SWITCH);
        !(has_switch && self.instructions.iter().any(|i| wide(&i)))
            && self.functions.iter().all(|f| !f.blocks.is_empty())
            && self.blocks.iter().all(|block| {
                let merge = block.merge.map(|i| self.instructions[i]);
                let labels = self
                    .labels(block.terminator)
                    .into_iter()
                    .chain(merge.into_iter().flat_map(|merge| merge.id_places().map(|p| self.words[p])));
                labels.into_iter().all(|label| self.block_of_label[label as usize] != NONE)
            })
    }

    /// The words of an instruction from its operand `n` on.
    pub(super) fn operands(&self, instruction: &Instruction) -> &'a [u32] {
        &self.words[instruction.operands..instruction.end()]
    }

    /// The labels that a terminator names, in its order.
    pub(super) fn labels(&self, terminator: usize) -> Vec<u32> {
        let terminator = &self.instructions[terminator];
        match terminator.opcode {
            op::BRANCH => self.operands(terminator).to_vec(),
            op::BRANCH_CONDITIONAL => self.operands(terminator)[1..3].to_vec(),
            op::SWITCH => self.operands(terminator)[1..].iter().step_by(2).copied().collect(),
            _ => Vec::new(),
        }
    }

    /// The block of a label, which [`Module::read`] saw to be there.
    pub(super) fn block(&self, label: u32) -> usize {
        self.block_of_label[label as usize]
    }

    /// The blocks that the merge instruction of a block names: the merge block, and a loop's continue target.
    pub(super) fn merge_blocks(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        let merge = self.blocks[block].merge.map(|i| self.instructions[i]);
        merge.into_iter().flat_map(|merge| merge.id_places().map(|place| self.block(self.words[place])))
    }

    /// Whether the block is the header of a loop.
    pub(super) fn is_loop(&self, block: usize) -> bool {
        self.blocks[block].merge.is_some_and(|i| self.instructions[i].opcode == op::LOOP_MERGE)
    }
}

/// Blocks of a function in an order in which those that dominate stand first: the reverse postorder of a walk that takes
/// merge blocks and continue targets before successors, which leaves them behind their constructs.
///
/// `next` lists what follows a block, in the order to be visited.
pub(super) fn structured_order(entry: usize, count: usize, mut next: impl FnMut(usize) -> Vec<usize>) -> Vec<usize> {
    let mut seen = vec![false; count];
    let mut order = Vec::new();
    let mut stack = vec![(entry, next(entry).into_iter())];
    seen[entry] = true;
    while let Some((block, rest)) = stack.last_mut() {
        let block = *block;
        match rest.find(|&b| !seen[b]) {
            Some(b) => {
                seen[b] = true;
                stack.push((b, next(b).into_iter()));
            }
            None => {
                order.push(block);
                stack.pop();
            }
        }
    }
    order.reverse();
    order
}
