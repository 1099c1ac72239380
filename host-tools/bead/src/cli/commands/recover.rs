//! `bead recover`: makes a whole recording of one that is cut or damaged.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;

use bead_wire::{Arrival, Message};

use crate::cli::commands::prelude::*;
use bead_recording::file::{About, Damage, Finished, Recording, RecordingError, State, Writer};
use bead_recording::frames::Item;
use bead_recording::raw;

const AFTER_HELP: &str = "\
What can be read of the recording is written to a new one, byte for byte, with the times of receipt and all \
that is attached. In a damaged place every frame is found by its own CRC. What is missing is said, also a \
strike whose samples came and whose result did not. The file itself stays as it is. Raw bytes as a bead sent them become a recording too, without times.

Exit status 0 also if something is missing, 2 if there is nothing to recover.

Examples:
  bead recover bead-20260718-101500.mcap.partial
  bead recover damaged.mcap --out sound.mcap
  bead recover uart.bin --out strikes.mcap";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording, or raw bytes as received.
    file: PathBuf,
    /// The new recording [default: F.mcap for F.mcap.partial, else F-recovered.mcap].
    #[arg(long, value_name = "F.mcap")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct RecoverReport {
    recording: PathBuf,
    found: String,
    frames: u64,
    bytes: u64,
    runs_missing: u64,
    frames_lost: u64,
    strikes_without_result: u64,
    frames_corrupt: u64,
    restarts: u64,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = &arguments.file;
    let out = arguments.out.clone().unwrap_or_else(|| new_name(file));
    let target = place::target(&out, FileKind::Recording, &[file], arguments.overwrite)?;
    let progress = output::spinner(format!("reading {}", file.display()));
    let result = match Recording::salvage(file) {
        Ok(recording) => recover(&recording, &target)?,
        Err(RecordingError::NotOurs(..)) if raw::frames_in(file) > 0 => from_raw(file, &target)?,
        Err(RecordingError::NotOurs(..)) if !begins_as_mcap(file) => bail!(
            Input,
            "{}: there is no frame of a bead and no record of a recording in it; give a recording, or the bytes that a bead \
             sent",
            file.display()
        ),
        Err(error) => return Err(error.into()),
    };
    progress.finish_and_clear();
    output::print(arguments.format, &result, || {
        let rows = [
            ("recording", result.recording.display().to_string()),
            ("found", result.found.clone()),
            ("frames", result.frames.to_string()),
            (
                "runs of bytes missing in the file",
                result.runs_missing.to_string(),
            ),
            ("frames missing by their numbers", result.frames_lost.to_string()),
            (
                "strikes without their result",
                result.strikes_without_result.to_string(),
            ),
            ("corrupt frames kept", result.frames_corrupt.to_string()),
        ];
        output::rows(rows)
    })
}

impl RecoverReport {
    fn new(finished: Finished, runs_missing: u64, found: String, open: &OpenStrikes) -> Self {
        let counters = finished.counters;
        Self {
            recording: finished.path,
            found,
            frames: counters.frames,
            bytes: counters.bytes,
            runs_missing,
            frames_lost: counters.lost,
            strikes_without_result: open.count(),
            frames_corrupt: counters.rejected.total(),
            restarts: counters.restarts,
        }
    }
}

/// Greatest number of strikes without a result at a time: one is sent while the next is measured. More are
/// forged.
const OPEN_MOST: usize = 16;

/// Counts strikes whose samples came, and whose result did not.
#[derive(Default)]
struct OpenStrikes {
    /// By the bead's address.
    strikes: BTreeMap<u8, BTreeSet<u32>>,
    /// Number of strikes whose result can come no more, after a restart or many others.
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

/// `F.mcap` of `F.mcap.partial` and `F.mcap.2.partial`, else `F-recovered.mcap`.
fn new_name(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let whole = name
        .strip_suffix(".partial")
        .map(|name| match name.rsplit_once('.') {
            Some((stem, number)) if number.parse::<u32>().is_ok() => stem,
            _ => name,
        });
    let whole = whole.filter(|name| name.ends_with(".mcap"));
    if let Some(name) = whole.filter(|name| !file.with_file_name(name).exists()) {
        return file.with_file_name(name);
    }
    let stem = whole
        .map_or(Path::new(&*name), Path::new)
        .file_stem()
        .unwrap_or_default();
    file.with_file_name(format!("{}-recovered.mcap", stem.to_string_lossy()))
}

fn begins_as_mcap(file: &Path) -> bool {
    let mut head = [0; 5];
    let read = File::open(file).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head == *b"\x89MCAP"
}

fn recover(recording: &Recording, target: &Target) -> Result<RecoverReport, Failure> {
    let (how, found) = match &recording.state {
        State::Whole => ("whole".to_owned(), "nothing is wrong with it".to_owned()),
        State::CutShort { runs_whole } => {
            let behind = "it is cut in its index, behind the last frame";
            let before = "it is cut short: what was received last is missing";
            (
                "cut short".to_owned(),
                output::either(*runs_whole, behind, before),
            )
        }
        State::Damaged(damage) => (damage.to_string(), damage.to_string()),
    };
    let mut about = About::clone(&recording.about);
    about.notes.insert("recovered_from".into(), how);
    let mut open = OpenStrikes::default();
    let several = !recording.beads.is_empty();
    let writer = if several {
        Writer::create_for_several(target, &about)?
    } else {
        Writer::create(target, &about)?
    };
    let finished = place::record(writer, |writer| {
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
    Ok(RecoverReport::new(finished, recording.runs_missing, found, &open))
}

fn from_raw(file: &Path, target: &Target) -> Result<RecoverReport, Failure> {
    let about = About {
        source: "raw bytes".to_owned(),
        ..About::default()
    };
    let mut open = OpenStrikes::default();
    let finished = place::record(Writer::create(target, &about)?, |writer| {
        raw::read(file, |bytes| writer.write(bytes, None, |item| open.push(item)))
    })?;
    let damage = Damage {
        other: Some("it has raw bytes, without times of receipt".to_owned()),
        ..Damage::default()
    };
    Ok(RecoverReport::new(finished, 0, damage.to_string(), &open))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unfinished_recording_gets_its_own_name_and_any_other_a_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let name = |file: &str| new_name(&folder.path().join(file));
        assert_eq!(name("a.mcap.partial"), folder.path().join("a.mcap"));
        assert_eq!(name("a.mcap.2.partial"), folder.path().join("a.mcap"));
        assert_eq!(name("a.mcap"), folder.path().join("a-recovered.mcap"));
        assert_eq!(name("uart.bin"), folder.path().join("uart-recovered.mcap"));
        std::fs::write(folder.path().join("a.mcap"), "").unwrap();
        assert_eq!(name("a.mcap.partial"), folder.path().join("a-recovered.mcap"));
    }
}
