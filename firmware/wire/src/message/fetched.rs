use crate::body::body;
use crate::text::Inner;

body! {
    /// A frame of an earlier strike, once more. A host asks for a strike with the request `fetch`. Its frames
    /// come in this order: the settings that it was measured with, its waveform, the strike, its shape.
    ///
    /// The header is that of the answer. The boot in which the strike was measured is in the body.
    pub struct Fetched {
        /// The boot in which the strike was measured.
        pub boot: u32,
        /// Number of the strike in that boot.
        pub strike: u32,
        /// Number of frames of the strike before this one.
        pub part: u8,
        /// Number of frames of the strike.
        pub parts: u8,
        /// Kind of the frame that it carries.
        pub frame_kind: u8,
        /// Body of that frame.
        pub body: Inner,
    }
}
