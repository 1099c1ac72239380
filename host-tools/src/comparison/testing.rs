//! What the unit tests of several files share.

use bead_model::design::{Capture, derive};
use bead_model::{Meter, Record, Scan, Settings, Sink, StrikeReport, Window};
use hertz_chain::Scenario;

use crate::bench::front_end::FrontEnd;
use crate::bench::sensed::{Sensed, Timing, bead_of, simulate_with_ring_down};
use crate::comparison::replay::{wire_shape, wire_strike};
use crate::recording::strikes::{Chunk, RecordedStrike};

/// The paper's strike, as every user has it.
pub(crate) fn paper_scenario() -> Scenario {
    Scenario::from_toml(
        include_str!("../../../docs/scenarios/paper-strike.toml"),
        "paper-strike.toml",
    )
    .unwrap()
}

/// Its first millisecond: the wave does not reach the intruder.
pub(crate) fn short_scenario() -> Scenario {
    Scenario {
        duration: 1e-3,
        ..paper_scenario()
    }
}

/// The paper's strike as bead 8 would report it, made by the model on this computer.
pub(crate) fn recorded_strike() -> RecordedStrike {
    let solution = simulate_with_ring_down(&paper_scenario()).unwrap();
    let front_end = FrontEnd::default();
    let settings = derive(
        &bead_of(&solution, 8).unwrap(),
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
        &mut Sensed::new(&solution, 8, timing),
        timing.scans(solution.end()),
        Some(1),
    );
    let mut strike = RecordedStrike {
        said: wire_strike(&Window::open(0, 0).report(&settings, &Record::new())),
        shape: None,
        scans: Vec::new(),
        chunks: Vec::new(),
        settings: Some(settings),
    };
    feed(&settings, &codes.scans, &mut strike);
    strike
}

fn feed(settings: &Settings, codes: &[[u16; 4]], strike: &mut RecordedStrike) {
    struct Into<'a>(&'a mut RecordedStrike);
    impl Sink for Into<'_> {
        fn chunk(&mut self, chunk: &bead_model::Chunk) {
            let sensitive: Vec<_> = chunk.scans.iter().map(|scan| scan.sensitive()).collect();
            let wide = chunk.before.iter().chain(&chunk.scans).map(|scan| scan.wide());
            let wide: Vec<_> = wide.filter(|_| chunk.loud).collect();
            self.0.extend(&sensitive, &wide);
            self.0.chunks.push(Chunk {
                end: self.0.scans.len(),
                absorbed_measured: chunk.absorbed_measured.to_bits(),
                absorbed_predicted: chunk.absorbed_predicted.to_bits(),
            });
        }
        fn report(&mut self, report: &StrikeReport) {
            self.0.said = wire_strike(report);
            self.0.shape = Some(wire_shape(report));
        }
    }
    let mut meter = Meter::new();
    let scans: Vec<Scan> = codes.iter().copied().map(Scan::new).collect();
    meter.process(settings, 1, scans, &mut Into(strike));
    assert_eq!(meter.strikes(), 1);
}
