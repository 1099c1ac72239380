//! An interpreter of the Thumb instructions that waiting loops are made of.
//!
//! # Design
//!
//! QEMU takes some microseconds for each access to a register, so a loop that polls one runs far slower than
//! real time. This interpreter executes such a loop beside QEMU, instruction by instruction, with QEMU's own
//! state and at the same virtual times. It does not know what a loop waits for, and guesses nothing: it
//! stops before the first instruction that it does not know, before an access that its [`Bus`] refuses, and
//! at a time limit. QEMU goes on from there, and cannot see the difference.
//!
//! A loop that returns to an earlier state repeats its turns until something that it reads changes. All
//! turns up to then are counted at once (`turns`). So are turns that differ only in counters, up to the
//! first that may end the loop (`trace`).
//!
//! A handler whose interrupt stays up is such a loop: it returns, and is entered again without an
//! instruction in between. The registers are not even restored (ARMv7-M ARM, B1.5.12). The interpreter
//! follows such a handler if it has executed it from its entry. It then knows all that the next entry would
//! restore: the interrupt masks, and that no floating point was in use.

mod alu;
mod bus;
mod code;
mod decode;
mod interpreter;
mod processor;
mod registers;
#[cfg(test)]
mod tests;
mod trace;
mod turns;

pub(crate) use bus::{Bus, Loaded, Stored};
pub(crate) use interpreter::Interpreter;
pub(crate) use processor::HandBack;
pub(crate) use registers::Registers;
