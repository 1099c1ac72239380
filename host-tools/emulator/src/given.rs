//! What a run is given.

use serde::{Deserialize, Serialize};

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
