//! Running an image: the host's side.
//!
//! # Design
//!
//! QEMU is a child process. The overlay is this crate, built as a shared object. A temporary directory
//! carries everything between the two (see `exchange`). Nothing is left behind, and runs share nothing, so
//! they may go in parallel.

mod cases;
mod checks;
mod coverage;
mod devices;
mod error;
mod folder;
mod image;
mod live;
mod log;
mod overlay;
mod process;
mod qemu;
mod sent;

use std::borrow::Cow;
use std::ffi::OsString;
use std::net::{Ipv4Addr, TcpListener};
use std::time::Duration;

pub use cases::{TestCase, test_cases};
pub use error::RunError;
pub use folder::remove_temporary_files;
pub use image::{Function, functions};
pub use live::{Live, Passed};
pub use overlay::carry;
pub use qemu::qemu_version;

use crate::ending::RunEnd;
use crate::exchange::{self, FORMAT, RunDescription};
use crate::given::{AnalogInput, Run};
use crate::machine::{USARTS, analog_pin, pin};
use crate::memory::{FLASH, WRITABLE};
use crate::outcome::Outcome;
use checks::{TWELVE_BITS, check_devices, check_image, check_pin, check_usart};
use folder::RunFolder;
use image::Image;
use process::QemuJob;
use qemu::FoundQemu;

impl Run {
    /// Runs the image to its end. Equal runs give equal bytes.
    ///
    /// # Errors
    /// See [`RunError`]. An image that never samples is not an error: then [`Outcome::sampling`] is `None`.
    pub fn execute(&self) -> Result<Outcome, RunError> {
        let (image, job) = self.prepare(false)?;
        let outcome = job.run(self.limit())?;
        self.complete(&image, &job, outcome)
    }

    /// Begins a run whose time the caller advances: see [`Live`]. It has no set end: `tail_ns` and
    /// `sampling_deadline_ns` are ignored, and `timeout` counts from stop to stop.
    ///
    /// # Errors
    /// See [`RunError`].
    pub fn start(&self) -> Result<Live, RunError> {
        let (image, job) = self.prepare(true)?;
        Live::start(self.clone(), image, job)
    }

    /// Limit of the run's real time. Under a debugger there is none.
    fn limit(&self) -> Option<Duration> {
        self.gdb.is_none().then_some(self.timeout)
    }

    /// Checks the run and writes its files.
    fn prepare(&self, live: bool) -> Result<(Image, QemuJob), RunError> {
        self.check()?;
        let shift = self.shift()?;
        if let Some(port) = self.gdb {
            check_port(port)?;
        }
        let image = Image::read(&self.elf)?;
        let description = self.describe(&image, live)?;
        check_image(self.chip, &image)?;
        let qemu = FoundQemu::find(self.qemu.as_deref())?;
        let overlay = overlay::find(self.overlay.as_deref())?;
        let folder = RunFolder::new()?;
        let mut arguments = self.command(&folder, &description)?;
        if let Some(starter) = image.starter() {
            arguments.extend(loader(&folder, "starter.bin", FLASH.start, &starter)?);
        }
        let job = QemuJob {
            qemu,
            overlay,
            folder,
            arguments,
            shift,
            devices: self.devices.clone(),
        };
        Ok((image, job))
    }

    /// Adds the contents of the run's other files to the outcome.
    fn complete(&self, image: &Image, job: &QemuJob, outcome: Outcome) -> Result<Outcome, RunError> {
        let folder = &job.folder;
        let rtt = folder.read(exchange::RTT)?;
        let mut uarts = Vec::new();
        for (usart, port) in USARTS.iter().enumerate() {
            uarts.push(sent::read(port, &folder.read(&exchange::sent(usart))?));
        }
        let usart1 = uarts.remove(0);
        uarts.retain(|uart| !uart.bytes.is_empty());
        let mut outcome = Outcome {
            uart: usart1.bytes,
            uart_ns: usart1.ns,
            uart_ninth: usart1.ninth,
            uarts,
            log: log::decode(&self.elf, &image.bytes, &rtt)?,
            rtt,
            semihosting: folder.text(exchange::SEMIHOSTING),
            flash: (WRITABLE.start, folder.read(exchange::FLASH)?),
            ..outcome
        };
        outcome.name_functions(|place| image.name(place));
        let missing = outcome.pins.iter().filter(|pin| !self.chip.has_pin(&pin.name));
        let missing: Vec<_> = missing
            .map(|pin| format!("GPIO {} moved, but the {} has no such pin", pin.name, self.chip))
            .collect();
        outcome.unmodelled.extend(missing);
        match outcome.end {
            RunEnd::Stuck(_) => Err(RunError::Stuck(outcome.into())),
            RunEnd::Stopped => Err(RunError::Timeout(self.timeout, outcome.into())),
            RunEnd::QemuEnded(ref how) => Err(RunError::QemuEnded(how.clone(), outcome.into())),
            _ => Ok(outcome),
        }
    }

    /// The shift of this run: the one given, else from the environment, else 3.
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
        let refused = || {
            let what = format!("the shift (Run::shift, {NAME}) is {said:?}");
            RunError::Input(what + "; give 0 to 10, for 1 to 1024 ns per instruction")
        };
        shift.filter(|shift| *shift <= 10).ok_or_else(refused)
    }

    /// Builds the description for the plugin.
    fn describe(&self, image: &Image, live: bool) -> Result<RunDescription<'_>, RunError> {
        let (labels, functions) = image.find(&self.functions)?;
        let position = |work: &String| {
            let what = format!("{work:?} is listed as work, but is not the label of a function");
            let unknown = || RunError::Input(what);
            labels.iter().position(|label| label == work).ok_or_else(unknown)
        };
        let coverage = coverage::stem(&image.bytes)?;
        Ok(RunDescription {
            format: FORMAT,
            shortens_waits: self.shorten_waits
                && self.gdb.is_none()
                && !self.count_cycles
                && coverage.is_none(),
            instruction_ns: 1 << self.shift()?,
            rtt: image.rtt,
            vectors: image.vectors,
            fault_handlers: image.fault_handlers.clone(),
            panic_functions: image.panic_functions(),
            work: self.work.iter().map(position).collect::<Result<_, _>>()?,
            live,
            coverage,
            labels,
            functions,
            run: Cow::Borrowed(self),
        })
    }

    /// Writes the run's files. Returns the arguments that give QEMU the image and the blocks in flash.
    fn command(
        &self,
        folder: &RunFolder,
        description: &RunDescription<'_>,
    ) -> Result<Vec<OsString>, RunError> {
        let json = serde_json::to_vec(description).expect("a plain struct has a JSON form");
        folder.write(exchange::DESCRIPTION, &json)?;
        folder.write(exchange::STIMULUS, &exchange::bytes_of(&self.stimulus))?;
        let mut arguments = vec!["-kernel".into(), self.elf.clone().into()];
        if let Some(port) = self.gdb {
            arguments.extend(["-gdb".into(), format!("tcp:127.0.0.1:{port}").into(), "-S".into()]);
        }
        if self.semihosting {
            let said = folder.path(exchange::SEMIHOSTING);
            // The image's standard output reaches this file by another route, and in order.
            let output = format!("file,id=semihosting,path={},append=on", said.display());
            arguments.extend(["-chardev".into(), output.into(), "-semihosting-config".into()]);
            let words = self.semihosting_arguments.iter();
            // QEMU reads two commas as one.
            let words: String = words
                .map(|word| format!(",arg={}", word.replace(',', ",,")))
                .collect();
            arguments.push(format!("enable=on,target=native,chardev=semihosting{words}").into());
        }
        for (i, (address, bytes)) in self.flash.iter().enumerate() {
            // QEMU's loader refuses an empty file.
            if !bytes.is_empty() {
                arguments.extend(loader(folder, &format!("flash{i}.bin"), *address, bytes)?);
            }
        }
        Ok(arguments)
    }

    /// Refuses inputs that would make QEMU or the plugin fail with a less helpful message.
    fn check(&self) -> Result<(), RunError> {
        let refused = |text: String| Err(RunError::Input(text));
        if self.sample_period_ns == 0 {
            let what = "the sample period is 0 ns; give the time from row to row of the stimulus";
            return refused(what.into());
        }
        let too_high = |row: &[u16; 4]| row.iter().any(|code| *code > 4095);
        if let Some(row) = self.stimulus.iter().position(too_high) {
            let codes = self.stimulus[row];
            return refused(format!("stimulus row {row} is {codes:?}; {TWELVE_BITS}"));
        }
        if let Some((from, to)) = self.functions.iter().find(|(_, pattern)| pattern.is_empty()) {
            let what = format!("label {from:?} has the pattern {to:?}, which is in every function's name");
            return refused(what);
        }
        let ppm = self.hse_ppm;
        if ppm.is_nan() || ppm.abs() >= 1000.0 {
            let what = format!("the crystal is off by {ppm} ppm; give less than 1000");
            return refused(what);
        }
        self.pin_inputs
            .iter()
            .try_for_each(|input| check_pin(self.chip, &input.pin))?;
        for (from, to) in &self.wires {
            check_pin(self.chip, from)?;
            check_pin(self.chip, to)?;
            if from == to {
                return refused(format!("a wire leads from {from} to itself; give two pins"));
            }
        }
        for wire in &self.analog_wires {
            if !["PA4", "PA5"].contains(&&*wire.from) {
                let from = &wire.from;
                return refused(format!(
                    "an analog wire begins at {from}; the outputs of the DAC are PA4 and PA5"
                ));
            }
            check_pin(self.chip, &wire.to)?;
            if !(0..3).any(|adc| (0..16).any(|channel| analog_pin(adc, channel) == pin(&wire.to))) {
                let to = &wire.to;
                return refused(format!(
                    "an analog wire leads to {to}, which is not an input of a converter"
                ));
            }
        }
        for AnalogInput {
            pin,
            period_ns,
            codes,
            ..
        } in &self.analog_inputs
        {
            check_pin(self.chip, pin)?;
            if *period_ns == 0 {
                return refused(format!("the codes at {pin} have a period of 0 ns"));
            }
            if let Some(code) = codes.iter().find(|code| **code > 4095) {
                return refused(format!("a code at {pin} is {code}; {TWELVE_BITS}"));
            }
        }
        check_devices(self.chip, &self.devices)?;
        self.uart_input
            .iter()
            .try_for_each(|input| check_usart(&input.port))?;
        for (address, bytes) in &self.flash {
            let flash = self.chip.flash();
            let (start, end, length) = (flash.start, flash.end, bytes.len());
            if !flash.contains(address) || u64::from(*address) + length as u64 > u64::from(end) {
                let place = format!("{length} bytes for flash at {address:#010x}");
                return refused(format!("{place} are outside {start:#010x}..{end:#010x}"));
            }
        }
        Ok(())
    }
}

/// QEMU's arguments for bytes in flash.
fn loader(folder: &RunFolder, name: &str, address: u32, bytes: &[u8]) -> Result<[OsString; 2], RunError> {
    let path = folder.write(name, bytes)?;
    let loader = format!("loader,file={},addr={address:#x},force-raw=on", path.display());
    Ok(["-device".into(), loader.into()])
}

/// Refuses a port at which QEMU's stub cannot listen. QEMU reports this only after it has started.
fn check_port(port: u16) -> Result<(), RunError> {
    let taken = |error| {
        let what = format!("a debugger cannot connect to port {port} of this computer ({error})");
        RunError::Input(what + "; give another port for gdb")
    };
    TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .map(drop)
        .map_err(taken)
}
