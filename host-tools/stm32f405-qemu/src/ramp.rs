//! Registers that count.

/// How a register counts: by one at each tick of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ramp {
    /// Ticks in a second, rounded up.
    pub hz: u32,
    /// True if it counts down.
    pub falls: bool,
    /// Time at which the register may overflow or be reloaded, ns. It may be too early, but never too late.
    pub until_ns: u64,
}
