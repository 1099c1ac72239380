use crate::body::body;
use crate::text::Block;

body! {
    /// The settings block in force. It comes with each identity frame, and after each change before the first
    /// strike that is measured with it. So a strike was measured with the settings of the last such frame
    /// before its own.
    pub struct Settings {
        /// Magic, version, length, body and CRC, as `bead-model` encoded them.
        pub block: Block,
    }
}
