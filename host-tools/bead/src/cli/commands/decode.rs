//! `bead decode`: frames as JSON, one object in each line.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::iter;

use bead_wire::Kind;
use serde_json::Value;

use super::clock::rfc3339;
use crate::cli::commands::prelude::*;
use bead_recording::clock::{Fit, Segments, Tracker};
use bead_recording::frames::{Frame, Frames, Item, Piece};
use bead_tables::printable::printable;

const AFTER_HELP: &str = "\
Fixed-point fields are shown in SI units, named in the key, with the bits next to them (…_raw). In a \
recording with receive times each frame also has `received`, the time at which this host received it, and \
`host_time`, the time of this host's clock at the frame's sample index, by the fit of `bead clock`. Counts of \
frames received, lost and refused go to standard error. With several files, each line names its `file`.

Examples:
  bead decode run/bead-8.mcap --kind strike,status
  bead decode monday.mcap tuesday.mcap --kind strike | jq .peak_force_n
  bead decode - < uart.bin";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Recordings (.mcap), raw bytes as received, or - for raw bytes from standard input.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print frames of these kinds only: strike,status [default: all].
    #[arg(long, value_name = "KIND,…", value_delimiter = ',', value_parser = kind)]
    kind: Vec<Kind>,
}

fn kind(text: &str) -> Result<Kind, String> {
    let named = Kind::ALL.iter().find(|kind| kind.name() == text);
    named.copied().ok_or_else(|| {
        let names: Vec<_> = Kind::ALL.iter().map(|kind| kind.name()).collect();
        format!("there is no such kind; the kinds are {}", names.join(", "))
    })
}

/// First bytes of every MCAP file (MCAP specification, "Magic").
const MCAP: &[u8] = b"\x89MCAP0\r\n";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments
        .files
        .iter()
        .try_for_each(|file| decode(arguments, file))
}

fn decode(arguments: &Arguments, path: &Path) -> Result<(), Failure> {
    let context = || format!("cannot read {}", path.display());
    let mut input: Box<dyn Read> = if path.as_os_str() == "-" {
        Box::new(io::stdin().lock())
    } else {
        Box::new(File::open(path).with_context(context)?)
    };
    let mut head = Vec::new();
    let mut first = input.by_ref().take(MCAP.len() as u64);
    first.read_to_end(&mut head).with_context(context)?;
    if head != MCAP {
        let mut failed = None;
        let mut input = io::Cursor::new(head).chain(input);
        let mut buffer = vec![0; 64 * 1024];
        let pieces = iter::from_fn(|| {
            let length = input.read(&mut buffer).unwrap_or_else(|error| {
                failed = Some(error);
                0
            });
            let piece = Piece {
                bytes: buffer[..length].to_vec(),
                received_ns: None,
                ..Piece::default()
            };
            (length > 0).then_some(piece)
        });
        print(arguments, path, Frames::new(pieces), &[])?;
        return Ok(failed.map_or(Ok(()), Err).with_context(context)?);
    }
    if path.as_os_str() == "-" {
        bail!(
            Input,
            "standard input is an MCAP file, which is read from its end as well; give its name instead of -"
        );
    }
    let recording = Recording::open_named(path)?;
    let tracker = Tracker::of(&recording)?;
    let fits: Vec<_> = tracker.segments.iter().map(|segment| segment.fit()).collect();
    print(arguments, path, recording.frames()?, &fits)?;
    Ok(())
}

/// Greatest number of rejects that are reported one by one. Noise can cause one for every two bytes.
const REJECTS_MOST: u64 = 1000;

/// Prints frames to standard output, one in each line. `fits` turn bead time into host time, one for each
/// segment.
fn print(
    arguments: &Arguments,
    path: &Path,
    mut frames: Frames<impl Iterator<Item = Piece>>,
    fits: &[Option<Fit>],
) -> Result<(), Failure> {
    let mut out = BufWriter::new(io::stdout().lock());
    let mut segments = Segments::default();
    let file = (arguments.files.len() > 1).then(|| path.to_string_lossy());
    let mut from_the_future = None;
    let mut rejects = 0;
    // Notes that wait for the first frame: a file without one is refused in a single line.
    let mut notes = Vec::new();
    while let Some(item) = frames.next() {
        let written = match item {
            Item::Frame(frame) => {
                from_the_future = frame.from_the_future().or(from_the_future);
                let fit = fits.get(segments.place(&frame)).and_then(Option::as_ref);
                let kind = frame.message.kind();
                if arguments.kind.is_empty() || arguments.kind.contains(&kind) {
                    let mut line = timed(&frame, fit);
                    if let Some(file) = &file {
                        line["file"] = file.as_ref().into();
                    }
                    writeln!(out, "{}", printable(&line.to_string()))
                } else {
                    Ok(())
                }
            }
            Item::Rejected(reject) => {
                rejects += 1;
                if rejects <= REJECTS_MOST {
                    notes.push(reject.to_string());
                } else if rejects == REJECTS_MOST + 1 {
                    let most = format!(
                        "more than {REJECTS_MOST} runs of bytes are refused; the others are only counted"
                    );
                    notes.push(most);
                }
                Ok(())
            }
        };
        if frames.counters().frames > 0 {
            notes.drain(..).for_each(|line| note!("{line}"));
        }
        // Live frames must not wait for a buffer to fill.
        match written.and_then(|()| if frames.is_empty() { out.flush() } else { Ok(()) }) {
            // No program reads the output any more.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
            other => other.context("cannot write to standard output")?,
        }
    }
    let counters = frames.counters();
    if counters.frames == 0 {
        bail!(
            Input,
            "{}: no frame in {} bytes; give a recording, or the bytes that a bead sent",
            path.display(),
            counters.bytes
        );
    }
    let pending = match frames.pending() {
        0 => String::new(),
        bytes => format!("; {bytes} bytes of a frame cut short at the end"),
    };
    note!(
        "{} frames in {} bytes; {} lost, {} refused, {} late, {} twice, {} restarts{pending}",
        counters.frames,
        counters.bytes,
        counters.lost,
        counters.rejected.total(),
        counters.late,
        counters.duplicates,
        counters.restarts
    );
    if let Some(who) = from_the_future {
        note!("{who}");
    }
    Ok(())
}

/// The frame as JSON, with the host's times where they are known.
fn timed(frame: &Frame, fit: Option<&Fit>) -> Value {
    let mut line = frame.json();
    if let Some(received_ns) = frame.received_ns {
        line["received"] = rfc3339(received_ns as i64).into();
        let bead = frame.seconds(frame.header.sample_index as f64);
        let host = fit.zip(bead).map(|(fit, bead)| rfc3339(fit.host_ns(bead)));
        line["host_time"] = host.into();
    }
    line
}
