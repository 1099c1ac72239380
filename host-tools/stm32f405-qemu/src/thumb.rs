//! An interpreter of the Thumb instructions that waiting loops are made of.
//!
//! # Design
//!
//! QEMU takes some microseconds for each access to a register, so a loop that polls one runs far slower than
//! real time. This interpreter executes such a loop beside QEMU, instruction by instruction, with QEMU's own
//! state and at the same virtual times. It does not know what a loop waits for, and guesses nothing: it stops
//! before the first instruction that it does not know, before an access that its [`Bus`] refuses, and at a
//! time limit. QEMU goes on from there, and cannot tell.
//!
//! A loop that comes back to the same state does the same again, as long as what it reads stays. Its turns up
//! to then are counted at once (`turns`). Turns that differ in counters alone are too, up to the first that
//! may end the loop (`trace`).
//!
//! A handler whose interrupt stays up is such a loop: it returns, and is entered again without an instruction
//! in between. The registers are not even restored (ARMv7-M ARM, B1.5.12). The interpreter follows it if it
//! has executed the handler from its entry, so that it knows all that the next entry would put back: the
//! masks of interrupts, and that no floating point was in use.

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
