//! Fields and bits of a register.

/// Bits `low..low + width` of a register.
pub(crate) const fn field(register: u32, low: u32, width: u32) -> u32 {
    (register >> low) & ((1 << width) - 1)
}

/// One bit of a register.
pub(crate) const fn bit(register: u32, n: u32) -> bool {
    (register >> n) & 1 == 1
}

/// The number of the register at `offset` in a row of registers that begins at `first`.
pub(crate) const fn index(offset: u32, first: u32) -> usize {
    ((offset - first) / 4) as usize
}
