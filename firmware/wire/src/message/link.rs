use crate::body::body;

body! {
    /// What came in over the link since the last reset, and what became of it: with each status, and at the end of a raw
    /// stream.
    ///
    /// The bytes between two delimiters are either an accepted request or counted in exactly one of the rejections.
    pub struct Link: Copy, Default {
        /// Bytes received.
        pub bytes: u64,
        /// Requests accepted.
        pub requests: u32,
        /// Times that the receiver was not emptied in time, and bytes were lost.
        pub overruns: u32,
        /// Times that there was no stop bit, or noise.
        pub line_errors: u32,
        /// Rejected: more bytes than any request has.
        pub rejected_too_long: u32,
        /// Rejected: not COBS.
        pub rejected_cobs: u32,
        /// Rejected: fewer bytes than header and CRC.
        pub rejected_too_short: u32,
        /// Rejected: the CRC does not match.
        pub rejected_crc: u32,
        /// Rejected: of another version.
        pub rejected_version: u32,
        /// Rejected: of an unknown kind.
        pub rejected_kind: u32,
        /// Rejected: the body is not that of its kind.
        pub rejected_body: u32,
        /// Rejected: the body goes on after its request.
        pub rejected_trailing: u32,
        /// Scans sent in raw frames.
        pub raw_sent: u64,
        /// Scans of a raw stream that were not sent: the link carries fewer than are taken.
        pub raw_dropped: u64,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Link {
    Link {
        bytes: 5_000_000_000,
        requests: 12,
        overruns: 1,
        line_errors: 2,
        rejected_too_long: 300,
        rejected_cobs: 4,
        rejected_too_short: 5,
        rejected_crc: 70_000,
        rejected_version: 6,
        rejected_kind: 7,
        rejected_body: 8,
        rejected_trailing: 9,
        raw_sent: 580_000,
        raw_dropped: 420_000,
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str =
    "000a031202040302010c0b01020a01011f0780e497d0120c0102ac020405f0a20406070809a0b323a0d1194622427300";
