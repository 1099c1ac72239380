use crate::body::body;

body! {
    /// Samples are missing that were to be searched for strikes. A strike in this gap was not seen, and one
    /// whose window reaches into it has no result.
    pub struct Gap: Copy {
        /// Number of the run of samples that begins after the gap, as in the status frame.
        pub epoch: u32,
        /// Sample index of the first scan that is missing.
        pub first_index: u64,
        /// Sample index of the first scan after the gap.
        pub end_index: u64,
    }
}
