//! The interface that all models share.

use std::borrow::Cow;
use std::collections::BTreeSet;

use super::clock::ClockTree;
use crate::ramp::Ramp;

/// A peripheral: registers, interrupt lines, and a clock.
///
/// An offset is the distance of a word from the first address of the peripheral. Times are virtual, in ns
/// since power-up, and never go back.
pub(crate) trait Peripheral {
    /// Reads a register, as the processor or the DMA does.
    ///
    /// # Errors
    /// The model has no such register.
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister>;

    /// Time up to which a read returns the same as one now, if nothing happens to the peripheral. This time
    /// may be too early, but never too late. `None` if a read has an effect beyond its value, such as taking
    /// a byte, or if the time is not known.
    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        None
    }

    /// The ramp of a register that counts, if nothing happens to the peripheral.
    fn ramp(&self, _offset: u32, _now: u64) -> Option<Ramp> {
        None
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model has no such register.
    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister>;

    /// Resets the registers. What comes from outside goes on: levels on pins, bytes on a line, the supply.
    /// Counts and notes stay too.
    fn reset(&mut self, now: u64);

    fn set_clocks(&mut self, _clocks: &ClockTree, _now: u64) {}

    /// The level of an interrupt line. `output` is the number of the line within this peripheral, from 0.
    fn interrupt(&self, _output: usize) -> bool {
        false
    }

    /// When a line will rise, or the machine will be reset, if no register is accessed. This time may be too
    /// early, but never too late. Effects of other peripherals are left out.
    fn next_interrupt(&self) -> Option<u64> {
        None
    }
}

/// There is no such register in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NoRegister;

/// Requests to a peripheral that its model does not carry out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Notes(BTreeSet<Cow<'static, str>>);

impl Notes {
    /// Takes a note. The same note is kept once.
    pub(crate) fn note(&mut self, what: impl Into<Cow<'static, str>>) {
        self.0.insert(what.into());
    }

    pub(crate) fn note_if(&mut self, asked: bool, what: &'static str) {
        if asked {
            self.note(what);
        }
    }

    /// Keeps a note while `holds` is true.
    pub(crate) fn keep_while(&mut self, holds: bool, what: String) {
        if holds {
            self.note(what);
        } else {
            self.0.remove(what.as_str());
        }
    }

    /// Takes notes from a table of registers, bits and notes: those for which one of the bits is written.
    pub(crate) fn note_bits(&mut self, table: &[(u32, u32, &'static str)], offset: u32, value: u32) {
        for (register, bits, what) in table {
            self.note_if(*register == offset && value & bits != 0, what);
        }
    }

    /// The notes in alphabetical order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(AsRef::as_ref)
    }
}

/// Accesses of tests, to registers that the model has.
#[cfg(test)]
pub(super) trait Access: Peripheral {
    /// Reads a register.
    fn get(&mut self, offset: u32, now: u64) -> u32 {
        self.read(offset, now).unwrap()
    }

    /// Writes registers, one after the other.
    fn put<const N: usize>(&mut self, now: u64, writes: [(u32, u32); N]) {
        for (offset, value) in writes {
            self.write(offset, value, now).unwrap();
        }
    }
}

#[cfg(test)]
impl<P: Peripheral> Access for P {}
