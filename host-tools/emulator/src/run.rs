//! Running an image: the host's side.
//!
//! # Design
//!
//! QEMU is a child process, the overlay is this very crate built as a shared object, and a temporary directory
//! carries everything between the two ([`crate::exchange`]). Nothing is left behind and nothing is shared between
//! runs, so runs may go in parallel.

mod error;
mod folder;
mod image;
mod log;
mod overlay;
mod process;
mod qemu;

use std::path::PathBuf;
use std::time::Duration;

pub use error::RunError;

use crate::exchange::{self, Description, FORMAT};
use crate::given::{Fault, PinInput, Poke, UartInput};
use crate::memory::{FLASH, WRITABLE};
use crate::outcome::{FunctionCount, Instructions, Outcome};
use error::io;
use folder::Folder;
use image::Image;
use process::start;
use qemu::Qemu;

/// One run of an image: what it is given, and when it ends.
///
/// ```no_run
/// use stm32f405_qemu::Run;
///
/// let mut run = Run::new("target/thumbv7em-none-eabihf/release/firmware");
/// run.stimulus = (0..1000u16).map(|i| [i, 2048, 0, 0]).collect();
/// let outcome = run.execute()?;
/// println!("{} bytes from USART1", outcome.uart.len());
/// # Ok::<(), stm32f405_qemu::RunError>(())
/// ```
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Run {
    /// The image, unchanged: what would be flashed.
    pub elf: PathBuf,
    /// Codes that ADC1 converts, 0..=4095: channels 0 to 3. Row 0 is read by the first externally triggered
    /// scan, row `i` by scans from `i` periods later; the last row stays. Scans started by software before read row 0.
    pub stimulus: Vec<[u16; 4]>,
    /// Time from row to row, in ns.
    pub sample_period_ns: u64,
    /// Blocks put in flash beside the image (settings), each with its address. Elsewhere, and where the image has
    /// nothing, flash is erased. [`Outcome::flash`] is such a block: with it a run goes on where another ended.
    pub flash: Vec<(u32, Vec<u8>)>,
    /// Which functions to count: a label and a part of a demangled path, for example
    /// `("observer", "bead_model::observer::")`. A label may stand more than once.
    pub functions: Vec<(String, String)>,
    /// The labels whose functions make a block a working one ([`Instructions::working`]).
    pub work: Vec<String>,
    /// Count instructions at all: it costs QEMU about half its speed. Turn it off for long runs.
    pub count_instructions: bool,
    /// How long the run goes on after the last row, in ns of virtual time.
    pub tail_ns: u64,
    /// When to give up, in ns of virtual time, if the first externally triggered scan has not come.
    pub sampling_deadline_ns: u64,
    /// When to give up in real time.
    pub timeout: Duration,
    /// The QEMU to run; `None` for what `STM32F405_QEMU` names, else `qemu-system-arm` from `PATH`.
    pub qemu: Option<PathBuf>,
    /// The overlay to load; `None` to look for it where the README says.
    pub overlay: Option<PathBuf>,
    /// Crystal on the HSE pins, in Hz.
    pub hse_hz: u32,
    /// How far it is off, in ppm: below 1000 either way, in steps of 1 Hz. The rows of the stimulus keep to it, all other
    /// times here are true.
    pub hse_ppm: f64,
    /// The 96-bit unique device identifier (RM0090 section 39.1).
    pub uid: [u8; 12],
    /// Bytes for the USART1 receiver.
    pub uart_input: Vec<UartInput>,
    /// Levels on pins.
    pub pin_inputs: Vec<PinInput>,
    /// Writes over guest memory, to provoke faults.
    pub pokes: Vec<Poke>,
    /// Faults on demand.
    pub faults: Vec<Fault>,
}

impl Run {
    /// A run of an image with all inputs at mid-scale, 10 µs a sample, 10 ms long, instructions counted.
    pub fn new(elf: impl Into<PathBuf>) -> Self {
        Self {
            elf: elf.into(),
            stimulus: vec![[2048; 4]],
            sample_period_ns: 10_000,
            flash: Vec::new(),
            functions: Vec::new(),
            work: Vec::new(),
            count_instructions: true,
            tail_ns: 10_000_000,
            sampling_deadline_ns: 2_000_000_000,
            timeout: Duration::from_secs(120),
            qemu: None,
            overlay: None,
            hse_hz: 8_000_000,
            hse_ppm: 0.0,
            uid: *b"\x31\x00\x24\x00\x0dQ943489",
            uart_input: Vec::new(),
            pin_inputs: Vec::new(),
            pokes: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// Runs the image to its end. The same run gives the same bytes.
    ///
    /// # Errors
    /// See [`RunError`]. An image that never samples is no error: [`Outcome::sampling`] is then `None`.
    pub fn execute(&self) -> Result<Outcome, RunError> {
        self.check()?;
        let image = Image::read(&self.elf)?;
        let (labels, ranges) = image.find(&self.functions)?;
        let position = |work: &String| {
            labels.iter().position(|label| label == work).ok_or_else(|| {
                RunError::Input(format!(
                    "{work:?} is said to be work and is no label of a function"
                ))
            })
        };
        let work = self.work.iter().map(position).collect::<Result<_, _>>()?;
        let qemu = Qemu::find(self.qemu.as_deref())?;
        let overlay = overlay::find(self.overlay.as_deref())?;

        let folder = tempfile::Builder::new()
            .prefix("stm32f405-qemu-")
            .tempdir()
            .map_err(io("cannot make a temporary directory"))?;
        let folder = Folder {
            path: folder.path().to_path_buf(),
            _kept: folder,
        };
        if folder.path.to_string_lossy().contains(',') {
            return Err(RunError::Input(format!(
                "the temporary directory {} has a comma in its name, which QEMU takes for a separator; set TMPDIR to another",
                folder.path.display()
            )));
        }

        let description = Description {
            format: FORMAT,
            sample_period_ns: self.sample_period_ns,
            tail_ns: self.tail_ns,
            sampling_deadline_ns: self.sampling_deadline_ns,
            hse_hz: self.hse_hz,
            hse_ppm: self.hse_ppm,
            uid: self.uid,
            rtt: image.rtt,
            count_instructions: self.count_instructions,
            labels: labels.len(),
            work,
            functions: ranges.clone(),
            uart_input: self.uart_input.clone(),
            pin_inputs: self.pin_inputs.clone(),
            pokes: self.pokes.clone(),
            faults: self.faults.clone(),
        };
        let json = serde_json::to_vec(&description).expect("a plain struct has a JSON form");
        folder.write(exchange::DESCRIPTION, &json)?;
        let rows: Vec<u8> = self
            .stimulus
            .iter()
            .flatten()
            .flat_map(|code| code.to_le_bytes())
            .collect();
        folder.write(exchange::STIMULUS, &rows)?;
        let blocks = self.flash_files(&folder)?;

        let mut version = qemu.plugin_version();
        let mut ended = start(
            &self.elf,
            self.timeout,
            &qemu,
            &folder,
            &overlay,
            version,
            &blocks,
        )?;
        if let Some(other) = qemu::wanted_version(&ended.stderr).filter(|other| *other != version) {
            version = other;
            ended = start(
                &self.elf,
                self.timeout,
                &qemu,
                &folder,
                &overlay,
                version,
                &blocks,
            )?;
        }
        let report = ended.report(&folder)?;

        let instructions = self.count_instructions.then(|| Instructions {
            total: report.instructions,
            worst_block: report.worst_block,
            working: report.working,
            idle: report.idle,
            functions: labels
                .into_iter()
                .zip(&report.labels)
                .enumerate()
                .map(|(index, (label, count))| FunctionCount {
                    label,
                    instructions: count.instructions,
                    calls: count.calls,
                    symbols: ranges.iter().filter(|r| r.label == index).count(),
                })
                .collect(),
        });
        let rtt = folder.read(exchange::RTT)?;
        Ok(Outcome {
            uart: folder.read(exchange::UART)?,
            uart_ns: words(&folder.read(exchange::UART_TIMES)?),
            log: log::decode(&self.elf, &image.bytes, &rtt)?,
            rtt,
            instructions,
            sampling: report.sampling,
            overruns: report.overruns,
            triggers_ignored: report.triggers_ignored,
            resets: report.resets,
            unknown_registers: report.unknown,
            unmodelled: report.unmodelled,
            pins: report.pins,
            flash: (WRITABLE.start, folder.read(exchange::FLASH)?),
            flash_operations: report.flash_operations,
            virtual_ns: report.virtual_ns,
        })
    }

    /// What would make QEMU or the plugin fail in a less helpful place.
    fn check(&self) -> Result<(), RunError> {
        let refused = |text: String| Err(RunError::Input(text));
        if self.sample_period_ns == 0 {
            return refused(
                "the sample period is 0 ns; give the time from row to row of the stimulus".into(),
            );
        }
        if let Some(row) = self
            .stimulus
            .iter()
            .position(|row| row.iter().any(|code| *code > 4095))
        {
            return refused(format!(
                "stimulus row {row} is {:?}; codes of the 12-bit ADC are 0..=4095",
                self.stimulus[row]
            ));
        }
        if let Some((from, to)) = self.functions.iter().find(|(_, pattern)| pattern.is_empty()) {
            return refused(format!(
                "label {from:?} has the pattern {to:?}, which is in every function's name"
            ));
        }
        if self.hse_ppm.is_nan() || self.hse_ppm.abs() >= 1000.0 {
            return refused(format!(
                "a crystal that is off by {} ppm; give less than 1000",
                self.hse_ppm
            ));
        }
        if let Some(input) = self.pin_inputs.iter().find(|input| input.place().is_none()) {
            return refused(format!("there is no pin {:?}; pins are PA0 to PI15", input.pin));
        }
        for (address, bytes) in &self.flash {
            let end = u64::from(*address) + bytes.len() as u64;
            if !FLASH.contains(address) || end > u64::from(FLASH.end) {
                return refused(format!(
                    "{} bytes for flash at {address:#010x} are outside {:#010x}..{:#010x}",
                    bytes.len(),
                    FLASH.start,
                    FLASH.end
                ));
            }
        }
        Ok(())
    }

    fn flash_files(&self, folder: &Folder) -> Result<Vec<String>, RunError> {
        let mut arguments = Vec::new();
        // An empty block is none: QEMU's loader refuses it.
        for (i, (address, bytes)) in self.flash.iter().enumerate().filter(|(_, (_, b))| !b.is_empty()) {
            let path = folder.write(&format!("flash{i}.bin"), bytes)?;
            arguments.push(format!(
                "loader,file={},addr={address:#x},force-raw=on",
                path.display()
            ));
        }
        Ok(arguments)
    }
}

fn words(bytes: &[u8]) -> Vec<u64> {
    let (words, _) = bytes.as_chunks();
    words.iter().map(|word| u64::from_le_bytes(*word)).collect()
}
