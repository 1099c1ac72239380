//! The runs of the figures. Each scenario is run once for all figures of a plate that need it.

use std::any::Any;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hertz_chain::{Scenario, Solution, Summary, simulate};

use crate::error::Error;

/// A run and its summary.
#[derive(Debug)]
pub(crate) struct FigureRun {
    /// The motion.
    pub(crate) solution: Solution,
    /// Peaks and energies.
    pub(crate) summary: Summary,
}

/// Errors of the conservation laws in a run, or in the worst of several.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LawErrors {
    /// Error of the energy balance, as a part of the striker's energy.
    pub(crate) balance: f64,
    /// Error of the momentum, as a part of the striker's.
    pub(crate) momentum: f64,
}

/// A result computed from a run, and how well the laws held in the run.
type KeptResult = (Arc<dyn Any + Send + Sync>, LawErrors);

/// Runs scenarios and keeps their results.
#[derive(Default)]
pub struct Lab {
    kept: Mutex<HashMap<String, KeptResult>>,
    /// Errors of the runs that the current figure has used.
    used: Mutex<HashMap<String, LawErrors>>,
}

impl std::fmt::Debug for Lab {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Lab").finish_non_exhaustive()
    }
}

impl Lab {
    /// Drops the kept results, which the next figures do not need.
    pub fn clear(&self) {
        lock(&self.kept).clear();
    }

    /// Begins a new figure.
    pub(crate) fn begin(&self) {
        lock(&self.used).clear();
    }

    /// The number of runs of the current figure, and how well the laws held in the worst; `None` if the
    /// figure used no run.
    pub(crate) fn worst(&self) -> Option<(usize, LawErrors)> {
        let used = lock(&self.used);
        let worst = |of: fn(&LawErrors) -> f64| used.values().map(of).fold(0.0, f64::max);
        let (balance, momentum) = (worst(|errors| errors.balance), worst(|errors| errors.momentum));
        (!used.is_empty()).then_some((used.len(), LawErrors { balance, momentum }))
    }

    /// The whole motion of a scenario.
    pub(crate) fn run(&self, scenario: &Scenario) -> Result<Arc<FigureRun>, Error> {
        self.keep("run", scenario, |run| run)
    }

    /// Returns the result of `reduce` for a scenario's run. The run itself is not kept, as the runs of a
    /// sweep would fill the memory. `tag` names what `reduce` does.
    pub(crate) fn keep<T: Any + Send + Sync>(
        &self,
        tag: &str,
        scenario: &Scenario,
        reduce: impl FnOnce(FigureRun) -> T,
    ) -> Result<Arc<T>, Error> {
        let scenario_text =
            serde_json::to_string(scenario).expect("a scenario has no map with keys that are no text");
        let key = format!("{tag} {scenario_text}");
        // The lock is not held while the scenario runs, so that other scenarios run at the same time.
        let found = lock(&self.kept).get(&key).cloned();
        let (value, errors) = match found {
            Some(kept) => kept,
            None => {
                let solution = simulate(scenario)?;
                let summary = solution.summary();
                let errors = LawErrors {
                    balance: summary.energy.balance_error,
                    momentum: momentum_error(&solution),
                };
                let kept: KeptResult = (Arc::new(reduce(FigureRun { solution, summary })), errors);
                lock(&self.kept).insert(key.clone(), kept.clone());
                kept
            }
        };
        lock(&self.used).insert(key, errors);
        Ok(value.downcast().expect("a tag names one kind of result"))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // After a panic every entry is whole, as each is inserted at once.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Times at which the momentum of a run is checked.
const LOOKS: usize = 64;

/// Greatest error of the momentum, as a part of the striker's: the total of two bodies that meet may be zero.
fn momentum_error(solution: &Solution) -> f64 {
    let model = solution.model();
    let scale = (model.mass(0) * model.striker_speed()).abs();
    let mut sampler = solution.sampler();
    let start = sampler.at(0.0).momentum();
    (1..=LOOKS)
        .map(|look| sampler.at(solution.end() * look as f64 / LOOKS as f64).momentum())
        .map(|momentum| (momentum - start).abs() / scale)
        .fold(0.0, f64::max)
}
