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
use bead_recording::file::RecordingError;
use bead_tables::whole::WriteError;
use hertz_sweep::folder::FolderError;
use hertz_sweep::time_series::TimeSeriesError;

/// Why a command did not end with exit status 0. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The command ran to its end and a check said no: exit status 1.
    #[error("{0}")]
    Verdict(String),
    /// The command line, a file it names, or the place to write to is wrong: exit status 2.
    #[error("{0:#}")]
    Input(anyhow::Error),
    /// The device or the emulator failed: exit status 3.
    #[error("{0:#}")]
    Device(anyhow::Error),
}

impl Failure {
    /// An input error with nothing beneath it.
    pub fn input(message: impl Display) -> Self {
        Self::Input(anyhow::anyhow!("{message}"))
    }

    /// A device failure with nothing beneath it.
    pub fn device(message: impl Display) -> Self {
        Self::Device(anyhow::anyhow!("{message}"))
    }

    /// The process's exit status.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Verdict(_) => 1,
            Self::Input(_) => 2,
            Self::Device(_) => 3,
        }
    }
}

/// Errors of the library whose cause is the command's input: exit status 2.
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
    FolderError,
    KeyError,
    RecordingError,
    TimeSeriesError,
    WaveformError,
    WriteError
);

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        use RunError::{ImageMissing, Input, NoSymbols, NotArmElf};
        match error {
            BenchError::Mute(_) => Self::device(error),
            BenchError::Emulator(ImageMissing { .. } | NotArmElf { .. } | NoSymbols { .. } | Input(_)) => {
                Self::input(error)
            }
            BenchError::Emulator(_) => Self::device(error),
            _ => Self::input(error),
        }
    }
}

impl From<LineError> for Failure {
    fn from(error: LineError) -> Self {
        match error {
            LineError::Refused(why) => Self::Verdict(why),
            _ => Self::device(error),
        }
    }
}

impl From<&Failure> for ExitCode {
    fn from(failure: &Failure) -> Self {
        Self::from(failure.exit_status())
    }
}

/// Says whether the input or the device is at fault.
pub trait Blame<T> {
    /// The input is at fault.
    fn or_input<C: Display + Send + Sync + 'static>(self, context: impl FnOnce() -> C) -> Result<T, Failure>;
    /// The device or the emulator is at fault.
    fn or_device<C: Display + Send + Sync + 'static>(self, context: impl FnOnce() -> C)
    -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> Blame<T> for Result<T, E> {
    fn or_input<C: Display + Send + Sync + 'static>(self, context: impl FnOnce() -> C) -> Result<T, Failure> {
        self.map_err(|error| Failure::Input(error.into().context(context())))
    }

    fn or_device<C: Display + Send + Sync + 'static>(
        self,
        context: impl FnOnce() -> C,
    ) -> Result<T, Failure> {
        self.map_err(|error| Failure::Device(error.into().context(context())))
    }
}
