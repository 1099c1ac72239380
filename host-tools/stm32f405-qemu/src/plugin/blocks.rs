//! Instructions of each block: from one interrupt of the ADC's DMA stream to the next.

use super::count::{Cost, InstructionCounters};
use crate::outcome::{BlockCost, Instructions};

pub(super) struct Blocks {
    pub(super) counters: &'static InstructionCounters,
    /// Labels whose functions make a block a working one.
    work: Vec<usize>,
    /// Cost of the whole image and instructions of the `work` functions when the block began. `None` before
    /// the first block.
    began: Option<(Cost, u64)>,
    ended: Instructions,
}

impl Blocks {
    pub(super) fn new(counters: &'static InstructionCounters, work: Vec<usize>) -> Self {
        Self {
            counters,
            work,
            began: None,
            ended: Instructions::default(),
        }
    }

    /// Handles a reset of the processor: the next block contains the start-up, and is not counted.
    pub(super) fn restart(&mut self) {
        self.counters.watch_masks(false);
        self.began = None;
    }

    /// Ends a block of `scans` scans, and begins the next. A block without scans is not counted.
    pub(super) fn end(&mut self, scans: u64) {
        self.counters.watch_masks(true);
        let now = (self.counters.cost(), self.counters.labelled(&self.work));
        let Some(began) = self.began.replace(now).filter(|_| scans > 0) else {
            return;
        };
        let Cost { instructions, cycles } = now.0.since(began.0);
        let block = BlockCost {
            instructions,
            cycles,
            scans,
        };
        if let Some(cycles) = cycles {
            let slowest = self.ended.slowest_block.get_or_insert(block);
            let most = slowest.cycles.unwrap_or_default().most;
            if cycles.most * slowest.scans > most * scans {
                *slowest = block;
            }
        }
        let worst = self.ended.worst_block.get_or_insert(block);
        if block.instructions_per_scan() > worst.instructions_per_scan() {
            *worst = block;
        }
        let (works, all) = (now.1 > began.1, &mut self.ended);
        let alike = if works { &mut all.working } else { &mut all.idle };
        let alike = alike.get_or_insert_default();
        alike.instructions += block.instructions;
        alike.cycles = block
            .cycles
            .map(|cycles| cycles + alike.cycles.unwrap_or_default());
        alike.scans += block.scans;
    }

    pub(super) fn instructions(&self) -> Instructions {
        Instructions {
            total: self.counters.total(),
            cycles: self.counters.cost().cycles,
            functions: self.counters.functions(),
            masked: self.counters.longest_masked(),
            ..self.ended.clone()
        }
    }
}
