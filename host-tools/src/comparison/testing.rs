//! What the unit tests of several files share.

use bead_model::design::{Capture, derive};
use bead_model::{Meter, Scan, Settings, Sink, StrikeReport, Window, WindowRecord};
use bead_wire::StrikeFlags;
use hertz_chain::Scenario;

use crate::bench::front_end::FrontEnd;
use crate::bench::sensed::{Sensed, Timing, bead_of, simulate_with_ring_down};
use crate::recording::strikes::RecordedStrike;

/// The paper's strike as bead 8 would report it, made by the model on this computer.
pub(crate) fn recorded_strike() -> RecordedStrike {
    recorded(&Scenario::paper(), &Scenario::paper(), 1)
}

/// A strike of `scenario` with the noise of a seed, measured with the settings of bead 8 of `believed`.
pub(crate) fn recorded(scenario: &Scenario, believed: &Scenario, seed: u64) -> RecordedStrike {
    let solution = simulate_with_ring_down(scenario).unwrap();
    let front_end = FrontEnd::default();
    let settings = derive(
        &bead_of(&simulate_with_ring_down(believed).unwrap(), 8).unwrap(),
        &front_end.calibration(),
        &Capture::default(),
    )
    .unwrap();
    let timing = Timing {
        lead_in: 0.02,
        strikes: 1,
        interval: 0.1,
    };
    let codes = front_end.digitise(
        &Sensed::new(&solution, 8, timing),
        timing.scans(solution.end()),
        Some(seed),
    );
    let nothing = Window::open(0, 0).report(&settings, &WindowRecord::new());
    let mut strike = RecordedStrike::new(0, bead_telemetry::strike(&nothing, StrikeFlags::NONE));
    strike.settings = Some(settings);
    feed(&settings, &codes.scans, &mut strike);
    strike
}

fn feed(settings: &Settings, codes: &[[u16; 4]], strike: &mut RecordedStrike) {
    struct Into<'a>(&'a mut RecordedStrike);
    impl Sink for Into<'_> {
        fn chunk(&mut self, chunk: &bead_model::Chunk) {
            self.0.push(&bead_telemetry::waveform(chunk));
        }
        fn report(&mut self, report: &StrikeReport) {
            self.0.said = bead_telemetry::strike(report, StrikeFlags::NONE);
            self.0.shape = Some(bead_telemetry::shape(report));
        }
    }
    let mut meter = Meter::new();
    let scans: Vec<Scan> = codes.iter().copied().map(Scan::new).collect();
    meter.process(settings, 1, scans, &mut Into(strike));
    assert_eq!(meter.strikes(), 1);
}
