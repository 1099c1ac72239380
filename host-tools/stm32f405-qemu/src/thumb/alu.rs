//! Arithmetic with flags (ARMv7-M ARM, A2.2.1 and A7.4.2).

/// Result and carry.
pub(super) type Shifted = (u32, bool);

/// Ways to shift an operand. `Rrx` rotates by one through the carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shift {
    Lsl,
    Lsr,
    Asr,
    Ror,
    Rrx,
}

/// Shift of an immediate: its type and its amount, from the fields of an instruction.
pub(super) fn immediate(kind: u32, amount: u32) -> (Shift, u32) {
    match (kind & 3, amount) {
        (0, n) => (Shift::Lsl, n),
        (1, n) => (Shift::Lsr, if n == 0 { 32 } else { n }),
        (2, n) => (Shift::Asr, if n == 0 { 32 } else { n }),
        (_, 0) => (Shift::Rrx, 1),
        (_, n) => (Shift::Ror, n),
    }
}

#[inline(always)]
pub(super) fn shift(value: u32, (kind, n): (Shift, u32), carry: bool) -> Shifted {
    if n == 0 {
        return (value, carry);
    }
    let wide = u64::from(value);
    match kind {
        Shift::Lsl if n > 32 => (0, false),
        Shift::Lsl => {
            let shifted = wide << n;
            (shifted as u32, shifted >> 32 & 1 == 1)
        }
        Shift::Lsr if n > 32 => (0, false),
        Shift::Lsr => ((wide >> n) as u32, wide >> (n - 1) & 1 == 1),
        Shift::Asr => {
            let (n, wide) = (n.min(32), i64::from(value as i32));
            ((wide >> n) as u32, wide >> (n - 1) & 1 == 1)
        }
        Shift::Ror => {
            let rotated = value.rotate_right(n & 31);
            (rotated, rotated >> 31 == 1)
        }
        Shift::Rrx => (value >> 1 | u32::from(carry) << 31, value & 1 == 1),
    }
}

/// Sum, carry and overflow.
#[inline(always)]
pub(super) fn add(a: u32, b: u32, carry: bool) -> (u32, bool, bool) {
    let wide = u64::from(a) + u64::from(b) + u64::from(carry);
    let sum = wide as u32;
    (sum, wide >> 32 != 0, ((a ^ sum) & (b ^ sum)) >> 31 == 1)
}

/// An immediate of 12 bits, expanded, and the carry that comes out of it (A5.3.2).
pub(super) fn expand(imm12: u32) -> (u32, Option<bool>) {
    let byte = imm12 & 0xff;
    match imm12 >> 8 & 0xf {
        0 => (byte, None),
        1 => (byte << 16 | byte, None),
        2 => (byte << 24 | byte << 8, None),
        3 => (byte * 0x0101_0101, None),
        _ => {
            let value = (byte & 0x7f | 0x80).rotate_right(imm12 >> 7 & 0x1f);
            (value, Some(value >> 31 == 1))
        }
    }
}
