//! Set-ups and comparisons that several tests share.

use hertz_chain::{Intruder, Oscillator, PulseSearch, Scenario, Section, Solution, Striker, simulate};

/// The paper's striker on elastic beads without an intruder. `duration` is in s.
pub(crate) fn elastic(beads: usize, duration: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.relaxation = 0.0;
    scenario.chain.beads = beads;
    scenario.duration = duration;
    scenario
}

/// A chain struck by a bead like its own: one solitary wave has nearly all of the energy.
pub(crate) fn struck_by_a_bead(beads: usize, duration: f64) -> Scenario {
    changed(elastic(beads, duration), |one| {
        one.striker = Striker::new(one.chain.radius, one.chain.material(), one.striker.velocity);
    })
}

/// The scenario after a change.
pub(crate) fn changed(mut scenario: Scenario, change: impl FnOnce(&mut Scenario)) -> Scenario {
    change(&mut scenario);
    scenario
}

/// The paper's intruder on the spring that absorbs most, 1e5 N/m.
pub(crate) fn softer(beads: impl IntoIterator<Item = usize>) -> Intruder {
    let stiffness = 1e5;
    let oscillator = Oscillator {
        stiffness,
        ..Oscillator::PAPER
    };
    Intruder::new(beads, oscillator)
}

/// Beads of this radius, m.
pub(crate) fn of_radius(beads: impl IntoIterator<Item = usize>, radius: f64) -> Section {
    let mut section = Section::of(beads);
    section.radius = Some(radius);
    section
}

/// A search for pulses of at least this part of the greatest.
pub(crate) fn from_height(height: f64) -> PulseSearch {
    PulseSearch {
        height,
        ..PulseSearch::default()
    }
}

/// The numbers of a row of a table.
pub(crate) fn numbers(row: &str) -> Vec<f64> {
    let words = row.split_whitespace();
    words.map(|word| word.parse().expect("a number")).collect()
}

pub(crate) fn run(scenario: &Scenario) -> Solution {
    simulate(scenario).expect("the scenario runs")
}

/// Asserts that a value differs from the expected one by less than this part of it.
#[track_caller]
pub(crate) fn near(value: f64, expected: f64, part: f64) {
    let error = value / expected - 1.0;
    assert!(error.abs() < part, "{value:?} is off {expected:?} by {error:e}");
}

/// Asserts that a value differs from the expected one by less than `most`.
#[track_caller]
pub(crate) fn close(value: f64, expected: f64, most: f64) {
    let error = value - expected;
    assert!(error.abs() < most, "{value:?} is off {expected:?} by {error:e}");
}

/// Asserts that a text is one line that begins with some words and holds others.
#[track_caller]
pub(crate) fn says(text: &str, start: &str, more: &str) {
    let is_line = text.lines().count() == 1;
    assert!(
        is_line && text.starts_with(start) && text.contains(more),
        "{text}"
    );
}

/// Random numbers, equal in every run (Marsaglia's xorshift).
pub(crate) struct Draw(pub(crate) u64);

impl Draw {
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// A number of mean 0 and variance 1: twelve uniform ones added.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.between(0.0, 1.0)).sum::<f64>() - 6.0
    }
}
