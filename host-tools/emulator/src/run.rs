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

use std::borrow::Cow;
use std::ffi::OsString;

pub use error::RunError;
pub use image::{Function, functions};

use crate::exchange::{self, Description, FORMAT};
use crate::given::Run;
use crate::memory::{FLASH, WRITABLE};
use crate::outcome::Outcome;
use folder::Folder;
use image::Image;
use qemu::FoundQemu;

impl Run {
    /// Runs the image to its end. The same run gives the same bytes.
    ///
    /// # Errors
    /// See [`RunError`]. An image that never samples is not an error: then [`Outcome::sampling`] is `None`.
    pub fn execute(&self) -> Result<Outcome, RunError> {
        self.check()?;
        let shift = self.shift()?;
        let image = Image::read(&self.elf)?;
        let description = self.describe(&image)?;
        let qemu = FoundQemu::find(self.qemu.as_deref())?;
        let overlay = overlay::find(self.overlay.as_deref())?;
        let folder = Folder::new()?;
        let command = self.command(&folder, &description)?;
        let outcome = process::run(&qemu, &overlay, &folder, &command, shift, self.timeout)?;
        let rtt = folder.read(exchange::RTT)?;
        let times = folder.read(exchange::UART_TIMES)?;
        let times = times.as_chunks().0.iter().map(|time| u64::from_le_bytes(*time));
        Ok(Outcome {
            uart: folder.read(exchange::UART)?,
            uart_ns: times.collect(),
            log: log::decode(&self.elf, &image.bytes, &rtt)?,
            rtt,
            flash: (WRITABLE.start, folder.read(exchange::FLASH)?),
            instruction_ns: 1 << shift,
            ..outcome
        })
    }

    /// The shift of this run: as given, else from the environment, else 3.
    ///
    /// # Errors
    /// [`RunError::Input`]: QEMU has no such shift.
    pub fn shift(&self) -> Result<u8, RunError> {
        const NAME: &str = "STM32F405_QEMU_SHIFT";
        let (shift, said) = match (self.shift, std::env::var(NAME)) {
            (Some(shift), _) => (Some(shift), shift.to_string()),
            (None, Ok(text)) => (text.parse().ok(), text),
            (None, Err(_)) => (Some(3), String::new()),
        };
        shift.filter(|shift| *shift <= 10).ok_or_else(|| {
            RunError::Input(format!(
                "the shift (Run::shift, {NAME}) is {said:?}; give 0 to 10, for 1 to 1024 ns an instruction"
            ))
        })
    }

    /// What the plugin is told.
    fn describe(&self, image: &Image) -> Result<Description<'_>, RunError> {
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
            rtt: image.rtt,
            work: self.work.iter().map(position).collect::<Result<_, _>>()?,
            labels,
            functions,
            run: Cow::Borrowed(self),
        })
    }

    /// Writes the run's files. Returns the arguments that give QEMU the image and the blocks in flash.
    fn command(&self, folder: &Folder, description: &Description<'_>) -> Result<Vec<OsString>, RunError> {
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
        let too_high = |row: &[u16; 4]| row.iter().any(|code| *code > 4095);
        if let Some(row) = self.stimulus.iter().position(too_high) {
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
