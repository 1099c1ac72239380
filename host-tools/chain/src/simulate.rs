//! Running a scenario.

use std::time::Instant;

use crate::options::MOST_VALUES;
pub use crate::options::{Accuracy, Options, SimulateError};
use crate::run::Run;
use crate::scenario::{InputError, Scenario};
use crate::solution::Solution;

/// Integrates a scenario over its duration at [`Accuracy::REFERENCE`].
///
/// # Errors
/// [`SimulateError`]: the scenario is out of range, or the integration cannot go on.
pub fn simulate(scenario: &Scenario) -> Result<Solution, SimulateError> {
    simulate_with(scenario, &Options::default())
}

/// Integrates a scenario as the options say.
///
/// # Errors
/// [`SimulateError`]: the scenario or an option is out of range, or the integration cannot go on.
pub fn simulate_with(scenario: &Scenario, options: &Options<'_>) -> Result<Solution, SimulateError> {
    let clock = Instant::now();
    let (end, mut run) = ready(scenario, options)?;
    let mut state = run.model().initial();
    let mut times = vec![run.time()];
    let mut states = state.clone();
    let progress = |part| options.progress.iter().for_each(|told| told(part));
    // A step ends where the scenario does, so that the summary never looks inside one.
    let covered = scenario.duration.min(end);
    let mut summary_end = 0;
    for stop in [covered, end] {
        while run.time() < stop {
            run.advance(stop)?;
            let time = run.time();
            times.push(time);
            run.write_state(&mut state);
            states.extend_from_slice(&state);
            if states.len() > MOST_VALUES {
                return Err(SimulateError::TooLong { time, end });
            }
            if times.len().is_multiple_of(64) {
                progress(time / end);
            }
        }
        if stop == covered {
            summary_end = times.len() - 1;
        }
    }
    progress(1.0);
    Ok(Solution {
        model: run.shared_model(),
        lanes: run.lanes(),
        tolerance: options.accuracy.tolerance,
        times,
        states,
        summary_end,
        evaluations: run.evaluations(),
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// When a run that keeps everything ends, and the run before its first step.
fn ready(scenario: &Scenario, options: &Options<'_>) -> Result<(f64, Run), SimulateError> {
    scenario.check()?;
    let end = options.duration.unwrap_or(scenario.duration);
    if !(end.is_finite() && end > 0.0) {
        let what = format!("{end} s cannot be simulated");
        return Err(InputError::at("duration", what, "give a number above zero").into());
    }
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
    /// Refuses what [`simulate_with`] would refuse before its first step, for one who has many runs to make.
    ///
    /// # Errors
    /// [`SimulateError`]: the scenario or an option is out of range, or it is clear that the run takes too
    /// long.
    pub fn check(&self, scenario: &Scenario) -> Result<(), SimulateError> {
        ready(scenario, self).map(|_| ())
    }
}
