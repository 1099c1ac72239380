//! The interpreter's view of memory and registers.

use crate::ramp::Ramp;

/// A word that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Loaded {
    pub(crate) value: u32,
    /// The time up to which another read gives the same, if memory is not written.
    pub(crate) holds_until: u64,
    /// How it counts, if it does.
    pub(crate) ramp: Option<Ramp>,
}

/// The memory and registers around the processor. An access that it refuses has had no effect.
pub(crate) trait Bus {
    /// A halfword of code.
    fn fetch(&mut self, address: u32) -> Option<u16>;

    /// Reads 1, 2 or 4 bytes at a time.
    fn load(&mut self, address: u32, bytes: u32, now: u64) -> Option<Loaded>;

    /// Returns `true` if reads of the word there have no effect.
    fn is_memory(&self, address: u32) -> bool;

    /// Returns `true` if `store` will accept 1, 2 or 4 bytes there.
    fn accepts(&self, address: u32, bytes: u32) -> bool;

    /// Writes them. Gives whether that has changed anything.
    fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> bool;
}
