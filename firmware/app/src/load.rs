//! Cost of the work on a block, by the core's cycle counter.

use bead_wire::Load;

use crate::bead::BeadState;
use crate::block::BLOCK_US;
use crate::counters::LoadCounter;
use crate::device::Device;

impl<D: Device> BeadState<D> {
    /// Does the work on a block, and counts its clocks. Their count wraps every 25 s; a block takes 2 ms.
    pub(crate) fn count_load(&self, work: impl FnOnce()) {
        let before = self.device.core_clocks();
        work();
        let clocks = self.device.core_clocks().wrapping_sub(before);
        self.load.update(|load| {
            load.blocks = load.blocks.wrapping_add(1);
            load.worst = load.worst.max(clocks);
            load.total += u64::from(clocks);
        });
    }

    /// Sends the clocks counted since the last call.
    pub(crate) fn send_load(&self) {
        let mut told = LoadCounter::default();
        self.load.update(|load| told = core::mem::take(load));
        let LoadCounter { blocks, worst, total } = told;
        self.send(Load {
            blocks,
            worst_cycles: worst,
            mean_cycles: (total / u64::from(blocks.max(1))) as u32,
            period_cycles: D::CORE_MHZ * BLOCK_US,
            masked_cycles: self.device.take_longest_mask(),
        });
    }
}
