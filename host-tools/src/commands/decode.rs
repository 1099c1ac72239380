//! `bead decode`: frames as JSON, one object a line.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::PathBuf;

use clap::Args;

use crate::failure::{Blame, Failure};
use crate::frames::{Item, Reader};
use crate::recording::Recording;

const AFTER_HELP: &str = "\
Fixed-point fields are shown in SI units, named in the key, with the bits beside them (…_raw). Counts of what was
received, lost and refused go to standard error.

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
    let mut input: Box<dyn Read> = if head == MCAP {
        if path.as_os_str() == "-" {
            return Err(Failure::input(
                "standard input is an MCAP file, which is read from its end as well; give its name instead of -",
            ));
        }
        let recording = Recording::open(path).map_err(Failure::input)?;
        if let Some(warning) = recording.warning() {
            eprintln!("bead: {}: {warning}", path.display());
        }
        Box::new(io::Cursor::new(recording.stream()))
    } else {
        Box::new(io::Cursor::new(head).chain(input))
    };

    let mut reader = Reader::new();
    let mut out = BufWriter::new(io::stdout().lock());
    let mut buffer = vec![0; 64 * 1024];
    loop {
        let length = match input.read(&mut buffer) {
            Ok(0) => break,
            Ok(length) => length,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error).or_input(context),
        };
        let mut written = Ok(());
        reader.feed(&buffer[..length], |item| {
            if written.is_ok() {
                written = match item {
                    Item::Frame(frame) => writeln!(out, "{}", frame.json()),
                    Item::Rejected(reject) => {
                        eprintln!("bead: {reject}");
                        Ok(())
                    }
                };
            }
        });
        // What comes live must not wait for a buffer to fill.
        match written.and_then(|()| out.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
            other => other.or_input(|| "cannot write to standard output")?,
        }
    }

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
