//! Frames as they come from a bead: pieces of bytes in, frames with their receive times out.
//!
//! # Design
//! [`Frames`] turns bytes into frames, from every source: a recording, a pipe, a line, an emulated run. It
//! keeps the frames of one piece of bytes. Frames stay as they came: fixed-point bits and ADC codes.

use std::collections::{HashMap, VecDeque};

use bead_wire::{Arrival, Counters, Decoder, Header, Message, Reject, Strike, VERSION};

/// A frame that passed every check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Version of the sender: see [`bead_wire::Frame::version`].
    pub version: u8,
    /// Address, boot, sequence number, sample index.
    pub header: Header,
    /// Its place among the frames of its bead.
    pub arrival: Arrival,
    /// Scans a second, in hertz, by the bead's last identity before it.
    pub sample_rate_hz: Option<u32>,
    /// Receive time, ns since 1970, `None` if unknown.
    pub received_ns: Option<u64>,
    /// Strike that a shape belongs to, from the strike frame before it.
    pub strike: Option<Strike>,
    /// The message.
    pub message: Message,
}

impl Frame {
    /// A frame of the bead with this address, with number 0 and at no known time.
    pub fn of(address: u8, boot: u8, arrival: Arrival, message: impl Into<Message>) -> Self {
        Self {
            version: bead_wire::VERSION,
            header: Header {
                address,
                boot,
                sequence: 0,
                sample_index: 0,
            },
            arrival,
            sample_rate_hz: None,
            received_ns: None,
            strike: None,
            message: message.into(),
        }
    }

    /// The bead's time of a sample index, in s since the reset. `None` before an identity gave the sample
    /// rate.
    pub fn seconds(&self, index: f64) -> Option<f64> {
        self.sample_rate_hz
            .filter(|rate| *rate > 0)
            .map(|rate| index / f64::from(rate))
    }

    /// One line about a bead of a version that this program does not know: who it is and what to do. `None`
    /// unless this is the identity of such a bead.
    pub fn from_the_future(&self) -> Option<String> {
        match &self.message {
            Message::Identity(bead) if self.version > VERSION => Some(format!(
                "bead {} with firmware {} ({}) speaks version {} of the protocol, and this program knows \
                 version {VERSION}; use the `bead` that belongs to that firmware",
                self.header.address, bead.firmware, bead.git, self.version
            )),
            _ => None,
        }
    }
}

/// The content between two delimiters.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(clippy::large_enum_variant, reason = "nearly every item is a frame")]
pub enum Item {
    /// A frame.
    Frame(Frame),
    /// Bytes that are not a frame.
    Rejected(Reject),
}

impl Item {
    /// The frame, if it is one.
    pub fn frame(self) -> Option<Frame> {
        match self {
            Self::Frame(frame) => Some(frame),
            Self::Rejected(_) => None,
        }
    }
}

/// A piece of received bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// Address of their bead, in a recording of several beads.
    pub bead: Option<u8>,
    /// The bytes, delimiters among them.
    pub bytes: Vec<u8>,
    /// Receive time of the last of them, ns since 1970, `None` if unknown.
    pub received_ns: Option<u64>,
}

/// Turns pieces of bytes into frames.
#[derive(Clone, Debug, Default)]
pub struct FrameReader {
    decoder: Decoder,
    /// Scans a second of each bead, by its address.
    rates: HashMap<u8, u32>,
    /// The last strike of each bead, by its address.
    strikes: HashMap<u8, Strike>,
}

impl FrameReader {
    /// Takes bytes as received, and passes each frame and each reject to `sink`.
    pub fn feed(&mut self, bytes: &[u8], received_ns: Option<u64>, mut sink: impl FnMut(Item)) {
        let Self {
            decoder,
            rates,
            strikes,
        } = self;
        decoder.feed(bytes, |result| {
            sink(match result {
                Ok(frame) => {
                    let (address, mut of_strike) = (frame.header.address, None);
                    match &frame.message {
                        Message::Identity(identity) => drop(rates.insert(address, identity.sample_rate_hz)),
                        Message::Strike(strike) => drop(strikes.insert(address, *strike)),
                        Message::Shape(shape) => {
                            let last = strikes.get(&address).copied();
                            of_strike = last.filter(|strike| strike.strike == shape.strike);
                        }
                        _ => {}
                    }
                    Item::Frame(Frame {
                        version: frame.version,
                        header: frame.header,
                        arrival: frame.arrival,
                        sample_rate_hz: rates.get(&address).copied(),
                        received_ns,
                        strike: of_strike,
                        message: frame.message,
                    })
                }
                Err(reject) => Item::Rejected(reject),
            });
        });
    }

    /// Counts of what came, what was refused, and what was lost.
    pub fn counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// Bytes after the last delimiter: at the end of a stream, a frame cut short.
    pub fn pending(&self) -> u64 {
        self.decoder.pending()
    }
}

/// The frames and rejects in pieces of bytes, in the order received.
#[derive(Clone, Debug)]
pub struct Frames<I> {
    pieces: I,
    reader: FrameReader,
    ready: VecDeque<Item>,
}

impl<I: Iterator<Item = Piece>> Frames<I> {
    /// The frames in `pieces`.
    pub fn new(pieces: impl IntoIterator<IntoIter = I>) -> Self {
        Self {
            pieces: pieces.into_iter(),
            reader: FrameReader::default(),
            ready: VecDeque::new(),
        }
    }

    /// Counts of what came so far, what was refused, and what was lost.
    pub fn counters(&self) -> &Counters {
        self.reader.counters()
    }

    /// Number of bytes after the last delimiter so far.
    pub fn pending(&self) -> u64 {
        self.reader.pending()
    }

    /// True if the next frame must be read from a piece that is still to come. On a line that may take long.
    pub fn is_empty(&self) -> bool {
        self.ready.is_empty()
    }
}

impl<I: Iterator<Item = Piece>> Iterator for Frames<I> {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        let Self {
            pieces,
            reader,
            ready,
        } = self;
        while ready.is_empty() {
            let piece = pieces.next()?;
            reader.feed(&piece.bytes, piece.received_ns, |item| ready.push_back(item));
        }
        ready.pop_front()
    }
}

/// The frames of a whole stream, and the counts of what came, was refused and was lost.
pub fn decode(bytes: &[u8]) -> (Vec<Frame>, Counters) {
    let (mut reader, mut frames) = (FrameReader::default(), Vec::new());
    reader.feed(bytes, None, |item| frames.extend(item.frame()));
    (frames, *reader.counters())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_items_of_a_piece_are_ready_before_the_first_is_handed_on() {
        let piece = |bytes: &[u8]| Piece {
            bytes: bytes.to_vec(),
            ..Piece::default()
        };
        // A code of COBS that promises nothing: each two bytes are a reject.
        let mut frames = Frames::new([piece(&[1, 0, 1, 0, 1]), piece(&[1]), piece(&[0])]);
        // When no more is ready, the line may be silent, and the reader must not wait for more.
        for is_last in [false, true, true] {
            assert!(matches!(frames.next(), Some(Item::Rejected(_))));
            assert_eq!(frames.is_empty(), is_last);
        }
        assert_eq!((frames.pending(), frames.next()), (0, None));
        assert_eq!(frames.counters().bytes, 7);
    }
}
