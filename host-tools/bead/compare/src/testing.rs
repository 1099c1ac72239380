//! Recorded strikes for unit tests.

use std::sync::LazyLock;

use bead_model::Scan;
use bead_model::design::{Capture, derive};
use bead_testing::Collector;
use hertz_chain::{Scenario, Solution};

use crate::front_end::AnalogFrontEnd;
use crate::sensed::{Sensed, Timing, bead_of, simulate_with_ring_down};
use bead_instrument::{Trace, Waveform};
use bead_recording::strikes::RecordedStrike;

static PAPER: LazyLock<Solution> = LazyLock::new(|| simulate_with_ring_down(&Scenario::paper()).unwrap());

/// The paper's strike as bead 8 would report it, made by the model on this computer. It hits 20 ms after the
/// first scan, which has the index 1.
pub(crate) fn recorded_strike() -> RecordedStrike {
    static STRIKE: LazyLock<RecordedStrike> = LazyLock::new(|| measured(&PAPER, &PAPER, 1, 0.02).unwrap());
    STRIKE.clone()
}

/// A strike at a time in s after the first scan. `None` if the detector was not armed by then.
pub(crate) fn recorded_after(lead_in: f64) -> Option<RecordedStrike> {
    measured(&PAPER, &PAPER, 1, lead_in)
}

/// A strike of `scenario` with the noise of a seed, measured with the settings of bead 8 of `believed`.
pub(crate) fn recorded(scenario: &Scenario, believed: &Scenario, seed: u64) -> RecordedStrike {
    let [scenario, believed] =
        [scenario, believed].map(|scenario| simulate_with_ring_down(scenario).unwrap());
    measured(&scenario, &believed, seed, 0.02).unwrap()
}

/// `None` if the detector did not fire.
fn measured(solution: &Solution, believed: &Solution, seed: u64, lead_in: f64) -> Option<RecordedStrike> {
    let (front_end, bead) = (AnalogFrontEnd::default(), bead_of(believed, 8).unwrap());
    let settings = derive(&bead, &front_end.calibration(), &Capture::default()).unwrap();
    let timing = Timing::once(lead_in);
    let (sensed, scans) = (Sensed::new(solution, 8, timing), timing.scans(solution.end()));
    let codes = front_end.digitise(&sensed, scans, Some(seed)).scans;
    let scans: Vec<Scan> = codes.into_iter().map(Scan::new).collect();
    let collected = Collector::measure(&settings, 1, &scans);
    assert!(collected.reports.len() < 2);
    let mut strike = RecordedStrike::new(0, *collected.reports.first()?);
    strike.shape = collected.shapes.first().copied();
    strike.settings = Some(settings);
    for chunk in &collected.chunks {
        strike.push(&chunk.into());
    }
    Some(strike)
}

/// A scenario of docs/scenarios.
pub(crate) fn scenario(name: &str) -> Scenario {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/scenarios");
    Scenario::load(format!("{folder}/{name}.toml")).unwrap()
}

/// The record of an instrument that begins at 0 s.
pub(crate) fn waveform(force: Option<Trace>, acceleration: Option<Trace>) -> Waveform {
    Waveform {
        force,
        acceleration,
        start: 0.0,
        remarks: Vec::new(),
    }
}
