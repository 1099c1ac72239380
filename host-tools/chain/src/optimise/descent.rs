//! Improving a design by Kraft's SLSQP.

use std::cell::RefCell;

use slsqp::{FailStatus, StopTols, SuccessStatus};

use super::problem::{Problem, Properties, Tried};
use super::search::Search;
use crate::simulate::SimulateError;

/// What a descent has come to; its objective function cannot return it.
struct Descent<'a> {
    best: Tried,
    spent: &'a mut usize,
    /// The evaluations are spent.
    full: bool,
    failed: Option<SimulateError>,
}

/// Change of a variable that makes a difference quotient.
const STEP: f64 = 1e-3;
/// Relative change of the share below which a descent ends.
const SETTLED: f64 = 1e-5;

impl Problem<'_> {
    /// Improves a design, until nothing near by is better or `most` evaluations are spent in all. `kinds` is how many
    /// intruders differ: one or all.
    pub(super) fn descend(
        &self,
        start: Tried,
        kinds: usize,
        most: usize,
        spent: &mut usize,
    ) -> Result<Tried, SimulateError> {
        let Search {
            mass,
            stiffness,
            damping,
            ..
        } = self.search;
        // Masses are counted in the part of the total that falls to one host, so that all variables are of order one.
        let each = self.search.total_mass / self.hosts.len() as f64;
        let to_bounds =
            |[low, high]: [f64; 2], scale: fn(f64, f64) -> f64| (scale(low, each), scale(high, each));
        let straight: fn(f64, f64) -> f64 = |value, each| value / each;
        let logarithm: fn(f64, f64) -> f64 = |value, _| value.ln();
        let bounds: Vec<(f64, f64)> = (0..kinds)
            .flat_map(|_| {
                [
                    to_bounds(*mass, straight),
                    to_bounds(*stiffness, logarithm),
                    to_bounds(*damping, logarithm),
                ]
            })
            .collect();
        let variables: Vec<f64> = start
            .design
            .iter()
            .flat_map(|[mass, stiffness, damping]| [mass / each, stiffness.ln(), damping.ln()])
            .zip(&bounds)
            .map(|(value, (low, high))| value.clamp(*low, *high))
            .collect();
        let design = |x: &[f64]| -> Vec<Properties> {
            x.chunks_exact(3)
                .map(|x| [x[0] * each, x[1].exp(), x[2].exp()])
                .collect()
        };

        let state = RefCell::new(Descent {
            best: start,
            spent,
            full: false,
            failed: None,
        });
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let state = &mut *state.borrow_mut();
            let count = if gradient.is_some() { 1 + x.len() } else { 1 };
            state.full |= *state.spent + count > most;
            let mut sets = vec![self.intruders(&design(x))];
            let mut steps = Vec::new();
            if gradient.is_some() {
                for (index, (low, high)) in bounds.iter().enumerate() {
                    // Away from the nearer bound: a step is never across it.
                    let step = if x[index] > 0.5 * (low + high) {
                        -STEP
                    } else {
                        STEP
                    };
                    let mut beside = x.to_vec();
                    beside[index] += step;
                    steps.push(step);
                    sets.push(self.intruders(&design(&beside)));
                }
            }
            let shares = if state.full || state.failed.is_some() {
                None
            } else {
                match self.shares(sets, state.spent) {
                    Ok(shares) => Some(shares),
                    Err(error) => {
                        state.failed = Some(error);
                        None
                    }
                }
            };
            // There is no other way to end the descent than that nothing gets better.
            let Some(shares) = shares else {
                if let Some(gradient) = gradient {
                    gradient.fill(0.0);
                }
                return state.best.value;
            };
            let value = self.search.aim.of(&shares[0]);
            if value < state.best.value {
                state.best.value = value;
                state.best.design = design(x);
            }
            let here = self.follow(&shares[0]);
            if let Some(gradient) = gradient {
                for (index, step) in steps.iter().enumerate() {
                    gradient[index] = (self.follow(&shares[index + 1]) - here) / step;
                }
            }
            here
        };
        let overweight = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let part = 1.0 / kinds as f64;
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                gradient.iter_mut().step_by(3).for_each(|entry| *entry = part);
            }
            let excess = x.iter().step_by(3).sum::<f64>() * part - 1.0;
            // Rounding is no excess: the descent would never think itself at its end.
            if excess.abs() < 1e-12 { 0.0 } else { excess }
        };
        let stop = StopTols {
            ftol_rel: SETTLED,
            ..StopTols::default()
        };
        let constraints: [&dyn slsqp::Func<()>; 1] = [&overweight];
        // Calls, of which none is counted in `spent` once that has come to `most`.
        let calls = most.min(1_000_000);
        let ended = slsqp::minimize(
            objective,
            &variables,
            &bounds,
            &constraints,
            (),
            calls,
            Some(stop),
        );
        let settled = match ended {
            Ok((status, ..)) => !matches!(status, SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, FailStatus::RoundoffLimited),
        };
        let mut state = state.into_inner();
        if let Some(error) = state.failed {
            return Err(error);
        }
        state.best.settled = settled && !state.full;
        Ok(state.best)
    }
}
