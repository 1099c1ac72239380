//! Accesses to registers that change only by time, by events or by these accesses.

use super::table::{PeripheralRow, TABLE, offset_in, row_at};
use crate::peripherals::dma::Dma;
use crate::ramp::Ramp;

/// A read that has no effect but its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SteadyRead {
    /// The value that is read.
    pub value: u32,
    /// Time up to which another read returns the same, ns. Not later than this read if an event came before
    /// it.
    pub holds_until: u64,
    /// The ramp of a value that counts, up to the next event.
    pub ramp: Option<Ramp>,
}

/// A write that has no effect but on the registers of its peripheral.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SteadyWrite {
    /// Time up to which every read returns the same if nothing else is written, ns. Not later than this
    /// write if an event came before it.
    pub holds_until: u64,
    /// When the next interrupt may come from now on, as
    /// [`Machine::next_interrupt`](super::Machine::next_interrupt) returns it.
    pub next_interrupt: Option<u64>,
}

/// Number of registers whose peripheral is remembered.
const PLACES: usize = 8;

/// The time up to which nothing happens, and the peripherals of the registers that were read last.
#[derive(Debug, Clone, Default)]
pub(super) struct QuietTime {
    /// Time of the next event, `None` if it is not computed yet.
    pub(super) until: Option<u64>,
    /// BSRR of a port that [`Machine::only_moves_pins`](super::Machine::only_moves_pins) allows, and the
    /// levels of the port's outputs, which nothing has changed since.
    pub(super) outputs: Option<(u32, u32)>,
    places: [Option<(u32, usize)>; PLACES],
    /// The DMA controllers as they were before the first write since
    /// [`Machine::keep_registers`](super::Machine::keep_registers).
    pub(super) kept: [Option<Dma>; 2],
}

impl QuietTime {
    /// Forgets the time and the levels, as something may have changed.
    pub(super) fn end(&mut self) {
        (self.until, self.outputs) = (None, None);
    }

    /// The peripheral of a register, and its offset in it.
    pub(super) fn place(&mut self, address: u32) -> Option<(&'static PeripheralRow, u32)> {
        let place = &mut self.places[(address >> 2 ^ address >> 10) as usize % PLACES];
        let row = match *place {
            Some((at, row)) if at == address => row,
            _ => {
                let row = row_at(address)?;
                *place = Some((address, row));
                row
            }
        };
        let row = &TABLE[row];
        Some((row, offset_in(row, address)))
    }
}
