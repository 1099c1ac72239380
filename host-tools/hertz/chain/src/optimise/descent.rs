//! Improves a design by Kraft's SLSQP method.

use std::cell::RefCell;

use slsqp::{FailStatus, StopTols, SuccessStatus};

use super::bounds::{Bounds, overreaches};
use super::design::Design;
use super::objective::Objective;
use super::problem::{DesignValues, Problem, TriedDesign};
use super::search::Search;
use super::variables::Variables;
use crate::simulate::SimulateError;

/// Gradients without a gain after which a descent ends: between kinks it could wander forever.
const PATIENCE: usize = 30;
/// Gradients over whose gain a descent that keeps all limits is judged, and the gain below which it ends.
const WINDOW: usize = 10;
const GAINED: f64 = 1e-6;
/// Number of such gains by which a descent may be above its rival. Its last part takes some 30 gradients for
/// each power of ten, so it can hardly hope for more than one.
const HOPE: f64 = 3.0;
/// Relative change of the share below which a descent ends.
const SETTLED: f64 = 1e-9;
/// Shares are smooth to this, so a share this little above its bound counts as at the bound.
const SMOOTH: f64 = 1e-7;
/// Greatest logarithm of a stroke over its limit that a descent regards.
const OVERREACH_MOST: f64 = 100.0;
/// Factor of a mean that a descent minimises. The method first assumes a curvature of 1. That of a share is
/// some tenth in these variables, and where the method overrates it, its steps are too short.
const SCALE: f64 = 10.0;

/// Number that a descent minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Aspect {
    /// The search's value of a design, within the limits on strokes.
    Value,
    /// The greatest overreach of its strokes.
    Overreach,
}

impl Problem<'_> {
    /// Improves a design until no design near it is better, until `most` evaluations have been made, or until
    /// there is no hope that it will be better than one with the value `rival`. Intruders stay alike if the
    /// design has one entry. `bounds` has an entry for each of the design, or one for all.
    pub(super) fn descend(
        &self,
        start: TriedDesign,
        bounds: &[Bounds],
        most: usize,
        rival: f64,
    ) -> Result<TriedDesign, SimulateError> {
        let mut sofar = self.sofar.get();
        sofar.descents += 1;
        self.tell(sofar);
        let full = sofar.evaluations + most.min(self.left());
        let to = |start, aspect| self.follow_down(start, bounds, (full, rival), aspect);
        let best = to(start, Aspect::Value)?;
        if best.excess == 0.0 || !best.settled {
            return Ok(best);
        }
        // A method that walks along its constraints can fail to find where all of them hold.
        let within = to(best, Aspect::Overreach)?;
        if within.excess > 0.0 || !within.settled {
            return Ok(within);
        }
        to(within, Aspect::Value)
    }

    /// Returns the parts whose greatest a descent minimises, for these values of a design.
    fn parts(&self, values: &DesignValues, bounds: &[Bounds], aspect: Aspect) -> Vec<f64> {
        match aspect {
            Aspect::Value => self.search.parts(&values.shares),
            Aspect::Overreach => overreaches(&values.strokes, bounds),
        }
    }

    /// Number of the parts of an aspect.
    fn count_parts(&self, bounds: &[Bounds], aspect: Aspect) -> usize {
        let runs = self.search.spread.corners().len() * self.speeds.len();
        let nothing = DesignValues {
            shares: vec![0.0; runs],
            strokes: vec![0.0; runs * self.hosts.len()],
        };
        self.parts(&nothing, bounds, aspect).len()
    }

    /// Runs the method once, up to a total of `full` evaluations.
    ///
    /// The greatest of several values has kinks, on which a descent would stop short. It is found as the
    /// least bound t with every value below it: t is one more variable, and each value a constraint.
    fn follow_down(
        &self,
        start: TriedDesign,
        bounds: &[Bounds],
        (full, rival): (usize, f64),
        aspect: Aspect,
    ) -> Result<TriedDesign, SimulateError> {
        let variables = Variables::new(self.search, bounds, start.design.intruders.len());
        let mut first = variables.of(&start.design);
        let mut limits = variables.bounds.clone();
        let parts = self.count_parts(bounds, aspect);
        let bounded = parts > 1 || aspect == Aspect::Overreach;
        if bounded {
            let (at, range) = self.bound_of(&start, aspect);
            first.push(at);
            limits.push(range);
        }
        let reaches = match aspect {
            Aspect::Value => self.count_parts(bounds, Aspect::Overreach),
            Aspect::Overreach => 0,
        };
        let descent = RefCell::new(Descent {
            problem: self,
            variables: &variables,
            bounds,
            most: full,
            rival,
            best: start,
            full: false,
            lost: false,
            in_vain: 0,
            bests: Vec::new(),
            failed: None,
            known: None,
        });
        if variables.bounds.is_empty() {
            // With every value fixed, there is one design.
            descent.borrow_mut().known(&[], false);
            return descent.into_inner().ended(true);
        }
        let free = variables.bounds.len();
        let mean = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let mut descent = descent.borrow_mut();
            let value = descent.aim(x, gradient, |values| SCALE * self.search.value(&values.shares));
            value.unwrap_or(SCALE * descent.best.value)
        };
        let bound = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let last = x.len() - 1;
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                gradient[last] = 1.0;
            }
            if descent.borrow().is_over() { 0.0 } else { x[last] }
        };
        let above = |part: usize| {
            let descent = &descent;
            move |x: &[f64], mut gradient: Option<&mut [f64]>, _: &mut ()| {
                let (bound, x) = x.split_last().expect("the bound is the last variable");
                if let Some(last) = gradient.as_mut().and_then(|gradient| gradient.last_mut()) {
                    *last = -1.0;
                }
                let gradient = gradient.map(|gradient| &mut gradient[..x.len()]);
                let mut descent = descent.borrow_mut();
                let value = descent.aim(x, gradient, |values| self.parts(values, bounds, aspect)[part]);
                let above = value.map(|value| value - bound);
                above.filter(|above| above.abs() >= SMOOTH).unwrap_or(0.0)
            }
        };
        let too_far = |reach: usize| {
            let descent = &descent;
            move |x: &[f64], mut gradient: Option<&mut [f64]>, _: &mut ()| {
                if let Some(gradient) = &mut gradient {
                    gradient.fill(0.0);
                }
                let gradient = gradient.map(|gradient| &mut gradient[..free]);
                let mut descent = descent.borrow_mut();
                let value = descent.aim(&x[..free], gradient, |values| {
                    overreaches(&values.strokes, bounds)[reach]
                });
                value.filter(|value| value.abs() >= SMOOTH).unwrap_or(0.0)
            }
        };
        let above: Vec<_> = (0..parts).map(above).collect();
        let too_far: Vec<_> = (0..reaches).map(too_far).collect();
        let too_heavy = |x: &[f64], mut gradient: Option<&mut [f64]>, _: &mut ()| {
            if let Some(gradient) = &mut gradient {
                gradient.fill(0.0);
            }
            if descent.borrow().is_over() {
                return 0.0;
            }
            variables.overweight(&x[..free], gradient.map(|gradient| &mut gradient[..free]))
        };
        let mut constraints = vec![&too_heavy as &dyn slsqp::Func<()>];
        if bounded {
            constraints.extend(above.iter().map(|above| above as &dyn slsqp::Func<()>));
        }
        constraints.extend(too_far.iter().map(|too_far| too_far as &dyn slsqp::Func<()>));
        let objective: &dyn slsqp::Func<()> = if bounded { &bound } else { &mean };
        let settled = minimised(objective, &first, &limits, &constraints, full);
        descent.into_inner().ended(settled)
    }

    /// The first value of the bound t on an aspect, and its range.
    fn bound_of(&self, start: &TriedDesign, aspect: Aspect) -> (f64, (f64, f64)) {
        match aspect {
            // A fresh start has not been tried. No share of energy is above 1, and a design that doubles the
            // value to be minimised is no start.
            Aspect::Value => {
                let remaining = self.search.objective == Objective::Remaining;
                (start.value.min(1.0), (0.0, if remaining { 1.0 } else { 2.0 }))
            }
            Aspect::Overreach => (start.excess, (-OVERREACH_MOST, OVERREACH_MOST)),
        }
    }
}

/// Runs Kraft's method. Returns true if it ended by itself.
fn minimised(
    objective: &dyn slsqp::Func<()>,
    first: &[f64],
    limits: &[(f64, f64)],
    constraints: &[&dyn slsqp::Func<()>],
    full: usize,
) -> bool {
    // A bound moves with the noise of the shares that touch it.
    let bounded = constraints.len() > 1;
    let ended = slsqp::minimize(
        objective,
        first,
        limits,
        constraints,
        (),
        // Calls after the last evaluation cost nothing, so this limit never ends a descent early.
        full.min(1_000_000),
        Some(StopTols {
            ftol_rel: if bounded { SMOOTH } else { SETTLED },
            ..StopTols::default()
        }),
    );
    match ended {
        Ok((status, ..)) => !matches!(status, SuccessStatus::MaxEvalReached),
        Err((status, ..)) => matches!(status, FailStatus::RoundoffLimited),
    }
}

/// Places to either side of another along one variable, and the distance between them.
type Beside = ([Vec<f64>; 2], f64);
/// Values at these two places, and the distance between them.
type ValuesBeside = ([DesignValues; 2], f64);

/// Values at a place of the variables, and on demand beside it.
struct KnownValues {
    x: Vec<f64>,
    values: DesignValues,
    /// Of each variable: the values to either side, and their distance in it.
    beside: Option<Vec<ValuesBeside>>,
}

/// State of a descent, which the objective function cannot return.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    variables: &'a Variables,
    bounds: &'a [Bounds],
    /// Most evaluations of the whole search.
    most: usize,
    /// Value of the design that is to be beaten.
    rival: f64,
    best: TriedDesign,
    /// True once the evaluations are spent or the search was asked to stop.
    full: bool,
    /// True once the method has lost its way: it tries values that are not numbers, or gains nothing.
    lost: bool,
    /// Gradients since the best design was found.
    in_vain: usize,
    /// The best value at each gradient since all limits are kept.
    bests: Vec<f64>,
    failed: Option<SimulateError>,
    /// The last place: objective and constraints ask for the same one in turn.
    known: Option<KnownValues>,
}

impl Descent<'_> {
    /// The best design of a descent that has ended.
    fn ended(mut self, settled: bool) -> Result<TriedDesign, SimulateError> {
        self.best.settled = settled && !self.full;
        self.failed.map_or(Ok(self.best), Err)
    }

    /// Returns true if nothing more will be tried. An objective function cannot stop the method, but constant
    /// values and constraints that hold end it.
    fn is_over(&self) -> bool {
        self.full || self.lost || self.failed.is_some()
    }

    /// Returns a number made of the values at `x`, and writes its derivatives if they are wanted; `None` if
    /// the descent is over.
    fn aim(
        &mut self,
        x: &[f64],
        gradient: Option<&mut [f64]>,
        of: impl Fn(&DesignValues) -> f64,
    ) -> Option<f64> {
        let with_slopes = gradient.is_some();
        let Some(known) = self.known(x, with_slopes) else {
            gradient.into_iter().for_each(|gradient| gradient.fill(0.0));
            return None;
        };
        let beside = known.beside.iter().flatten();
        let slopes = beside.map(|([low, high], apart)| (of(high) - of(low)) / apart);
        for (entry, slope) in gradient.into_iter().flatten().zip(slopes) {
            *entry = slope;
        }
        Some(of(&known.values))
    }

    /// Returns the values at `x`, and beside it if wanted; `None` if the descent is over.
    fn known(&mut self, x: &[f64], with_slopes: bool) -> Option<&KnownValues> {
        let suffices = |known: &KnownValues| known.x == x && (known.beside.is_some() || !with_slopes);
        if !self.known.as_ref().is_some_and(suffices) {
            self.known = Some(self.evaluate(x, with_slopes)?);
        }
        self.known.as_ref()
    }

    fn evaluate(&mut self, x: &[f64], with_slopes: bool) -> Option<KnownValues> {
        let beside = if with_slopes {
            self.variables.beside(x)
        } else {
            Vec::new()
        };
        let (here, beside) = self.try_at(x, beside)?;
        let problem = self.problem;
        let found = problem.judged(self.variables.design(x), &here, self.bounds);
        // A fresh start may be slightly too heavy, where its masses were raised to the least.
        if found.is_better_than(&self.best) && self.variables.overweight(x, None) <= 1e-9 {
            problem.note(found.value, found.excess);
            self.best = found;
            self.in_vain = 0;
        } else if with_slopes {
            self.in_vain += 1;
            self.lost |= self.in_vain >= PATIENCE;
        }
        if with_slopes && self.best.excess == 0.0 {
            self.judge();
        }
        Some(KnownValues {
            x: x.to_vec(),
            values: here,
            beside: with_slopes.then_some(beside),
        })
    }

    /// Ends a descent that gains next to nothing, or too little to beat its rival.
    fn judge(&mut self) {
        let best = self.best.value;
        self.bests.push(best);
        if let Some(before) = self.bests.iter().nth_back(WINDOW) {
            let gain = before - best;
            self.lost |= gain < GAINED || best - self.rival > HOPE * gain;
        }
    }

    /// Returns the values at `x`, and beside it; `None` if the descent is over.
    fn try_at(&mut self, x: &[f64], beside: Vec<Beside>) -> Option<(DesignValues, Vec<ValuesBeside>)> {
        self.lost |= !x.iter().all(|x| x.is_finite());
        if self.is_over() {
            return None;
        }
        let made = self.problem.sofar.get().evaluations;
        let strokes = self.bounds.iter().any(|bounds| bounds.stroke.is_finite());
        let design = |x: &Vec<f64>| self.variables.design(x);
        let here = self.variables.design(x);
        let pairs: Vec<[Design; 2]> = beside
            .iter()
            .map(|(pair, _)| pair.each_ref().map(design))
            .collect();
        let exact = !beside.is_empty() && !strokes;
        if exact && made + Search::GRADIENT_RUNS > self.most {
            self.full = true;
            return None;
        }
        if exact && let Some((here, values)) = self.problem.try_around(&here, &pairs) {
            let beside = values
                .into_iter()
                .zip(beside)
                .map(|(values, (_, apart))| (values, apart));
            return Some((here, beside.collect()));
        }
        self.full |= made + 1 + 2 * beside.len() > self.most;
        if self.is_over() {
            return None;
        }
        let designs: Vec<Design> = std::iter::once(here).chain(pairs.into_iter().flatten()).collect();
        match self.problem.try_designs(&designs, strokes) {
            Ok(values) if values.len() == designs.len() => {
                let mut values = values.into_iter();
                let here = values.next()?;
                let pair = |(_, apart)| Some(([values.next()?, values.next()?], apart));
                Some((here, beside.into_iter().map_while(pair).collect()))
            }
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
