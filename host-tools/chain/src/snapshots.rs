//! Whole snapshots at equal intervals, taken while a run goes on: what a [`Solution`](crate::Solution) gives
//! at these times, bit for bit, with nothing kept but one state.

use crate::run::{Run, Step};
use crate::solution::Snapshot;
use crate::solver::Dense;

/// Snapshots of a [`Run`], every so often from where it is to an end.
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
    /// The next one.
    next: u64,
    /// How many there are up to the end.
    rows: u64,
    /// The state where the next step begins.
    state: Vec<f64>,
}

impl Snapshots {
    /// Snapshots at the multiples of 1/`rate`, `rate` in Hz, up to `end`, s, where the run must end a step.
    ///
    /// # Panics
    /// If the rate is not above zero.
    pub fn new(run: &mut Run, rate: f64, end: f64) -> Self {
        assert!(rate > 0.0, "snapshots need a rate above zero, not {rate} Hz");
        let mut state = vec![0.0; run.model().layout().dimension()];
        run.write_state(&mut state);
        Self {
            rate,
            end,
            next: (run.time() * rate * (1.0 - 1e-12)).ceil() as u64,
            // Rounding must not lose a last one that falls on the end.
            rows: (end * rate * (1.0 + 1e-12)).floor() as u64 + 1,
            state,
        }
    }

    /// How many have been taken, from t = 0 on.
    pub fn count(&self) -> u64 {
        self.next
    }

    /// Takes those of a step: all of them, in order.
    pub fn observe(&mut self, step: &mut Step<'_>, mut take: impl FnMut(&Snapshot<'_>)) {
        let (from, to) = (step.from(), step.to());
        let (lanes, tolerance) = step.method();
        let model = step.model();
        let mut dense = None;
        while self.next < self.rows {
            let time = (self.next as f64 / self.rate).min(self.end).max(from);
            // The next step begins with what falls on its beginning.
            if time > to || (time == to && to < self.end) {
                break;
            }
            let again = || Dense::new(&lanes, model.layout(), (from, to), &self.state, tolerance);
            let mut state = vec![0.0; self.state.len()];
            dense.get_or_insert_with(again).at(time, &mut state);
            take(&Snapshot::new(step.shared_model(), time, state));
            self.next += 1;
        }
        drop(dense);
        step.write_state(&mut self.state);
    }
}
