//! Why a run failed. Each error is one line: what failed, why, and what to do next.

use std::path::PathBuf;
use std::time::Duration;

/// Why [`Run::execute`](crate::Run::execute) gave no outcome.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The image cannot be read.
    #[error("cannot read the firmware image {}: {source}; build it first or name another", path.display())]
    ImageMissing {
        /// The image.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not an ELF for a 32-bit ARM.
    #[error("{} is not an ARM ELF file ({reason}); give the image that the thumbv7em build made", path.display())]
    NotArmElf {
        /// The image.
        path: PathBuf,
        /// What was found instead.
        reason: String,
    },
    /// Functions were asked for by name, and the image has no symbols.
    #[error("{} has no symbol table, so functions cannot be counted by name; build it without strip", path.display())]
    NoSymbols {
        /// The image.
        path: PathBuf,
    },
    /// The image's defmt records cannot be read.
    #[error("the log of {} cannot be decoded: {reason}; build the image with a defmt that this decoder knows", path.display())]
    Log {
        /// The image.
        path: PathBuf,
        /// What the decoder said.
        reason: String,
    },
    /// The run asks for something impossible.
    #[error("{0}")]
    Input(String),
    /// QEMU was not found.
    #[error(
        "{program} was not found; install it with `apt-get install qemu-system-arm` (Debian or Ubuntu), or set STM32F405_QEMU to its path"
    )]
    QemuMissing {
        /// What was tried.
        program: String,
    },
    /// QEMU runs, but its version cannot be read.
    #[error(
        "`{program} --version` said {said:?}, which is no QEMU version; set STM32F405_QEMU to a qemu-system-arm of 7.2 or newer"
    )]
    QemuVersion {
        /// What was run.
        program: String,
        /// Its first line.
        said: String,
    },
    /// The shared object that QEMU loads is not where it is looked for.
    #[error(
        "the overlay {file} was not found in {}; build it with `cargo build -p stm32f405-qemu`, or set STM32F405_QEMU_OVERLAY to its path",
        list(looked)
    )]
    OverlayMissing {
        /// Its file name.
        file: String,
        /// Where it was looked for.
        looked: Vec<PathBuf>,
    },
    /// The file found is not the overlay.
    #[error("{} is not a usable overlay: {reason}; build it again with `cargo build -p stm32f405-qemu`", path.display())]
    OverlayOdd {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// QEMU refused the overlay, or the overlay refused QEMU.
    #[error("QEMU cannot load the overlay: {line}")]
    OverlayRefused {
        /// The first line that says why.
        line: String,
    },
    /// The overlay does not fit the inside of this QEMU.
    #[error(
        "the overlay does not fit this QEMU: {line}; Debian's and Ubuntu's qemu-system-arm 7.2, 10.0 and 11.1 are known to work"
    )]
    SelfTest {
        /// Which check failed.
        line: String,
    },
    /// The processor locked up: a fault inside the fault handler, or no image at the reset vector.
    #[error(
        "the guest locked up: {line}; a fault was raised inside the HardFault handler, or the image has no vector table"
    )]
    GuestLockup {
        /// What QEMU said.
        line: String,
    },
    /// QEMU ended without a report.
    #[error("QEMU ended with {status}: {line}")]
    Qemu {
        /// Its exit status.
        status: String,
        /// The first line on its standard error.
        line: String,
    },
    /// The run took too long in real time.
    #[error("the run was stopped after {} s of real time{}; give it a longer timeout, or look for a loop without WFI", timeout.as_secs_f64(), seen(*uart_bytes))]
    Timeout {
        /// The limit.
        timeout: Duration,
        /// Bytes that the image had sent by then.
        uart_bytes: u64,
    },
    /// The run's temporary files.
    #[error("{what}: {source}")]
    Io {
        /// What was being done, with the path.
        what: String,
        /// Why it failed.
        source: std::io::Error,
    },
}

fn list(paths: &[PathBuf]) -> String {
    paths
        .iter()
        .map(|p| p.display().to_string())
        .collect::<Vec<_>>()
        .join(", ")
}

fn seen(uart_bytes: u64) -> String {
    match uart_bytes {
        0 => " without a byte on the UART".into(),
        n => format!(" with {n} bytes on the UART"),
    }
}

pub(super) fn io(what: &str) -> impl Fn(std::io::Error) -> RunError + use<> {
    let what = what.to_string();
    move |source| RunError::Io {
        what: what.clone(),
        source,
    }
}
