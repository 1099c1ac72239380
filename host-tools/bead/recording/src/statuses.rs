//! The last status of every boot. A bead counts from its reset, so these make up its counts over all boots.

use bead_wire::{Header, Message, Status};

use crate::frames::Frame;

/// The last status of every boot of every bead. After power-up the number of the boot begins again, and so
/// does the time.
#[derive(Debug, Clone, Default)]
pub struct LastStatuses(Vec<(Header, Status)>);

impl LastStatuses {
    /// Takes the next frame.
    pub fn push(&mut self, frame: &Frame) {
        let Frame { header, message, .. } = frame;
        let Message::Status(status) = message else { return };
        let of_bead = |(other, _): &&mut (Header, Status)| other.address == header.address;
        let same_boot = |(other, before): &&mut (Header, Status)| {
            other.boot == header.boot && before.uptime_ms <= status.uptime_ms
        };
        match self.0.iter_mut().rev().find(of_bead).filter(same_boot) {
            Some((_, before)) => *before = *status,
            None => self.0.push((*header, *status)),
        }
    }

    /// A count of all beads in all their boots.
    pub fn sum(&self, count: impl Fn(&Status) -> u32) -> u64 {
        self.0.iter().map(|(_, status)| u64::from(count(status))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_wire::{Arrival, Body};

    #[test]
    fn of_each_boot_of_each_bead_the_last_status_counts() {
        let mut statuses = LastStatuses::default();
        for (address, boot, uptime_ms, overruns) in [
            (7, 0, 1000, 100),
            (8, 0, 500, 400),
            (7, 0, 2000, 1),
            (8, 0, 1500, 5),
            // A power cycle, and a reset.
            (7, 0, 700, 100),
            (7, 0, 1700, 20),
            (7, 1, 2700, 300),
        ] {
            let mut status = Status::draw(&mut || 0);
            (status.uptime_ms, status.overruns) = (uptime_ms, overruns);
            statuses.push(&Frame::of(address, boot, Arrival::Next { lost: 0 }, status));
        }
        assert_eq!(statuses.sum(|status| status.overruns), 1 + 5 + 20 + 300);
    }
}
