//! Force and acceleration over time from the files of other instruments.
//!
//! # Design
//! The first bytes of a file determine its form; its name does not. Names of table columns state quantity
//! and unit unless the caller does ([`Choice`]). All readers push their rows into one place (`rows.rs`),
//! which refuses disordered times, missing values and gaps. A [`Waveform`] is in SI units, begins at rest,
//! and has a value at any time ([`trace::Trace`]).

mod arrays;
mod choice;
mod columns;
mod doubts;
mod error;
mod gzip;
mod matlab;
mod numpy;
mod parquet;
mod recorded;
mod riff;
mod rows;
mod signals;
#[cfg(test)]
mod testing;
mod text;
pub mod trace;
mod unread;
mod wav;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use choice::{Choice, ColumnAddress, Wanted};
pub use error::WaveformError;
pub use signals::Waveform;
pub use trace::Trace;

impl Waveform {
    /// Reads a file; of a recording of several beads, a strike of bead number `bead`.
    ///
    /// # Errors
    /// The file cannot be read, or is no waveform with units; the message is one line: what, why, what next.
    pub fn read(path: &Path, choice: &Choice, bead: Option<usize>) -> Result<Self, WaveformError> {
        let unread = WaveformError::unread(path);
        if !path.metadata().map_err(&unread)?.is_file() {
            return Err(WaveformError::unfit(
                path,
                "is a directory, a device or a pipe; give a file",
            ));
        }
        let mut head = Vec::new();
        let read = File::open(path).and_then(|file| file.take(unread::HEAD).read_to_end(&mut head));
        read.map_err(unread)?;
        match &head[..] {
            [] => Err(WaveformError::unfit(
                path,
                "is empty; give a file with a waveform",
            )),
            [0x1F, 0x8B, ..] => {
                let unpacked = gzip::unpack(path)?;
                let waveform = Self::read(unpacked.path(), choice, bead);
                waveform.map_err(|error| error.of(path))
            }
            [b'P', b'A', b'R', b'1', ..] => parquet::read(path, choice),
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E', ..] => wav::read(path, choice),
            [0x89, b'M', b'C', b'A', b'P', ..] => recorded::read(path, choice, bead),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => numpy::read(path, choice),
            head if matlab::is_level_5(head) => matlab::read(path, choice),
            head => match unread::reason(head) {
                Some(reason) => Err(WaveformError::unfit(path, reason)),
                None => text::read(path, choice),
            },
        }
    }
}
