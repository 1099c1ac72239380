//! The strike meter: trigger, history before it, window, and the quiet that re-arms it.

use crate::quantity::{Energy, Scan};
use crate::settings::{HISTORY_MAX, Settings};
use crate::shape::Shape;
use crate::window::{StrikeReport, Window};

/// Scans in a full chunk of a window's waveform.
pub const CHUNK: usize = 32;

/// A piece of a window's waveform, with the energies absorbed by its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Number of the strike since power-up, from 0.
    pub strike: u32,
    /// Sample index of the first scan.
    pub first_index: u64,
    /// The codes, [`CHUNK`] of them but in the last chunk of a window.
    pub scans: heapless::Vec<Scan, CHUNK>,
    /// Estimate A at the last scan.
    pub absorbed_measured: Energy,
    /// Estimate B at the last scan.
    pub absorbed_predicted: Energy,
}

/// Where the meter's results go.
pub trait Sink {
    /// A piece of the waveform is complete. Pieces come in order and cover the window.
    fn chunk(&mut self, chunk: &Chunk);
    /// A window is complete; comes after its last chunk.
    fn report(&mut self, report: &StrikeReport);
    /// The shape of the window just reported; none of one longer than [`KEPT`].
    fn shape(&mut self, report: &StrikeReport, shape: &Shape);
}

/// Scans that are kept: what came before a trigger, and at a window's end the whole of it.
pub const KEPT: usize = 1024;
const _: () = assert!(HISTORY_MAX <= KEPT);

/// The last [`KEPT`] scans.
#[derive(Clone)]
struct History {
    scans: [Scan; KEPT],
    next: usize,
}

impl History {
    #[inline(always)]
    fn push(&mut self, scan: Scan) {
        self.scans[self.next] = scan;
        self.next = (self.next + 1) % KEPT;
    }

    /// The scan `ago` samples before the latest one.
    #[inline(always)]
    fn back(&self, ago: usize) -> Scan {
        self.scans[(self.next + KEPT - 1 - ago) % KEPT]
    }
}

#[derive(Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap to box it on, and one meter in all"
)]
enum Phase {
    /// Counts quiet samples until a whole history of them is there.
    Settling { quiet: u16 },
    /// Waits for a strike.
    Armed,
    /// Measures one.
    Measuring { window: Window, chunk: Chunk },
}

/// Finds strikes in the stream of scans and measures each. State only: the settings come with every sample.
#[derive(Clone)]
pub struct Meter {
    history: History,
    phase: Phase,
    strikes: u32,
}

impl Default for Meter {
    fn default() -> Self {
        Self::new()
    }
}

impl Meter {
    /// A meter that has seen nothing yet: it arms after a history's worth of quiet.
    pub const fn new() -> Self {
        const NOTHING: Scan = Scan {
            force: crate::quantity::AdcCode::new(0),
            acceleration: crate::quantity::AdcCode::new(0),
        };
        Self {
            history: History {
                scans: [NOTHING; KEPT],
                next: 0,
            },
            phase: Phase::Settling { quiet: 0 },
            strikes: 0,
        }
    }

    /// Forgets what it has seen, so that no window mixes samples from before and after a gap. The number of
    /// strikes goes on.
    pub fn restart(&mut self) {
        self.phase = Phase::Settling { quiet: 0 };
    }

    /// Strikes that have triggered so far.
    pub fn strikes(&self) -> u32 {
        self.strikes
    }

    /// Whether a strike would be measured if it came now.
    pub fn is_armed(&self) -> bool {
        matches!(self.phase, Phase::Armed)
    }

    /// Takes the scan with sample index `index`; indices are consecutive between calls of
    /// [`restart`](Self::restart).
    #[inline]
    pub fn process(&mut self, settings: &Settings, index: u64, scan: Scan, sink: &mut impl Sink) {
        self.history.push(scan);
        match &mut self.phase {
            Phase::Armed => {
                if self.rises(settings) {
                    self.open(settings, index, sink);
                }
            }
            Phase::Settling { quiet } => {
                // The first samples look back on scans from before the gap; a false rise only starts the
                // count anew.
                *quiet = quiet.saturating_add(1);
                let quiet = *quiet;
                if quiet > settings.window.lookback && self.rises(settings) {
                    self.phase = Phase::Settling { quiet: 0 };
                } else if quiet >= settings.window.history {
                    self.phase = Phase::Armed;
                }
            }
            Phase::Measuring { .. } => self.measure(settings, index, scan, sink),
        }
    }

    /// The trigger: the force has risen by the threshold since `lookback` samples ago. An offset that drifts
    /// does not matter, and a recorded window says on its own when it fires.
    #[inline(always)]
    fn rises(&self, settings: &Settings) -> bool {
        let now = self.history.back(0).force.get();
        let before = self
            .history
            .back(usize::from(settings.window.lookback))
            .force
            .get();
        now >= before.saturating_add(settings.window.threshold)
    }

    /// Opens a window and runs it through the history up to and with the scan that triggered.
    #[cold]
    fn open(&mut self, settings: &Settings, index: u64, sink: &mut impl Sink) {
        let history = settings.window.history;
        let first_index = index + 1 - u64::from(history);
        self.phase = Phase::Measuring {
            window: Window::open(self.strikes, first_index),
            chunk: Chunk {
                strike: self.strikes,
                first_index,
                scans: heapless::Vec::new(),
                absorbed_measured: Energy::ZERO,
                absorbed_predicted: Energy::ZERO,
            },
        };
        self.strikes += 1;
        for ago in (0..history).rev() {
            let scan = self.history.back(usize::from(ago));
            self.measure(settings, index - u64::from(ago), scan, sink);
        }
    }

    fn measure(&mut self, settings: &Settings, index: u64, scan: Scan, sink: &mut impl Sink) {
        let Phase::Measuring { window, chunk } = &mut self.phase else {
            return;
        };
        window.process(settings, scan);
        // There is room: a full chunk is sent and emptied below.
        let _ = chunk.scans.push(scan);
        let done = window.samples() >= settings.window.length;
        if done || chunk.scans.is_full() {
            chunk.absorbed_measured = window.absorbed_measured(settings);
            chunk.absorbed_predicted = window.absorbed_predicted(settings);
            sink.chunk(chunk);
            chunk.scans.clear();
            chunk.first_index = index + 1;
        }
        if done {
            let report = window.report(settings);
            sink.report(&report);
            let samples = usize::from(report.samples);
            if samples <= KEPT {
                let history = &self.history;
                let scans = (0..samples).rev().map(|ago| history.back(ago));
                sink.shape(&report, &Shape::of(settings, scans));
            }
            self.phase = Phase::Settling { quiet: 0 };
        }
    }
}
