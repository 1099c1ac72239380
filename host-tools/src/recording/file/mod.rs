//! Recordings: what a bead sent, byte for byte, and what belongs to it, in one MCAP file.
//!
//! # Design
//! The channel `frames` has one message for each run of bytes between two delimiters, as received: sound
//! frames and corrupt ones alike, so that a recording can be decoded again by a better decoder. Runs that are
//! no frames and come together stand in one message, with the delimiters between them. The messages are
//! numbered from 0, so that a damaged file tells how many are missing. Beside it stand a metadata record
//! `recording` (see [`About`]) and attachments (see [`Part`]).
//!
//! For programs that know nothing of beads the channels `strikes`, `shapes`, `waveforms`, `status`, `health`
//! and `faults` say in Protobuf and SI units what the frames say ([`crate::recording::protobuf`]). This
//! program does not read them: what it tells of a recording it finds in the frames.
//!
//! **Several beads.** In a recording of several beads each has these channels for itself, with its address in
//! their names, `bead/7/frames` and so on, and attachments of its own. See [`Origin`] and [`Writer::join`].
//! One iterator reads both kinds: [`Pieces`] says of each piece whose it is, and [`Recording::of`] leaves one
//! bead.
//!
//! **Times.** A message's publish time is the bead's own: sample index over sample rate, in nanoseconds. Its
//! log time is the host's, when the bytes were received, in nanoseconds since 1970. Where the host's is not
//! known, it is the bead's, but never runs back: after a restart of the bead, whose index begins again, it
//! goes on from the last one. An emulated bead was received at times that count from its power-up, so that
//! equal runs have equal recordings. Bytes that are no frame have the time of the frame before them.
//!
//! A second channel, `received`, says when the host received the bytes: for each piece of bytes in which runs
//! ended, the number of the last run (u32) and the host's time (u64, ns since 1970), little-endian. From this
//! [`crate::recording::clock`] finds how the clocks of bead and host run against each other.
//!
//! **Crashes.** A recording is written as `NAME.partial` and takes its name when it is finished: a file with
//! that name is whole. The writer gives complete chunks to the system, at least once a second while bytes
//! come. A recording cut short at any byte gives back every message before the cut, and says that it was cut.
//! A damaged one gives back what is before and behind the damage ([`Damage`]). The chunks are not compressed,
//! as frames are dense and a cut chunk must stay readable.

mod about;
mod channels;
mod chunk;
mod error;
mod found;
mod layout;
mod read;
mod records;
mod source;
mod stream;
#[cfg(test)]
mod tests;
mod times;
mod walk;
mod writer;

pub use about::{About, Origin, Part};
pub use error::RecordingError;
pub use read::{Bead, Pieces, Recording};
pub use walk::{Damage, State};
pub use writer::{Finished, Lane, Writer};
