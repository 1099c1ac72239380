//! The interpreter's view of memory and registers.

use crate::ramp::Ramp;

/// A word that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Loaded {
    pub(crate) value: u32,
    /// The time up to which another read returns the same, if memory is not written.
    pub(crate) holds_until: u64,
    /// The ramp of a word that counts.
    pub(crate) ramp: Option<Ramp>,
}

/// A write that has been made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stored {
    /// True if the write changed something that [`Bus::is_as_kept`] does not check.
    pub(crate) changed: bool,
    /// The time up to which everything that was read keeps its value, if memory is not written.
    pub(crate) holds_until: u64,
    /// The time before which instructions must begin from now on.
    pub(crate) limit: u64,
}

impl Stored {
    /// A write without any of these effects.
    pub(crate) const QUIETLY: Self = Self {
        changed: false,
        holds_until: u64::MAX,
        limit: u64::MAX,
    };
}

/// The memory and registers around the processor. A refused access has no effect.
pub(crate) trait Bus {
    /// A halfword of code.
    fn fetch(&mut self, address: u32) -> Option<u16>;

    /// Reads 1, 2 or 4 bytes at a time.
    fn load(&mut self, address: u32, bytes: u32, now: u64) -> Option<Loaded>;

    /// Returns `true` if reads of the word there have no effect.
    fn is_memory(&self, address: u32) -> bool;

    /// Returns `true` if `store` will accept 1, 2 or 4 bytes there at this time.
    fn accepts(&self, address: u32, bytes: u32, now: u64) -> bool;

    /// Writes 1, 2 or 4 bytes.
    fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> Stored;

    /// Writes a register that `accepts` knows nothing of, while an exception is handled.
    fn write_register(
        &mut self,
        _place: (u32, u32),
        _value: u32,
        _now: u64,
        _exception: u32,
    ) -> Option<Stored> {
        None
    }

    /// Keeps the present state of memory and registers, for [`Self::is_as_kept`].
    fn keep(&mut self);

    /// Returns `true` if memory and registers are as they were at the last [`Self::keep`].
    fn is_as_kept(&self) -> bool;

    /// The address of an exception's handler, if a return from it would enter it again at once, given the
    /// interrupt masks as they were at its entry.
    fn enters_again(&self, _exception: u32) -> Option<u32> {
        None
    }

    /// Returns `true` if a write of BASEPRI in a handler has no effect.
    fn keeps_base_priority(&self, _value: u32) -> bool {
        false
    }
}
