//! Strikes that the bead plays to itself, compared with what its own code makes of the same codes here.

use bead_compare::replay::replay;
use bead_line::conversation::{Conversation, LineError};
use bead_model::made_up::{REST, played};
use bead_model::{Meter, Scan, Settings, Strike, StrikeFlags};
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_wire::{Message, Played, Request};

use super::levels::Levels;
use super::report::CheckRow;
use crate::model_bead::MeterOutput;

/// Strikes of a train, and the time from one to the next, ms.
pub(super) const TRAIN: u32 = 6;
const INTERVAL_MS: u32 = 60;

/// Greatest difference of a value from that of the played codes, as a part. The line from output to input
/// is known to a tenth of a percent; its bend of some codes in 1500 accounts for the rest.
const AGREES: f64 = 0.01;

pub(super) const BUDGET: &str = "budget";
pub(super) const NAMES: [&str; 5] = [
    "strike, trigger",
    "strike, replay",
    "strike, values",
    "train",
    BUDGET,
];

/// Results of a bead with these settings for the played codes.
pub(super) struct Expected {
    /// Scans from the first played one to the one that triggers.
    trigger: i64,
    strike: Strike,
}

impl Expected {
    /// `None` if nothing triggers with these settings.
    pub(super) fn of(settings: &Settings, levels: &Levels) -> Option<Self> {
        const BEFORE: usize = 4000;
        const AFTER: usize = 3000;
        // The wide channels do not matter: the strike stays within the range of the sensitive ones.
        let scan = |codes: [u16; 2]| {
            let [force, acceleration] = [0, 1].map(|channel| {
                let code = levels.lines[channel].at(codes[channel].into());
                code.round().clamp(0.0, 4095.0) as u16
            });
            Scan::new([force, REST[0], acceleration, REST[1]])
        };
        let rest = |count: usize| std::iter::repeat_n(scan(REST), count);
        let scans: Vec<Scan> = rest(BEFORE)
            .chain(played().map(scan))
            .chain(rest(AFTER))
            .collect();
        let mut output = MeterOutput::default();
        Meter::new().process(settings, 0, scans, &mut output);
        let (strike, _) = *output.reports.first()?;
        Some(Self {
            trigger: strike.trigger_index as i64 - BEFORE as i64,
            strike,
        })
    }
}

/// Peak force (N), A and B (J) of a strike.
fn values(strike: &Strike) -> [f64; 3] {
    [
        strike.peak_force.newtons(),
        strike.absorbed_measured.joules(),
        strike.absorbed_predicted.joules(),
    ]
}

/// Greatest difference of values, as a part.
fn difference(seen: [f64; 3], expected: [f64; 3]) -> f64 {
    let parts = seen
        .iter()
        .zip(expected)
        .map(|(seen, expected)| (seen / expected - 1.0).abs());
    parts.fold(0.0, f64::max)
}

/// The strikes that were played, and those that the bead found.
pub(super) struct Strikes {
    asked: u32,
    played: Vec<Played>,
    found: Vec<RecordedStrike>,
}

impl Strikes {
    pub(super) fn play(bead: &mut Conversation, settings: &Settings, count: u32) -> Result<Self, LineError> {
        let answer = bead.request_done(&Request::Play {
            strikes: count,
            interval_ms: INTERVAL_MS,
        })?;
        let played: Vec<Played> = answer
            .frames
            .iter()
            .filter_map(|frame| match frame.message {
                Message::Played(played) => Some(played),
                _ => None,
            })
            .collect();
        let mut found = assemble(answer.frames, Some(*settings));
        found.retain(|strike| strike.said.flags.has(StrikeFlags::PLAYED));
        Ok(Self {
            asked: count,
            played,
            found,
        })
    }

    /// Scans from the first played one to the one that triggers, for each strike that was found.
    fn triggers(&self) -> impl Iterator<Item = i64> + '_ {
        let pairs = self.found.iter().zip(&self.played);
        pairs.map(|(strike, played)| strike.said.trigger_index.wrapping_sub(played.first_index) as i64)
    }

    /// Returns `true` if every strike came whole.
    fn is_whole(&self) -> bool {
        let count = self.asked as usize;
        self.found.len() == count
            && self.played.len() == count
            && self.played.iter().all(|played| played.complete)
    }

    /// Rows of a strike that was played alone. The replay compares every bit of the strikes of the `train`,
    /// too.
    pub(super) fn rows_of_one(&self, train: &Self, expected: Option<&Expected>) -> Vec<CheckRow> {
        let [trigger, replay_row, value_row] = [NAMES[0], NAMES[1], NAMES[2]];
        let all = self.found.iter().chain(&train.found);
        let (Some(strike), Some(expected)) = (self.found.first(), expected) else {
            let seen = match expected {
                Some(_) => "no strike with the flag played",
                None => "the played strike does not reach the trigger of these settings",
            };
            let rest = [replay_row, value_row].map(|name| CheckRow::not_done(name, "needs a strike"));
            return [CheckRow::of(trigger, seen, "one strike", false)]
                .into_iter()
                .chain(rest)
                .collect();
        };
        let at = self.triggers().next().unwrap_or_default();
        let row = CheckRow::of(
            trigger,
            format!("{} found, {at} scans into the playback", self.found.len()),
            format!("1, {} scans", expected.trigger),
            self.is_whole() && at == expected.trigger,
        );
        let trigger = row.with("scans", at as f64);
        let differs = all.clone().find_map(|strike| replay(strike).failure());
        let seen = differs
            .clone()
            .unwrap_or_else(|| format!("every bit of {} strikes", all.count()));
        let replayed = CheckRow::of(replay_row, seen, "every bit", differs.is_none());
        let ([peak, a, b], [peak_expected, a_expected, b_expected]) =
            (values(&strike.said), values(&expected.strike));
        let off = difference([peak, a, b], [peak_expected, a_expected, b_expected]);
        let row = CheckRow::of(
            value_row,
            format!("peak {peak:.3} N, A {:.4} µJ, B {:.4} µJ", a * 1e6, b * 1e6),
            format!(
                "{peak_expected:.3}, {:.4}, {:.4} within {:.0} %",
                a_expected * 1e6,
                b_expected * 1e6,
                100.0 * AGREES
            ),
            off <= AGREES,
        );
        let row = row
            .with("peak_force", peak)
            .with("absorbed_measured", a)
            .with("absorbed_predicted", b);
        vec![trigger, replayed, row]
    }

    /// Row of a train, whose strikes must agree with the single one.
    pub(super) fn row_of_train(&self, one: &Self) -> CheckRow {
        let (Some(alone), Some(trigger)) = (one.found.first(), one.triggers().next()) else {
            return CheckRow::not_done(NAMES[3], "needs a strike");
        };
        let late = self.triggers().filter(|at| *at != trigger).count();
        let all = self.found.iter();
        let off = all.map(|strike| difference(values(&strike.said), values(&alone.said)));
        let off = off.fold(0.0, f64::max);
        let row = CheckRow::of(
            NAMES[3],
            format!(
                "{} found, {late} late, {:.2} % off",
                self.found.len(),
                100.0 * off
            ),
            format!("{}, 0, {:.0} %", self.asked, 100.0 * AGREES),
            self.is_whole() && late == 0 && off <= AGREES,
        );
        row.with("strikes", self.found.len() as f64).with("off", off)
    }
}
