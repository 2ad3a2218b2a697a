//! The constants of a module: those that stand in it, specialisation constants with their values put in, and new ones.

use std::collections::HashMap;

use super::instruction::{Instruction, op};
use super::module::{Module, NONE};

/// Decorations: SpecId.
const SPEC_ID: u32 = 1;

/// Constants by their ids, each value of 32 bits and each composite once.
pub(super) struct Constants {
    /// By id: the bits of a scalar constant (booleans are 0 and 1); new constants are behind the module's own ids.
    bits: Vec<Option<u32>>,
    /// By id of the module: the first constant of the same type and value, or itself.
    canonical: Vec<u32>,
    /// Scalar types of 32 bits, and whether it is the boolean one.
    scalar_types: HashMap<u32, bool>,
    integer_type: Option<u32>,
    by_value: HashMap<(u32, u32), u32>,
    /// Constants to be added: id, type, bits.
    pub(super) added: Vec<(u32, u32, u32)>,
}

impl Constants {
    /// Reads the constants of a module, with `values` by the ids of specialisation constants.
    pub(super) fn read(module: &Module<'_>, values: &[(u32, u32)]) -> Self {
        let bound = module.words[3];
        let mut this = Self {
            bits: vec![None; bound as usize],
            canonical: (0..bound).collect(),
            scalar_types: HashMap::new(),
            integer_type: None,
            by_value: HashMap::new(),
            added: Vec::new(),
        };
        let globals = &module.instructions[..module.globals];
        // Decorations stand before constants.
        let mut given = HashMap::new();
        for instruction in globals {
            let is_integer = instruction.opcode == op::TYPE_INT;
            match (instruction.opcode, module.operands(instruction)) {
                (op::DECORATE, &[target, SPEC_ID, id]) => {
                    given.extend(values.iter().find(|value| value.0 == id).map(|value| (target, value.1)));
                }
                (op::TYPE_BOOL, _) => drop(this.scalar_types.insert(instruction.result, true)),
                (op::TYPE_INT | op::TYPE_FLOAT, &[32, ..]) => {
                    this.scalar_types.insert(instruction.result, false);
                    this.integer_type = this.integer_type.or(is_integer.then_some(instruction.result));
                }
                (op::SPEC_CONSTANT_OP, &[opcode, ref operands @ ..]) => {
                    this.spec_constant_op(module, instruction, opcode, operands);
                }
                (_, operands) => {
                    if let Some(bits) = this.scalar_bits(instruction, operands, &given) {
                        this.define(instruction.result, instruction.result_type, bits);
                    }
                }
            }
        }
        this
    }

    fn scalar_bits(&self, i: &Instruction, operands: &[u32], given: &HashMap<u32, u32>) -> Option<u32> {
        let is_bool = *self.scalar_types.get(&i.result_type)?;
        let fallback = match i.opcode {
            op::CONSTANT_TRUE | op::SPEC_CONSTANT_TRUE => 1,
            op::CONSTANT_FALSE | op::SPEC_CONSTANT_FALSE | op::CONSTANT_NULL => 0,
            op::CONSTANT | op::SPEC_CONSTANT => *operands.first()?,
            _ => return None,
        };
        let value = given.get(&i.result).copied().unwrap_or(fallback);
        Some(if is_bool { u32::from(value != 0) } else { value })
    }

    /// Folds an OpSpecConstantOp, if all its operands are known.
    fn spec_constant_op(&mut self, module: &Module<'_>, i: &Instruction, opcode: u32, operands: &[u32]) {
        let (id, ty) = (i.result, i.result_type);
        let known = |&id: &u32| self.canonical.get(id as usize).copied();
        if u32::from(op::COMPOSITE_EXTRACT) == opcode && !operands.is_empty() {
            if let Some(part) = known(&operands[0]).and_then(|start| self.extract(module, start, &operands[1..])) {
                self.canonical[id as usize] = part;
                self.bits[id as usize] = self.bits(part);
            }
            return;
        }
        let bits: Option<Vec<u32>> = operands.iter().map(|id| known(id).and_then(|id| self.bits(id))).collect();
        let folded = bits.and_then(|bits| super::fold::fold(u16::try_from(opcode).ok()?, &bits));
        if let Some(bits) = folded.filter(|_| self.is_scalar(ty)) {
            self.define(id, ty, bits);
        }
    }

    fn define(&mut self, id: u32, ty: u32, bits: u32) {
        self.bits[id as usize] = Some(bits);
        self.canonical[id as usize] = *self.by_value.entry((ty, bits)).or_insert(id);
    }

    /// The first representatives: constants stand for themselves or for an earlier one, nothing is known of values in
    /// functions, and the rest stands for itself.
    pub(super) fn representatives(&self, module: &Module<'_>) -> Vec<u32> {
        let mut all = self.canonical.clone();
        for block in &module.blocks {
            for i in &module.instructions[block.first..block.terminator] {
                if i.result != 0 {
                    all[i.result as usize] = 0;
                }
            }
        }
        all
    }

    /// The bits of a scalar constant of 32 bits or a boolean one.
    pub(super) fn bits(&self, id: u32) -> Option<u32> {
        self.bits.get(id as usize).copied().flatten()
    }

    /// Whether it is the boolean type or one of 32 bits.
    pub(super) fn is_scalar(&self, ty: u32) -> bool {
        self.scalar_types.contains_key(&ty)
    }

    /// The constant of a type and value, added if there is none.
    pub(super) fn scalar(&mut self, ty: u32, bits: u32) -> u32 {
        let next = u32::try_from(self.bits.len()).unwrap_or(u32::MAX);
        let id = *self.by_value.entry((ty, bits)).or_insert(next);
        if id == next {
            self.bits.push(Some(bits));
            self.added.push((id, ty, bits));
        }
        id
    }

    /// A part of a constant composite by its indices.
    pub(super) fn extract(&self, module: &Module<'_>, start: u32, indices: &[u32]) -> Option<u32> {
        indices.iter().try_fold(start, |id, &index| {
            let place = *module.definition.get(id as usize).filter(|&&place| place != NONE)?;
            let composite = &module.instructions[place];
            let is_composite = matches!(composite.opcode, op::CONSTANT_COMPOSITE | op::SPEC_CONSTANT_COMPOSITE);
            let part = module.operands(composite).get(index as usize).filter(|_| is_composite)?;
            Some(self.canonical[*part as usize])
        })
    }

    /// The words that define a scalar constant.
    pub(super) fn words(&self, id: u32, ty: u32, bits: u32) -> Vec<u32> {
        let head = |opcode: u16, len: u32| len << 16 | u32::from(opcode);
        match (self.scalar_types.get(&ty), bits) {
            (Some(true), 0) => vec![head(op::CONSTANT_FALSE, 3), ty, id],
            (Some(true), _) => vec![head(op::CONSTANT_TRUE, 3), ty, id],
            _ => vec![head(op::CONSTANT, 4), ty, id, bits],
        }
    }

    /// A type of integers of 32 bits.
    pub(super) fn integer_type(&self) -> Option<u32> {
        self.integer_type
    }

    /// The first id that is free.
    pub(super) fn bound(&self) -> u32 {
        u32::try_from(self.bits.len()).unwrap_or(u32::MAX)
    }
}
