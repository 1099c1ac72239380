//! The interrupt lines of the peripherals.

use std::sync::LazyLock;

use super::board::{Exterior, NMI, SYSTICK};
use super::chip::Chip;
use super::table::{PeripheralRow, TABLE};

/// The peripherals that have lines: they are asked after every access.
static INTERRUPTING: LazyLock<Vec<&PeripheralRow>> =
    LazyLock::new(|| TABLE.iter().filter(|row| !row.lines.is_empty()).collect());

/// The lines that the board knows to be up, a bit for each.
#[derive(Debug, Clone, Default)]
pub(super) struct InterruptLines(u128);

impl InterruptLines {
    pub(super) fn settle(&mut self, chip: &mut Chip, board: &mut impl Exterior) {
        // The vectors are in flash: a line that rises now is served when flash can be read again.
        if chip.stands_still() {
            return;
        }
        if std::mem::take(&mut chip.units.systick.fired) {
            board.set_interrupt(SYSTICK, true);
            board.set_interrupt(SYSTICK, false);
        }
        // Some peripherals share a line.
        let mut levels = 0;
        for row in INTERRUPTING.iter() {
            let model = (row.model)(&chip.units);
            for (output, line) in row.lines.iter().enumerate() {
                levels |= u128::from(model.interrupt(output)) << line;
            }
        }
        let changed = std::mem::replace(&mut self.0, levels) ^ levels;
        for line in (0..=NMI).filter(|line| changed >> line & 1 == 1) {
            board.set_interrupt(line, levels >> line & 1 == 1);
        }
    }
}
