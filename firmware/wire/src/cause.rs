//! Causes for refusing bytes.

use serde::Serialize;

use crate::version::reader;

/// Bytes between two delimiters that are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{bytes} bytes rejected: {cause}")]
pub struct Reject {
    /// Cause of the reject.
    pub cause: Cause,
    /// Number of bytes, as received.
    pub bytes: u64,
}

/// Reasons why bytes are no frame, in the order of the checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum Cause {
    /// More bytes than any frame has.
    #[error("longer than a frame may be")]
    TooLong,
    /// Not COBS: a run of bytes goes on beyond the delimiter.
    #[error("not COBS")]
    Cobs,
    /// Fewer bytes than header and CRC.
    #[error("shorter than a header")]
    TooShort,
    /// The CRC does not match.
    #[error("CRC differs")]
    Crc,
    /// A version that this one cannot read.
    #[error("version {0} of the protocol is unknown here; use {program}", program = reader(*.0))]
    Version(u8),
    /// A kind that this version does not know.
    #[error("kind {0} is unknown")]
    Kind(u8),
    /// The body does not fit the kind.
    #[error("body is not a message of its kind")]
    Body,
    /// Bytes are left over after the body.
    #[error("body goes on after its message")]
    Trailing,
}

/// Number of rejects, by [`Cause`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rejected {
    /// [`Cause::TooLong`]
    pub too_long: u64,
    /// [`Cause::Cobs`]
    pub cobs: u64,
    /// [`Cause::TooShort`]
    pub too_short: u64,
    /// [`Cause::Crc`]
    pub crc: u64,
    /// [`Cause::Version`]
    pub version: u64,
    /// [`Cause::Kind`]
    pub kind: u64,
    /// [`Cause::Body`]
    pub body: u64,
    /// [`Cause::Trailing`]
    pub trailing: u64,
}

impl Rejected {
    /// The sums of these counts and of others.
    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            too_long: self.too_long + other.too_long,
            cobs: self.cobs + other.cobs,
            too_short: self.too_short + other.too_short,
            crc: self.crc + other.crc,
            version: self.version + other.version,
            kind: self.kind + other.kind,
            body: self.body + other.body,
            trailing: self.trailing + other.trailing,
        }
    }

    /// Number of rejects, of all causes.
    pub fn total(&self) -> u64 {
        let damaged = self.too_long + self.cobs + self.too_short + self.crc;
        damaged + self.version + self.kind + self.body + self.trailing
    }

    pub(crate) fn count(&mut self, cause: Cause) {
        *match cause {
            Cause::TooLong => &mut self.too_long,
            Cause::Cobs => &mut self.cobs,
            Cause::TooShort => &mut self.too_short,
            Cause::Crc => &mut self.crc,
            Cause::Version(_) => &mut self.version,
            Cause::Kind(_) => &mut self.kind,
            Cause::Body => &mut self.body,
            Cause::Trailing => &mut self.trailing,
        } += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_are_counted_by_cause_and_in_all_and_those_of_two_lines_are_added() {
        use Cause::{Body, Cobs, Crc, Kind, TooLong, TooShort, Trailing, Version};
        // Powers of two, so that no two sums are equal.
        let each = |times: u64| Rejected {
            too_long: times,
            cobs: 2 * times,
            too_short: 4 * times,
            crc: 8 * times,
            version: 16 * times,
            kind: 32 * times,
            body: 64 * times,
            trailing: 128 * times,
        };
        let causes = [
            TooLong,
            Cobs,
            TooShort,
            Crc,
            Version(9),
            Kind(200),
            Body,
            Trailing,
        ];
        let mut counted = Rejected::default();
        for (power, cause) in causes.into_iter().enumerate() {
            (0..1 << power).for_each(|_| counted.count(cause));
        }
        assert_eq!((counted, counted.total()), (each(1), 255));
        assert_eq!(counted.and(&each(2)), each(3));
    }
}
