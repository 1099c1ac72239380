//! Registers of the processor.

/// Numbers of the program counter and of the link register.
pub(super) const PC: usize = 15;
pub(super) const LR: usize = 14;
/// Bits of xPSR.
pub(super) const N: u32 = 1 << 31;
pub(super) const Z: u32 = 1 << 30;
pub(super) const C: u32 = 1 << 29;
pub(super) const V: u32 = 1 << 28;
/// IT\[1:0\] and IT\[7:2\].
pub(super) const IT: u32 = 0x0600_fc00;
/// The number of the exception.
const EXCEPTION: u32 = 0x1ff;

/// The processor's registers and flags.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Registers {
    /// R0 to R15; R15 is the address of the next instruction.
    pub(crate) r: [u32; 16],
    /// xPSR: the flags, Q, GE, the state of an IT block, the exception.
    pub(crate) xpsr: u32,
}

impl Registers {
    /// The exception that the processor handles. 0 is none.
    pub(crate) fn exception(&self) -> u32 {
        self.xpsr & EXCEPTION
    }
}

/// The state of an IT block.
pub(super) fn it_of(xpsr: u32) -> u8 {
    (xpsr >> 25 & 3 | xpsr >> 8 & 0xfc) as u8
}

/// Returns `true` if a condition holds (ARMv7-M ARM, A7.3).
#[inline(always)]
pub(super) fn passes(xpsr: u32, condition: u8) -> bool {
    let has = |flag| xpsr & flag != 0;
    let holds = match condition >> 1 {
        0 => has(Z),
        1 => has(C),
        2 => has(N),
        3 => has(V),
        4 => has(C) && !has(Z),
        5 => has(N) == has(V),
        6 => has(N) == has(V) && !has(Z),
        _ => return true,
    };
    holds != (condition & 1 == 1)
}
