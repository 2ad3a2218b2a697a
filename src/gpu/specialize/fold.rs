//! Folding: integer, boolean and comparison instructions on constants of 32 bits (SPIR-V 1.6, sections 3.52.13 to 15).
//! Floating point is not folded, so that an image keeps its bits.

/// The result of `opcode` for scalar operands given by their bits (booleans are 0 and 1), as bits.
///
/// `None` where the result is undefined, or where it is not an instruction of integers or booleans alone.
pub(super) fn fold(opcode: u16, operands: &[u32]) -> Option<u32> {
    match *operands {
        [a] => fold_one(opcode, a),
        [a, b] => fold_two(opcode, a, b),
        [a, b, c] if opcode == super::instruction::op::SELECT => Some(if a != 0 { b } else { c }),
        _ => None,
    }
}

fn fold_one(opcode: u16, a: u32) -> Option<u32> {
    Some(match opcode {
        // Bitcast, SNegate, LogicalNot, Not, BitReverse, BitCount.
        124 => a,
        126 => a.wrapping_neg(),
        168 => u32::from(a == 0),
        200 => !a,
        204 => a.reverse_bits(),
        205 => a.count_ones(),
        _ => return None,
    })
}

fn fold_two(opcode: u16, a: u32, b: u32) -> Option<u32> {
    let (x, y) = (a.cast_signed(), b.cast_signed());
    Some(match opcode {
        // IAdd, ISub, IMul.
        128 => a.wrapping_add(b),
        130 => a.wrapping_sub(b),
        132 => a.wrapping_mul(b),
        // UDiv, SDiv, UMod, SRem, SMod: undefined by zero and on overflow. SMod takes the sign of the divisor.
        134 => a.checked_div(b)?,
        135 => x.checked_div(y)?.cast_unsigned(),
        137 => a.checked_rem(b)?,
        138 => x.checked_rem(y)?.cast_unsigned(),
        139 => {
            let rest = x.checked_rem(y)?;
            (if rest != 0 && (rest < 0) != (y < 0) { rest + y } else { rest }).cast_unsigned()
        }
        // LogicalEqual, LogicalNotEqual, LogicalOr, LogicalAnd.
        164 => u32::from(a == b),
        165 => u32::from(a != b),
        166 => a | b,
        167 => a & b,
        // IEqual, INotEqual; greater, greater or equal, less, less or equal, each unsigned and signed.
        170 => u32::from(a == b),
        171 => u32::from(a != b),
        172 => u32::from(a > b),
        173 => u32::from(x > y),
        174 => u32::from(a >= b),
        175 => u32::from(x >= y),
        176 => u32::from(a < b),
        177 => u32::from(x < y),
        178 => u32::from(a <= b),
        179 => u32::from(x <= y),
        // Shifts, undefined from the width on: right logical, right arithmetic, left.
        194 => a.checked_shr(b)?,
        195 => x.checked_shr(b)?.cast_unsigned(),
        196 => a.checked_shl(b)?,
        // BitwiseOr, BitwiseXor, BitwiseAnd.
        197 => a | b,
        198 => a ^ b,
        199 => a & b,
        _ => return None,
    })
}
