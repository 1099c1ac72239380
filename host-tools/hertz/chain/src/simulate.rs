//! Runs a scenario and keeps its motion.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use crate::options::MOST_VALUES;
pub use crate::options::{Accuracy, Options, SimulateError};
use crate::run::Run;
use crate::scenario::Scenario;
use crate::solution::Solution;
use crate::solver::StepLog;
use crate::summariser::Summariser;
use crate::summary::{SolverSummary, Summary};

/// Integrates a scenario over its duration at [`Accuracy::REFERENCE`].
///
/// # Errors
/// [`SimulateError`]: the scenario is out of range, or the integration cannot go on.
pub fn simulate(scenario: &Scenario) -> Result<Solution, SimulateError> {
    simulate_with(scenario, &Options::default())
}

/// Integrates a scenario with these options.
///
/// # Errors
/// [`SimulateError`]: the scenario or an option is out of range, or the integration cannot go on.
pub fn simulate_with(scenario: &Scenario, options: &Options<'_>) -> Result<Solution, SimulateError> {
    let clock = Instant::now();
    let (end, mut run) = ready(scenario, options)?;
    let (mut times, mut state) = (vec![run.time()], run.model.initial());
    let (mut states, mut log) = (state.clone(), StepLog::of_run());
    // A step ends where the scenario does, so the summary covers whole steps.
    let covered = scenario.duration.min(end);
    while run.time() < end {
        let from = run.time();
        run.advance(if from < covered { covered } else { end })?;
        run.stepper.record(from, &mut log);
        run.stepper.state(&mut state);
        let time = run.time();
        times.push(time);
        states.extend_from_slice(&state);
        if states.len() + log.size() > MOST_VALUES {
            return Err(SimulateError::TooLong { time, end });
        }
        options.report(run.steps(), time / end);
    }
    let solver = SolverSummary {
        steps: run.steps(),
        evaluations: run.evaluations(),
        seconds: clock.elapsed().as_secs_f64(),
    };
    Ok(Solution {
        model: run.model,
        lanes: run.stepper.lanes,
        accuracy: options.accuracy,
        times,
        states,
        log,
        covered,
        solver,
        summary: OnceLock::new(),
    })
}

/// Returns the end of a run that keeps its motion, s, and the run before its first step.
fn ready(scenario: &Scenario, options: &Options<'_>) -> Result<(f64, Run), SimulateError> {
    scenario.check()?;
    let end = options.end(scenario)?;
    let longest_step = options.accuracy.longest_step;
    let run = Run::new(scenario, options.accuracy)?;
    run.check(end, longest_step)?;
    let values = run.fewest_steps(end, longest_step) * run.model().layout().dimension() as f64;
    if values > MOST_VALUES as f64 {
        return Err(SimulateError::TooLong { time: 0.0, end });
    }
    Ok((end, run))
}

impl Solution {
    /// Peaks, final state and energies of the run, from t = 0 to the scenario's end (or to the run's, if that
    /// is earlier). They are those that [`summarise`](crate::summarise()) finds, bit for bit, and the first
    /// call takes as long.
    pub fn summary(&self) -> Summary {
        let find = || {
            let start = self.model.initial();
            let run = Run::start(Arc::clone(&self.model), (0.0, &start), self.accuracy);
            let mut run = run.expect("this accuracy was used before");
            let mut summariser = Summariser::new(&mut run);
            run.watch(self.covered, |step| summariser.observe(step))
                .expect("the same steps were made before");
            let mut summary = summariser.summary(&mut run);
            summary.solver = self.solver;
            summary
        };
        self.summary.get_or_init(find).clone()
    }
}

impl Options<'_> {
    /// Checks a scenario as [`simulate_with`] does before its first step, for programs with many runs.
    ///
    /// # Errors
    /// [`SimulateError`]: the scenario or an option is out of range, or the run would take too long.
    pub fn check(&self, scenario: &Scenario) -> Result<(), SimulateError> {
        ready(scenario, self).map(|_| ())
    }
}
