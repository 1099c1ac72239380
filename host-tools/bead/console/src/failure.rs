//! Why a command failed, and its exit status.
//!
//! | status | meaning |
//! |---|---|
//! | 0 | done |
//! | 1 | a check said no: a replay that differs, a figure out of tolerance |
//! | 2 | the command line or its input is wrong |
//! | 3 | the device or the emulator failed |

use std::fmt::Display;
use std::process::ExitCode;

use stm32f405_qemu::RunError;

use bead_bench::error::BenchError;
use bead_compare::error::CompareError;
use bead_instrument::WaveformError;
use bead_line::conversation::LineError;
use bead_line::key::KeyError;
use bead_line::rom_loader::RomError;
use bead_recording::file::RecordingError;
use bead_tables::whole::WriteError;

/// Why a command did not end with exit status 0. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
#[error("{0:#}")]
pub enum Failure {
    /// The command ran to its end and a check said no: exit status 1.
    Verdict(anyhow::Error),
    /// The command line, a file it names, or the place to write to is wrong: exit status 2.
    Input(anyhow::Error),
    /// The device or the emulator failed: exit status 3.
    Device(anyhow::Error),
}

/// A [`Failure`] of a kind, with a message as for `format!`.
#[macro_export]
macro_rules! failure {
    ($kind:ident, $($message:tt)+) => {
        $crate::failure::Failure::$kind($crate::anyhow::anyhow!($($message)+))
    };
}

/// Ends a function with a [`Failure`] of a kind, with a message as for `format!`.
#[macro_export]
macro_rules! bail {
    ($kind:ident, $($message:tt)+) => {
        return Err($crate::failure!($kind, $($message)+))
    };
}

impl Failure {
    /// An input error without a cause beneath it.
    pub fn input(message: impl Display) -> Self {
        failure!(Input, "{message}")
    }

    /// The process's exit status.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Verdict(_) => 1,
            Self::Input(_) => 2,
            Self::Device(_) => 3,
        }
    }

    /// A verdict of a check.
    pub fn verdict(message: impl Display) -> Self {
        failure!(Verdict, "{message}")
    }
}

/// Errors of the crates below whose cause is the command's input: exit status 2.
macro_rules! input_errors {
    ($($error:ty),*) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::input(error)
            }
        })*
    };
}
input_errors!(
    CompareError,
    hertz_chain::InputError,
    hertz_chain::SimulateError,
    hertz_charts::Error,
    KeyError,
    RecordingError,
    WaveformError,
    WriteError
);

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Input(error)
    }
}

impl From<hertz_chain::PeriodicError> for Failure {
    fn from(error: hertz_chain::PeriodicError) -> Self {
        match error {
            hertz_chain::PeriodicError::Simulate(error) => error.into(),
            // The absence of a motion that repeats is a result.
            error => Self::Verdict(error.into()),
        }
    }
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        use RunError::{ImageMissing, Input, NoSymbols, NotArmElf};
        match error {
            BenchError::Emulator(ImageMissing { .. } | NotArmElf { .. } | NoSymbols { .. } | Input(_)) => {
                Self::input(error)
            }
            BenchError::Mute(_) | BenchError::Emulator(_) => failure!(Device, "{error}"),
            _ => Self::input(error),
        }
    }
}

impl From<LineError> for Failure {
    fn from(error: LineError) -> Self {
        match error {
            LineError::Refused(why) => failure!(Verdict, "{why}"),
            _ => failure!(Device, "{error}"),
        }
    }
}

impl From<RomError> for Failure {
    fn from(error: RomError) -> Self {
        failure!(Device, "{error}")
    }
}

impl From<&Failure> for ExitCode {
    fn from(failure: &Failure) -> Self {
        Self::from(failure.exit_status())
    }
}
