#![doc = include_str!("../README.md")]

mod ending;
mod exchange;
mod given;
pub mod machine;
mod memory;
mod outcome;
mod peripherals;
mod plugin;
mod run;
mod thumb;
mod vcd;

pub use ending::{CodeAddress, Exception, RunEnd};
pub use given::{
    AnalogInput, AnalogWire, Fault, FaultKind, Inputs, Level, PinInput, Poke, Run, Since, UartInput,
};
pub use outcome::{
    BlockCost, Cycles, FlashOperation, FunctionCount, Instructions, Interrupt, LogLine, Masked, Outcome, Pin,
    Reset, ResetCause, Sampling, StretchWork, Uart, UnknownRegister,
};
#[doc(hidden)]
pub use run::carry;
pub use run::{
    Function, Live, Passed, RunError, TestCase, functions, qemu_version, remove_temporary_files, test_cases,
};
