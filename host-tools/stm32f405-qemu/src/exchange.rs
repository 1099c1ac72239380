//! The exchange between the host process and the plugin inside QEMU: files in one directory for each run.
//!
//! # Design
//!
//! QEMU's plugin arguments are a comma-separated list without quoting. So the plugin is given one thing only:
//! a directory. The host writes [`DESCRIPTION`] and [`STIMULUS`] before it starts QEMU; the plugin writes
//! [`sent`] and [`RTT`] while the image runs and [`OUTCOME`] when it ends. A run that ends without an outcome
//! has failed.
//!
//! In a live run nothing that grows with time is written to files. At a stop the plugin writes a message on
//! standard output, what came out since the stop before ([`Reached`]), and reads what comes next from
//! standard input ([`TimeStep`], with [`STEP`] before it). A message is two lengths, a JSON text and bytes:
//! see [`write_message`].
//!
//! Both sides are this crate, built twice. By [`FORMAT`] in the description the plugin detects whether both
//! are of the same build: an older shared object is refused, not misread.

use std::borrow::Cow;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::given::{Inputs, Run};
use crate::outcome::{Sampling, StretchWork};

/// Changes with every change of these files.
pub(crate) const FORMAT: u32 = 20;

pub(crate) const DESCRIPTION: &str = "run.json";
/// Rows of four little-endian u16: the codes of ADC channels 0 to 3.
pub(crate) const STIMULUS: &str = "stimulus.bin";
/// Name of the file with the frames that a USART sent: USART1 is `sent0.bin`. A record for each frame,
/// little-endian: u64, the virtual time in ns at which it had left, and u16, its data bits.
pub(crate) fn sent(usart: usize) -> String {
    format!("sent{usart}.bin")
}
/// Bytes of RTT up-channel 0, in order.
pub(crate) const RTT: &str = "rtt.bin";
/// The run's outcome, without what the other files hold.
pub(crate) const OUTCOME: &str = "outcome.json";
/// Text that the image wrote by semihosting.
pub(crate) const SEMIHOSTING: &str = "semihosting.txt";
/// The socket at which the host answers for devices: a [`BusCall`](crate::BusCall) and a
/// [`BusAnswer`](crate::BusAnswer), each as a message.
pub(crate) const DEVICES: &str = "devices";
/// Contents of the flash that can be written at the end of the run.
pub(crate) const FLASH: &str = "flash.bin";

/// Removes a run's directory while other threads, or the other side, may still write to it. A file that is
/// created meanwhile prevents the removal, so this retries for a second.
pub(crate) fn remove(folder: &Path) {
    let started = Instant::now();
    // Files that cannot be removed are left in the folder for temporary files.
    while std::fs::remove_dir_all(folder).is_err_and(|error| error.kind() == io::ErrorKind::DirectoryNotEmpty)
        && started.elapsed() < Duration::from_secs(1)
    {
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Exit status of QEMU when the overlay's self-test fails. QEMU itself uses 0, 1 and signals.
pub(crate) const SELF_TEST_STATUS: i32 = 86;
/// Every line that the overlay prints on standard error starts with this.
pub(crate) const LINE_PREFIX: &str = "stm32f405-qemu: ";

/// Description of a run, from the host to the plugin. The fields of `run` that only the host needs are left
/// out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct RunDescription<'a> {
    pub(crate) format: u32,
    pub(crate) run: Cow<'a, Run>,
    /// True if loops that wait may be executed without QEMU.
    pub(crate) shortens_waits: bool,
    /// Virtual time of an instruction, ns.
    pub(crate) instruction_ns: u64,
    /// Address of the RTT control block, if the image has one.
    pub(crate) rtt: Option<u32>,
    /// Address of the image's vector table.
    pub(crate) vectors: u32,
    /// First addresses of the handlers of faults: vectors 3 to 6.
    pub(crate) fault_handlers: Vec<u32>,
    /// First addresses of the functions that a panic enters.
    pub(crate) panic_functions: Vec<u32>,
    pub(crate) functions: Vec<FunctionRange>,
    pub(crate) labels: Vec<String>,
    /// The labels whose functions make a block a working one.
    pub(crate) work: Vec<usize>,
    /// True if the host advances virtual time step by step.
    pub(crate) live: bool,
    /// Path of the file of executed addresses, without its extension.
    pub(crate) coverage: Option<PathBuf>,
}

/// On standard input of QEMU: the host wants the report of a run that takes too long.
pub(crate) const REPORT: u8 = b'r';
/// On standard input of QEMU: a [`TimeStep`] follows.
pub(crate) const STEP: u8 = b's';

/// The next step of virtual time, and the inputs that arrive in it. The bytes that follow it are rows of the
/// stimulus, as in [`STIMULUS`].
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct TimeStep {
    /// Virtual time of the next stop. `None` ends the run here.
    pub(crate) to_ns: Option<u64>,
    pub(crate) inputs: Inputs,
}

/// A stop, and the output since the one before. The bytes that follow it are the records of each USART, as in
/// [`sent`], and then those of the log.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Reached {
    pub(crate) now_ns: u64,
    /// True once the run has ended.
    pub(crate) ended: bool,
    pub(crate) sampling: Option<Sampling>,
    /// End of the last row of the stimulus, if the first row has begun.
    pub(crate) codes_until_ns: Option<u64>,
    pub(crate) work: StretchWork,
    /// Lengths of the records of each USART.
    pub(crate) sent: Vec<usize>,
}

/// Writes a message: the lengths of its two parts (u32, little-endian), the JSON text, the bytes.
pub(crate) fn write_message(to: &mut impl Write, text: &impl Serialize, bytes: &[u8]) -> io::Result<()> {
    let text = serde_json::to_vec(text).map_err(io::Error::other)?;
    for length in [text.len(), bytes.len()] {
        let length = u32::try_from(length).map_err(io::Error::other)?;
        to.write_all(&length.to_le_bytes())?;
    }
    to.write_all(&text)?;
    to.write_all(bytes)?;
    to.flush()
}

/// Reads a message.
pub(crate) fn read_message<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<(T, Vec<u8>)> {
    let mut length = || {
        let mut length = [0; 4];
        from.read_exact(&mut length)?;
        Ok::<_, io::Error>(u32::from_le_bytes(length) as usize)
    };
    let (mut text, mut bytes) = (vec![0; length()?], vec![0; length()?]);
    from.read_exact(&mut text)?;
    from.read_exact(&mut bytes)?;
    Ok((serde_json::from_slice(&text)?, bytes))
}

/// Decodes rows: four little-endian u16 each.
pub(crate) fn rows(bytes: &[u8]) -> Vec<[u16; 4]> {
    let row = |row: &[[u8; 2]; 4]| row.map(u16::from_le_bytes);
    bytes.as_chunks().0.as_chunks().0.iter().map(row).collect()
}

/// Encodes rows.
pub(crate) fn bytes_of(rows: &[[u16; 4]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|code| code.to_le_bytes())
        .collect()
}

/// A function of the image that belongs to a label: addresses `[start, end)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FunctionRange {
    pub(crate) label: usize,
    pub(crate) start: u32,
    pub(crate) end: u32,
}
