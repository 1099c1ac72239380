use crate::body::body;
use crate::names::names;

names! {
    /// Where the settings in force came from. The list may grow at its end.
    pub enum SettingsSource {
        /// They are compiled in: flash has none.
        0 "built_in" BuiltIn,
        /// A debug probe put them into flash.
        1 "flash" Flash,
        /// They are compiled in, because the settings in flash were refused.
        2 "flash_refused" FlashRefused,
        /// A host wrote them over the link; flash keeps them.
        3 "stored" Stored,
        /// They are compiled in, because several boots in a row failed with those in flash. The bead looks
        /// for strikes when a host arms it.
        4 "rescue" Rescue,
    }
}

body! {
    /// Counters since the last reset, and the state of the bead. It comes every second.
    pub struct Status: Copy {
        /// Time since the last reset, in ms, without the time in which flash was erased.
        pub uptime_ms: u64,
        /// Number of starts of acquisition. A step means that samples are missing.
        pub epoch: u32,
        /// Number of scans taken.
        pub samples: u64,
        /// Number of strikes found.
        pub strikes: u32,
        /// Number of overruns of the ADC or the DMA.
        pub overruns: u32,
        /// Number of blocks of samples that the estimators never saw.
        pub blocks_dropped: u32,
        /// Number of frames that were made and numbered but not sent, because the transmit queue was full.
        pub frames_dropped_queue_full: u32,
        /// Number of frames that were made and numbered but not sent, because they were longer than a frame
        /// may be.
        pub frames_dropped_too_long: u32,
        /// The least stack that was ever free, in bytes.
        pub stack_free_min: u32,
        /// Where the settings in force came from.
        pub settings_source: SettingsSource,
        /// True while the bead looks for strikes.
        pub armed: bool,
    }
}
