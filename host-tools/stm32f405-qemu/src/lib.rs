#![doc = include_str!("../README.md")]

mod chip;
mod device;
mod ending;
mod exchange;
mod given;
mod level;
pub mod machine;
mod memory;
mod outcome;
mod peripherals;
mod plugin;
mod ramp;
mod run;
#[cfg(feature = "scenario")]
mod scenario;
mod thumb;
mod vcd;

pub use chip::{Chip, UnknownChip};
pub use device::{BusAnswer, BusCall, BusEvent, Device, Devices, SpiFrame};
pub use ending::{CodeAddress, Exception, RunEnd};
pub use given::{AnalogInput, AnalogWire, Fault, FaultKind, Inputs, PinInput, Poke, Run, Since, UartInput};
pub use level::Level;
pub use outcome::{
    BlockCost, Cycles, FlashOperation, FunctionCount, Instructions, Interrupt, LogLine, Masked, Outcome, Pin,
    Reset, ResetCause, Sampling, StretchWork, Uart, UnknownRegister,
};
#[doc(hidden)]
pub use run::carry;
pub use run::{
    Function, Live, Passed, RunError, TestCase, functions, qemu_version, remove_temporary_files, test_cases,
};
#[cfg(feature = "scenario")]
pub use scenario::{Scenario, ScenarioError};
