use crate::body::body;

body! {
    /// A strike that the bead's own outputs played on a bench, or a level that they held. It comes after
    /// each.
    pub struct Played: Copy {
        /// Sample index of the first scan that finds it at the inputs.
        pub first_index: u64,
        /// Number of scans that find it.
        pub scans: u32,
        /// False if the outputs did not get all of its codes.
        pub complete: bool,
    }
}
