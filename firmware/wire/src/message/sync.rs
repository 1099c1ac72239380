use crate::body::body;

body! {
    /// A rising edge on the sync input, by the sample clock: beads that see the same edges share a time base.
    ///
    /// Index and clocks are those of the very timer clock that makes the samples, so that no rounding stands between
    /// them. An edge is told if it comes 10 ms or more after the one before it.
    pub struct Sync: Copy {
        /// Number of the edge among those told since the last reset, from 0.
        pub edge: u32,
        /// Index of the last sample trigger at or before the edge.
        pub index: u64,
        /// From that trigger to the edge, in clocks of the sample timer (84 MHz): below `clocks_per_sample`.
        pub clocks: u16,
        /// Clocks in a sample period.
        pub clocks_per_sample: u16,
        /// Times since the last reset that one edge or more came too soon after another to be told.
        pub missed: u32,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Sync {
    Sync {
        edge: 11,
        index: 41_168,
        clocks: 839,
        clocks_per_sample: 840,
        missed: 300,
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a030902040302010c0b01020a010110070bd0c102c706c806ac0278bebcf300";
