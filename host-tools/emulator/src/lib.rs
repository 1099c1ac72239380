#![doc = include_str!("../README.md")]

mod exchange;
pub mod machine;
pub mod peripherals;
mod plugin;
mod run;

pub use exchange::{
    Block, Fault, FaultKind, FlashOperation, Pin, PinInput, Poke, Reset, ResetCause, Sampling, UartInput,
    UnknownRegister,
};
pub use run::{FunctionCount, Instructions, LogLine, Outcome, Run, RunError};
