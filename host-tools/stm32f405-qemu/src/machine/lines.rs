//! The interrupt lines of the peripherals.

use super::board::{Exterior, SYSTICK};
use super::chip::Chip;

/// The lines that the board knows to be up, a bit for each.
#[derive(Debug, Clone, Default)]
pub(super) struct InterruptLines(u128);

impl InterruptLines {
    /// Returns `true` if the board knows a line to be up.
    pub(super) fn is_up(&self, line: usize) -> bool {
        self.0 >> line & 1 == 1
    }

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
        for row in chip.written.iter() {
            let model = (row.model)(&chip.units);
            for (output, line) in row.lines.iter().enumerate() {
                levels |= u128::from(model.interrupt(output)) << line;
            }
        }
        let mut changed = std::mem::replace(&mut self.0, levels) ^ levels;
        while changed != 0 {
            let line = changed.trailing_zeros() as usize;
            changed &= changed - 1;
            board.set_interrupt(line, levels >> line & 1 == 1);
        }
    }
}
