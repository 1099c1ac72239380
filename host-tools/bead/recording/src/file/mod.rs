//! Recordings: the bytes that beads sent, and what belongs to them, in one MCAP file.
//!
//! # Design
//! The channel `frames` has one message for each run of bytes up to a delimiter, with the delimiter, as
//! received: sound frames and corrupt ones alike, so that a recording can be decoded again by a better
//! decoder. Runs that are not frames and come together share a message. The messages are numbered from 0, so
//! that the numbers show how many are missing in a damaged file. Beside it are a metadata record `recording`
//! ([`About`]), one `note` for each note of a person ([`Note`]), and attachments ([`Part`]).
//!
//! For programs that know nothing of beads the channels `strikes`, `shapes`, `waveforms`, `status`, `health`
//! and `faults` have the content of the frames in Protobuf and SI units ([`crate::protobuf`]).
//! This program does not read them.
//!
//! **Several beads.** In a recording of several beads each has its own channels, with its address in their
//! names, `bead/7/frames` and so on, and its own attachments. See [`RecordingOrigin`] and
//! [`RecordingWriter::join`]. One iterator reads both kinds: each of its [`Pieces`] names its bead, and
//! [`Recording::of`] selects one bead.
//!
//! **Times.** The publish time of a message is the bead's own: sample index over sample rate, in nanoseconds.
//! Its log time is the host's, when the bytes were received, in nanoseconds since 1970. The receive times of
//! an emulated bead count from its power-up, so that equal runs have equal recordings. Where no receive time
//! is known, the log time is the bead's, but never decreases: after a restart of the bead, whose index begins
//! again, it continues from the last one. Bytes that are not a frame have the time of the frame before them.
//!
//! A message on the channel `received` shows that log times are receive times. It has, for each piece of
//! bytes in which runs ended, the number of the last run (u32) and the host's time (u64, ns since 1970),
//! little-endian. From the receive times [`crate::clock`] finds how the clocks of bead and host run relative
//! to each other.
//!
//! **Crashes.** A recording is written as `NAME.partial` and takes its name when it is finished: a file with
//! that name is whole. The writer gives complete chunks to the system, at least once a second while bytes
//! come. A recording that is cut at any byte gives back every message before the cut. A damaged one gives
//! back every chunk with a good CRC, and of the others every frame with a good CRC ([`Damage`]). The chunks
//! are not compressed, so that a cut or damaged one stays readable. A file that another program has
//! compressed is refused with the command that unpacks it.

mod about;
mod append;
mod channels;
mod contents;
mod error;
mod follow;
mod layout;
mod notes;
mod read;
mod records;
mod search;
mod stream;
mod tail;
#[cfg(test)]
mod tests;
mod writer;

pub use about::{About, Part, RecordedBead, RecordingOrigin};
pub use append::add_notes;
pub use error::RecordingError;
pub use follow::Follower;
pub use notes::{NOTES_MOST, Note};
pub(crate) use read::{CUT_IN_INDEX, RECOVERED_FROM, WHOLE};
pub use read::{Pieces, Recording};
pub use records::{Damage, State};
pub use writer::{BeadIndex, Finished, RecordingWriter};
