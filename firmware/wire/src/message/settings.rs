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

#[cfg(test)]
pub(crate) fn example() -> Settings {
    Settings {
        block: Block::try_from(&b"BEAD\x01\x00\xff"[..]).unwrap(),
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a030602040302010c0b01020a0101080707424541440106ff2fa4ef5400";
