//! Force and acceleration over time from the files of other instruments.
//!
//! # Design
//! The first bytes of a file tell its form, its name does not. Text tables and Parquet files have columns,
//! whose names give quantity and unit unless the caller does ([`Choice`]). All readers push their rows into
//! one place (`rows.rs`), which refuses disordered times, missing values and gaps. A [`Waveform`] is in SI
//! units, begins at rest, and has a value at any time ([`trace::Trace`]).

mod choice;
mod columns;
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

pub use choice::{Address, Choice, Wanted};
pub use error::WaveformError;
pub use signals::Waveform;
pub use trace::Trace;

impl Waveform {
    /// Reads a file; of a recording of several beads, a strike of bead number `bead`.
    ///
    /// # Errors
    /// The file cannot be read, or is no waveform with units; the message is one line: what, why, what next.
    pub fn read(path: &Path, choice: &Choice, bead: Option<usize>) -> Result<Self, WaveformError> {
        let unread = |source| WaveformError::File {
            path: path.to_owned(),
            source,
        };
        let is_file = path.metadata().map_err(unread)?.is_file();
        if !is_file {
            return Err(WaveformError::unfit(
                path,
                "is a directory, a device or a pipe; give a file",
            ));
        }
        let mut head = [0; 12];
        let mut file = File::open(path).map_err(unread)?;
        let mut length = 0;
        while let Ok(more @ 1..) = file.read(&mut head[length..]) {
            length += more;
        }
        match (&head[..length], length) {
            (_, 0) => Err(WaveformError::unfit(
                path,
                "is empty; give a file with a waveform",
            )),
            ([b'P', b'A', b'R', b'1', ..], _) => parquet::read(path, choice),
            ([b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E'], _) => wav::read(path, choice),
            ([0x89, b'M', b'C', b'A', b'P', ..], _) => recorded::read(path, choice, bead),
            _ => text::read(path, choice),
        }
    }
}
