use crate::body::body;

body! {
    /// The image in the bead's flash, as the bead reads it. A host asks for it.
    pub struct Image: Copy {
        /// Address of its first byte.
        pub address: u32,
        /// Its length, in bytes.
        pub bytes: u32,
        /// CRC-32/ISO-HDLC over all of them.
        pub crc: u32,
    }
}
