use crate::body::body;
use crate::names::names;
use crate::text::Text;

/// Longest detail of a fault or a reply, in bytes.
pub const MAX_DETAIL: usize = 96;

/// One line for people.
pub type Detail = Text<MAX_DETAIL>;

names! {
    /// What went wrong. The list may grow at its end.
    pub enum FaultCause {
        /// The image panicked; `detail` has file and line.
        0 "panic" Panic,
        /// The core took a hard fault; `pc` is the instruction.
        1 "hard_fault" HardFault,
        /// The watchdog reset the bead.
        2 "watchdog" Watchdog,
        /// The ADC overran (RM0090 section 13.8.2): acquisition was started again.
        3 "adc_overrun" AdcOverrun,
        /// The DMA stream reported a transfer error: acquisition was started again.
        4 "dma_error" DmaError,
        /// The estimators fell behind and a block was lost: a strike in progress is void.
        5 "block_lost" BlockLost,
        /// The settings block in flash failed its check.
        6 "settings_refused" SettingsRefused,
        /// The stack reached its guard.
        7 "stack_overflow" StackOverflow,
        /// The window of a strike was cut by lost samples: the strike has no result.
        8 "strike_cut" StrikeCut,
        /// The force code does not move, although noise should move it.
        9 "force_stuck" ForceStuck,
        /// The force lies at a rail for longer than any strike.
        10 "force_railed" ForceRailed,
        /// The acceleration code does not move, although noise should move it.
        11 "acceleration_stuck" AccelerationStuck,
        /// The acceleration lies at a rail for longer than any strike.
        12 "acceleration_railed" AccelerationRailed,
        /// The supply is below its limit.
        13 "supply_low" SupplyLow,
        /// A fault of causes 9 to 13 is over; `detail` is the name of its cause.
        14 "recovered" Recovered,
    }
}

body! {
    /// Something went wrong, in this boot or the one before.
    pub struct Fault {
        /// What went wrong.
        pub cause: FaultCause,
        /// The boot in which it did: the one before, if it ended in a reset.
        pub boot: u32,
        /// Program counter where it did; 0 where that says nothing.
        pub pc: u32,
        /// One line for people; longer ones are cut between characters.
        pub detail: Detail,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Fault {
    Fault {
        cause: FaultCause::HardFault,
        boot: 1,
        pc: 0x0800_1234,
        detail: "CFSR 0x00008200: bus fault at 0x4001_2400 \u{2026}".into(),
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a030502040302010c0b01020a01013a070101b4a480402d4346535220307830303030383230303a20627573206661756c74206174203078343030315f3234303020e280a6368f5b4600";
