//! Lines for people about what was recorded.

use std::fmt;

use bead_wire::{Counters, Fault, Message, Strike};

use crate::recorder::{Recorded, RecordedPort};
use bead_recording::frames::Frame;
use bead_tables::printable::one_line;

/// A line about a strike or a fault; `None` for another message.
pub fn of_message(frame: &Frame, is_fetched: bool) -> Option<String> {
    match &frame.message {
        Message::Strike(strike) => Some(of_strike(frame, strike) + if is_fetched { ", fetched" } else { "" }),
        Message::Fault(fault) => Some(of_fault(fault)),
        _ => None,
    }
}

fn of_strike(frame: &Frame, strike: &Strike) -> String {
    let at = match frame.seconds(strike.trigger_index as f64) {
        Some(seconds) => format!("at {seconds:.5} s"),
        None => format!("at sample {}", strike.trigger_index),
    };
    let mut line = format!(
        "strike {} {at}: {:.3} N, {:+.1} to {:+.1} m/s², absorbed {:.2} nJ measured, {:.2} nJ predicted",
        strike.strike,
        strike.peak_force.newtons(),
        strike.acceleration_min.metres_per_second_squared(),
        strike.acceleration_max.metres_per_second_squared(),
        strike.absorbed_measured.joules() * 1e9,
        strike.absorbed_predicted.joules() * 1e9,
    );
    line.extend(strike.flags.names().flat_map(|name| [", ", name]));
    line
}

fn of_fault(fault: &Fault) -> String {
    // A line end in the text would let a bead print what looks like a strike.
    let detail = one_line(fault.detail.as_str());
    let separator = if detail.is_empty() { "" } else { ", " };
    format!("fault in boot {}: {}{separator}{detail}", fault.boot, fault.cause)
}

fn losses(counters: &Counters) -> String {
    let (lost, corrupt, restarts) = (counters.lost, counters.rejected.total(), counters.restarts);
    format!("{lost} lost, {corrupt} corrupt, {restarts} restarts")
}

/// A line for one of several ports: its bead, and its losses.
impl fmt::Display for RecordedPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { address, strikes, .. } = self;
        match (self.bead, &self.counters) {
            (Some(bead), Some(counters)) => {
                let (frames, losses) = (counters.frames, losses(counters));
                write!(
                    f,
                    "bead {bead} at {address}: {strikes} strikes, {frames} frames; {losses}"
                )
            }
            (Some(bead), None) => write!(
                f,
                "{address} was not recorded: its bead has the address {bead}, as another bead does; give it a \
                 different one: bead settings set address=N"
            ),
            (None, _) => write!(
                f,
                "{address}: no frame came; is there a bead, and does --baud match?"
            ),
        }
    }
}

/// A line about the files of a recording and their content.
impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let files: Vec<_> = self.files.iter().map(|path| path.display().to_string()).collect();
        let (files, counters, strikes) = (files.join(", "), &self.counters, self.strikes);
        let (frames, bytes, seconds) = (counters.frames, counters.bytes, self.duration.as_secs_f64());
        let losses = losses(counters);
        write!(
            f,
            "{files}: {strikes} strikes, {frames} frames in {bytes} bytes and {seconds:.1} s; {losses}"
        )?;
        match (self.fetched, self.gone) {
            (0, 0) => Ok(()),
            (fetched, gone) => write!(f, "; {fetched} strikes fetched, {gone} could not be fetched"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_a_line_with_its_cause_and_what_the_bead_said_of_it() {
        let fault = |cause, detail: &str| Fault {
            cause,
            boot: 3,
            pc: 0,
            detail: detail.into(),
        };
        assert_eq!(
            of_fault(&fault(bead_wire::FaultCause::Recovered, "force_stuck")),
            "fault in boot 3: recovered, force_stuck"
        );
        assert_eq!(
            of_fault(&fault(bead_wire::FaultCause::Watchdog, "")),
            "fault in boot 3: watchdog"
        );
        assert_eq!(
            of_fault(&fault(bead_wire::FaultCause::Panic, "x\nstrike 7 at 1.0 s")),
            "fault in boot 3: panic, x\\u000astrike 7 at 1.0 s"
        );
    }
}
