//! The drop test: the gain of the force from the momentum of a ball.
//!
//! # Design
//! A ball of mass m falls from a height h onto the cap, bounces and lands again after T. During each
//! contact, T_c, its weight acts too; it flies for T - T_c. So the force's area is
//!
//! J = m (v_in + v_out + g T_c),  v_in = √(2 g h),  v_out = g (T - T_c) / 2,
//!
//! and a code is worth J / (Δt Σ). The contact itself needs no model. Strikes that follow each other within
//! the longest flight, 2 v_in / g, are one drop: its first two are the landings. A code's worth is the mean
//! over the drops; the scatter at each height is type A. Heights have to agree within the uncertainty of
//! their ratio, in which the mass cancels.

use bead_recording::strikes::RecordedStrike;
use bead_wire::StrikeFlags;

use crate::calibration::{BeadIdentity, Calibration, LeftOut, because, supply};
use crate::landing::Landing;
use crate::model::median;
pub use crate::momentum::DropInputs;
use crate::momentum::{Drop, combine, gain_of};

/// Factor over the longest flight beyond which a gap between strikes begins another drop.
const LATER: f64 = 1.05;
/// Greatest relative deviation of a drop's gain from the median at its height: a ball that grazes the cap
/// transfers less momentum.
const GRAZED: f64 = 0.1;
/// Least number of drops at a height: one has no scatter.
const FEWEST: usize = 2;
/// Strikes of one recording, all from one height.
#[derive(Debug, Clone)]
pub struct DropSeries {
    /// Name of the recording.
    pub recording: String,
    /// Place of its height among those of [`DropInputs`].
    pub height: usize,
    /// Its strikes, of one bead, in the order of their time.
    pub strikes: Vec<RecordedStrike>,
}

/// Evaluates a drop test.
///
/// # Errors
/// One line: too few drops at a height, or inputs that do not belong together.
pub fn evaluate(series: &[DropSeries], stated: &DropInputs) -> Result<Calibration, String> {
    let mut left_out = Vec::new();
    let mut drops = Vec::new();
    for one in series {
        let height = stated
            .heights
            .get(one.height)
            .ok_or("a recording has no height; give one --height for each recording, or one for all")?;
        let flight = 2.0 * (2.0 * height.value / stated.gravity.value).sqrt();
        // A window opened on request or by the trigger line is no landing.
        let landings: Vec<&RecordedStrike> =
            one.strikes.iter().filter(|strike| is_by_force(strike)).collect();
        for (number, group) in groups(&landings, LATER * flight).into_iter().enumerate() {
            let subject = format!("{}, drop {number}", one.recording);
            match drop_of(group, one.height, flight) {
                Ok(drop) => drops.push((subject, drop)),
                Err(why) => left_out.push(LeftOut { subject, why }),
            }
        }
    }
    let gains: Vec<f64> = drops.iter().map(|(_, drop)| gain_of(stated, drop)).collect();
    // One median for each height: a check with their uncertainty judges whether heights agree.
    let middles: Vec<f64> = (0..stated.heights.len())
        .map(|height| {
            let at = drops
                .iter()
                .zip(&gains)
                .filter(|((_, drop), _)| drop.height == height);
            median(&at.map(|(_, gain)| *gain).collect::<Vec<_>>()).unwrap_or(0.0)
        })
        .collect();
    let mut kept = Vec::new();
    for ((subject, drop), gain) in drops.into_iter().zip(gains) {
        let off = gain / middles[drop.height] - 1.0;
        if off.abs() < GRAZED {
            kept.push((subject, drop, gain));
        } else {
            let why = format!(
                "its impulse differs from the others' by {:+.0} %: the ball grazed the cap, or fell from \
                 another height",
                100.0 * (1.0 / (1.0 + off) - 1.0)
            );
            left_out.push(LeftOut { subject, why });
        }
    }
    let counts: Vec<usize> = (0..stated.heights.len())
        .map(|height| kept.iter().filter(|(_, drop, _)| drop.height == height).count())
        .collect();
    if let Some(height) = counts.iter().position(|count| *count < FEWEST) {
        let why = because(&left_out);
        return Err(format!(
            "{} from {} m can be used, but at least {FEWEST} are needed{why}; record more, ten for a good mean",
            counted(counts[height]),
            stated.heights[height].value
        ));
    }
    let bead = series.iter().flat_map(|one| &one.strikes).next();
    let mut calibration = combine(stated, &kept, &counts);
    calibration.bead = bead.map(BeadIdentity::of);
    calibration.supply_v = supply(series.iter().flat_map(|one| &one.strikes));
    calibration.left_out = left_out;
    Ok(calibration)
}

fn counted(drops: usize) -> String {
    match drops {
        0 => "no drop".to_owned(),
        1 => "one drop".to_owned(),
        more => format!("{more} drops"),
    }
}

/// True if the force opened the window of a strike.
fn is_by_force(strike: &RecordedStrike) -> bool {
    let flags = strike.said.flags;
    !flags.has(StrikeFlags::TRIGGERED_BY_LINE) && !flags.has(StrikeFlags::TRIGGERED_ON_REQUEST)
}

/// Groups of strikes that follow each other within a time, s.
fn groups<'a, 'b>(strikes: &'a [&'b RecordedStrike], within: f64) -> Vec<&'a [&'b RecordedStrike]> {
    let time = |strike: &RecordedStrike| {
        strike.said.trigger_index as f64 / f64::from(strike.rate().unwrap_or(100_000))
    };
    let follows = |one: &&RecordedStrike, next: &&RecordedStrike| {
        let apart = time(next) - time(one);
        one.nth_boot == next.nth_boot && (0.0..within).contains(&apart)
    };
    strikes.chunk_by(follows).collect()
}

/// The drop of a group of strikes. The longest flight is in s.
fn drop_of(group: &[&RecordedStrike], height: usize, flight: f64) -> Result<Drop, String> {
    let (first, second) = match group {
        [first, second, ..] => (first, second),
        _ => {
            return Err(format!(
                "no second landing came within {flight:.3} s: the ball missed the cap after its bounce; drop again"
            ));
        }
    };
    let rate = first
        .rate()
        .ok_or("the sample rate of its bead is unknown; record from the bead's start")?;
    let landing = Landing::of(first)?;
    let again = Landing::of(second).map_err(|why| format!("second landing: {why}"))?;
    Ok(Drop {
        height,
        landing,
        between: again.begin - landing.begin,
        rate: f64::from(rate),
    })
}
