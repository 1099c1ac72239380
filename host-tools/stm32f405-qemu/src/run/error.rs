//! Errors of a run. Each is one line: the failure, its reason, and the next step.

use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;

use crate::outcome::{Outcome, UnknownRegister};

/// Error of [`Run::execute`](crate::Run::execute).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The image at this path cannot be read.
    #[error("cannot read the firmware image {path}: {1}; build it first or name another", path = .0.display())]
    ImageMissing(PathBuf, #[source] std::io::Error),
    /// The file at this path is not an ELF with something to load for a 32-bit ARM, for this reason.
    #[error("{path} is not an ARM firmware image ({1}); give the ELF that the thumbv7em build made", path = .0.display())]
    NotArmElf(PathBuf, String),
    /// The image at this path does not fit the run's part, for this reason.
    #[error("{path} is an image for another part: {1}", path = .0.display())]
    OtherPart(PathBuf, String),
    /// Functions were asked for by name, and the image at this path has no symbols.
    #[error("{path} has no symbol table, so functions cannot be counted by name; build it without strip", path = .0.display())]
    NoSymbols(PathBuf),
    /// The defmt records of the image at this path cannot be read, for the reason that the decoder gave.
    #[error("the log of {path} cannot be decoded: {1}; build the image with a defmt that this decoder knows", path = .0.display())]
    Log(PathBuf, String),
    /// The run asks for something impossible.
    #[error("{0}")]
    Input(String),
    /// The QEMU of this name cannot be used, for this reason.
    #[error("{0} cannot be used: {1}; set STM32F405_QEMU to a qemu-system-arm of 7.2 or newer")]
    QemuUnusable(String, String),
    /// There is no QEMU of this name.
    #[error(
        "{0} was not found; install it with `apt-get install qemu-system-arm` (Debian or Ubuntu), or set STM32F405_QEMU to its path"
    )]
    QemuMissing(String),
    /// The QEMU of this name runs, but the first line of its output has no version in it.
    #[error(
        "`{0} --version` printed {1:?}, which is not a QEMU version; set STM32F405_QEMU to a qemu-system-arm of 7.2 or newer"
    )]
    QemuVersion(String, String),
    /// The shared object of this name, which QEMU loads, is in none of these places.
    #[error(
        "the overlay {0} was not found in {looked}; build it with `cargo build -p stm32f405-qemu`, or set STM32F405_QEMU_OVERLAY to its path",
        looked = list(.1)
    )]
    OverlayMissing(String, Vec<PathBuf>),
    /// The file at this path is not the overlay, for this reason.
    #[error("{path} is not a usable overlay: {1}; build it again with `cargo build -p stm32f405-qemu`", path = .0.display())]
    OverlayOdd(PathBuf, String),
    /// QEMU refused the overlay, or the overlay refused QEMU: the first line of the reason.
    #[error("QEMU cannot load the overlay: {0}")]
    OverlayRefused(String),
    /// The overlay panicked: the place and the reason.
    #[error("the overlay failed ({0}): this is a fault of the emulator; please report it with the image")]
    OverlayFailed(String),
    /// The overlay does not fit the inside of this QEMU: the check that failed.
    #[error(
        "the overlay does not fit this QEMU: {0}; Debian's and Ubuntu's qemu-system-arm 7.2, 10.0 and 11.1 are known to work"
    )]
    SelfTest(String),
    /// QEMU ended without a report: its exit status, and the first line on its standard error.
    #[error("QEMU ended with {0}: {1}")]
    Qemu(ExitStatus, String),
    /// QEMU ended in the middle of the run, by a signal for example: its exit status, and the first line on
    /// its standard error. Has the outcome up to then.
    #[error("QEMU ended{at}, before the run was over: {0}", at = .1.whereabouts())]
    QemuEnded(String, Box<Outcome>),
    /// The run took longer than this in real time. Has the outcome up to then.
    #[error(
        "the run was stopped after {limit} s of real time{at}, {sent}{unknown}; give it a longer timeout, or look for a loop without WFI",
        limit = .0.as_secs_f64(), at = .1.whereabouts(), sent = seen(.1.uart.len()), unknown = unknown(.1)
    )]
    Timeout(Duration, Box<Outcome>),
    /// The image does nothing but read a register that no model knows. Has the outcome up to then.
    #[error(
        "the image is stuck{at}, {sent}{unknown}; no model knows what it reads there",
        at = .0.whereabouts(), sent = seen(.0.uart.len()), unknown = unknown(.0)
    )]
    Stuck(Box<Outcome>),
    /// QEMU ran longer than this, and did not report.
    #[error("QEMU was killed: it took more than {limit} s and did not report", limit = .0.as_secs_f64())]
    Silent(Duration),
    /// Failure of the run's temporary files: the operation, and its error.
    #[error("{0}: {1}")]
    Io(&'static str, #[source] std::io::Error),
}

impl RunError {
    /// Outcome of the run up to the point where it was stopped.
    pub fn outcome(&self) -> Option<&Outcome> {
        match self {
            Self::Timeout(_, outcome) | Self::Stuck(outcome) | Self::QemuEnded(_, outcome) => Some(outcome),
            _ => None,
        }
    }
}

/// The registers that no model knows, the most accessed first.
fn unknown(outcome: &Outcome) -> String {
    let mut registers: Vec<_> = outcome.unknown_registers.iter().collect();
    registers.sort_by_key(|register| std::cmp::Reverse(register.reads + register.writes));
    let reads = |register: &&UnknownRegister| format!("{} ({} reads)", register.name, register.reads);
    let reads: Vec<_> = registers.iter().take(3).map(reads).collect();
    if reads.is_empty() {
        String::new()
    } else {
        format!("; without a model: {}", reads.join(", "))
    }
}

fn list(paths: &[PathBuf]) -> String {
    let shown: Vec<_> = paths.iter().map(|path| path.display().to_string()).collect();
    shown.join(", ")
}

fn seen(uart_bytes: usize) -> String {
    match uart_bytes {
        0 => "without a byte on the UART".into(),
        n => format!("with {n} bytes on the UART"),
    }
}

pub(super) fn io(what: &'static str) -> impl Fn(std::io::Error) -> RunError {
    move |source| RunError::Io(what, source)
}
