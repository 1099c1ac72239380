use crate::body::body;

body! {
    /// Counts of the bytes and requests that the bead received since the last reset, by their outcome. It
    /// comes with each status frame, and at the end of a raw stream.
    ///
    /// The bytes between two delimiters count once: as a request, or in exactly one of the rejections.
    pub struct Link: Copy, Default {
        /// Number of bytes received.
        pub bytes: u64,
        /// Number of requests understood, including those to other addresses.
        pub requests: u32,
        /// Number of times that the receiver was not emptied in time, and bytes were lost.
        pub overruns: u32,
        /// Number of stop bits that were missing or noisy.
        pub line_errors: u32,
        /// Rejected: longer than any request.
        pub rejected_too_long: u32,
        /// Rejected: not COBS.
        pub rejected_cobs: u32,
        /// Rejected: shorter than header and CRC.
        pub rejected_too_short: u32,
        /// Rejected: wrong CRC.
        pub rejected_crc: u32,
        /// Rejected: another version.
        pub rejected_version: u32,
        /// Rejected: unknown kind.
        pub rejected_kind: u32,
        /// Rejected: the body does not fit the kind.
        pub rejected_body: u32,
        /// Rejected: bytes are left over after the body.
        pub rejected_trailing: u32,
        /// Number of scans sent in raw frames.
        pub raw_sent: u64,
        /// Number of scans of raw streams that were not sent, because the link carries fewer scans than the
        /// bead takes.
        pub raw_dropped: u64,
    }
}
