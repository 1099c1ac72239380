//! Improving a design by Kraft's SLSQP.

use std::cell::RefCell;

use slsqp::{FailStatus, StopTols, SuccessStatus};

use super::problem::{Problem, Properties, Tried};
use super::search::Search;
use crate::simulate::SimulateError;

/// Change of a variable that makes a difference quotient.
const STEP: f64 = 1e-3;
/// Relative change of the share below which a descent ends.
const SETTLED: f64 = 1e-5;

impl Problem<'_> {
    /// Improves a design until nothing near it is better, or until `most` evaluations are `spent` in all. The
    /// intruders stay alike if the design has one entry.
    pub(super) fn descend(
        &self,
        start: Tried,
        most: usize,
        spent: &mut usize,
    ) -> Result<Tried, SimulateError> {
        let variables = Variables::new(self.search, start.design.len());
        let first = variables.of(&start.design);
        let descent = RefCell::new(Descent {
            problem: self,
            variables: &variables,
            most,
            best: start,
            spent,
            full: false,
            failed: None,
        });
        let ended = slsqp::minimize(
            |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| descent.borrow_mut().value(x, gradient),
            &first,
            &variables.bounds,
            &[&overweight as &dyn slsqp::Func<()>],
            (),
            // Calls. Those after `most` evaluations cost nothing, so the budget never ends a descent before
            // its time.
            most.min(1_000_000),
            Some(StopTols {
                ftol_rel: SETTLED,
                ..StopTols::default()
            }),
        );
        let settled = match ended {
            Ok((status, ..)) => !matches!(status, SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, FailStatus::RoundoffLimited),
        };
        let Descent {
            mut best,
            full,
            failed,
            ..
        } = descent.into_inner();
        best.settled = settled && !full;
        failed.map_or(Ok(best), Err)
    }
}

/// The variables of a descent, three for each entry of a design. All are of order one: the mass in parts of
/// the total that falls to one host, and the logarithms of stiffness and damping.
struct Variables {
    /// The part of the total mass that falls to one host, kg.
    each: f64,
    bounds: Vec<(f64, f64)>,
}

impl Variables {
    fn new(search: &Search, entries: usize) -> Self {
        let each = search.total_mass / search.hosts.len() as f64;
        let bounds = [
            search.mass.map(|mass| mass / each),
            search.stiffness.map(f64::ln),
            search.damping.map(f64::ln),
        ];
        Self {
            each,
            bounds: bounds.map(|[low, high]| (low, high)).repeat(entries),
        }
    }

    /// The variables of a design, moved into the bounds.
    fn of(&self, design: &[Properties]) -> Vec<f64> {
        let free = design
            .iter()
            .flat_map(|[mass, stiffness, damping]| [mass / self.each, stiffness.ln(), damping.ln()]);
        free.zip(&self.bounds)
            .map(|(value, (low, high))| value.clamp(*low, *high))
            .collect()
    }

    fn design(&self, x: &[f64]) -> Vec<Properties> {
        x.chunks_exact(3)
            .map(|x| [x[0] * self.each, x[1].exp(), x[2].exp()])
            .collect()
    }

    /// Steps to designs beside `x`, one for each variable. Each goes away from the nearer bound, so none
    /// crosses it.
    fn steps(&self, x: &[f64]) -> Vec<f64> {
        let away = |(x, (low, high)): (&f64, &(f64, f64))| if *x > 0.5 * (low + high) { -STEP } else { STEP };
        x.iter().zip(&self.bounds).map(away).collect()
    }
}

/// What a descent has come to. The objective function cannot return it.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    variables: &'a Variables,
    most: usize,
    best: Tried,
    spent: &'a mut usize,
    /// The evaluations are spent.
    full: bool,
    failed: Option<SimulateError>,
}

impl Descent<'_> {
    /// The smooth aim at `x`, and its derivatives where they are asked for.
    fn value(&mut self, x: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let steps = gradient
            .as_ref()
            .map_or_else(Vec::new, |_| self.variables.steps(x));
        let Some(shares) = self.shares(x, &steps) else {
            // No objective function can stop the descent. A value that no longer changes does.
            gradient.into_iter().for_each(|gradient| gradient.fill(0.0));
            return self.best.value;
        };
        let problem = self.problem;
        let value = problem.search.aim.of(&shares[0]);
        if value < self.best.value {
            self.best.value = value;
            self.best.design = self.variables.design(x);
        }
        let here = problem.follow(&shares[0]);
        let slopes = shares[1..].iter().zip(&steps);
        let slopes = slopes.map(|(beside, step)| (problem.follow(beside) - here) / step);
        for (entry, slope) in gradient.into_iter().flatten().zip(slopes) {
            *entry = slope;
        }
        here
    }

    /// Shares at `x`, then a step beside it in each variable; none once the evaluations are spent or a run
    /// has failed.
    fn shares(&mut self, x: &[f64], steps: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.full |= *self.spent + 1 + steps.len() > self.most;
        if self.full || self.failed.is_some() {
            return None;
        }
        let intruders = |x: &[f64]| self.problem.intruders(&self.variables.design(x));
        let beside = steps.iter().enumerate().map(|(index, step)| {
            let mut beside = x.to_vec();
            beside[index] += step;
            intruders(&beside)
        });
        let sets = std::iter::once(intruders(x)).chain(beside).collect();
        let shares = self.problem.shares(sets, self.spent);
        shares.map_err(|error| self.failed = Some(error)).ok()
    }
}

/// How much the intruders of a design weigh over the bound on their sum, as a part of it; at most 0 where it
/// is kept.
fn overweight(x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()) -> f64 {
    let part = 1.0 / (x.len() / 3) as f64;
    if let Some(gradient) = gradient {
        gradient.fill(0.0);
        gradient.iter_mut().step_by(3).for_each(|entry| *entry = part);
    }
    let excess = x.iter().step_by(3).sum::<f64>() * part - 1.0;
    // Rounding is no excess: the descent would never find its end.
    if excess.abs() < 1e-12 { 0.0 } else { excess }
}
