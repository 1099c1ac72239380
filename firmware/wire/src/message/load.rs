use crate::body::body;

body! {
    /// Cost of the work on a block of samples, by the core's cycle counter.
    ///
    /// It is sent when a host asks for the status, and covers the blocks since the last time, or since the
    /// reset. Interrupts that come meanwhile count too.
    pub struct Load: Copy {
        /// Blocks that the estimators took.
        pub blocks: u32,
        /// Cycles of the block that took longest.
        pub worst_cycles: u32,
        /// Cycles of a block on average; 0 without a block.
        pub mean_cycles: u32,
        /// Cycles from one block to the next: all that there are.
        pub period_cycles: u32,
        /// Cycles of the longest stretch without interrupts while samples are taken.
        pub masked_cycles: u32,
    }
}
