//! A bead on this computer: the bit-exact code of the bead on what its sensors convert.

use bead_model::settings::Settings;
use bead_model::{Chunk, Meter, Scan, Sink};
use bead_recording::strikes::RecordedStrike;
use bead_wire::{Shape, Strike, Waveform};
use hertz_chain::Solution;

use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Sensed, Timing};

/// Time after the last strike, s: a meter measures three of five scans that come, so it lags behind a window.
const TAIL: f64 = 0.02;

/// A strike as it would be recorded: the samples of the first window, and its result.
#[derive(Default)]
struct FirstWindow {
    chunks: Vec<Chunk>,
    strike: Option<Strike>,
}

impl Sink for FirstWindow {
    fn chunk(&mut self, chunk: &Chunk) {
        if self.strike.is_none() {
            self.chunks.push(chunk.clone());
        }
    }

    fn report(&mut self, strike: &Strike, _: &Shape) {
        self.strike.get_or_insert(*strike);
    }
}

/// The first strike of a bead with these settings, as a recording would have it. `None` if it finds none.
pub fn recorded(
    settings: &Settings,
    front_end: &AnalogFrontEnd,
    (solution, bead): (&Solution, usize),
    timing: Timing,
    seed: u64,
) -> Option<RecordedStrike> {
    let sensed = Sensed::new(solution, bead, timing);
    let codes = front_end.digitise(&sensed, timing.scans(solution.end() + TAIL), Some(seed));
    let (mut meter, mut first) = (Meter::new(), FirstWindow::default());
    meter.process(settings, 1, codes.scans.into_iter().map(Scan::new), &mut first);
    let mut strike = RecordedStrike::new(0, first.strike?);
    strike.settings = Some(*settings);
    for chunk in &first.chunks {
        strike.push(&Waveform::from(chunk));
    }
    Some(strike)
}

/// Results in the order in which the meter gives them.
struct Reports(Vec<(Strike, Shape)>);

impl Sink for Reports {
    fn chunk(&mut self, _: &Chunk) {}

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.0.push((*strike, *shape));
    }
}

/// The results of a bead with these settings for the first window after each strike of a simulated chain. A
/// later window is an echo. `seed` is that of the noise.
pub fn measured(
    settings: &Settings,
    front_end: &AnalogFrontEnd,
    (solution, bead): (&Solution, usize),
    timing: Timing,
    seed: u64,
) -> Vec<(Strike, Shape)> {
    let sensed = Sensed::new(solution, bead, timing);
    let codes = front_end.digitise(&sensed, timing.scans(solution.end() + TAIL), Some(seed));
    let (mut meter, mut reports) = (Meter::new(), Reports(Vec::new()));
    // The first scan has the index 1, as on the bead.
    meter.process(settings, 1, codes.scans.into_iter().map(Scan::new), &mut reports);
    let (starts, mut begun) = (timing.starts(1.0), 0);
    reports.0.retain(|(strike, _)| {
        let now = starts.partition_point(|start| *start <= strike.trigger_index as f64);
        std::mem::replace(&mut begun, now) != now
    });
    reports.0
}
