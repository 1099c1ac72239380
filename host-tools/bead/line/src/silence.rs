//! The reason why a request gets no reply, from the other frames on the line.

use std::collections::BTreeSet;
use std::fmt::Write;

use bead_wire::{ANY, Counters, Link, Message};

use bead_recording::frames::Frame;

/// Evidence from the frames that come while a reply is awaited.
#[derive(Clone, Debug, Default)]
pub(super) struct Evidence {
    /// Addresses of the beads that sent anything since the first request.
    beads: BTreeSet<u8>,
    /// First and last count of what the bead received.
    links: Option<[Link; 2]>,
    /// First and last number of strikes.
    strikes: Option<[u32; 2]>,
    /// Newest boot, and number of its changes.
    boot: Option<u8>,
    restarts: u32,
}

impl Evidence {
    /// Discards the evidence for a new request, except the addresses.
    pub(super) fn begin(&mut self) {
        *self = Self {
            beads: std::mem::take(&mut self.beads),
            ..Self::default()
        };
    }

    /// Notes that all frames came from one bead, which has this address now.
    pub(super) fn note_alone(&mut self, address: u8) {
        self.beads = BTreeSet::from([address]);
    }

    pub(super) fn several(&self) -> Option<String> {
        (self.beads.len() > 1).then(|| self.addresses())
    }

    fn addresses(&self) -> String {
        let beads: Vec<_> = self.beads.iter().map(u8::to_string).collect();
        beads.join(", ")
    }

    /// Takes a frame. `asked` is the address of the request, or [`ANY`].
    pub(super) fn note(&mut self, frame: &Frame, asked: u8) {
        self.beads.insert(frame.header.address);
        if asked != ANY && asked != frame.header.address {
            return;
        }
        if self
            .boot
            .replace(frame.header.boot)
            .is_some_and(|boot| boot != frame.header.boot)
        {
            // After a restart, the bead's counts begin at 0 again.
            *self = Self {
                beads: std::mem::take(&mut self.beads),
                boot: self.boot,
                restarts: self.restarts + 1,
                ..Self::default()
            };
        }
        match &frame.message {
            Message::Link(link) => self.links.get_or_insert([*link; 2])[1] = *link,
            Message::Status(status) => self.strikes.get_or_insert([status.strikes; 2])[1] = status.strikes,
            _ => {}
        }
    }

    /// Explains why there is no reply, as far as the bead's own counts show it.
    pub(super) fn explain(&self, asked: u8, counters: &Counters) -> String {
        let mut said = match (counters.bytes, counters.frames) {
            (0, _) => {
                return "nothing came at all: is the bead powered, and is its PA9 wired to the adapter's \
                        receive pin?"
                    .into();
            }
            (_, 0) => {
                let several = match asked {
                    ANY => " If several beads share the line, ask one of them with --address N",
                    _ => "",
                };
                return format!("bytes came, but no frame among them: does --baud match?{several}");
            }
            _ => format!("{} frames came", counters.frames),
        };
        let beads = self.addresses();
        match asked {
            ANY if self.beads.len() > 1 => {
                return format!(
                    "{said}, from the beads at the addresses {beads}, whose replies collide: ask one of them \
                     with --address N"
                );
            }
            ANY => {}
            _ if self.beads.contains(&asked) => {}
            _ if self.beads.is_empty() => {}
            _ => {
                return format!(
                    "{said} from address {beads}, none from this bead: correct --address, or check that this \
                     bead is powered"
                );
            }
        }
        // Writing into a text cannot fail.
        if counters.lost > 0 {
            let _ = write!(said, " and {} were lost", counters.lost);
        }
        if let Some([first, last]) = self.strikes.filter(|[first, last]| last > first) {
            let _ = write!(said, ", {} strikes among them", last - first);
        }
        if self.restarts > 0 {
            let _ = write!(
                said,
                "; it was reset {} times meanwhile: its fault frames say why",
                self.restarts
            );
        }
        let Some([first, last]) = self.links else {
            return said
                + "; none of them says what the bead received: listen longer with --timeout 3; is its PA10 wired to \
                   the adapter's transmit pin?";
        };
        let new = |count: fn(&Link) -> u32| count(&last).saturating_sub(count(&first));
        let _ = match (
            last.bytes - first.bytes.min(last.bytes),
            new(|link| link.requests),
        ) {
            (0, _) if last.bytes == 0 => write!(
                said,
                "; by its own count it never received a byte: is its PA10 wired to the adapter's transmit pin?"
            ),
            (0, _) => write!(
                said,
                "; by its own count it received {} bytes before and none since: does the adapter still send?",
                last.bytes
            ),
            (bytes, 0) => write!(
                said,
                "; it received {bytes} bytes meanwhile and no request among them ({} with a wrong CRC, {} overruns, \
                 {} line errors): is the line noisy, or does another program send too?",
                new(|link| link.rejected_crc),
                new(|link| link.overruns),
                new(|link| link.line_errors)
            ),
            (_, requests) => write!(
                said,
                "; it understood {requests} requests meanwhile: its replies were lost on the way, or went to another \
                 program; ask again"
            ),
        };
        said
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_testing::Speaker;
    use bead_wire::{Body, Status};

    /// Returns the text after these messages, each with its boot.
    fn said(messages: &[(u32, Message)]) -> String {
        let (mut seen, mut bead) = (Evidence::default(), Speaker::default());
        for (boot, message) in messages {
            bead.boot = *boot;
            bead.say(0, message.clone());
        }
        let (frames, counters) = bead_recording::frames::decode(&bead.bytes);
        frames.iter().for_each(|frame| seen.note(frame, ANY));
        seen.explain(ANY, &counters)
    }

    /// Counts of bytes, of requests, and of those with a wrong CRC.
    fn link([bytes, requests, rejected_crc]: [u32; 3]) -> Message {
        let link = Link {
            bytes: bytes.into(),
            requests,
            rejected_crc,
            ..Link::default()
        };
        link.into()
    }

    #[test]
    fn what_the_bead_says_of_its_line_is_what_the_host_says_of_it() {
        let links = |counts: [[u32; 3]; 2]| counts.map(|counts| (0, link(counts))).to_vec();
        let strikes = |strikes| {
            let status = Status::draw(&mut || 0);
            (0, Status { strikes, ..status }.into())
        };
        let reset = [(0, [9, 1, 0]), (1, [0; 3]), (2, [0; 3])].map(|(boot, counts)| (boot, link(counts)));
        for (messages, expected) in [
            (
                links([[0; 3]; 2]),
                "2 frames came; by its own count it never received",
            ),
            (links([[9, 1, 0]; 2]), "received 9 bytes before and none since"),
            (
                links([[9, 1, 0], [30, 1, 2]]),
                "it received 21 bytes meanwhile and no request among them (2 with a wrong CRC",
            ),
            (links([[9, 1, 0], [30, 3, 0]]), "understood 2 requests meanwhile"),
            (
                vec![strikes(5), strikes(80)],
                "2 frames came, 75 strikes among them; none of them says",
            ),
            (reset.to_vec(), "it was reset 2 times meanwhile"),
        ] {
            let said = said(&messages);
            assert!(said.contains(expected), "{said}");
        }
    }
}
