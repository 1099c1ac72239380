//! The interrupt lines of the peripherals.

use super::board::{Board, NMI, SYSTICK};
use super::chip::Chip;
use super::table::TABLE;

#[derive(Debug, Clone)]
pub(super) struct InterruptLines([bool; NMI + 1]);

impl Default for InterruptLines {
    fn default() -> Self {
        Self([false; NMI + 1])
    }
}

impl InterruptLines {
    pub(super) fn settle(&mut self, chip: &mut Chip, board: &mut impl Board) {
        // The vectors are in flash: a line that rises now is served when flash can be read again.
        if chip.stands_still() {
            return;
        }
        if std::mem::take(&mut chip.units.systick.fired) {
            board.set_interrupt(SYSTICK, true);
            board.set_interrupt(SYSTICK, false);
        }
        // Some peripherals share a line.
        let mut levels = [false; NMI + 1];
        for row in TABLE {
            let model = (row.model)(&chip.units);
            for (output, line) in row.lines.iter().enumerate() {
                levels[*line] |= model.interrupt(output);
            }
        }
        for (line, (known, level)) in self.0.iter_mut().zip(levels).enumerate() {
            if *known != level {
                *known = level;
                board.set_interrupt(line, level);
            }
        }
    }
}
