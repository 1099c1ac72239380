//! Strikes of recordings, as their beads measured them.

use std::path::Path;

use crate::choice::Choice;
use crate::error::WaveformError;
use crate::rows::{ACCELERATION_LATER, Rows};
use crate::signals::Waveform;
use bead_recording::file::{RecordedBead, Recording};

/// Reads a strike of a recording; of a recording of several beads, one of bead number `bead`.
pub(super) fn read(path: &Path, choice: &Choice, bead: Option<usize>) -> Result<Waveform, WaveformError> {
    let unfit = |what: String| Err(WaveformError::unfit(path, what));
    if choice.names_a_column() || choice.rate_hz.is_some() {
        return unfit(
            "is a recording, which has its own units; leave columns and --read rate out".to_owned(),
        );
    }
    let mut received = Recording::open_named(path)?;
    let beads = &received.beads;
    if !beads.is_empty() {
        let places: Vec<_> = beads.iter().map(RecordedBead::place).collect();
        let Some(at) = places.iter().position(|place| Some(*place) == bead) else {
            return unfit(format!(
                "has the beads {places:?}; choose one of them with --bead"
            ));
        };
        received = received.each().swap_remove(at);
    }
    let wanted = choice.strike.unwrap_or(0);
    let mut strikes = received.strikes()?;
    let Some(strike) = strikes.by_ref().nth(wanted) else {
        let all = received.strikes()?.count();
        return match all {
            0 => Err(received.no_strike(strikes.frames()).into()),
            _ => unfit(format!(
                "has {all} strikes, numbered from 0, and none is number {wanted}; choose one with --read strike=N"
            )),
        };
    };
    let number = strike.said.strike;
    if strike.missing() > 0 {
        return unfit(format!(
            "strike {wanted} lacks {} of its {} samples; choose another with --read strike=N",
            strike.missing(),
            strike.said.samples
        ));
    }
    let (Some(signal), Some(rate)) = (strike.signal(), strike.rate()) else {
        return unfit(format!(
            "strike {wanted} came without settings, so its samples have no units; choose another"
        ));
    };
    let mut rows = Rows::new(path, "sample", Some(f64::from(rate)), [true, true]);
    rows.acceleration_later = ACCELERATION_LATER;
    for ((sample, force), acceleration) in (0..).zip(&signal.force).zip(&signal.acceleration) {
        rows.push(sample, [None, Some(*force), Some(*acceleration)])?;
    }
    if choice.strike.is_none() && strikes.next().is_some() {
        rows.remarks.push(format!(
            "it has several strikes, and the first is taken, which is number {number} of its bead; choose another with \
             --read strike=N"
        ));
    }
    rows.end()
}
