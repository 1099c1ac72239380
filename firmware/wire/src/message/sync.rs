use crate::body::body;

body! {
    /// A rising edge on the sync input, and its time by the sample clock. Beads that see the same edges share
    /// a time base.
    ///
    /// The clock that takes the samples also times the edge, so nothing is rounded between the two. An edge
    /// is reported if it comes at least 10 ms after the last reported one.
    pub struct Sync: Copy {
        /// Number of the edge among those reported since the last reset, from 0.
        pub edge: u32,
        /// Index of the last sample trigger at or before the edge.
        pub index: u64,
        /// Time from that trigger to the edge, in clocks of the sample timer (84 MHz). Less than
        /// `clocks_per_sample`.
        pub clocks: u16,
        /// Number of clocks in a sample period: 840 at 100 kHz.
        pub clocks_per_sample: u16,
        /// Number of times, since the last reset, that edges came too soon after another to be reported.
        pub missed: u32,
    }
}
