//! `bead decode`: frames as JSON, one object a line.

use std::fs::File;
use std::io::{self, BufWriter, Read, StdoutLock, Write};
use std::path::PathBuf;

use clap::Args;
use serde_json::Value;

use super::clock::rfc3339;
use crate::cli::failure::{Blame, Failure};
use crate::recording::clock::{Fit, Tracker, begins_segment};
use crate::recording::file::Recording;
use crate::recording::frames::{Frame, Item, Reader};

const AFTER_HELP: &str = "\
Fixed-point fields are shown in SI units, named in the key, with the bits beside them (…_raw). Of a recording that has
receive times each frame also has `received`, when this host got it, and `host_time`, what this host's clock showed at
the frame's sample index, by the fit of `bead clock`. Counts of what was received, lost and refused go to standard error.

Examples:
  bead decode run/bead-8.mcap | jq 'select(.kind == \"strike\")'
  bead decode - < uart.bin";

/// Arguments of `bead decode`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// A recording (.mcap), raw bytes as received, or - for raw bytes from standard input.
    file: PathBuf,
}

/// What every MCAP file begins with (MCAP specification, "Magic").
const MCAP: &[u8] = b"\x89MCAP0\r\n";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let path = &arguments.file;
    let context = || format!("cannot read {}", path.display());
    let mut input: Box<dyn Read> = if path.as_os_str() == "-" {
        Box::new(io::stdin().lock())
    } else {
        Box::new(File::open(path).or_input(context)?)
    };
    let mut head = Vec::new();
    input
        .by_ref()
        .take(MCAP.len() as u64)
        .read_to_end(&mut head)
        .or_input(context)?;
    let mut printer = Printer::new();
    if head == MCAP {
        if path.as_os_str() == "-" {
            return Err(Failure::input(
                "standard input is an MCAP file, which is read from its end as well; give its name instead of -",
            ));
        }
        let recording = Recording::open(path).map_err(Failure::input)?;
        if let Some(warning) = recording.warning() {
            eprintln!("bead: {}: {warning}", path.display());
        }
        let tracker = Tracker::of(&recording);
        printer.fits = tracker.segments().iter().map(|segment| segment.fit()).collect();
        for run in &recording.runs {
            for bytes in [&run.bytes[..], &[0]] {
                printer.print(bytes, run.received_ns);
            }
            if !printer.flush()? {
                return Ok(());
            }
        }
    } else {
        let mut input = io::Cursor::new(head).chain(input);
        let mut buffer = vec![0; 64 * 1024];
        loop {
            let length = match input.read(&mut buffer) {
                Ok(0) => break,
                Ok(length) => length,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error).or_input(context),
            };
            printer.print(&buffer[..length], None);
            // What comes live must not wait for a buffer to fill.
            if !printer.flush()? {
                return Ok(());
            }
        }
    }

    let reader = &printer.reader;
    let counters = reader.counters();
    if counters.frames == 0 {
        return Err(Failure::input(format!(
            "{}: no frame in {} bytes; give a recording, or the bytes that a bead sent",
            path.display(),
            counters.bytes
        )));
    }
    eprintln!(
        "bead: {} frames in {} bytes; {} lost, {} refused, {} late, {} twice, {} restarts{}",
        counters.frames,
        counters.bytes,
        counters.lost,
        counters.rejected.total(),
        counters.late,
        counters.duplicates,
        counters.restarts,
        match reader.pending() {
            0 => String::new(),
            bytes => format!("; {bytes} bytes of a frame cut short at the end"),
        }
    );
    Ok(())
}

/// Frames to standard output, a line each.
struct Printer {
    reader: Reader,
    out: BufWriter<StdoutLock<'static>>,
    written: io::Result<()>,
    /// How bead time becomes host time, of each boot.
    fits: Vec<Option<Fit>>,
    /// Boots that have begun.
    boots: usize,
}

impl Printer {
    fn new() -> Self {
        Self {
            reader: Reader::new(),
            out: BufWriter::new(io::stdout().lock()),
            written: Ok(()),
            fits: Vec::new(),
            boots: 0,
        }
    }

    fn print(&mut self, bytes: &[u8], received_ns: Option<u64>) {
        let Self {
            reader,
            out,
            written,
            fits,
            boots,
        } = self;
        reader.feed(bytes, |item| {
            let frame = match item {
                Item::Frame(frame) => frame,
                Item::Rejected(reject) => return eprintln!("bead: {reject}"),
            };
            *boots += usize::from(begins_segment(frame.arrival));
            let fit = boots.checked_sub(1).and_then(|boot| fits.get(boot)?.as_ref());
            if written.is_ok() {
                *written = writeln!(out, "{}", timed(&frame, received_ns, fit));
            }
        });
    }

    /// Hands on what was printed; false if nobody reads it any more.
    fn flush(&mut self) -> Result<bool, Failure> {
        let written = std::mem::replace(&mut self.written, Ok(()));
        match written.and_then(|()| self.out.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
            other => other
                .or_input(|| "cannot write to standard output")
                .map(|()| true),
        }
    }
}

/// The frame as JSON, with the host's times of it where they are known.
fn timed(frame: &Frame, received_ns: Option<u64>, fit: Option<&Fit>) -> Value {
    let mut line = frame.json();
    if let Some(received_ns) = received_ns {
        line["received"] = rfc3339(received_ns as i64).into();
        let bead = frame
            .sample_rate_hz
            .map(|rate| frame.header.sample_index as f64 / f64::from(rate));
        let host = fit.zip(bead).map(|(fit, bead)| rfc3339(fit.host_ns(bead)));
        line["host_time"] = host.into();
    }
    line
}
