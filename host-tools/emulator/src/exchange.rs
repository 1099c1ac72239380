//! What the host process and the plugin inside QEMU tell each other: files in one directory per run.
//!
//! # Design
//!
//! QEMU's plugin arguments are a comma-separated list without quoting, so the plugin is given one thing only: a
//! directory. The host writes [`DESCRIPTION`] and [`STIMULUS`] before it starts QEMU; the plugin writes [`UART`] and
//! [`RTT`] while the image runs and [`REPORT`] when it ends. A run that ends without a report has failed.
//!
//! Both sides are one crate built twice, and [`FORMAT`] in the description says so: a shared object left over from
//! an older build is told apart instead of misread.

use serde::{Deserialize, Serialize};

/// Changes with every change of these files.
pub(crate) const FORMAT: u32 = 5;

pub(crate) const DESCRIPTION: &str = "run.json";
/// Rows of two little-endian u16: the code of ADC channel 0, then that of channel 1.
pub(crate) const STIMULUS: &str = "stimulus.bin";
/// Bytes that left the USART1 transmitter, in order.
pub(crate) const UART: &str = "uart.bin";
/// Bytes of RTT up-channel 0, in order.
/// When each of them had left: virtual times in ns, little-endian u64.
pub(crate) const UART_TIMES: &str = "uart-times.bin";
pub(crate) const RTT: &str = "rtt.bin";
pub(crate) const REPORT: &str = "report.json";
/// What flash sectors 10 and 11 hold at the end.
pub(crate) const FLASH: &str = "flash.bin";

/// Exit status of QEMU when the overlay's self-test fails. QEMU itself uses 0, 1 and signals.
pub(crate) const SELF_TEST_STATUS: i32 = 86;
/// What every line that the overlay prints on standard error starts with.
pub(crate) const LINE_PREFIX: &str = "stm32f405-qemu: ";

/// What to run, host to plugin.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Description {
    pub(crate) format: u32,
    pub(crate) sample_period_ns: u64,
    pub(crate) tail_ns: u64,
    pub(crate) sampling_deadline_ns: u64,
    pub(crate) hse_hz: u32,
    pub(crate) hse_ppm: f64,
    pub(crate) uid: [u8; 12],
    /// Address of the RTT control block, if the image has one.
    pub(crate) rtt: Option<u32>,
    pub(crate) count_instructions: bool,
    pub(crate) functions: Vec<FunctionRange>,
    pub(crate) labels: usize,
    /// The labels whose functions make a block a working one.
    pub(crate) work: Vec<usize>,
    pub(crate) uart_input: Vec<UartInput>,
    pub(crate) pin_inputs: Vec<PinInput>,
    pub(crate) pokes: Vec<Poke>,
    pub(crate) faults: Vec<Fault>,
}

/// One function of the image that belongs to a label: `[start, end)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FunctionRange {
    pub(crate) label: usize,
    pub(crate) start: u32,
    pub(crate) end: u32,
}

/// Bytes for the USART1 receiver, sent back to back at its own baud rate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UartInput {
    /// Virtual time at which the first start bit falls, in ns.
    pub at_ns: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A level put on a pin from outside, low at first.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PinInput {
    /// For example `PA15`.
    pub pin: String,
    /// When the level changes, up, down, up and so on: virtual times in ns after the first externally triggered scan, the
    /// time of the stimulus, in order.
    pub changes_ns: Vec<u64>,
}

impl PinInput {
    /// Port (`A` is 0) and number, if there is such a pin.
    pub(crate) fn place(&self) -> Option<(usize, usize)> {
        let mut letters = self.pin.strip_prefix('P')?.chars();
        let port = "ABCDEFGHI".find(letters.next()?)?;
        let number = letters.as_str().parse().ok().filter(|number| *number < 16)?;
        Some((port, number))
    }
}

/// A fault on demand: bytes written over guest memory, flash included, behind the processor's back.
///
/// A reset brings flash back as it was, so that the image that faulted can start again; what is written over RAM stays.
/// What the firmware itself has written to flash stays too: the bytes poked are not part of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Poke {
    /// Virtual time of the write, in ns since power-up.
    pub at_ns: u64,
    /// First address.
    pub address: u32,
    /// What to write there.
    pub bytes: Vec<u8>,
}

/// A fault on demand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Virtual time, in ns after the first externally triggered scan: the time of the stimulus.
    pub at_ns: u64,
    /// What fails.
    pub kind: FaultKind,
}

/// What fails.
///
/// [`WildJump`](Self::WildJump) to [`RunawayStack`](Self::RunawayStack) make the processor run wild: the vector of the DMA stream that serves ADC1 is overwritten in flash, and
/// that stream's next interrupt does the rest. The reset brings flash back. Nothing happens if no stream serves ADC1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// ADC1 loses a conversion, as when the DMA does not fetch in time: SR.OVR is set, DMA requests and triggers stop
    /// until it is cleared (RM0090 section 13.8.1).
    AdcOverrun,
    /// The DMA stream that serves ADC1 meets a bus error: TEIF is set and the stream stops (section 10.3.18). Nothing
    /// happens if no stream serves it.
    AdcDmaError,
    /// USART1 ends no frame for so many ns: what is in its registers stays there, and the DMA waits. A USART without flow
    /// control never does this by itself; it is what a transmitter held by CTS, or a DMA stream that got stuck, looks like.
    TransmitterStalled {
        /// How long, in ns.
        for_ns: u64,
    },
    /// The supply is so high from now on, in mV; 3300 before. Only the programmable voltage detector sees it: below 1.8 V
    /// silicon would not run.
    Supply {
        /// In mV.
        millivolts: u32,
    },
    /// The vector leads out of memory: a hard fault.
    WildJump,
    /// The vector becomes that of WWDG (position 0): where an image does not use the window watchdog, its handler for
    /// interrupts that have none.
    UnhandledInterrupt,
    /// The vector leads to `b .` in the last bytes of flash: the processor never leaves the handler.
    Hang,
    /// The vector leads to a loop in the last bytes of flash that pushes on the stack for ever.
    RunawayStack,
    /// The power goes and comes back at once: a power-on reset. RAM then holds nothing of before, the reset flags are those
    /// of power-up, and a flash operation that ran is left half done. The stimulus goes on.
    PowerCut,
    /// [`PowerCut`](Self::PowerCut) in the midst of a flash operation: a word programmed, a sector erased. Several are
    /// counted each by itself, and the count goes on over resets.
    PowerCutInFlash {
        /// How many operations begin before that one, from the time of the fault on.
        after: u32,
        /// How much of it is over when the power goes: 0 to 100.
        percent: u8,
    },
}

/// What was seen, plugin to host.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Report {
    pub(crate) sampling: Option<Sampling>,
    pub(crate) virtual_ns: u64,
    pub(crate) overruns: u64,
    pub(crate) triggers_ignored: u64,
    pub(crate) resets: Vec<Reset>,
    pub(crate) unknown: Vec<UnknownRegister>,
    pub(crate) unmodelled: Vec<String>,
    pub(crate) pins: Vec<Pin>,
    pub(crate) flash_operations: Vec<FlashOperation>,
    pub(crate) instructions: u64,
    pub(crate) labels: Vec<Count>,
    pub(crate) worst_block: Option<Block>,
    pub(crate) working: Option<Block>,
    pub(crate) idle: Option<Block>,
}

/// The externally triggered scans of ADC1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sampling {
    /// Virtual time of the first one, which reads row 0 of the stimulus, in ns.
    pub first_ns: u64,
    /// How many were started.
    pub scans: u64,
}

/// A reset of the machine after power-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reset {
    /// Virtual time, in ns.
    pub at_ns: u64,
    /// What asked for it.
    pub cause: ResetCause,
}

/// What asked for a reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetCause {
    /// SYSRESETREQ, by the firmware itself.
    Software,
    /// The independent watchdog ran out.
    Watchdog,
    /// [`FaultKind::PowerCut`] or [`FaultKind::PowerCutInFlash`].
    PowerCut,
}

/// A word programmed or a sector erased by the firmware, or at least begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlashOperation {
    /// Virtual time at which it began, in ns.
    pub at_ns: u64,
    /// First address.
    pub address: u32,
    /// How much it programs or erases.
    pub bytes: u32,
    /// Whether it erases.
    pub erase: bool,
}

/// A register that the firmware touched and no model knows, or whose peripheral's clock was off.
///
/// It read as zero and its writes went nowhere: on silicon the firmware may behave otherwise.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnknownRegister {
    /// For example `SPI1+0x08`, or `USART1+0x00 (clock off)`.
    pub name: String,
    /// Address of the word.
    pub address: u32,
    /// How often it was read.
    pub reads: u64,
    /// How often it was written.
    pub writes: u64,
    /// What was written last.
    pub last_write: Option<u32>,
}

/// An output pin that moved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    /// For example `PC13`.
    pub name: String,
    /// How often its level changed while it was an output.
    pub edges: u64,
}

/// Instructions executed inside the functions of one label.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Count {
    pub(crate) instructions: u64,
    pub(crate) calls: u64,
}

/// A stretch from interrupt to interrupt of the ADC's DMA stream, or several of them together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Instructions of the whole image, interrupts and all.
    pub instructions: u64,
    /// Scans of the ADC in the same stretch.
    pub scans: u64,
}

impl Block {
    /// Instructions for each scan of the ADC.
    pub fn instructions_per_scan(&self) -> f64 {
        self.instructions as f64 / self.scans as f64
    }
}
