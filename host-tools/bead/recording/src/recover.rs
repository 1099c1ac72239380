//! Makes whole recordings from cut or damaged ones, and from raw bytes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use bead_wire::{Arrival, Message};

use crate::file::{
    About, CUT_IN_INDEX, Finished, RECOVERED_FROM, Recording, RecordingError, RecordingWriter, State, WHOLE,
};
use crate::frames::Item;
use crate::raw;
use bead_tables::whole::Target;

/// A recovered recording, and what is missing in it.
#[derive(Debug)]
pub struct Recovered {
    /// The new recording.
    pub finished: Finished,
    /// Damage of the old one, in words.
    pub found: String,
    /// Number of runs of bytes that are missing in the old file.
    pub runs_missing: u64,
    /// Number of strikes whose samples came, and whose result did not.
    pub strikes_without_result: u64,
}

/// Greatest number of strikes without a result at a time: one is sent while the next is measured. More are
/// forged.
const OPEN_MOST: usize = 16;

/// Counts strikes whose samples came, and whose result did not.
#[derive(Default)]
struct OpenStrikes {
    /// By the bead's address.
    strikes: BTreeMap<u8, BTreeSet<u32>>,
    /// Number of strikes whose result can no longer come, after a restart or many others.
    ended: u64,
}

impl OpenStrikes {
    fn push(&mut self, item: Item) {
        let Item::Frame(frame) = item else { return };
        let open = self.strikes.entry(frame.header.address).or_default();
        if let Arrival::Restart { .. } = frame.arrival {
            self.ended += open.len() as u64;
            open.clear();
        }
        match frame.message {
            // A late one may be of a strike whose result came.
            Message::Waveform(waveform) if !matches!(frame.arrival, Arrival::Late | Arrival::Duplicate) => {
                open.insert(waveform.strike);
                if open.len() > OPEN_MOST {
                    open.pop_first();
                    self.ended += 1;
                }
            }
            Message::Strike(strike) => _ = open.remove(&strike.strike),
            _ => {}
        }
    }

    fn count(&self) -> u64 {
        self.ended + self.strikes.values().map(|open| open.len() as u64).sum::<u64>()
    }
}

/// Writes what can be read of a recording to a new one, byte for byte.
///
/// # Errors
/// The old file cannot be read, or the new one cannot be written.
pub fn recover(recording: &Recording, target: &Target) -> Result<Recovered, RecordingError> {
    let (how, found) = match &recording.state {
        State::Whole => (WHOLE.to_owned(), "nothing is wrong with it".to_owned()),
        State::CutShort { runs_whole } => {
            let (how, found) = if *runs_whole {
                (CUT_IN_INDEX, "only its index is cut short, after the last frame")
            } else {
                (
                    "cut short",
                    "it is cut short: the last bytes received are missing",
                )
            };
            (how.to_owned(), found.to_owned())
        }
        State::Damaged(damage) => (damage.to_string(), damage.to_string()),
    };
    let mut about = About::clone(&recording.about);
    about.notes.insert(RECOVERED_FROM.into(), how);
    let mut open = OpenStrikes::default();
    let several = !recording.beads.is_empty();
    let writer = if several {
        RecordingWriter::create_for_several(target, &about)?
    } else {
        RecordingWriter::create(target, &about)?
    };
    let finished = writer.fill(|writer| {
        for (part, data) in &recording.parts {
            writer.attach(*part, data)?;
        }
        let mut beads = BTreeMap::new();
        for bead in &recording.beads {
            let index = writer.join(&bead.origin)?;
            for (part, data) in &bead.parts {
                writer.attach_to(index, *part, data)?;
            }
            beads.insert(bead.origin.address, index);
        }
        for piece in recording.pieces()? {
            let (bytes, received_ns) = (&piece.bytes, piece.received_ns);
            match piece.bead.and_then(|address| beads.get(&address)) {
                Some(bead) => writer.write_of(*bead, bytes, received_ns, |item| open.push(item))?,
                None if several => {}
                None => writer.write(bytes, received_ns, |item| open.push(item))?,
            }
        }
        Ok(())
    })?;
    Ok(Recovered {
        finished,
        found,
        runs_missing: recording.runs_missing,
        strikes_without_result: open.count(),
    })
}

/// Writes a recording of bytes as a bead sent them, without times of receipt.
///
/// # Errors
/// As [`recover`].
pub fn recover_raw(file: &Path, target: &Target) -> Result<Recovered, RecordingError> {
    let about = About {
        source: "raw bytes".to_owned(),
        ..About::default()
    };
    let mut open = OpenStrikes::default();
    let writer = RecordingWriter::create(target, &about)?;
    let finished =
        writer.fill(|writer| raw::read(file, |bytes| writer.write(bytes, None, |item| open.push(item))))?;
    Ok(Recovered {
        finished,
        found: "it has raw bytes, without the times at which they were received".to_owned(),
        runs_missing: 0,
        strikes_without_result: open.count(),
    })
}
