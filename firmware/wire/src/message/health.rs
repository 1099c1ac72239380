use crate::body::body;
use crate::names::bits;

body! {
    /// Failures of sensors and supply since the last reset, and those that stand now. It comes with each
    /// status frame.
    pub struct Health: Copy, Default {
        /// Number of frames that the boot before this one had made but not sent when the reset came; 0 after
        /// power-up.
        pub frames_lost_by_reset: u32,
        /// Number of strikes without a result, because samples of their window were lost.
        pub strikes_cut: u32,
        /// Number of times that the force sensor got stuck.
        pub force_stuck: u32,
        /// Number of times that the force stayed at a rail.
        pub force_railed: u32,
        /// Number of times that the acceleration sensor got stuck.
        pub acceleration_stuck: u32,
        /// Number of times that the acceleration stayed at a rail.
        pub acceleration_railed: u32,
        /// Number of times that the supply fell below its limit.
        pub supply_low: u32,
        /// Supply voltage at its last measurement, in mV; 0 before the first.
        pub supply_mv: u16,
        /// Faults that stand now.
        pub standing: Standing,
    }
}

bits! {
    /// Faults that stand now.
    pub struct Standing(u8) {
        /// The force sensor is stuck.
        0 "force_stuck" FORCE_STUCK,
        /// The force stays at a rail.
        1 "force_railed" FORCE_RAILED,
        /// The acceleration sensor is stuck.
        2 "acceleration_stuck" ACCELERATION_STUCK,
        /// The acceleration stays at a rail.
        3 "acceleration_railed" ACCELERATION_RAILED,
        /// The supply is below its limit.
        4 "supply_low" SUPPLY_LOW,
        /// The crystal does not run, or is none that boards have: there are no samples.
        5 "crystal_failed" CRYSTAL_FAILED,
        /// The part is not an STM32F405: there are no samples.
        6 "part_wrong" PART_WRONG,
    }
}
