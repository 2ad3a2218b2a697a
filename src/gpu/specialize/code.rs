//! Straight code for the functions of a module: values by what computes them, so that nothing is computed twice.

use std::collections::HashMap;

use super::emit::head;
use super::instruction::op;
use super::module::{HEADER, Module};

/// Decoration: NoContraction.
const NO_CONTRACTION: u32 = 42;

/// The types that the code uses.
struct Types {
    float: u32,
    int: u32,
    uint: u32,
    boolean: u32,
    /// Of two, three and four words.
    vectors: [u32; 3],
}

/// Code in the making.
pub(super) struct Code<'a> {
    module: &'a Module<'a>,
    types: Types,
    next_id: u32,
    /// By type and bits; they are added behind the module's own.
    constants: HashMap<(u32, u32), u32>,
    constant_words: Vec<u32>,
    decorations: Vec<u32>,
    /// By opcode, type and operands.
    values: HashMap<(u16, u32, Vec<u32>), u32>,
    body: Vec<u32>,
}

impl<'a> Code<'a> {
    /// `None` where a type is missing.
    pub(super) fn new(module: &'a Module<'a>) -> Option<Self> {
        let find = |opcode: u16, operands: &[u32]| {
            let mut globals = module.instructions[..module.globals].iter();
            globals.find(|i| i.opcode == opcode && module.operands(i) == operands).map(|i| i.result)
        };
        let uint = find(op::TYPE_INT, &[32, 0])?;
        let types = Types {
            float: find(op::TYPE_FLOAT, &[32])?,
            int: find(op::TYPE_INT, &[32, 1])?,
            uint,
            boolean: find(op::TYPE_BOOL, &[])?,
            vectors: [
                find(op::TYPE_VECTOR, &[uint, 2])?,
                find(op::TYPE_VECTOR, &[uint, 3])?,
                find(op::TYPE_VECTOR, &[uint, 4])?,
            ],
        };
        Some(Self {
            module,
            types,
            next_id: module.words[3],
            constants: HashMap::new(),
            constant_words: Vec::new(),
            decorations: Vec::new(),
            values: HashMap::new(),
            body: Vec::new(),
        })
    }

    /// The function (as its place among the module's) whose name begins so.
    pub(super) fn find_function(&self, name: &str) -> Option<usize> {
        let names = self.module.instructions[..self.module.globals].iter().filter(|i| i.opcode == op::NAME);
        let id = names.map(|i| self.module.operands(i)).find_map(|operands| {
            let (&id, text) = operands.split_first()?;
            let bytes: Vec<u8> = text.iter().flat_map(|word| word.to_le_bytes()).collect();
            bytes.starts_with(name.as_bytes()).then_some(id)
        })?;
        self.module.functions.iter().position(|f| self.module.instructions[f.first].result == id)
    }

    /// Begins the body of a function; returns the ids of its parameters.
    pub(super) fn begin(&mut self, function: usize) -> Vec<u32> {
        let head_range = self.module.functions[function].head(self.module);
        self.values.clear();
        self.body.clear();
        for i in &self.module.instructions[head_range.clone()] {
            self.body.extend_from_slice(&self.module.words[i.start..i.end()]);
        }
        let label = self.new_id();
        self.body.extend([head(op::LABEL, 2), label]);
        self.module.instructions[head_range].iter().skip(1).map(|i| i.result).collect()
    }

    /// Ends it with its result; returns its words.
    pub(super) fn end(&mut self, result: u32) -> Vec<u32> {
        self.body.extend([head(op::RETURN_VALUE, 2), result, head(op::FUNCTION_END, 1)]);
        std::mem::take(&mut self.body)
    }

    /// The module with these functions in the places of those that were there.
    pub(super) fn splice(&self, functions: &[(usize, Vec<u32>)]) -> Vec<u32> {
        let module = self.module;
        let start_of = |i: usize| module.instructions.get(i).map_or(module.words.len(), |i| i.start);
        // Annotations stand before types.
        let first_type = module.instructions.iter().position(super::instruction::Instruction::is_type).unwrap_or(0);
        let mut words = module.words[..start_of(first_type)].to_vec();
        words[3] = self.next_id;
        words.extend_from_slice(&self.decorations);
        words.extend_from_slice(&module.words[start_of(first_type)..start_of(module.globals)]);
        words.extend_from_slice(&self.constant_words);
        for (f, function) in module.functions.iter().enumerate() {
            match functions.iter().find(|(replaced, _)| *replaced == f) {
                Some((_, body)) => words.extend_from_slice(body),
                None => {
                    let next = module.functions.get(f + 1).map_or(module.instructions.len(), |next| next.first);
                    words.extend_from_slice(&module.words[start_of(function.first)..start_of(next)]);
                }
            }
        }
        debug_assert!(words.len() > HEADER);
        words
    }

    fn new_id(&mut self) -> u32 {
        self.next_id += 1;
        self.next_id - 1
    }

    fn constant(&mut self, ty: u32, bits: u32) -> u32 {
        if let Some(&id) = self.constants.get(&(ty, bits)) {
            return id;
        }
        let id = self.new_id();
        self.constant_words.extend([head(op::CONSTANT, 4), ty, id, bits]);
        self.constants.insert((ty, bits), id);
        id
    }

    pub(super) fn constant_float(&mut self, value: f32) -> u32 {
        self.constant(self.types.float, value.to_bits())
    }

    pub(super) fn constant_int(&mut self, value: i32) -> u32 {
        self.constant(self.types.int, value.cast_unsigned())
    }

    pub(super) fn constant_uint(&mut self, value: u32) -> u32 {
        self.constant(self.types.uint, value)
    }

    fn value(&mut self, opcode: u16, ty: u32, operands: &[u32]) -> u32 {
        let key = (opcode, ty, operands.to_vec());
        if let Some(&id) = self.values.get(&key) {
            return id;
        }
        let id = self.new_id();
        self.body.extend([head(opcode, 3 + operands.len()), ty, id]);
        self.body.extend_from_slice(operands);
        // No fusing: neighbours must round alike.
        if matches!(opcode, op::F_ADD | op::F_SUB | op::F_MUL | op::F_DIV) {
            self.decorations.extend([head(op::DECORATE, 3), id, NO_CONTRACTION]);
        }
        self.values.insert(key, id);
        id
    }

    pub(super) fn float(&mut self, opcode: u16, operands: &[u32]) -> u32 {
        self.value(opcode, self.types.float, operands)
    }

    pub(super) fn int(&mut self, opcode: u16, operands: &[u32]) -> u32 {
        self.value(opcode, self.types.int, operands)
    }

    pub(super) fn uint(&mut self, opcode: u16, operands: &[u32]) -> u32 {
        self.value(opcode, self.types.uint, operands)
    }

    pub(super) fn bool(&mut self, opcode: u16, operands: &[u32]) -> u32 {
        self.value(opcode, self.types.boolean, operands)
    }

    /// A vector of two to four words.
    pub(super) fn vector(&mut self, words: &[u32]) -> u32 {
        self.value(op::COMPOSITE_CONSTRUCT, self.types.vectors[words.len() - 2], words)
    }

    /// The components of a vector of three floats.
    pub(super) fn components(&mut self, vector: u32) -> [u32; 3] {
        // Indices are literals, not ids.
        [0, 1, 2].map(|i| self.value(op::COMPOSITE_EXTRACT, self.types.float, &[vector, i]))
    }

    /// Word `word` of the set that holds one number.
    pub(super) fn set_word(&mut self, number: u32, word: u32) -> u32 {
        let [five, mask, word, one, zero] = [5, 31, word, 1, 0].map(|n| self.constant_uint(n));
        let its_word = self.uint(op::SHIFT_RIGHT_LOGICAL, &[number, five]);
        let place = self.uint(op::BITWISE_AND, &[number, mask]);
        let bit = self.uint(op::SHIFT_LEFT_LOGICAL, &[one, place]);
        let is_there = self.bool(op::I_EQUAL, &[its_word, word]);
        self.uint(op::SELECT, &[is_there, bit, zero])
    }
}
