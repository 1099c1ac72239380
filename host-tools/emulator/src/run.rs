//! Running an image: the host's side.
//!
//! # Design
//!
//! QEMU is a child process. The overlay is this crate, built as a shared object. A temporary directory
//! carries everything between the two (see `exchange`). Nothing is left behind, and runs share nothing, so
//! they may go in parallel.

mod error;
mod folder;
mod image;
mod log;
mod overlay;
mod process;
mod qemu;

use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

pub use error::RunError;

use crate::exchange::{self, Description, FORMAT};
use crate::given::{Fault, PinInput, Poke, UartInput};
use crate::memory::{FLASH, WRITABLE};
use crate::outcome::Outcome;
use folder::Folder;
use image::Image;
use qemu::FoundQemu;

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
    /// Codes that ADC1 converts, 0..=4095: channels 0 to 3. The first externally triggered scan reads row 0.
    /// Scans from `i` periods later on read row `i`. The last row stays. Scans that software starts before
    /// that read row 0.
    pub stimulus: Vec<[u16; 4]>,
    /// Time from row to row, in ns.
    pub sample_period_ns: u64,
    /// Blocks in flash beside the image (settings, for example), each with its address. Where neither a block
    /// nor the image has anything, flash is erased. [`Outcome::flash`] is such a block: with it a run goes on
    /// where another ended.
    pub flash: Vec<(u32, Vec<u8>)>,
    /// Which functions to count: a label and a part of a demangled path, for example `("observer",
    /// "bead_model::observer::")`. A label may be given more than once.
    pub functions: Vec<(String, String)>,
    /// The labels whose functions make a block a working one
    /// ([`Instructions::working`](crate::Instructions::working)).
    pub work: Vec<String>,
    /// Whether to count instructions. This costs QEMU about half of its speed. Turn it off for long runs.
    pub count_instructions: bool,
    /// How long the run goes on after the last row, in ns of virtual time.
    pub tail_ns: u64,
    /// When to give up, in ns of virtual time, if the first externally triggered scan has not come.
    pub sampling_deadline_ns: u64,
    /// When to give up in real time.
    pub timeout: Duration,
    /// The QEMU to run. `None` for the one that `STM32F405_QEMU` names, else `qemu-system-arm` from `PATH`.
    pub qemu: Option<PathBuf>,
    /// The overlay to load. `None` to look for it where the README says.
    pub overlay: Option<PathBuf>,
    /// Crystal on the HSE pins, in Hz.
    pub hse_hz: u32,
    /// How far the crystal is off, in ppm: less than 1000 either way, in steps of 1 Hz. The rows of the
    /// stimulus follow it. All other times here are true ones.
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
    /// A run of an image with all inputs at mid-scale, 10 µs for each sample, 10 ms long. Instructions are
    /// counted.
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
    /// See [`RunError`]. An image that never samples is not an error: then [`Outcome::sampling`] is `None`.
    pub fn execute(&self) -> Result<Outcome, RunError> {
        self.check()?;
        let image = Image::read(&self.elf)?;
        let description = self.describe(&image)?;
        let qemu = FoundQemu::find(self.qemu.as_deref())?;
        let overlay = overlay::find(self.overlay.as_deref())?;
        let folder = Folder::new()?;
        let command = self.command(&folder, &description)?;
        let outcome = process::run(&qemu, &overlay, &folder, &command, self.timeout)?;
        let rtt = folder.read(exchange::RTT)?;
        let times = folder.read(exchange::UART_TIMES)?;
        Ok(Outcome {
            uart: folder.read(exchange::UART)?,
            uart_ns: times
                .as_chunks()
                .0
                .iter()
                .copied()
                .map(u64::from_le_bytes)
                .collect(),
            log: log::decode(&self.elf, &image.bytes, &rtt)?,
            rtt,
            flash: (WRITABLE.start, folder.read(exchange::FLASH)?),
            ..outcome
        })
    }

    /// What the plugin is told.
    fn describe(&self, image: &Image) -> Result<Description, RunError> {
        let (labels, functions) = image.find(&self.functions)?;
        let position = |work: &String| {
            labels.iter().position(|label| label == work).ok_or_else(|| {
                RunError::Input(format!(
                    "{work:?} is said to be work and is no label of a function"
                ))
            })
        };
        Ok(Description {
            format: FORMAT,
            sample_period_ns: self.sample_period_ns,
            tail_ns: self.tail_ns,
            sampling_deadline_ns: self.sampling_deadline_ns,
            hse_hz: self.hse_hz,
            hse_ppm: self.hse_ppm,
            uid: self.uid,
            rtt: image.rtt,
            count_instructions: self.count_instructions,
            work: self.work.iter().map(position).collect::<Result<_, _>>()?,
            labels,
            functions,
            uart_input: self.uart_input.clone(),
            pin_inputs: self.pin_inputs.clone(),
            pokes: self.pokes.clone(),
            faults: self.faults.clone(),
        })
    }

    /// Writes the run's files. Returns the arguments that give QEMU the image and the blocks in flash.
    fn command(&self, folder: &Folder, description: &Description) -> Result<Vec<OsString>, RunError> {
        let json = serde_json::to_vec(description).expect("a plain struct has a JSON form");
        folder.write(exchange::DESCRIPTION, &json)?;
        let codes = self.stimulus.iter().flatten();
        let rows: Vec<u8> = codes.flat_map(|code| code.to_le_bytes()).collect();
        folder.write(exchange::STIMULUS, &rows)?;
        let mut arguments = vec!["-kernel".into(), self.elf.clone().into()];
        for (i, (address, bytes)) in self.flash.iter().enumerate() {
            // QEMU's loader refuses an empty file.
            if !bytes.is_empty() {
                let path = folder.write(&format!("flash{i}.bin"), bytes)?;
                let file = path.display();
                arguments.extend([
                    "-device".into(),
                    format!("loader,file={file},addr={address:#x},force-raw=on").into(),
                ]);
            }
        }
        Ok(arguments)
    }

    /// Refuses what would make QEMU or the plugin fail in a less helpful place.
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
}
