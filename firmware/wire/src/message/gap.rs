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

#[cfg(test)]
pub(crate) fn example() -> Gap {
    Gap {
        epoch: 3,
        first_index: 41_200,
        end_index: 42_371,
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a031502040302010c0b01020a01010d0703f0c10283cb02ef38678b00";
