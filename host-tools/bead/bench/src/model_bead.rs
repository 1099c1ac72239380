//! A bead on this computer: the bit-exact code of the bead, fed with what its sensors would convert.

use bead_model::settings::Settings;
use bead_model::{Chunk, Meter, Scan, Sink};
use bead_recording::strikes::RecordedStrike;
use bead_wire::{Shape, Strike, Waveform};
use hertz_chain::Solution;

use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Sensed, Timing};

/// Time after the last strike, s: a meter measures three of every five scans, so it lags behind a window.
const TAIL: f64 = 0.02;

/// The results of a meter in their order, and the samples of the first window.
#[derive(Default)]
pub(crate) struct MeterOutput {
    first: Vec<Waveform>,
    pub(crate) reports: Vec<(Strike, Shape)>,
}

impl Sink for MeterOutput {
    fn chunk(&mut self, chunk: &Chunk) {
        if self.reports.is_empty() {
            self.first.push(chunk.into());
        }
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.reports.push((*strike, *shape));
    }
}

/// Runs the bead's code on the strikes of a simulated chain, as its front end digitises them.
fn output(
    settings: &Settings,
    front_end: &AnalogFrontEnd,
    (solution, bead): (&Solution, usize),
    timing: Timing,
    seed: u64,
) -> MeterOutput {
    let sensed = Sensed::new(solution, bead, timing);
    let codes = front_end.digitise(&sensed, timing.scans(solution.end() + TAIL), Some(seed));
    let mut output = MeterOutput::default();
    // The first scan has the index 1, as on the bead.
    Meter::new().process(settings, 1, codes.scans.into_iter().map(Scan::new), &mut output);
    output
}

/// The first strike of a bead with these settings, as a recording would have it. `None` if it finds none.
pub fn recorded(
    settings: &Settings,
    front_end: &AnalogFrontEnd,
    bead: (&Solution, usize),
    timing: Timing,
    seed: u64,
) -> Option<RecordedStrike> {
    let output = output(settings, front_end, bead, timing, seed);
    let mut strike = RecordedStrike::new(0, output.reports.first()?.0);
    strike.settings = Some(*settings);
    output.first.iter().for_each(|waveform| strike.push(waveform));
    Some(strike)
}

/// The results of a bead with these settings for the first window after each strike of a simulated chain. A
/// later window is an echo. `seed` is the seed of the noise.
pub fn measured(
    settings: &Settings,
    front_end: &AnalogFrontEnd,
    bead: (&Solution, usize),
    timing: Timing,
    seed: u64,
) -> Vec<(Strike, Shape)> {
    let mut reports = output(settings, front_end, bead, timing, seed).reports;
    let (starts, mut begun) = (timing.starts(1.0), 0);
    reports.retain(|(strike, _)| {
        let now = starts.partition_point(|start| *start <= strike.trigger_index as f64);
        std::mem::replace(&mut begun, now) != now
    });
    reports
}
