//! Registers that count.

/// How a register counts: by one at each tick of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ramp {
    /// Ticks in a second, rounded up.
    pub hz: u32,
    /// True if it counts down.
    pub falls: bool,
    /// Time at which it does something else, ns: before it, it neither overflows nor is reloaded. This time
    /// may be too early, but never too late.
    pub until_ns: u64,
}
