//! Times of the messages in a recording.

use bead_wire::Arrival;

/// Times of the messages, in nanoseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    pub(super) sample_rate_hz: u32,
    /// Time of the bead since its reset.
    pub(super) bead: u64,
    /// Log time of the recording.
    pub(super) log: u64,
    /// Log time at the bead's reset.
    pub(super) reset: u64,
    /// True if log times are those of the host.
    pub(super) received: bool,
}

impl Clock {
    pub(super) fn tick(&mut self, sample_index: u64, arrival: Arrival) {
        if let Arrival::Restart { .. } = arrival {
            self.reset = self.log;
        }
        let ns = u128::from(sample_index) * 1_000_000_000;
        let time = ns.checked_div(u128::from(self.sample_rate_hz)).unwrap_or(0);
        self.bead = u64::try_from(time).unwrap_or(u64::MAX);
        if !self.received {
            self.log = self.log.max(self.reset.saturating_add(self.bead));
        }
    }

    /// Sets the receive time of what follows.
    pub(super) fn receive(&mut self, received_ns: u64) {
        self.received = true;
        self.log = self.log.max(received_ns);
    }
}
