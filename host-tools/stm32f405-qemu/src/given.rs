//! Inputs and options of a run.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::chip::Chip;
use crate::device::Devices;
use crate::level::Level;

/// One run of an image: its inputs, and when it ends. Its serialised form is what QEMU's side needs, without
/// the image, the stimulus, the blocks in flash and the programs.
///
/// ```no_run
/// use stm32f405_qemu::Run;
///
/// let mut run = Run::new("target/thumbv7em-none-eabihf/release/firmware");
/// run.stimulus = (0..1000u16).map(|i| [i, 2048, 0, 0]).collect();
/// let outcome = run.execute()?;
/// println!("{} bytes from USART1", outcome.uart.len());
/// # Ok::<(), stm32f405_qemu::RunError>(())
/// ```
#[derive(Debug, Clone, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Run {
    /// The image, unchanged: what would be flashed.
    #[serde(skip)]
    pub elf: PathBuf,
    /// Codes that ADC1 converts, 0..=4095: channels 0 to 3. The first externally triggered scan reads row 0,
    /// unless [`stimulus_since`](Self::stimulus_since) is power-up. Scans from `i` periods later on read row
    /// `i`. The last row stays. Scans before row 0 begins read it too.
    #[serde(skip)]
    pub stimulus: Vec<[u16; 4]>,
    /// Time from row to row, in ns.
    pub sample_period_ns: u64,
    /// Start of row 0: the first externally triggered scan, or power-up. Choose power-up for an image that
    /// starts its scans by software.
    pub stimulus_since: Since,
    /// Blocks in flash beside the image (settings, for example), each with its address. Flash is erased
    /// outside the image and the blocks. [`Outcome::flash`](crate::Outcome::flash) is such a block: with it a
    /// run continues from the flash of another.
    #[serde(skip)]
    pub flash: Vec<(u32, Vec<u8>)>,
    /// Functions to count: a label and a part of a demangled path, for example `("observer",
    /// "bead_model::observer::")`. A label may be given more than once.
    pub functions: Vec<(String, String)>,
    /// The labels whose functions make a block a working one
    /// ([`Instructions::working`](crate::Instructions::working)).
    pub work: Vec<String>,
    /// Counts instructions. This about halves QEMU's speed. Turn it off for long runs.
    pub count_instructions: bool,
    /// Estimates the cycles of the instructions that are counted ([`Cycles`](crate::Cycles)). The run takes
    /// three to five times as long.
    pub count_cycles: bool,
    /// Virtual time that the run continues after the last row, ns.
    pub tail_ns: u64,
    /// Virtual time at which the run gives up if the first externally triggered scan has not come, ns.
    pub sampling_deadline_ns: u64,
    /// Limit of real time.
    pub timeout: Duration,
    /// The QEMU to run. `None` for the one that `STM32F405_QEMU` names, else `qemu-system-arm` from `PATH`.
    #[serde(skip)]
    pub qemu: Option<PathBuf>,
    /// The overlay to load. `None` to look for it where the README says.
    #[serde(skip)]
    pub overlay: Option<PathBuf>,
    /// Crystal on the HSE pins, in Hz.
    pub hse_hz: u32,
    /// The part: its memory, its peripherals and its pins.
    pub chip: Chip,
    /// DEV_ID of another part (RM0090 section 38.6.1), for an image that reads it. Nothing else changes.
    /// `None` for that of [`chip`](Self::chip).
    pub dev_id: Option<u16>,
    /// Frequency error of the crystal, ppm: less than 1000 either way, in steps of 1 Hz. The rows of the
    /// stimulus follow it. All other times here are true ones.
    pub hse_ppm: f64,
    /// QEMU's `-icount shift`: an instruction takes 2^`shift` ns of virtual time, 1 to 1024, or a cycle of
    /// HCLK, in whole ns, if that is longer. `None` for what `STM32F405_QEMU_SHIFT` says, else 3: 8 ns from
    /// 125 MHz on, and 63 ns at 16 MHz. At 4 (16 ns, 2.7 cycles at 168 MHz) the core is as slow as one that
    /// waits for flash at every turn.
    pub shift: Option<u8>,
    /// True if SWSTART starts a scan while CR2.EXTEN selects a trigger. RM0090 section 13.3 leaves both open.
    pub software_scan_under_trigger: bool,
    /// Time that the DMA takes to fetch a byte received by USART1, ns. If the processor reads the data
    /// register meanwhile, the DMA never gets that byte.
    pub receive_dma_latency_ns: u64,
    /// Ends the run early, with [`RunError::Stuck`](crate::RunError::Stuck), when the image only reads a
    /// register that no model knows: half a million times.
    pub stop_when_stuck: bool,
    /// Executes loops that wait for a register, a word of RAM or nothing outside of QEMU, and skips turns
    /// that are all the same. The outcome is equal without this option, except for [`Outcome::busy_with`] and
    /// [`StretchWork::calls`](crate::StretchWork), but the run takes longer. Has no effect with a debugger,
    /// or while cycles are counted or coverage is recorded.
    ///
    /// [`Outcome::busy_with`]: crate::Outcome::busy_with
    pub shorten_waits: bool,
    /// Lets the image call the host by semihosting (BKPT 0xAB). Its output is
    /// [`Outcome::semihosting`](crate::Outcome::semihosting), and its exit ends the run. **It can then also
    /// read and write the host's files and run commands**: only for images that you trust.
    pub semihosting: bool,
    /// The words that the image receives as its command line by semihosting.
    #[serde(skip)]
    pub semihosting_arguments: Vec<String>,
    /// Ends the run with [`RunEnd::Hung`](crate::RunEnd::Hung) when the image is in an endless loop that no
    /// interrupt, event or input of this run can end. In a [`Live`](crate::Live) run an input may still come.
    /// An image that enables interrupts by edges on pins or by received bytes is assumed to wait for them.
    pub stop_when_hung: bool,
    /// The 96-bit unique device identifier (RM0090 section 39.1).
    pub uid: [u8; 12],
    /// Bytes for the receivers of the USARTs.
    pub uart_input: Vec<UartInput>,
    /// Levels on pins.
    pub pin_inputs: Vec<PinInput>,
    /// Records the times at which output pins change, for [`Outcome::vcd`](crate::Outcome::vcd). They are
    /// always counted.
    pub record_pins: bool,
    /// Codes at pins other than those of the stimulus, for all three converters.
    pub analog_inputs: Vec<AnalogInput>,
    /// Wires from pin to pin, for example `("PA9".into(), "PA10".into())`. A wire carries the level of an
    /// output, and the frames of a USART to the receiver of a USART.
    pub wires: Vec<(String, String)>,
    /// Devices at the I2C and SPI buses.
    pub devices: Devices,
    /// Wires from the outputs of the DAC to analog inputs. While an output is off, its input reads as without
    /// the wire.
    pub analog_wires: Vec<AnalogWire>,
    /// Triggers that the DAC misses, by their number since its channel was enabled, from 0.
    pub dac_misses: Vec<u64>,
    /// Seed of the random number generator's words.
    pub random_seed: u64,
    /// Frequency of the LSI oscillator, which clocks the watchdog and the RTC, Hz. `None` for 32 kHz; silicon
    /// has 17 to 47.
    pub lsi_hz: Option<u32>,
    /// Writes over guest memory, to provoke faults.
    pub pokes: Vec<Poke>,
    /// Faults on demand.
    pub faults: Vec<Fault>,
    /// A TCP port of this computer at which QEMU's stub waits for a debugger. The image stops before its
    /// first instruction until the debugger continues it, and the run has no [`timeout`](Self::timeout).
    /// Virtual time stands still while the image does; a step over a breakpoint costs some of it.
    #[serde(skip)]
    pub gdb: Option<u16>,
}

impl Run {
    /// A run of an image with all inputs at mid-scale, 10 µs for each sample, 10 ms long. Instructions are
    /// counted.
    pub fn new(elf: impl Into<PathBuf>) -> Self {
        Self {
            elf: elf.into(),
            stimulus: vec![[2048; 4]],
            sample_period_ns: 10_000,
            stimulus_since: Since::FirstScan,
            flash: Vec::new(),
            functions: Vec::new(),
            work: Vec::new(),
            count_instructions: true,
            count_cycles: false,
            tail_ns: 10_000_000,
            sampling_deadline_ns: 2_000_000_000,
            timeout: Duration::from_secs(120),
            qemu: None,
            overlay: None,
            hse_hz: 8_000_000,
            chip: Chip::default(),
            dev_id: None,
            hse_ppm: 0.0,
            shift: None,
            software_scan_under_trigger: true,
            receive_dma_latency_ns: 0,
            stop_when_stuck: true,
            shorten_waits: true,
            semihosting: false,
            semihosting_arguments: Vec::new(),
            stop_when_hung: false,
            uid: *b"\x31\x00\x24\x00\x0dQ943489",
            uart_input: Vec::new(),
            pin_inputs: Vec::new(),
            record_pins: false,
            analog_inputs: Vec::new(),
            wires: Vec::new(),
            devices: Devices::default(),
            analog_wires: Vec::new(),
            dac_misses: Vec::new(),
            random_seed: 0,
            lsi_hz: None,
            pokes: Vec::new(),
            faults: Vec::new(),
            gdb: None,
        }
    }
}

/// Origin of a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub enum Since {
    /// The first externally triggered scan.
    #[default]
    FirstScan,
    /// Power-up, before the first instruction.
    PowerUp,
}

impl Since {
    /// Returns the virtual time `ns` after this origin. `None` before the first scan, if that is the origin.
    pub(crate) fn plus(self, ns: u64, first_scan_ns: Option<u64>) -> Option<u64> {
        match self {
            Self::FirstScan => first_scan_ns.map(|first| first.saturating_add(ns)),
            Self::PowerUp => Some(ns),
        }
    }

    /// Reason why an input with this origin did not arrive, besides the end of the run.
    pub(crate) fn missed(self, sampled: bool) -> &'static str {
        match self {
            Self::FirstScan if !sampled => ": there was no triggered scan to count from",
            _ => "",
        }
    }
}

/// Bytes for the receiver of a USART, sent back to back at its own baud rate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UartInput {
    /// `USART1`, `USART2`, `USART3`, `UART4`, `UART5` or `USART6`.
    pub port: String,
    /// Virtual time at which the first start bit falls, in ns.
    pub at_ns: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

impl UartInput {
    /// Bytes for USART1.
    pub fn usart1(at_ns: u64, bytes: impl Into<Vec<u8>>) -> Self {
        Self {
            port: "USART1".into(),
            at_ns,
            bytes: bytes.into(),
        }
    }
}

/// Inputs to the image of a [`Live`](crate::Live) run while it runs.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Bytes for the receivers of the USARTs. Those for one port keep their order.
    pub uart: Vec<UartInput>,
    /// Levels on pins. A pin that is not in [`Run::pin_inputs`] is undriven until its first level.
    pub levels: Vec<Level>,
    /// Rows that follow those of the stimulus given so far, one a period.
    #[serde(skip)]
    pub codes: Vec<[u16; 4]>,
}

/// Codes at an analog pin: a new one every period.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnalogInput {
    /// For example `PC0`.
    pub pin: String,
    /// Start of the first code.
    pub since: Since,
    /// Time from code to code, in ns.
    pub period_ns: u64,
    /// Codes of 12 bits, 0..=4095. The first one also applies before its time, and the last one stays. A
    /// conversion reads the code at the time when it ends.
    pub codes: Vec<u16>,
}

impl AnalogInput {
    pub(crate) fn code(&self, now: u64, first_scan_ns: Option<u64>) -> u16 {
        let began = self.since.plus(0, first_scan_ns);
        let passed = began.map_or(0, |began| now.saturating_sub(began)) / self.period_ns.max(1);
        let last = self.codes.len().saturating_sub(1);
        let position = usize::try_from(passed).map_or(last, |position| position.min(last));
        self.codes.get(position).copied().unwrap_or(0)
    }
}

/// A wire from an output of the DAC to an analog input. Both have the same supply, so the code of the input
/// is that of the output, except for resistors in the wire and its defects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AnalogWire {
    /// `PA4` or `PA5`.
    pub from: String,
    /// For example `PA0`.
    pub to: String,
    /// Fraction of the voltage that arrives: 1, or that of a divider.
    pub gain: f64,
    /// Offset of the input, in codes.
    pub offset: f64,
    /// Deviation from a straight line at both ends, in codes: a parabola that is 0 in the middle.
    pub bend: f64,
    /// Change of the code for a change of the other output by half its range.
    pub cross_talk: f64,
    /// Noise of the input, in codes rms.
    pub noise: f64,
    /// Delay of the input, ns: at most a period of the signal played.
    pub delay_ns: u64,
    /// Time constant of a capacitor at the input, ns.
    pub lag_ns: u64,
}

impl AnalogWire {
    /// An ideal wire.
    pub fn new(from: impl Into<String>, to: impl Into<String>) -> Self {
        Self {
            from: from.into(),
            to: to.into(),
            gain: 1.0,
            offset: 0.0,
            bend: 0.0,
            cross_talk: 0.0,
            noise: 0.0,
            delay_ns: 0,
            lag_ns: 0,
        }
    }
}

/// A level on a pin from outside. It is low from power-up until its first change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PinInput {
    /// For example `PA15`.
    pub pin: String,
    /// Origin of `changes_ns`.
    pub since: Since,
    /// Times at which the level changes: up, down, up and so on. Virtual times in ns, in order.
    pub changes_ns: Vec<u64>,
}

impl PinInput {
    /// A level that changes at these times.
    pub fn new(pin: impl Into<String>, since: Since, changes_ns: impl Into<Vec<u64>>) -> Self {
        let (pin, changes_ns) = (pin.into(), changes_ns.into());
        Self {
            pin,
            since,
            changes_ns,
        }
    }
}

/// A fault on demand: bytes are written over guest memory, including flash, without the processor's doing.
///
/// A reset restores flash, so that the image can start again after its fault. Bytes written over RAM stay.
/// Data that the firmware itself wrote to flash stay too; the bytes of a poke are not part of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Poke {
    /// Virtual time of the write, in ns since power-up.
    pub at_ns: u64,
    /// First address.
    pub address: u32,
    /// Bytes to write there.
    pub bytes: Vec<u8>,
}

impl Poke {
    /// Writes over a word.
    pub fn word(at_ns: u64, address: u32, word: u32) -> Self {
        let bytes = word.to_le_bytes().into();
        Self {
            at_ns,
            address,
            bytes,
        }
    }
}

/// A fault on demand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Origin of `at_ns`.
    pub since: Since,
    /// Virtual time, in ns.
    pub at_ns: u64,
    /// The kind of failure.
    pub kind: FaultKind,
}

impl Fault {
    /// A fault at a time after the first externally triggered scan.
    pub fn after_first_scan(at_ns: u64, kind: FaultKind) -> Self {
        let since = Since::FirstScan;
        Self { since, at_ns, kind }
    }

    /// A fault at a time after power-up. A fault at 0 is in place before the first instruction.
    pub fn after_power_up(at_ns: u64, kind: FaultKind) -> Self {
        let since = Since::PowerUp;
        Self { since, at_ns, kind }
    }

    /// A supply that rises or falls linearly from power-up: from one voltage to another, in mV, within
    /// `for_ns`. In steps of 10 mV.
    pub fn supply_ramp(from_mv: u32, to_mv: u32, for_ns: u64) -> impl Iterator<Item = Self> {
        let steps = from_mv.abs_diff(to_mv).div_ceil(10).max(1);
        (0..=steps).map(move |step| {
            let part = |whole: u64| whole * u64::from(step) / u64::from(steps);
            let change = part(from_mv.abs_diff(to_mv).into()) as u32;
            let millivolts = if from_mv < to_mv {
                from_mv + change
            } else {
                from_mv - change
            };
            Self::after_power_up(part(for_ns), FaultKind::Supply { millivolts })
        })
    }
}

/// The kind of failure.
///
/// [`WildJump`](Self::WildJump) to [`RunawayStack`](Self::RunawayStack) make the processor crash. The vector
/// of the DMA stream that serves the sampling converter is overwritten in flash, so that the next interrupt
/// of that stream crashes. The reset restores flash. Nothing happens if no stream serves the converter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultKind {
    /// The converter that samples loses a conversion, as it does when the DMA does not fetch in time. SR.OVR
    /// is set. DMA requests and triggers stop until it is cleared (RM0090 section 13.8.1).
    AdcOverrun,
    /// The converter that samples starts a scan without a trigger, as soon as it waits for triggers. A
    /// trigger that comes before that scan is over has no effect.
    ExtraScan,
    /// The converter that samples misses the next trigger that it waits for.
    MissedTrigger,
    /// The DMA stream that serves the converter that samples meets a bus error. TEIF is set and the stream
    /// stops (section 10.3.18). Nothing happens if no stream serves it.
    AdcDmaError,
    /// USART1 completes no frame for some time. Its registers keep their contents, and the DMA waits. A USART
    /// without flow control never does this by itself. A transmitter held by CTS, or a stuck DMA stream,
    /// looks like this.
    TransmitterStalled {
        /// Duration, ns.
        for_ns: u64,
    },
    /// The crystal stops, or never starts if this comes at power-up. With the clock security system on, the
    /// processor gets an NMI and goes on with the internal oscillator (RM0090 section 7.2.7). Without it, a
    /// processor that is clocked by the crystal stands still, and only the watchdog brings it back. A reset
    /// does not bring the crystal back.
    CrystalStops,
    /// A crystal that has stopped can start again.
    CrystalStarts,
    /// Sets the supply to this voltage; it begins with 3300 mV. The programmable voltage detector and the
    /// inner channels see it. The codes of the stimulus are not scaled: the caller scales them. Below 1.8 V
    /// silicon would not run.
    Supply {
        /// In mV.
        millivolts: u32,
    },
    /// The vector points outside memory: a hard fault.
    WildJump,
    /// The vector becomes that of WWDG (position 0). In an image that does not use the window watchdog, this
    /// is the handler for interrupts that have no handler of their own.
    UnhandledInterrupt,
    /// The vector points to `b .` in the last bytes of flash: the processor never leaves the handler.
    Hang,
    /// The vector points to an endless loop in the last bytes of flash, which pushes on the stack.
    RunawayStack,
    /// The power goes and comes back at once: a power-on reset. RAM loses what it held, the reset flags are
    /// as after power-up, and a flash operation under way is left half done. The stimulus goes on.
    PowerCut,
    /// A [`PowerCut`](Self::PowerCut) in the middle of a flash operation, which programs a word or erases a
    /// sector. Each fault of this kind counts operations separately. Resets do not end the count.
    PowerCutInFlash {
        /// Number of operations that begin before that one, counted from the time of the fault.
        after: u32,
        /// Part of the operation that is complete when the power fails: 0 to 100 %.
        percent: u8,
    },
}
