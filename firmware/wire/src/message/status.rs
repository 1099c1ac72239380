use crate::body::body;
use crate::names::names;

names! {
    /// Where the settings in force came from.
    pub enum SettingsSource {
        /// Compiled in: flash has no settings.
        0 "built_in" BuiltIn,
        /// Put into flash by a debug probe.
        1 "flash" Flash,
        /// Compiled in, because the settings in flash failed their check.
        2 "flash_refused" FlashRefused,
        /// Written over the link and kept in flash.
        3 "stored" Stored,
    }
}

body! {
    /// Counters since the last reset, and the state of the bead: every second.
    pub struct Status: Copy {
        /// Milliseconds since the last reset.
        pub uptime_ms: u64,
        /// Times that acquisition was started; a step means that samples are missing between.
        pub epoch: u32,
        /// Scans taken.
        pub samples: u64,
        /// Strikes found.
        pub strikes: u32,
        /// ADC or DMA overruns.
        pub overruns: u32,
        /// Blocks of samples that the estimators never saw.
        pub blocks_dropped: u32,
        /// Frames made and numbered but not sent: the transmit queue was full.
        pub frames_dropped_queue_full: u32,
        /// Frames made and numbered but not sent: longer than a frame may be.
        pub frames_dropped_too_long: u32,
        /// Least stack that was ever free, in bytes.
        pub stack_free_min: u32,
        /// Where the settings came from.
        pub settings_source: SettingsSource,
        /// Whether the strike detector is armed.
        pub armed: bool,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Status {
    Status {
        uptime_ms: 5_000_000_000,
        epoch: 1,
        samples: 500_000_000_000,
        strikes: 3,
        overruns: 0,
        blocks_dropped: 200,
        frames_dropped_queue_full: 70_000,
        frames_dropped_too_long: 0,
        stack_free_min: 2_048,
        settings_source: SettingsSource::FlashRefused,
        armed: true,
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str =
    "000a030202040302010c0b01020a01010f0780e497d012018090cad2c60e0306c801f0a2040980100201dd2ac55b00";
