//! What the host process and the plugin inside QEMU tell each other: files in one directory for each run.
//!
//! # Design
//!
//! QEMU's plugin arguments are a comma-separated list without quoting. So the plugin is given one thing only:
//! a directory. The host writes [`DESCRIPTION`] and [`STIMULUS`] before it starts QEMU; the plugin writes
//! [`sent`] and [`RTT`] while the image runs and [`OUTCOME`] when it ends. A run that ends without an outcome
//! has failed.
//!
//! Both sides are this crate, built twice. By [`FORMAT`] in the description the plugin sees whether both are
//! of the same build: an older shared object is refused, not misread.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::given::Run;

/// Changes with every change of these files.
pub(crate) const FORMAT: u32 = 10;

pub(crate) const DESCRIPTION: &str = "run.json";
/// Rows of four little-endian u16: the codes of ADC channels 0 to 3.
pub(crate) const STIMULUS: &str = "stimulus.bin";
/// What left the USARTs, a file for each: USART1 is `sent0.bin`. A record for each frame, little-endian: u64, the
/// virtual time in ns at which it had left, and u16, its data bits.
pub(crate) fn sent(usart: usize) -> String {
    format!("sent{usart}.bin")
}
/// Bytes of RTT up-channel 0, in order.
pub(crate) const RTT: &str = "rtt.bin";
/// The run's outcome, without what the other files hold.
pub(crate) const OUTCOME: &str = "outcome.json";
/// What the image said by semihosting.
pub(crate) const SEMIHOSTING: &str = "semihosting.txt";
/// What flash sectors 10 and 11 hold at the end.
pub(crate) const FLASH: &str = "flash.bin";

/// Exit status of QEMU when the overlay's self-test fails. QEMU itself uses 0, 1 and signals.
pub(crate) const SELF_TEST_STATUS: i32 = 86;
/// Every line that the overlay prints on standard error starts with this.
pub(crate) const LINE_PREFIX: &str = "stm32f405-qemu: ";

/// What to run, host to plugin. The fields of `run` that only the host needs are left out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Description<'a> {
    pub(crate) format: u32,
    pub(crate) run: Cow<'a, Run>,
    /// Address of the RTT control block, if the image has one.
    pub(crate) rtt: Option<u32>,
    /// First addresses of the handlers of faults: vectors 3 to 6.
    pub(crate) fault_handlers: Vec<u32>,
    /// First addresses of the functions that a panic enters.
    pub(crate) panic_functions: Vec<u32>,
    pub(crate) functions: Vec<FunctionRange>,
    pub(crate) labels: Vec<String>,
    /// The labels whose functions make a block a working one.
    pub(crate) work: Vec<usize>,
}

/// A function of the image that belongs to a label: addresses `[start, end)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FunctionRange {
    pub(crate) label: usize,
    pub(crate) start: u32,
    pub(crate) end: u32,
}
