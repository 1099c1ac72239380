//! Recorded strikes for unit tests.

use std::sync::LazyLock;

use bead_model::design::{Capture, derive};
use bead_model::{Scan, Settings, Window, WindowRecord};
use bead_testing::Collector;
use hertz_chain::{Scenario, Solution};

use crate::front_end::FrontEnd;
use crate::sensed::{Sensed, Timing, bead_of, simulate_with_ring_down};
use bead_recording::strikes::RecordedStrike;

/// The paper's strike as bead 8 would report it, made by the model on this computer.
pub(crate) fn recorded_strike() -> RecordedStrike {
    recorded(&Scenario::paper(), &Scenario::paper(), 1)
}

/// A strike at a time in s after the first scan. `None` if the detector was not armed by then.
pub(crate) fn recorded_after(lead_in: f64) -> Option<RecordedStrike> {
    static PAPER: LazyLock<Solution> = LazyLock::new(|| simulate_with_ring_down(&Scenario::paper()).unwrap());
    measured(&PAPER, &PAPER, 1, lead_in)
}

/// A strike of `scenario` with the noise of a seed, measured with the settings of bead 8 of `believed`.
pub(crate) fn recorded(scenario: &Scenario, believed: &Scenario, seed: u64) -> RecordedStrike {
    let [scenario, believed] =
        [scenario, believed].map(|scenario| simulate_with_ring_down(scenario).unwrap());
    measured(&scenario, &believed, seed, 0.02).unwrap()
}

fn measured(solution: &Solution, believed: &Solution, seed: u64, lead_in: f64) -> Option<RecordedStrike> {
    let front_end = FrontEnd::default();
    let settings = derive(
        &bead_of(believed, 8).unwrap(),
        &front_end.calibration(),
        &Capture::default(),
    )
    .unwrap();
    let timing = Timing {
        lead_in,
        strikes: 1,
        interval: 0.1,
    };
    let codes = front_end.digitise(
        &Sensed::new(solution, 8, timing),
        timing.scans(solution.end()),
        Some(seed),
    );
    let (nothing, _) = Window::open(0, 0).report(&settings, &WindowRecord::new());
    let mut strike = RecordedStrike::new(0, nothing);
    strike.settings = Some(settings);
    feed(&settings, &codes.scans, &mut strike).then_some(strike)
}

/// True if the detector fired.
fn feed(settings: &Settings, codes: &[[u16; 4]], strike: &mut RecordedStrike) -> bool {
    let scans: Vec<Scan> = codes.iter().copied().map(Scan::new).collect();
    let collected = Collector::measure(settings, 1, &scans);
    for chunk in &collected.chunks {
        strike.push(&chunk.into());
    }
    let [report] = collected.reports[..] else {
        assert!(collected.reports.is_empty());
        return false;
    };
    strike.said = report;
    strike.shape = collected.shapes.first().copied();
    true
}
