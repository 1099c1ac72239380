//! `bead recover`: makes a whole recording of one that is cut or damaged.

use std::fs::File;
use std::io::Read;

use crate::cli::commands::prelude::*;
use bead_recording::file::{Recording, RecordingError};
use bead_recording::raw;
use bead_recording::recover::{recover, recover_raw};

const AFTER_HELP: &str = "\
All that can be read of the recording is written to a new one, byte for byte, with the times of receipt and \
all attachments. In a damaged place every frame is found by its own CRC. Missing parts are reported, and also \
strikes whose samples came without their result. The file itself stays as it is. Raw bytes as a bead sent \
them become a recording too, without times.

Exit status 0 even if something is missing, 2 if there is nothing to recover.

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
    /// Format of the result.
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
    let recovered = match Recording::salvage(file) {
        Ok(recording) => recover(&recording, &target)?,
        Err(RecordingError::NotOurs(..)) if raw::frames_in(file) > 0 => recover_raw(file, &target)?,
        Err(RecordingError::NotOurs(..)) if !begins_as_mcap(file) => bail!(
            Input,
            "{}: it contains neither a frame of a bead nor a record of a recording; give a recording, or the bytes that a \
             bead sent",
            file.display()
        ),
        Err(error) => return Err(error.into()),
    };
    let counters = recovered.finished.counters;
    let result = RecoverReport {
        recording: recovered.finished.path,
        found: recovered.found,
        frames: counters.frames,
        bytes: counters.bytes,
        runs_missing: recovered.runs_missing,
        frames_lost: counters.lost,
        strikes_without_result: recovered.strikes_without_result,
        frames_corrupt: counters.rejected.total(),
        restarts: counters.restarts,
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
