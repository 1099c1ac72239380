//! Runs a scenario and keeps its motion.

use std::time::Instant;

use crate::options::MOST_VALUES;
pub use crate::options::{Accuracy, Options, SimulateError};
use crate::run::{Run, Step};
use crate::scenario::Scenario;
use crate::solution::Solution;
use crate::summariser::Summariser;
use crate::summary::SolverSummary;

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
    let mut summariser = Summariser::new(&mut run);
    let mut record = Record::new(&run, end, options.progress);
    // A step ends where the scenario does, so the summary covers whole steps.
    let covered = scenario.duration.min(end);
    record.extend(&mut run, covered, |step| summariser.observe(step))?;
    let mut summary = summariser.summary(&mut run);
    record.extend(&mut run, end, |_| ())?;
    if let Some(progress) = options.progress {
        progress(1.0);
    }
    summary.solver = SolverSummary {
        steps: run.steps(),
        evaluations: run.evaluations(),
        seconds: clock.elapsed().as_secs_f64(),
    };
    Ok(Solution {
        model: run.shared_model(),
        lanes: run.lanes(),
        tolerance: options.accuracy.tolerance,
        times: record.times,
        states: record.states,
        summary,
    })
}

/// The state at the end of each step of a run.
struct Record<'a> {
    /// s.
    times: Vec<f64>,
    /// One after another, each as long as `state`.
    states: Vec<f64>,
    state: Vec<f64>,
    /// Last time of the run, s.
    end: f64,
    progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl<'a> Record<'a> {
    fn new(run: &Run, end: f64, progress: Option<&'a (dyn Fn(f64) + Sync)>) -> Self {
        let state = run.model().initial();
        Self {
            times: vec![run.time()],
            states: state.clone(),
            state,
            end,
            progress,
        }
    }

    /// Runs to `stop`, s, and calls `observe` with each step.
    fn extend(
        &mut self,
        run: &mut Run,
        stop: f64,
        mut observe: impl FnMut(&mut Step<'_>),
    ) -> Result<(), SimulateError> {
        while run.time() < stop {
            let mut step = run.step(stop)?;
            observe(&mut step);
            step.write_state(&mut self.state);
            let time = step.to();
            self.times.push(time);
            self.states.extend_from_slice(&self.state);
            if self.states.len() > MOST_VALUES {
                let end = self.end;
                return Err(SimulateError::TooLong { time, end });
            }
            if let Some(progress) = self.progress
                && self.times.len().is_multiple_of(64)
            {
                progress(time / self.end);
            }
        }
        Ok(())
    }
}

/// Returns the end of a run that keeps its motion, s, and the run before its first step.
fn ready(scenario: &Scenario, options: &Options<'_>) -> Result<(f64, Run), SimulateError> {
    scenario.check()?;
    let end = options.end(scenario)?;
    let Accuracy { longest_step, .. } = options.accuracy;
    options.accuracy.check()?;
    let run = Run::new(scenario, options.accuracy)?;
    run.check(end, longest_step)?;
    let values = run.fewest_steps(end, longest_step) * run.model().layout().dimension() as f64;
    if values > MOST_VALUES as f64 {
        return Err(SimulateError::TooLong { time: 0.0, end });
    }
    Ok((end, run))
}

impl Options<'_> {
    /// Checks a scenario as [`simulate_with`] does before its first step, for a program with many runs to
    /// make.
    ///
    /// # Errors
    /// [`SimulateError`]: the scenario or an option is out of range, or it is clear that the run takes too
    /// long.
    pub fn check(&self, scenario: &Scenario) -> Result<(), SimulateError> {
        ready(scenario, self).map(|_| ())
    }
}
