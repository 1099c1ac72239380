use crate::body::body;
use crate::names::names;
use crate::text::Text;

/// Longest detail of a fault or a reply, in bytes.
pub const MAX_DETAIL: usize = 96;

/// One line for people.
pub type Detail = Text<MAX_DETAIL>;

names! {
    /// Cause of a fault. The list may grow at its end.
    pub enum FaultCause {
        /// The firmware panicked; `detail` has file and line.
        0 "panic" Panic,
        /// The core took a hard fault; `pc` is the address of the instruction.
        1 "hard_fault" HardFault,
        /// The watchdog reset the bead.
        2 "watchdog" Watchdog,
        /// The ADC overran (RM0090 section 13.8.2). Acquisition was started again.
        3 "adc_overrun" AdcOverrun,
        /// The DMA stream reported a transfer error. Acquisition was started again.
        4 "dma_error" DmaError,
        /// The estimators fell behind and a block was lost. A strike in progress is void.
        5 "block_lost" BlockLost,
        /// The bead refused the settings block in flash; `detail` says why.
        6 "settings_refused" SettingsRefused,
        /// The stack reached its limit.
        7 "stack_overflow" StackOverflow,
        /// Samples were lost in the window of a strike. The strike has no result.
        8 "strike_cut" StrikeCut,
        /// The code of the force does not change, although noise should change it.
        9 "force_stuck" ForceStuck,
        /// The force stays at a rail for longer than any strike does.
        10 "force_railed" ForceRailed,
        /// The code of the acceleration does not change, although noise should change it.
        11 "acceleration_stuck" AccelerationStuck,
        /// The acceleration stays at a rail for longer than any strike does.
        12 "acceleration_railed" AccelerationRailed,
        /// The supply is below its limit.
        13 "supply_low" SupplyLow,
        /// A fault of one of the causes 9 to 13 is over; `detail` is the name of the cause.
        14 "recovered" Recovered,
        /// A start of acquisition took a scan more or fewer than there were triggers. The scans were counted,
        /// and the sample index is right.
        15 "index_corrected" IndexCorrected,
        /// The crystal did not start, or it stopped. The bead runs on its internal oscillator. It answers,
        /// and it takes no samples.
        16 "crystal_failed" CrystalFailed,
        /// The trigger line is held low: no bead on it can tell the others of a strike.
        17 "trigger_line_low" TriggerLineLow,
        /// The crystal is none that boards have, `detail` says which. The bead runs on its internal
        /// oscillator. It answers, and it takes no samples.
        18 "crystal_wrong" CrystalWrong,
        /// The part is not an STM32F405, `detail` says which. The bead runs on its internal oscillator. It
        /// answers, and it takes no samples.
        19 "part_wrong" PartWrong,
    }
}

body! {
    /// Something went wrong, in this boot or in the one before it.
    pub struct Fault {
        /// Cause of the fault.
        pub cause: FaultCause,
        /// The boot in which it went wrong. It is the boot before this one if the fault ended in a reset.
        pub boot: u32,
        /// Program counter when it went wrong; 0 where it has no meaning.
        pub pc: u32,
        /// One line for people. A longer line is cut between two characters.
        pub detail: Detail,
    }
}
