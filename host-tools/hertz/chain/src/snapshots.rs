//! Snapshots at equal intervals, taken during a run. They equal those of a [`Solution`](crate::Solution) bit
//! for bit, and only one state is kept.

use crate::run::{Run, RunStep};
use crate::solution::Snapshot;
use crate::solver::{Dense, StepLog};

/// Snapshots of a [`Run`] at equal intervals, from its present time to an end.
///
/// ```
/// use hertz_chain::{Accuracy, Run, Scenario, Snapshots};
///
/// let mut run = Run::new(&Scenario::paper(), Accuracy::DRAFT)?;
/// let mut snapshots = Snapshots::new(&mut run, 1e5, 4e-3);
/// let mut greatest = 0.0_f64;
/// run.watch(4e-3, |step| {
///     snapshots.observe(step, |at| greatest = greatest.max(at.energies().chain));
/// })?;
/// assert_eq!(snapshots.count(), 401);
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Snapshots {
    rate: f64,
    end: f64,
    /// Number of the next snapshot.
    next: u64,
    /// Number of snapshots up to the end, counted from t = 0.
    rows: u64,
    /// State at the start of the next step.
    state: Vec<f64>,
    /// The last step with a snapshot.
    log: StepLog,
    dense: Dense,
}

impl Snapshots {
    /// Snapshots at the multiples of 1/`rate`, with `rate` in Hz, up to `end`, s, where the run must end a
    /// step.
    ///
    /// # Panics
    /// If the rate is not above zero.
    pub fn new(run: &mut Run, rate: f64, end: f64) -> Self {
        assert!(rate > 0.0, "snapshots need a rate above zero, not {rate} Hz");
        Self {
            rate,
            end,
            next: (run.time() * rate * (1.0 - 1e-12)).ceil() as u64,
            // Rounding must not lose a last snapshot at the end.
            rows: (end * rate * (1.0 + 1e-12)).floor() as u64 + 1,
            state: run.snapshot().state,
            log: StepLog::default(),
            dense: Dense::new(&run.stepper.lanes, run.model.layout()),
        }
    }

    /// Number of snapshots taken, counted from t = 0.
    pub fn count(&self) -> u64 {
        self.next
    }

    /// Calls `take` with the snapshots of a step. Must be called with each step of the run, in order.
    pub fn observe(&mut self, step: &mut RunStep<'_>, mut take: impl FnMut(&Snapshot<'_>)) {
        let (from, to) = (step.from(), step.to());
        let (model, stepper) = (&step.run.model, &mut step.run.stepper);
        self.log.clear();
        while self.next < self.rows {
            let time = (self.next as f64 / self.rate).min(self.end).max(from);
            // A snapshot at the end of a step belongs to the next.
            if time > to || (time == to && to < self.end) {
                break;
            }
            if self.log.count() == 0 {
                stepper.record(from, &mut self.log);
                self.dense.load(&self.log, 0, &self.state);
            }
            let mut state = Vec::with_capacity(self.state.len());
            self.dense.at(time, &mut state);
            take(&Snapshot { model, time, state });
            self.next += 1;
        }
        stepper.state(&mut self.state);
    }
}
