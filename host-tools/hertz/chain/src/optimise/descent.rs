//! Improves a design by Kraft's SLSQP method.

use std::cell::RefCell;

use slsqp::{FailStatus, StopTols, SuccessStatus};

use super::objective::Objective;
use super::problem::{Problem, TriedDesign};
use super::variables::Variables;
use crate::simulate::SimulateError;

/// Relative change of the share below which a descent ends.
const SETTLED: f64 = 1e-9;
/// Shares are smooth to this, so a share so little above its bound is at it.
const SMOOTH: f64 = 1e-7;
/// Least gain for which a descent is restarted from its end, without its estimate of the curvature.
const GAINED: f64 = 1e-6;

impl Problem<'_> {
    /// Improves a design until no design near it is better, or until `most` evaluations have been made.
    /// Intruders stay alike if the design has one entry.
    pub(super) fn descend(&self, start: TriedDesign, most: usize) -> Result<TriedDesign, SimulateError> {
        let mut sofar = self.sofar.get();
        sofar.descents += 1;
        self.tell(sofar);
        let full = sofar.evaluations + most.min(self.left());
        let mut best = start;
        loop {
            let before = best.value;
            best = self.follow_down(best, full)?;
            if !best.settled || before - best.value < GAINED {
                return Ok(best);
            }
        }
    }

    /// Runs the method once, up to a total of `full` evaluations.
    ///
    /// The greatest of several values has kinks, on which a descent would stop short. It is found as the
    /// least bound t with every value below it: t is one more variable, and each value a constraint.
    fn follow_down(&self, start: TriedDesign, full: usize) -> Result<TriedDesign, SimulateError> {
        let variables = Variables::new(self.search, start.design.len());
        let mut first = variables.of(&start.design);
        let mut bounds = variables.bounds.clone();
        let corners = self.search.spread.corners().len();
        let parts = self.search.parts(&vec![0.0; corners * self.speeds.len()]).len();
        let bounded = parts > 1;
        if bounded {
            // A fresh start has not been tried. No share of energy is above 1, and a design that doubles what
            // it is to make small is no start.
            first.push(start.value.min(1.0));
            let most = if self.search.objective == Objective::Remaining {
                1.0
            } else {
                2.0
            };
            bounds.push((0.0, most));
        }
        let descent = RefCell::new(Descent {
            problem: self,
            variables: &variables,
            most: full,
            best: start,
            full: false,
            failed: None,
            known: None,
        });
        let mean = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            descent
                .borrow_mut()
                .aim(x, gradient, |shares| self.search.value(shares))
        };
        let bound = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let last = x.len() - 1;
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                gradient[last] = 1.0;
            }
            x[last]
        };
        let above = |part: usize| {
            let descent = &descent;
            move |x: &[f64], mut gradient: Option<&mut [f64]>, _: &mut ()| {
                let (bound, x) = x.split_last().expect("the bound is the last variable");
                if let Some(last) = gradient.as_mut().and_then(|gradient| gradient.last_mut()) {
                    *last = -1.0;
                }
                let free = gradient.map(|gradient| &mut gradient[..x.len()]);
                let share = descent
                    .borrow_mut()
                    .aim(x, free, |shares| self.search.parts(shares)[part]);
                if (share - bound).abs() < SMOOTH {
                    0.0
                } else {
                    share - bound
                }
            }
        };
        let above: Vec<_> = (0..parts).map(above).collect();
        let too_heavy = |x: &[f64], mut gradient: Option<&mut [f64]>, _: &mut ()| {
            if let Some(gradient) = &mut gradient {
                gradient.fill(0.0);
            }
            let free = variables.bounds.len();
            variables.overweight(&x[..free], gradient.map(|gradient| &mut gradient[..free]))
        };
        let mut constraints = vec![&too_heavy as &dyn slsqp::Func<()>];
        if bounded {
            constraints.extend(above.iter().map(|above| above as &dyn slsqp::Func<()>));
        }
        let objective: &dyn slsqp::Func<()> = if bounded { &bound } else { &mean };
        let ended = slsqp::minimize(
            objective,
            &first,
            &bounds,
            &constraints,
            (),
            // Calls after the last evaluation cost nothing, so this limit never ends a descent early.
            full.min(1_000_000),
            Some(StopTols {
                // A bound moves with the noise of the shares that touch it.
                ftol_rel: if bounded { SMOOTH } else { SETTLED },
                ..StopTols::default()
            }),
        );
        let settled = match ended {
            Ok((status, ..)) => !matches!(status, SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, FailStatus::RoundoffLimited),
        };
        let mut ended = descent.into_inner();
        ended.best.settled = settled && !ended.full;
        ended.failed.map_or(Ok(ended.best), Err)
    }
}

/// Shares at a place of the variables, and on demand beside it.
struct KnownShares {
    x: Vec<f64>,
    /// One for each strike.
    shares: Vec<f64>,
    /// Of each variable: the shares to either side, and their distance in it.
    beside: Option<Vec<([Vec<f64>; 2], f64)>>,
}

/// State of a descent, which the objective function cannot return.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    variables: &'a Variables<'a>,
    /// Most evaluations of the whole search.
    most: usize,
    best: TriedDesign,
    /// True once the evaluations are spent or the search was asked to stop.
    full: bool,
    failed: Option<SimulateError>,
    /// The last place: objective and constraints ask for the same one in turn.
    known: Option<KnownShares>,
}

impl Descent<'_> {
    /// Returns a number made of the shares at `x`, and writes its derivatives if they are wanted.
    fn aim(&mut self, x: &[f64], gradient: Option<&mut [f64]>, of: impl Fn(&[f64]) -> f64) -> f64 {
        let (worst, with_slopes) = (self.best.value, gradient.is_some());
        let Some(known) = self.known(x, with_slopes) else {
            // An objective function cannot stop the descent, but a constant value ends it.
            gradient.into_iter().for_each(|gradient| gradient.fill(0.0));
            return worst;
        };
        let beside = known.beside.iter().flatten();
        let slopes = beside.map(|([low, high], apart)| (of(high) - of(low)) / apart);
        for (entry, slope) in gradient.into_iter().flatten().zip(slopes) {
            *entry = slope;
        }
        of(&known.shares)
    }

    /// Returns the shares at `x`, and beside it if wanted; `None` once the search is spent, stopped, or has
    /// failed.
    fn known(&mut self, x: &[f64], with_slopes: bool) -> Option<&KnownShares> {
        let suffices = |known: &KnownShares| known.x == x && (known.beside.is_some() || !with_slopes);
        if !self.known.as_ref().is_some_and(suffices) {
            self.known = Some(self.evaluate(x, with_slopes)?);
        }
        self.known.as_ref()
    }

    fn evaluate(&mut self, x: &[f64], with_slopes: bool) -> Option<KnownShares> {
        let beside = if with_slopes {
            self.variables.beside(x)
        } else {
            Vec::new()
        };
        let mut shares = self.shares(x, &beside)?.into_iter();
        let here = shares.next()?;
        let problem = self.problem;
        let value = problem.search.value(&here);
        // A fresh start may be slightly too heavy, where its masses were raised to the least.
        if value < self.best.value && self.variables.overweight(x, None) <= 1e-9 {
            self.best.value = value;
            self.best.design = self.variables.design(x);
            problem.note(value);
        }
        let pair = |(_, apart): &([Vec<f64>; 2], f64)| Some(([shares.next()?, shares.next()?], *apart));
        let beside = with_slopes.then(|| beside.iter().map_while(pair).collect());
        Some(KnownShares {
            x: x.to_vec(),
            shares: here,
            beside,
        })
    }

    /// Returns the shares at `x`, then beside it; `None` once the search is spent, stopped, or has failed.
    fn shares(&mut self, x: &[f64], beside: &[([Vec<f64>; 2], f64)]) -> Option<Vec<Vec<f64>>> {
        let made = self.problem.sofar.get().evaluations;
        self.full |= made + 1 + 2 * beside.len() > self.most;
        if self.full || self.failed.is_some() {
            return None;
        }
        let beside = beside.iter().flat_map(|(pair, _)| pair).map(Vec::as_slice);
        let all = std::iter::once(x).chain(beside);
        let designs: Vec<_> = all.map(|x| self.variables.design(x)).collect();
        match self.problem.shares(&designs) {
            Ok(shares) if shares.len() == designs.len() => Some(shares),
            Ok(_) => {
                self.full = true;
                None
            }
            Err(error) => {
                self.failed = Some(error);
                None
            }
        }
    }
}
