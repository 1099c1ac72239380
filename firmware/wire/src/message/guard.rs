use crate::body::body;

body! {
    /// Strikes passed over and requests refused since the last reset: the bead keeps itself within reach. It
    /// comes with each status frame.
    pub struct Guard: Copy, Default {
        /// Strikes that were found and not measured, because their frames found no room on the line, or
        /// because settings were about to change. They have a number.
        pub strikes_passed_over: u32,
        /// Strikes with the flag `sensor_still`.
        pub strikes_still: u32,
        /// Number of boots in a row that ended in a fault within a second of their start. After five, the
        /// bead uses the built-in settings.
        pub boots_failed: u32,
        /// Settings that were not written, because flash is written only so often.
        pub refused_too_soon: u32,
        /// True if the bead has a key. Requests that change its state must then be signed.
        pub keyed: bool,
        /// Counter of the last signed request that was accepted; the next one needs a higher one.
        pub counter: u64,
        /// Signed requests that were accepted.
        pub signed: u32,
        /// Requests refused, because they were not signed.
        pub refused_unsigned: u32,
        /// Signed requests refused, because they were signed with another key, for another bead, or changed
        /// on the way.
        pub refused_forged: u32,
        /// Signed requests refused, because their counter was used before, or is too far ahead.
        pub refused_replayed: u32,
        /// Signed requests refused, because their time was over, or their boot.
        pub refused_late: u32,
        /// Waves that no window could hold: the one before had come too short a time ago, or scans of earlier
        /// windows still waited to be measured. They have no number.
        pub strikes_in_dead_time: u32,
    }
}

impl Guard {
    /// Fields at the end that the first images did not send, each a byte of 0 if it is absent.
    pub(crate) const GAINED: usize = 1;
}
