//! Force and acceleration over time from the files of other instruments.
//!
//! # Design
//! The first bytes of a file tell its form, its name does not. Text tables and Parquet files have columns,
//! whose names give quantity and unit unless the caller does ([`Choice`]). All readers push their rows into
//! one place (`rows.rs`), which refuses disordered times, missing values and gaps. A [`Waveform`] is in SI
//! units, begins at rest, and has a value at any time ([`trace::Trace`]).

mod choice;
mod columns;
mod doubts;
mod error;
mod parquet;
mod recorded;
mod riff;
mod rows;
mod signals;
mod text;
pub mod trace;
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
        let read = File::open(path).and_then(|file| file.take(12).read_to_end(&mut head));
        read.map_err(unread)?;
        match &head[..] {
            [] => Err(WaveformError::unfit(
                path,
                "is empty; give a file with a waveform",
            )),
            [b'P', b'A', b'R', b'1', ..] => parquet::read(path, choice),
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E'] => wav::read(path, choice),
            [0x89, b'M', b'C', b'A', b'P', ..] => recorded::read(path, choice, bead),
            _ => text::read(path, choice),
        }
    }
}
