//! What a run gives.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What a run gave.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Outcome {
    /// Bytes that left the USART1 transmitter.
    pub uart: Vec<u8>,
    /// When each of them had left, in ns of virtual time since power-up.
    pub uart_ns: Vec<u64>,
    /// The defmt log, decoded.
    pub log: Vec<LogLine>,
    /// The same log as it came over RTT.
    pub rtt: Vec<u8>,
    /// What was executed; `None` if not counted.
    pub instructions: Option<Instructions>,
    /// The externally triggered scans; `None` if the image never came to sample.
    pub sampling: Option<Sampling>,
    /// How often the ADC lost a conversion (ADC_SR.OVR was set).
    pub overruns: u64,
    /// Triggers that came while a scan was running or while OVR stood, and so started nothing.
    pub triggers_ignored: u64,
    /// Resets after power-up.
    pub resets: Vec<Reset>,
    /// Registers that the firmware touched and that read as zero here for want of a model.
    pub unknown_registers: Vec<UnknownRegister>,
    /// Features of modelled peripherals that the firmware asked for and that are not modelled.
    pub unmodelled: Vec<String>,
    /// Output pins that moved.
    pub pins: Vec<Pin>,
    /// What flash sectors 10 and 11, which firmware can write, hold at the end: address and bytes, as for [`Run::flash`].
    pub flash: (u32, Vec<u8>),
    /// Words that the firmware programmed and sectors that it erased, in order.
    pub flash_operations: Vec<FlashOperation>,
    /// Virtual time at the end, in ns since power-up.
    pub virtual_ns: u64,
}

/// Instructions executed, at 8 ns of virtual time each; a processor in WFI executes none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Instructions {
    /// By the whole image.
    pub total: u64,
    /// One entry a label, in the order given.
    pub functions: Vec<FunctionCount>,
    /// The busiest stretch between two interrupts of the ADC's DMA stream.
    pub worst_block: Option<Block>,
    /// All stretches together in which a function of [`Run::work`] ran; `None` if none ever did.
    pub working: Option<Block>,
    /// All other stretches together; `None` if there were none.
    pub idle: Option<Block>,
}

/// Instructions inside the functions of one label, without those of functions that they call.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FunctionCount {
    /// The label.
    pub label: String,
    /// Instructions executed.
    pub instructions: u64,
    /// How often one of the functions was entered.
    pub calls: u64,
    /// How many functions of the image the label stands for: 0 means that the compiler inlined them all, or a typing
    /// mistake.
    pub symbols: usize,
}

/// One line of the image's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogLine {
    /// `trace`, `debug`, `info`, `warn` or `error`; `None` for `println`.
    pub level: Option<String>,
    /// As the image's `defmt::timestamp!` formats it; `None` if it has none.
    pub timestamp: Option<String>,
    /// The message.
    pub text: String,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(timestamp) = &self.timestamp {
            write!(f, "{timestamp} ")?;
        }
        if let Some(level) = &self.level {
            write!(f, "{:5} ", level.to_uppercase())?;
        }
        f.write_str(&self.text)
    }
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
    /// [`FaultKind::PowerCut`](crate::FaultKind::PowerCut) or
    /// [`FaultKind::PowerCutInFlash`](crate::FaultKind::PowerCutInFlash).
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
