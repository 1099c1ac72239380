//! Running an image: the host's side.
//!
//! # Design
//!
//! QEMU is a child process, the overlay is this very crate built as a shared object, and a temporary directory
//! carries everything between the two ([`crate::exchange`]). Nothing is left behind and nothing is shared between
//! runs, so runs may go in parallel.

mod error;
mod image;
mod log;
mod overlay;
mod qemu;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

pub use error::RunError;
pub use log::LogLine;

use crate::exchange::{
    self, Block, Description, FORMAT, Fault, FlashOperation, LINE_PREFIX, Pin, PinInput, Poke, Report, Reset,
    SELF_TEST_STATUS, Sampling, UartInput, UnknownRegister,
};
use crate::machine::{FLASH, WRITABLE};
use image::Image;
use qemu::Qemu;

/// One run of an image: what it is given, and when it ends.
///
/// ```no_run
/// use stm32f405_qemu::Run;
///
/// let mut run = Run::new("target/thumbv7em-none-eabihf/release/firmware");
/// run.stimulus = (0..1000u16).map(|i| [i, 2048]).collect();
/// let outcome = run.execute()?;
/// println!("{} bytes from USART1", outcome.uart.len());
/// # Ok::<(), stm32f405_qemu::RunError>(())
/// ```
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Run {
    /// The image, unchanged: what would be flashed.
    pub elf: PathBuf,
    /// Codes that ADC1 converts, 0..=4095: channel 0, channel 1. Row 0 is read by the first externally triggered
    /// scan, row `i` by scans from `i` periods later; the last row stays. Scans started by software before read row 0.
    pub stimulus: Vec<[u16; 2]>,
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
    /// A run of an image with both inputs at mid-scale, 10 µs a sample, 10 ms long, instructions counted.
    pub fn new(elf: impl Into<PathBuf>) -> Self {
        Self {
            elf: elf.into(),
            stimulus: vec![[2048, 2048]],
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
        let mut ended = self.start(&qemu, &folder, &overlay, version, &blocks)?;
        if let Some(other) = qemu::wanted_version(&ended.stderr).filter(|other| *other != version) {
            version = other;
            ended = self.start(&qemu, &folder, &overlay, version, &blocks)?;
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

    fn start(
        &self,
        qemu: &Qemu,
        folder: &Folder,
        overlay: &Path,
        version: i32,
        blocks: &[String],
    ) -> Result<Ended, RunError> {
        let plugin = folder.write("overlay.so", &overlay::with_version(overlay, version)?)?;
        let stderr_path = folder.path.join("stderr");
        let stderr = File::create(&stderr_path).map_err(io("cannot write the run's temporary files"))?;
        let mut command = Command::new(&qemu.program);
        command
            .args(["-M", "netduinoplus2", "-icount", "shift=3,sleep=off"])
            .args(["-nographic", "-monitor", "none", "-serial", "none", "-kernel"])
            .arg(&self.elf)
            .arg("-plugin")
            .arg(format!("{},run={}", plugin.display(), folder.path.display()))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(stderr);
        for block in blocks {
            command.args(["-device", block]);
        }
        let child = command.spawn().map_err(|_| RunError::QemuMissing {
            program: qemu.program.to_string_lossy().into_owned(),
        })?;
        let Some(status) = wait(child, self.timeout)? else {
            let uart_bytes = folder.path.join(exchange::UART).metadata().map_or(0, |m| m.len());
            return Err(RunError::Timeout {
                timeout: self.timeout,
                uart_bytes,
            });
        };
        let stderr = std::fs::read(&stderr_path).map_err(io("cannot read what QEMU said"))?;
        Ok(Ended {
            status,
            stderr: String::from_utf8_lossy(&stderr).into_owned(),
        })
    }
}

/// What a run gave.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Outcome {
    /// Bytes that left the USART1 transmitter.
    pub uart: Vec<u8>,
    /// When each of them had left, in ns of virtual time since power-up.
    pub uart_ns: Vec<u64>,
    /// The defmt log, decoded.
    pub log: Vec<LogLine>,
    /// The same log as it came over RTT.
    pub rtt: Vec<u8>,
    /// What was executed; `None` if not counted.
    pub instructions: Option<Instructions>,
    /// The externally triggered scans; `None` if the image never came to sample.
    pub sampling: Option<Sampling>,
    /// How often the ADC lost a conversion (ADC_SR.OVR was set).
    pub overruns: u64,
    /// Triggers that came while a scan was running or while OVR stood, and so started nothing.
    pub triggers_ignored: u64,
    /// Resets after power-up.
    pub resets: Vec<Reset>,
    /// Registers that the firmware touched and that read as zero here for want of a model.
    pub unknown_registers: Vec<UnknownRegister>,
    /// Features of modelled peripherals that the firmware asked for and that are not modelled.
    pub unmodelled: Vec<String>,
    /// Output pins that moved.
    pub pins: Vec<Pin>,
    /// What flash sectors 10 and 11, which firmware can write, hold at the end: address and bytes, as for [`Run::flash`].
    pub flash: (u32, Vec<u8>),
    /// Words that the firmware programmed and sectors that it erased, in order.
    pub flash_operations: Vec<FlashOperation>,
    /// Virtual time at the end, in ns since power-up.
    pub virtual_ns: u64,
}

/// Instructions executed, at 8 ns of virtual time each; a processor in WFI executes none.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Instructions {
    /// By the whole image.
    pub total: u64,
    /// One entry a label, in the order given.
    pub functions: Vec<FunctionCount>,
    /// The busiest stretch between two interrupts of the ADC's DMA stream.
    pub worst_block: Option<Block>,
    /// All stretches together in which a function of [`Run::work`] ran; `None` if none ever did.
    pub working: Option<Block>,
    /// All other stretches together; `None` if there were none.
    pub idle: Option<Block>,
}

/// Instructions inside the functions of one label, without those of functions that they call.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FunctionCount {
    /// The label.
    pub label: String,
    /// Instructions executed.
    pub instructions: u64,
    /// How often one of the functions was entered.
    pub calls: u64,
    /// How many functions of the image the label stands for: 0 means that the compiler inlined them all, or a typing
    /// mistake.
    pub symbols: usize,
}

fn words(bytes: &[u8]) -> Vec<u64> {
    let (words, _) = bytes.as_chunks();
    words.iter().map(|word| u64::from_le_bytes(*word)).collect()
}

struct Folder {
    path: PathBuf,
    _kept: tempfile::TempDir,
}

impl Folder {
    fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.path.join(name);
        std::fs::write(&path, bytes).map_err(io("cannot write the run's temporary files"))?;
        Ok(path)
    }

    fn read(&self, name: &str) -> Result<Vec<u8>, RunError> {
        std::fs::read(self.path.join(name)).map_err(io("cannot read back what the run wrote"))
    }
}

/// A QEMU that ended by itself.
struct Ended {
    status: ExitStatus,
    stderr: String,
}

impl Ended {
    /// The overlay's report, or why there is none.
    fn report(&self, folder: &Folder) -> Result<Report, RunError> {
        if let Ok(report) = std::fs::read(folder.path.join(exchange::REPORT)) {
            return serde_json::from_slice(&report).map_err(|e| RunError::Qemu {
                status: self.status.to_string(),
                line: format!("its report cannot be read ({e})"),
            });
        }
        let first = |part: &str| self.stderr.lines().find(|l| l.contains(part)).map(str::to_string);
        let ours = first(LINE_PREFIX).map(|l| l.replace(LINE_PREFIX, ""));
        let any = || {
            self.stderr
                .lines()
                .next()
                .unwrap_or("it said nothing")
                .to_string()
        };
        Err(if self.status.code() == Some(SELF_TEST_STATUS) {
            RunError::SelfTest {
                line: ours.unwrap_or_else(any),
            }
        } else if let Some(line) = first("Lockup") {
            RunError::GuestLockup { line }
        } else if let Some(line) = ours.or_else(|| first("plugin")) {
            RunError::OverlayRefused { line }
        } else {
            RunError::Qemu {
                status: self.status.to_string(),
                line: any(),
            }
        })
    }
}

/// Its exit status, or `None` if it had to be killed.
fn wait(mut child: Child, limit: Duration) -> Result<Option<ExitStatus>, RunError> {
    let deadline = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait().map_err(io("cannot wait for QEMU"))? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            child.kill().map_err(io("cannot stop QEMU"))?;
            child.wait().map_err(io("cannot wait for QEMU"))?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn io(what: &str) -> impl Fn(std::io::Error) -> RunError + use<> {
    let what = what.to_string();
    move |source| RunError::Io {
        what: what.clone(),
        source,
    }
}
