use crate::body::body;

body! {
    /// A strike that the bead keeps, so that a host can fetch it. A host asks for the list of them; each
    /// gives one frame, the oldest first. They outlive a reset, and the oldest give way to new ones.
    pub struct Kept: Copy {
        /// The boot in which the strike was measured.
        pub boot: u32,
        /// Number of the strike in that boot.
        pub strike: u32,
        /// Number of frames of the strike.
        pub parts: u8,
        /// Number of bytes of memory that it takes.
        pub bytes: u32,
    }
}
