//! Outcome of a run.

use std::fmt;
use std::ops::{Add, Sub};

use serde::{Deserialize, Serialize};

use crate::ending::{CodeAddress, Exception, RunEnd};

/// Outcome of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Outcome {
    /// The end of the run.
    pub end: RunEnd,
    /// Bytes that left the USART1 transmitter by a pin.
    pub uart: Vec<u8>,
    /// Time at which each byte had left, in ns of virtual time since power-up.
    pub uart_ns: Vec<u64>,
    /// The numbers of the bytes from USART1 whose ninth data bit was set.
    pub uart_ninth: Vec<usize>,
    /// Frames of the other USARTs that sent anything.
    pub uarts: Vec<Uart>,
    /// Text that the image wrote by semihosting.
    pub semihosting: String,
    /// The defmt log, decoded.
    pub log: Vec<LogLine>,
    /// Raw bytes of the log, as received over RTT.
    pub rtt: Vec<u8>,
    /// Virtual time of an instruction at the end of the run, in ns: see [`Run::shift`](crate::Run::shift).
    pub instruction_ns: u32,
    /// The interrupts that the processor took, by the vectors at the beginning of flash. A handler that
    /// several vectors share is not counted.
    pub interrupts: Vec<Interrupt>,
    /// Executed instructions. `None` if they were not counted.
    pub instructions: Option<Instructions>,
    /// The externally triggered scans. `None` if the image never sampled.
    pub sampling: Option<Sampling>,
    /// Number of conversions that an ADC lost (times that ADC_SR.OVR was set).
    pub overruns: u64,
    /// Triggers that started nothing, since a scan was running or OVR was set.
    pub triggers_ignored: u64,
    /// Resets after power-up.
    pub resets: Vec<Reset>,
    /// Exceptions of faults, the first 16.
    pub exceptions: Vec<Exception>,
    /// Times at which the image panicked, in ns.
    pub panics: Vec<u64>,
    /// Address at which the processor was at the end: the beginning of its last block of instructions
    /// without a branch. `None` if it slept from the first instruction.
    pub stopped_at: Option<CodeAddress>,
    /// The register that the processor accessed most at the end, if one stands out.
    pub busy_with: Option<String>,
    /// Registers that the firmware accessed and that no model knows.
    pub unknown_registers: Vec<UnknownRegister>,
    /// Features of modelled peripherals that the firmware asked for and that are not modelled.
    pub unmodelled: Vec<String>,
    /// Faults, levels and bytes that did not arrive: the run was over, or never sampled.
    pub never_came: Vec<String>,
    /// Output pins that moved.
    pub pins: Vec<Pin>,
    /// Contents at the end of the flash that firmware can write, which is all but sectors 0 and 1: address
    /// and bytes. A range of it that the image leaves free can be a block of
    /// [`Run::flash`](crate::Run::flash).
    pub flash: (u32, Vec<u8>),
    /// Words that the firmware programmed and sectors that it erased, in order.
    pub flash_operations: Vec<FlashOperation>,
    /// Time that the processor spent at each clock: HCLK in Hz, and virtual time in ns. 0 Hz is a clock that
    /// stands still, in STOP or STANDBY or without a crystal.
    pub hclk_ns: Vec<(u32, u64)>,
    /// True if the image started the crystal, so that its clocks may depend on
    /// [`Run::hse_hz`](crate::Run::hse_hz).
    pub crystal_started: bool,
    /// Virtual time at the end, in ns since power-up.
    pub virtual_ns: u64,
}

impl Outcome {
    /// Checks that the image passed: it ran to the end of its time, exited with status 0, or stopped at a
    /// breakpoint.
    ///
    /// # Errors
    /// One line that describes the failure.
    pub fn verdict(&self) -> Result<(), String> {
        let last = self
            .log
            .last()
            .map(|line| format!("; the last line of its log: {line}"));
        let last = last.unwrap_or_default();
        let fault = self
            .exceptions
            .last()
            .map(ToString::to_string)
            .unwrap_or_default();
        let place = self.whereabouts();
        Err(match &self.end {
            RunEnd::Over | RunEnd::Breakpoint(_) | RunEnd::Exited(0) => return Ok(()),
            RunEnd::Exited(status) => format!("the image ended with status {status}{last}"),
            RunEnd::Panicked => {
                let at = self.panics.last().map_or(0.0, |at| *at as f64 * 1e-9);
                format!("the image panicked at {at:.6} s{last}")
            }
            RunEnd::Faulted => format!("the image is in a fault handler: {fault}{last}"),
            RunEnd::LockedUp(at) => {
                let at = at.as_ref().map(|at| format!(" at {at}")).unwrap_or_default();
                let had = if fault.is_empty() {
                    ""
                } else {
                    "; the last fault was "
                };
                format!(
                    "the processor locked up{at}: a fault in a fault handler, or no image at the reset vector\
                     {had}{fault}{last}"
                )
            }
            RunEnd::Hung(at) => {
                format!("the image hangs: it is in an endless loop at {at}, and no interrupt will come{last}")
            }
            RunEnd::Stuck(register) => {
                format!("the image does nothing but read {register}{place}; no model knows that register")
            }
            RunEnd::Stopped => format!("the run was stopped{place}"),
            RunEnd::QemuEnded(how) => format!("QEMU ended{place} ({how})"),
        })
    }

    /// Adds the function around each address by calling `name`.
    pub(crate) fn name_functions(&mut self, name: impl Fn(&mut CodeAddress)) {
        let at_end = match &mut self.end {
            RunEnd::Breakpoint(place) | RunEnd::Hung(place) => Some(place),
            RunEnd::LockedUp(place) => place.as_mut(),
            _ => None,
        };
        let of_faults = self
            .exceptions
            .iter_mut()
            .flat_map(|e| [e.pc.as_mut(), e.lr.as_mut()]);
        let masked = self.instructions.as_mut().and_then(|all| all.masked.as_mut());
        let masked = masked.map(|masked| &mut masked.from);
        let places = of_faults.chain([at_end, self.stopped_at.as_mut(), masked]);
        places.flatten().for_each(name);
    }

    /// Place and activity of the processor at the end, as a part of a sentence.
    pub(crate) fn whereabouts(&self) -> String {
        let place = self.stopped_at.as_ref().map(|place| format!(", at {place}"));
        let busy = self
            .busy_with
            .as_ref()
            .map(|register| format!(", busy with {register}"));
        let time = format!(" at {:.6} s", self.virtual_ns as f64 * 1e-9);
        [Some(time), place, busy].into_iter().flatten().collect()
    }
}

/// Executed instructions. A processor in WFI executes none.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Instructions {
    /// By the whole image.
    pub total: u64,
    /// Cycles that they would take. `None` if they were not counted
    /// ([`Run::count_cycles`](crate::Run::count_cycles)).
    pub cycles: Option<Cycles>,
    /// One entry for each label, in the order given.
    pub functions: Vec<FunctionCount>,
    /// The busiest stretch between two interrupts of the ADC's DMA stream.
    pub worst_block: Option<BlockCost>,
    /// The stretch of this kind with the most cycles per scan, by the upper bound. `None` if cycles were not
    /// counted.
    pub slowest_block: Option<BlockCost>,
    /// All stretches in which a function of [`Run::work`](crate::Run::work) ran, taken together. `None` if
    /// there were none.
    pub working: Option<BlockCost>,
    /// All other stretches, taken together. `None` if there were none.
    pub idle: Option<BlockCost>,
    /// The longest stretch without interrupts (PRIMASK set) since the first interrupt of the ADC's DMA
    /// stream: by the upper bound of its cycles, or by its instructions if cycles were not counted.
    pub masked: Option<Masked>,
}

/// A stretch from CPSID to CPSIE, or to the MSR that restores PRIMASK, including nested sections. The MSR is
/// assumed to write the value read before the CPSID.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Masked {
    /// Executed instructions.
    pub instructions: u64,
    /// Cycles that they would take, if these were counted.
    pub cycles: Option<Cycles>,
    /// Address at which the stretch begins.
    pub from: CodeAddress,
}

/// Instructions inside the functions of one label. Functions that they call are not included.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FunctionCount {
    /// The label.
    pub label: String,
    /// Instructions executed.
    pub instructions: u64,
    /// Cycles that they would take, if these were counted.
    pub cycles: Option<Cycles>,
    /// Number of calls of these functions.
    pub calls: u64,
    /// Number of functions of the image that have the label. 0 means that the compiler inlined them all, or
    /// that the pattern has a mistake.
    pub symbols: usize,
}

/// Count of an interrupt.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interrupt {
    /// Its number as an exception: interrupt line 0 is 16, SysTick 15.
    pub exception: usize,
    /// For example `USART1`, `TIM1_UP_TIM10` or `SysTick`.
    pub name: String,
    /// Number of times it was taken.
    pub taken: u64,
}

/// Bytes that a USART sent by a pin.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Uart {
    /// For example `USART3`.
    pub port: String,
    /// The bytes: the lower eight data bits of each frame.
    pub bytes: Vec<u8>,
    /// Time at which each byte had left, in ns of virtual time since power-up.
    pub ns: Vec<u64>,
    /// The numbers of the bytes whose ninth data bit was set.
    pub ninth: Vec<usize>,
}

/// One line of the image's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogLine {
    /// `trace`, `debug`, `info`, `warn` or `error`. `None` for `println`.
    pub level: Option<String>,
    /// As the image's `defmt::timestamp!` formats it. `None` if the image has no timestamp.
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

/// Cost of a stretch of a live run. It is counted rather than timed, and so is equal in every run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StretchWork {
    /// Number of QEMU's calls of the overlay: for an access to a peripheral, or at a requested time.
    pub calls: u64,
    /// Executed instructions; 0 if they are not counted.
    pub instructions: u64,
    /// Inputs and rows of the stimulus that the emulator holds at the end of the stretch.
    pub held: usize,
}

/// The externally triggered scans, of the converter that was triggered first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sampling {
    /// Virtual time of the first one, which reads row 0 of the stimulus, in ns.
    pub first_ns: u64,
    /// Number started.
    pub scans: u64,
}

/// A reset of the machine after power-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reset {
    /// Virtual time, in ns.
    pub at_ns: u64,
    /// Cause of the reset.
    pub cause: ResetCause,
}

/// Cause of a reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetCause {
    /// SYSRESETREQ, by the firmware itself.
    Software,
    /// The independent watchdog ran out.
    Watchdog,
    /// The window watchdog ran out, or was fed outside of its window.
    WindowWatchdog,
    /// STANDBY has ended, by a rising edge on WKUP (PA0) or by the RTC.
    Standby,
    /// [`FaultKind::PowerCut`](crate::FaultKind::PowerCut) or
    /// [`FaultKind::PowerCutInFlash`](crate::FaultKind::PowerCutInFlash).
    PowerCut,
}

/// A word that the firmware programmed, or a sector that it erased. The operation may have been cut short.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlashOperation {
    /// Virtual time at which it began, in ns.
    pub at_ns: u64,
    /// First address.
    pub address: u32,
    /// Number of bytes that it programs or erases.
    pub bytes: u32,
    /// True for an erase.
    pub erase: bool,
}

/// A register that the firmware accessed and no model knows, or whose peripheral's clock was off.
///
/// It read as zero, and writes to it had no effect. On silicon the firmware may behave differently.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnknownRegister {
    /// For example `SPI1_SR`, or `USART1_SR (clock off)`.
    pub name: String,
    /// Address of the word.
    pub address: u32,
    /// True if the clock of its peripheral was off: then it reads as zero on silicon too.
    pub clock_off: bool,
    /// Number of reads.
    pub reads: u64,
    /// Number of writes.
    pub writes: u64,
    /// The last value written. A narrow store is shifted to its place in the word.
    pub last_write: Option<u32>,
}

/// An output pin that moved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    /// For example `PC13`.
    pub name: String,
    /// Number of changes of its level while it was an output.
    pub edges: u64,
    /// Time of each change, in ns since power-up, and the level from then on. Empty unless the run recorded
    /// them ([`Run::record_pins`](crate::Run::record_pins)).
    pub changes: Vec<(u64, bool)>,
}

/// The time from one interrupt of the ADC's DMA stream to the next, or several such stretches taken together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockCost {
    /// Instructions of the whole image, with its interrupts.
    pub instructions: u64,
    /// Cycles that they would take, if these were counted.
    pub cycles: Option<Cycles>,
    /// Scans of the ADC in the same time.
    pub scans: u64,
}

impl BlockCost {
    /// Instructions for each scan of the ADC.
    pub fn instructions_per_scan(&self) -> f64 {
        self.instructions as f64 / self.scans as f64
    }

    /// Cycles for each scan of the ADC, in the order of the fields of [`Cycles`]; `None` if they were not
    /// counted.
    pub fn cycles_per_scan(&self) -> Option<[f64; 4]> {
        let cycles = self.cycles?;
        let cycles = [cycles.ideal, cycles.cached, cycles.uncached, cycles.most];
        Some(cycles.map(|cycles| cycles as f64 / self.scans as f64))
    }
}

/// Cycles of the core's clock for several kinds of memory: estimated from the timing tables of the core
/// (DDI0439B) and the description of the flash at 168 MHz (RM0090 section 3.5), not measured. Sleep takes
/// none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Cycles {
    /// Memory that is always ready.
    pub ideal: u64,
    /// Flash with caches and prefetch on.
    pub cached: u64,
    /// Flash with caches and prefetch off.
    pub uncached: u64,
    /// An upper bound: nothing overlaps, and every wait that is possible occurs.
    pub most: u64,
}

impl Cycles {
    fn with(self, other: Self, of: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            ideal: of(self.ideal, other.ideal),
            cached: of(self.cached, other.cached),
            uncached: of(self.uncached, other.uncached),
            most: of(self.most, other.most),
        }
    }
}

impl Add for Cycles {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, |one, other| one + other)
    }
}

impl Sub for Cycles {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.with(other, |one, other| one - other)
    }
}
