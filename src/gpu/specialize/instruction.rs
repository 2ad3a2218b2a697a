//! The instructions of SPIR-V that the specialiser knows: where their ids stand, and which of them do nothing but make a
//! value (SPIR-V 1.6, section 3.52). What is not in here is left alone.

/// Opcodes by their names in the specification.
#[allow(missing_docs, reason = "the specification says what they are")]
pub(super) mod op {
    pub(in super::super) const UNDEF: u16 = 1;
    pub(in super::super) const SOURCE: u16 = 3;
    pub(in super::super) const SOURCE_EXTENSION: u16 = 4;
    pub(in super::super) const NAME: u16 = 5;
    pub(in super::super) const MEMBER_NAME: u16 = 6;
    pub(in super::super) const LINE: u16 = 8;
    pub(in super::super) const EXT_INST_IMPORT: u16 = 11;
    pub(in super::super) const EXT_INST: u16 = 12;
    pub(in super::super) const CAPABILITY: u16 = 17;
    pub(in super::super) const ENTRY_POINT: u16 = 15;
    pub(in super::super) const TYPE_BOOL: u16 = 20;
    pub(in super::super) const TYPE_INT: u16 = 21;
    pub(in super::super) const TYPE_FLOAT: u16 = 22;
    pub(in super::super) const TYPE_VECTOR: u16 = 23;
    pub(in super::super) const TYPE_FORWARD_POINTER: u16 = 39;
    pub(in super::super) const CONSTANT_TRUE: u16 = 41;
    pub(in super::super) const CONSTANT_FALSE: u16 = 42;
    pub(in super::super) const CONSTANT: u16 = 43;
    pub(in super::super) const CONSTANT_COMPOSITE: u16 = 44;
    pub(in super::super) const CONSTANT_NULL: u16 = 46;
    pub(in super::super) const SPEC_CONSTANT_TRUE: u16 = 48;
    pub(in super::super) const SPEC_CONSTANT_FALSE: u16 = 49;
    pub(in super::super) const SPEC_CONSTANT: u16 = 50;
    pub(in super::super) const SPEC_CONSTANT_COMPOSITE: u16 = 51;
    pub(in super::super) const SPEC_CONSTANT_OP: u16 = 52;
    pub(in super::super) const FUNCTION: u16 = 54;
    pub(in super::super) const FUNCTION_PARAMETER: u16 = 55;
    pub(in super::super) const FUNCTION_END: u16 = 56;
    pub(in super::super) const FUNCTION_CALL: u16 = 57;
    pub(in super::super) const VARIABLE: u16 = 59;
    pub(in super::super) const LOAD: u16 = 61;
    pub(in super::super) const STORE: u16 = 62;
    pub(in super::super) const ACCESS_CHAIN: u16 = 65;
    pub(in super::super) const IN_BOUNDS_ACCESS_CHAIN: u16 = 66;
    pub(in super::super) const DECORATE: u16 = 71;
    pub(in super::super) const MEMBER_DECORATE: u16 = 72;
    pub(in super::super) const COMPOSITE_CONSTRUCT: u16 = 80;
    pub(in super::super) const COMPOSITE_EXTRACT: u16 = 81;
    pub(in super::super) const COPY_OBJECT: u16 = 83;
    pub(in super::super) const BITCAST: u16 = 124;
    pub(in super::super) const I_ADD: u16 = 128;
    pub(in super::super) const F_ADD: u16 = 129;
    pub(in super::super) const F_SUB: u16 = 131;
    pub(in super::super) const F_MUL: u16 = 133;
    pub(in super::super) const F_DIV: u16 = 136;
    pub(in super::super) const LOGICAL_OR: u16 = 166;
    pub(in super::super) const LOGICAL_AND: u16 = 167;
    pub(in super::super) const SELECT: u16 = 169;
    pub(in super::super) const I_EQUAL: u16 = 170;
    pub(in super::super) const S_LESS_THAN: u16 = 177;
    pub(in super::super) const U_LESS_THAN_EQUAL: u16 = 178;
    pub(in super::super) const F_ORD_LESS_THAN: u16 = 184;
    pub(in super::super) const F_ORD_GREATER_THAN: u16 = 186;
    pub(in super::super) const F_ORD_LESS_THAN_EQUAL: u16 = 188;
    pub(in super::super) const SHIFT_RIGHT_LOGICAL: u16 = 194;
    pub(in super::super) const SHIFT_LEFT_LOGICAL: u16 = 196;
    pub(in super::super) const BITWISE_OR: u16 = 197;
    pub(in super::super) const BITWISE_XOR: u16 = 198;
    pub(in super::super) const BITWISE_AND: u16 = 199;
    pub(in super::super) const PHI: u16 = 245;
    pub(in super::super) const LOOP_MERGE: u16 = 246;
    pub(in super::super) const SELECTION_MERGE: u16 = 247;
    pub(in super::super) const LABEL: u16 = 248;
    pub(in super::super) const BRANCH: u16 = 249;
    pub(in super::super) const BRANCH_CONDITIONAL: u16 = 250;
    pub(in super::super) const SWITCH: u16 = 251;
    pub(in super::super) const KILL: u16 = 252;
    pub(in super::super) const RETURN: u16 = 253;
    pub(in super::super) const RETURN_VALUE: u16 = 254;
    pub(in super::super) const UNREACHABLE: u16 = 255;
    pub(in super::super) const NO_LINE: u16 = 317;
    pub(in super::super) const GROUP_NON_UNIFORM_ELECT: u16 = 333;
}

/// Which words behind the result type and the result are ids.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Operands {
    /// The first so many; the rest are literals.
    Ids(usize),
    /// All, and at least so many.
    All(usize),
    /// All but the word at this place.
    AllBut(usize),
    /// So many ids, then, if anything, a mask that adds literals alone (memory operands).
    Memory(usize),
    /// So many ids, then, if anything, a mask and ids (image operands).
    Image(usize),
    /// Selector and default label, then literal and label in turn.
    Switch,
}

/// What is known of an opcode.
#[derive(Clone, Copy)]
struct Grammar {
    has_type: bool,
    has_result: bool,
    operands: Operands,
    /// It makes a value, a type or a variable and does nothing else.
    pure: bool,
}

/// `None`: unknown.
fn grammar(opcode: u16) -> Option<Grammar> {
    use Operands::{All, AllBut, Ids, Image, Memory, Switch};
    let value = |operands| Grammar { has_type: true, has_result: true, operands, pure: true };
    let defines = |operands| Grammar { has_type: false, has_result: true, operands, pure: true };
    let acts = |operands| Grammar { has_type: false, has_result: false, operands, pure: false };
    Some(match opcode {
        op::EXT_INST_IMPORT => defines(Ids(0)),
        // String, extension, memory model, capability, processes; execution mode.
        7 => Grammar { pure: false, ..defines(Ids(0)) },
        10 | 14 | 17 | 330 => acts(Ids(0)),
        16 => acts(Ids(1)),
        // Types: void, bool, int, float; vector, matrix, image, sampler, sampled image, array, runtime array.
        19..=22 | 26 => defines(Ids(0)),
        23..=25 | 27 | 29 => defines(Ids(1)),
        28 => defines(Ids(2)),
        // Struct, function; pointer.
        30 => defines(All(0)),
        33 => defines(All(1)),
        32 => defines(AllBut(0)),
        // Ray queries and acceleration structures.
        4472 | 5341 => defines(Ids(0)),
        op::UNDEF | 41..=43 | 46 | 48..=50 | op::FUNCTION_PARAMETER => value(Ids(0)),
        op::CONSTANT_COMPOSITE | op::SPEC_CONSTANT_COMPOSITE => value(All(0)),
        op::SPEC_CONSTANT_OP => value(AllBut(0)),
        op::FUNCTION => Grammar { pure: false, ..value(AllBut(0)) },
        op::FUNCTION_CALL => Grammar { pure: false, ..value(All(1)) },
        op::VARIABLE => value(AllBut(0)),
        op::LOAD => value(Memory(1)),
        op::STORE => acts(Memory(2)),
        op::ACCESS_CHAIN | op::IN_BOUNDS_ACCESS_CHAIN => value(All(1)),
        // Array length; extract and insert by index; shuffle; construct, extract, insert, copy, transpose.
        68 | op::COMPOSITE_EXTRACT => value(Ids(1)),
        77 => value(All(2)),
        78 => value(All(3)),
        80 => value(All(0)),
        op::COPY_OBJECT | 84 => value(All(1)),
        79 | 82 => value(Ids(2)),
        // Fetch; read is left alone, since an image may be volatile; image of a sampled image; sizes.
        95 => value(Image(2)),
        100 | 103 | 104 => value(All(1)),
        // Conversions and bitcast; arithmetic; any, all, NaN, infinity; logic, comparison; bits; CopyLogical.
        109..=116 | 120 | 124 | 126..=127 | 154..=157 | 168 | 200 | 204 | 205 | 400 => value(All(1)),
        128..=152 | 164..=167 | 170..=191 | 194..=199 => value(All(2)),
        // Select; bit fields: insert, and extract signed and unsigned.
        op::SELECT | 202 | 203 => value(All(3)),
        201 => value(All(4)),
        op::EXT_INST => value(AllBut(1)),
        // It depends on which lanes run together.
        op::GROUP_NON_UNIFORM_ELECT => Grammar { pure: false, ..value(Ids(1)) },
        op::PHI => value(All(0)),
        op::LOOP_MERGE => acts(Ids(2)),
        op::SELECTION_MERGE => acts(Ids(1)),
        op::LABEL => Grammar { pure: false, ..defines(Ids(0)) },
        op::BRANCH | op::RETURN_VALUE => acts(All(1)),
        op::BRANCH_CONDITIONAL => acts(Ids(3)),
        op::SWITCH => acts(Switch),
        op::KILL | op::RETURN | op::UNREACHABLE | op::FUNCTION_END => acts(Ids(0)),
        _ => return None,
    })
}

/// GLSL.std.450 instructions that write through a pointer: Modf, Frexp.
const EXT_INST_WRITES: [u32; 2] = [35, 51];

/// One instruction: a run of words of the module.
#[derive(Clone, Copy)]
pub(super) struct Instruction {
    /// Opcode.
    pub(super) opcode: u16,
    /// Words, the first included.
    pub(super) len: usize,
    /// First word.
    pub(super) start: usize,
    /// Id of the result type; 0 if there is none or the instruction is unknown.
    pub(super) result_type: u32,
    /// Id of the result; 0 likewise.
    pub(super) result: u32,
    /// It makes a value and does nothing else.
    pub(super) pure: bool,
    /// First word behind opcode, type and result.
    pub(super) operands: usize,
    shape: Option<Operands>,
}

impl Instruction {
    /// The instruction that begins at word `start`; `None` if the words end or an id is out of `bound`.
    pub(super) fn read(words: &[u32], start: usize, bound: u32) -> Option<Self> {
        let first = *words.get(start)?;
        let (opcode, len) = ((first & 0xffff) as u16, (first >> 16) as usize);
        let all = words.get(start..start + len)?;
        let mut this =
            Self { opcode, len, start, result_type: 0, result: 0, pure: false, operands: start + 1, shape: None };
        if len == 0 {
            return None;
        }
        let Some(grammar) = grammar(opcode) else { return Some(this) };
        let mut next = 1;
        for (there, slot) in [(grammar.has_type, &mut this.result_type), (grammar.has_result, &mut this.result)] {
            if there {
                *slot = *all.get(next).filter(|id| (1..bound).contains(*id))?;
                next += 1;
            }
        }
        this.operands = start + next;
        this.pure = grammar.pure;
        this.shape = Some(grammar.operands);
        let operands = &all[next..];
        match (grammar.operands, opcode) {
            (Operands::Ids(n) | Operands::All(n) | Operands::Memory(n) | Operands::Image(n), _)
                if operands.len() < n =>
            {
                return None;
            }
            // Volatile accesses and those of the memory model are left alone: aligned and nontemporal ones are known.
            (Operands::Memory(n), _) if operands.get(n).is_some_and(|mask| mask & !0b110 != 0) => {
                (this.pure, this.shape) = (false, None);
            }
            (Operands::AllBut(n), _) if operands.len() <= n => return None,
            (Operands::Switch, _) if operands.len() < 2 || operands.len() % 2 != 0 => return None,
            // Those that take literals besides.
            (_, op::SPEC_CONSTANT_OP) if matches!(operands[0], 79 | 81 | 82) => this.shape = None,
            (_, op::EXT_INST) => this.pure = !EXT_INST_WRITES.contains(&operands[1]),
            (_, op::PHI) if operands.len() % 2 != 0 => return None,
            _ => {}
        }
        this.id_places().all(|place| (1..bound).contains(&words[place])).then_some(this)
    }

    /// The instruction is not in the table, or used in a way that is not.
    pub(super) fn is_unknown(&self) -> bool {
        self.shape.is_none()
    }

    /// It defines a type.
    pub(super) fn is_type(&self) -> bool {
        matches!(self.opcode, 19..=33)
    }

    /// First word behind the instruction.
    pub(super) fn end(&self) -> usize {
        self.start + self.len
    }

    /// Places of the words that are ids, type and result left out; none if it is unknown.
    pub(super) fn id_places(&self) -> impl Iterator<Item = usize> + use<> {
        let (first, shape, count) = (self.operands, self.shape, self.end() - self.operands);
        (0..count)
            .filter(move |&i| match shape {
                None => false,
                Some(Operands::All(_)) => true,
                Some(Operands::Ids(n) | Operands::Memory(n)) => i < n,
                Some(Operands::AllBut(n) | Operands::Image(n)) => i != n,
                Some(Operands::Switch) => i == 0 || i % 2 == 1,
            })
            .map(move |i| first + i)
    }
}
