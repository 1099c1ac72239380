//! An STM32F405 for tests: its peripherals laid over stock QEMU, and the call that runs an image on them.
#![cfg_attr(not(test), deny(clippy::unwrap_used))]

mod exchange;
pub mod machine;
pub mod peripherals;
mod plugin;
mod run;

pub use exchange::{Block, Pin, Poke, Reset, ResetCause, Sampling, UartInput, UnknownRegister};
pub use run::{FunctionCount, Instructions, LogLine, Outcome, Run, RunError};
