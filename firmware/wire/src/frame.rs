//! One frame: its layout, how it is encoded, and how it is decoded.
//!
//! # Design
//! ```text
//! 0x00  COBS( version u8 | kind u8 | boot u8 | sequence u32 | sample index u64 | address u8
//!             | body | CRC-32 u32 )  0x00
//! ```
//!
//! Numbers are little-endian. The CRC is CRC-32/ISO-HDLC of all bytes before it. A delimiter is on *both*
//! sides of a frame. With one at the end only, a flipped bit in it, or a reset in the middle of a frame,
//! would damage the next frame too.
//!
//! **The header is frozen**, and so are the bodies of [`Identity`](crate::Identity) and
//! [`Reply`](crate::Reply). A later version may change all other bodies, and may append fields to these two.
//! A host can therefore always say which bead sends and why it cannot read the rest, and a bead can always
//! say that it does not understand its host.

use crate::body::Body;
use crate::cause::Cause;
use crate::message::{Fetched, Guard, Kind, MAX_BODY, Message, Shape};
use crate::payload::{BufferTooSmall, CRC_LENGTH, open, seal};
use crate::sequence::Arrival;
use crate::version::{VERSION, is_unreleased};

/// Version, kind, boot, sequence, sample index, address.
const HEADER: usize = 1 + 1 + 1 + 4 + 8 + 1;
/// Longest frame before COBS, in bytes.
const MAX_PAYLOAD: usize = HEADER + MAX_BODY + CRC_LENGTH;
/// Longest frame between its delimiters, in bytes.
pub(crate) const MAX_ENCODED: usize = cobs::max_encoding_length(MAX_PAYLOAD);
/// Longest frame on the wire with both delimiters, in bytes. A buffer of this length is always long enough.
pub const MAX_FRAME: usize = 1 + MAX_ENCODED + 1;

/// The header of a frame: the fields before every body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Address of the bead, from its settings. It tells beads apart on a shared line and in merged streams. 0
    /// unless the owner chose one.
    pub address: u8,
    /// Low byte of the number of resets since power-up. A different byte begins a new run of sequence
    /// numbers.
    pub boot: u8,
    /// Number of the frame since the reset, from 0. Frames that were made but not sent count too. It wraps
    /// after 2³².
    pub sequence: u32,
    /// Index of the newest scan when the frame was made.
    pub sample_index: u64,
}

/// A frame that passed every check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Version of the sender. It is above [`VERSION`] for an identity or a reply of a later version.
    pub version: u8,
    /// Its header.
    pub header: Header,
    /// Its place among the earlier frames of this address.
    pub arrival: Arrival,
    /// Its message.
    pub message: Message,
}

/// Writes one frame, with both its delimiters, to the head of `buffer` and returns it.
///
/// # Errors
/// The buffer is too small. [`MAX_FRAME`] bytes are always enough.
pub fn encode<'b>(
    header: &Header,
    message: &Message,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], BufferTooSmall> {
    let mut packed = Packed::new();
    packed.pack(header.address, header.boot, message)?;
    packed.stamp(header.sequence, header.sample_index);
    packed.seal(buffer)
}

/// A frame without CRC and COBS: header and body, as they wait to be sent.
pub struct Packed {
    payload: [u8; MAX_PAYLOAD],
    length: usize,
}

impl Default for Packed {
    fn default() -> Self {
        Self::new()
    }
}

impl Packed {
    /// Bytes before the body.
    pub const HEADER: usize = HEADER;
    /// Longest packed frame, in bytes.
    pub const MAX: usize = MAX_PAYLOAD - CRC_LENGTH;

    /// An empty frame.
    pub const fn new() -> Self {
        Self {
            payload: [0; MAX_PAYLOAD],
            length: 0,
        }
    }

    /// Packs a message under an address, in a boot. [`stamp`](Self::stamp) gives the frame its number and its
    /// time.
    ///
    /// # Errors
    /// Never: there is room for the longest message. An error costs a frame, a panic would cost the bead.
    // A function of its own so that its instructions can be counted.
    #[inline(never)]
    pub fn pack(&mut self, address: u8, boot: u8, message: &Message) -> Result<(), BufferTooSmall> {
        self.fill(address, boot, message.kind(), |room| message.encode(room))
    }

    /// Packs the body of a message, as [`pack`](Self::pack) does. This code is compiled with its caller: for
    /// the one kind that comes by the dozen.
    ///
    /// # Errors
    /// As for [`pack`](Self::pack).
    pub fn pack_body<B: Body>(
        &mut self,
        address: u8,
        boot: u8,
        kind: Kind,
        body: &B,
    ) -> Result<(), BufferTooSmall> {
        self.fill(address, boot, kind, |room| {
            Ok(postcard::to_slice(body, room)?.len())
        })
    }

    #[inline(always)]
    fn fill(
        &mut self,
        address: u8,
        boot: u8,
        kind: Kind,
        encode: impl FnOnce(&mut [u8]) -> postcard::Result<usize>,
    ) -> Result<(), BufferTooSmall> {
        let payload = &mut self.payload;
        payload[0] = VERSION;
        payload[1] = kind as u8;
        payload[2] = boot;
        payload[HEADER - 1] = address;
        let length = encode(&mut payload[HEADER..HEADER + MAX_BODY]).map_err(|_| BufferTooSmall(MAX_BODY))?;
        self.length = HEADER + length;
        Ok(())
    }

    /// Gives the frame its number and its time.
    pub fn stamp(&mut self, sequence: u32, sample_index: u64) {
        self.payload[3..7].copy_from_slice(&sequence.to_le_bytes());
        self.payload[7..HEADER - 1].copy_from_slice(&sample_index.to_le_bytes());
    }

    /// Kind and body, as another frame can carry them.
    pub fn content(&self) -> (u8, &[u8]) {
        (self.payload[1], &self.payload[Self::HEADER..self.length])
    }

    /// Header and body.
    pub fn bytes(&self) -> &[u8] {
        &self.payload[..self.length]
    }

    /// Room for header and body of this length, at most [`MAX`](Self::MAX), to be filled.
    pub(crate) fn room(&mut self, length: usize) -> &mut [u8] {
        self.length = length.min(Self::MAX);
        &mut self.payload[..self.length]
    }

    /// Writes the frame, with both its delimiters, to the head of `buffer` and returns it.
    ///
    /// # Errors
    /// The buffer is too small. [`MAX_FRAME`] bytes are always enough.
    #[inline(never)]
    pub fn seal<'b>(&mut self, buffer: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        seal(&mut self.payload, self.length, buffer)
    }
}

/// A payload whose CRC is right and whose header can be read. Its body is not yet checked.
pub(crate) struct Checked<'a> {
    pub(crate) version: u8,
    kind: u8,
    pub(crate) header: Header,
    body: &'a [u8],
}

impl<'a> Checked<'a> {
    /// Checks a payload.
    pub(crate) fn new(payload: &'a [u8]) -> Result<Self, Cause> {
        let (head, body) = open::<HEADER>(payload)?;
        let [version, kind, boot, s0, s1, s2, s3, index @ .., address] = *head;
        if version == 0 || is_unreleased(version) {
            return Err(Cause::Version(version));
        }
        let header = Header {
            address,
            boot,
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
            sample_index: u64::from_le_bytes(index),
        };
        Ok(Self {
            version,
            kind,
            header,
            body,
        })
    }

    /// Returns `true` if this is the first frame of a boot.
    pub(crate) fn opens_boot(&self) -> bool {
        self.kind == Kind::Identity as u8 && self.header.sequence == 0
    }

    /// Decodes the body.
    pub(crate) fn message(&self) -> Result<Message, Cause> {
        let later = self.version > VERSION;
        let frozen = [Kind::Identity, Kind::Reply].map(|kind| kind as u8);
        if later && !frozen.contains(&self.kind) {
            return Err(Cause::Version(self.version));
        }
        read(self.kind, self.body, later)
    }
}

/// Reads the message of a kind. Bytes may follow only in a body of a later version.
fn read(kind: u8, body: &[u8], later: bool) -> Result<Message, Cause> {
    let kind = Kind::from_byte(kind).ok_or(Cause::Kind(kind))?;
    match Message::decode(kind, body) {
        Ok((message, rest)) if rest.is_empty() || later => Ok(message),
        Ok(_) => Err(Cause::Trailing),
        Err(_) => read_grown(kind, body),
    }
}

/// Reads a body of the first images, which ends before the fields that its kind has gained since.
fn read_grown(kind: Kind, body: &[u8]) -> Result<Message, Cause> {
    let gained = match kind {
        Kind::Guard => Guard::GAINED,
        Kind::Shape => Shape::GAINED,
        _ => return Err(Cause::Body),
    };
    let mut whole = heapless::Vec::<u8, MAX_BODY>::from_slice(body).map_err(|_| Cause::Body)?;
    whole
        .extend_from_slice(&[0; Shape::GAINED][..gained])
        .map_err(|_| Cause::Body)?;
    match Message::decode(kind, &whole) {
        Ok((message, [])) => Ok(message),
        _ => Err(Cause::Body),
    }
}

impl Fetched {
    /// The message that the frame carries.
    ///
    /// # Errors
    /// The kind is unknown to this version, or the body does not decode.
    pub fn message(&self) -> Result<Message, Cause> {
        read(self.frame_kind, self.body.bytes(), false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Gap;
    use crate::text::Inner;

    const GAP: Gap = Gap {
        epoch: 3,
        first_index: 41_200,
        end_index: 42_371,
    };

    #[test]
    fn a_fetched_frame_gives_the_message_that_was_sent_first() {
        let gap = Message::from(GAP);
        let body = Inner::filled_by(|room| gap.encode(room).unwrap());
        let longer = Inner::filled_by(|room| gap.encode(room).unwrap() + 1);
        for (frame_kind, body, found) in [
            (Kind::Gap as u8, body.clone(), Ok(gap)),
            (Kind::Gap as u8, longer, Err(Cause::Trailing)),
            (Kind::Gap as u8, Inner::default(), Err(Cause::Body)),
            (63, body, Err(Cause::Kind(63))),
        ] {
            let fetched = Fetched {
                boot: 2,
                strike: 300,
                part: 22,
                parts: 24,
                frame_kind,
                body,
            };
            assert_eq!(fetched.message(), found);
        }
    }

    #[test]
    fn bodies_of_the_first_images_lack_what_their_kind_gained_later() {
        for (kind, gained) in [(Kind::Guard, Guard::GAINED), (Kind::Shape, Shape::GAINED)] {
            let message = Message::draw(kind, &mut || 0);
            let mut body = [0; MAX_BODY];
            let length = message.encode(&mut body).unwrap();
            let first = length - gained;
            for end in first - 1..=length {
                let is_whole = [first, length].contains(&end);
                let expected = is_whole.then_some(message.clone()).ok_or(Cause::Body);
                assert_eq!(read(kind as u8, &body[..end], false), expected, "{kind:?} {end}");
            }
        }
    }

    #[test]
    fn a_body_that_is_packed_by_its_kind_gives_the_same_bytes() {
        let (mut one, mut other) = (Packed::new(), Packed::new());
        one.pack(7, 2, &GAP.into()).unwrap();
        other.pack_body(7, 2, Kind::Gap, &GAP).unwrap();
        assert_eq!(one.bytes(), other.bytes());
        assert_eq!(one.content(), (Kind::Gap as u8, &one.bytes()[Packed::HEADER..]));
    }

    #[test]
    fn there_is_no_room_for_more_than_the_longest_frame() {
        assert_eq!(Packed::new().room(Packed::MAX + 1).len(), Packed::MAX);
    }
}
