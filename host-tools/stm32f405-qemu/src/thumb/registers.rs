//! Registers of the processor.

/// The processor's registers and flags.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Registers {
    /// R0 to R15; R15 is the address of the next instruction.
    pub(crate) r: [u32; 16],
    /// xPSR: the flags, Q, GE, the state of an IT block, the exception.
    pub(crate) xpsr: u32,
}
