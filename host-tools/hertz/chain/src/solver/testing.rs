//! Runs, comparisons and a referee for the tests of the solver.
//!
//! The referee is another method, other code, and the model's own equations: Gragg's midpoint rule in 2, 4, 6
//! and more parts of a step, extrapolated to infinitely many (Hairer, Nørsett and Wanner, *Solving Ordinary
//! Differential Equations I*, 2nd ed., II.9). Where a contact opens or closes the force is only Hölder
//! continuous. The extrapolation then converges slowly, and the steps shrink until the singular point lies in
//! one too short to do harm. A step ends where a force begins or ceases to be clipped, since such a kink can
//! hide between the points of a step.

use std::sync::Arc;

use super::{Lanes, Stepper};
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{Chain, Intruder, Scenario, Striker};

/// Beads of the paper with this relaxation time, struck as in the paper.
pub(crate) fn plain(beads: usize, relaxation: f64, duration: f64) -> Scenario {
    let chain = Chain {
        beads,
        relaxation,
        ..Chain::PAPER
    };
    Scenario::new(duration, chain, Striker::PAPER)
}

/// The scenario with the paper's intruder in these beads.
pub(crate) fn hosting(mut scenario: Scenario, beads: impl IntoIterator<Item = usize>) -> Scenario {
    scenario.intruders = vec![Intruder::new(beads, Oscillator::PAPER)];
    scenario
}

/// A run from a time and a state, in steps of up to a part `longest` of the shortest contact.
pub(crate) fn start(model: &Model, from: (f64, &[f64]), tolerance: f64, longest: f64) -> Stepper {
    let longest = longest * model.shortest_time();
    let (lanes, layout) = (Arc::new(Lanes::new(model)), model.layout());
    Stepper::new(lanes, layout, from, tolerance, longest)
}

impl Stepper {
    /// Runs to a time. Returns the numbers of bodies that all steps computed, and that they moved.
    pub(crate) fn run_to(&mut self, end: f64) -> [usize; 2] {
        let mut sums = [0; 2];
        while self.time < end {
            self.advance(end).expect("it goes on");
            sums[0] += self.computed();
            sums[1] += self.moving().map(|run| run.len()).sum::<usize>();
        }
        sums
    }

    /// The present state, taken from a copy.
    pub(crate) fn present(&self, model: &Model) -> Vec<f64> {
        let mut state = model.initial();
        self.clone().state(&mut state);
        state
    }
}

/// Difference of places or velocities of all bodies across a contact. A wall stands still at 0.
pub(crate) fn across(bodies: &[f64], contact: usize) -> f64 {
    bodies[contact - 1] - bodies.get(contact).copied().unwrap_or(0.0)
}

/// Greatest distance of two states, as a part of their values or of the scales.
pub(crate) fn distance(model: &Model, ours: &[f64], theirs: &[f64]) -> f64 {
    let pairs = ours.iter().zip(theirs).zip(model.scales());
    let errors = pairs.map(|((a, b), scale)| (a - b).abs() / scale.max(b.abs()));
    errors.fold(0.0, f64::max)
}

/// The state after a step of `h` from `start` at `time`, and the factor for the next step; `None` without
/// convergence.
fn extrapolated(
    model: &Model,
    (time, start): (f64, &[f64]),
    h: f64,
    scales: &[f64],
) -> Option<(Vec<f64>, f64)> {
    let (mut first, mut rate) = (start.to_vec(), start.to_vec());
    model.rate(time, start, &mut first);
    let plus = |from: &[f64], h: f64, rate: &[f64]| -> Vec<f64> {
        let pairs = from.iter().zip(rate);
        pairs.map(|(from, rate)| from + h * rate).collect()
    };
    // The last row of the table of extrapolations.
    let (mut row, mut before) = (Vec::<Vec<f64>>::new(), f64::INFINITY);
    for column in 1..10_u32 {
        let short = h / f64::from(2 * column);
        let (mut last, mut state) = (start.to_vec(), plus(start, short, &first));
        for part in 1..2 * column {
            model.rate(time + f64::from(part) * short, &state, &mut rate);
            let next = plus(&last, 2.0 * short, &rate);
            last = std::mem::replace(&mut state, next);
        }
        // Gragg's last step, which also sees the force at the end.
        model.rate(time + h, &state, &mut rate);
        let next = plus(&last, short, &rate);
        state = plus(&state, 1.0, &next).iter().map(|sum| 0.5 * sum).collect();
        let mut error = f64::INFINITY;
        for (coarse, coarser) in (1..column).rev().zip(&mut row) {
            let ratio = f64::from(column) / f64::from(coarse);
            let part = 1.0 / (ratio * ratio - 1.0);
            let change = |(fine, coarse): (&f64, &f64)| part * (fine - coarse);
            let changes: Vec<f64> = state.iter().zip(&*coarser).map(change).collect();
            let finer = plus(&state, 1.0, &changes);
            let allowed = finer.iter().zip(scales);
            let allowed = allowed.map(|(value, scale)| 1e-15 * scale + 3e-14 * value.abs());
            let errors = changes.iter().zip(allowed);
            let errors = errors.map(|(change, most)| change.abs() / most);
            error = errors.fold(0.0, f64::max);
            *coarser = std::mem::replace(&mut state, finer);
        }
        if column > 5 && error <= 1.0 {
            return Some((state, (7.0 / f64::from(column)).powi(2).min(3.0)));
        }
        if column > 3 && error > (0.3 * before).max(1.0) {
            return None;
        }
        before = error;
        row.push(state);
    }
    None
}

/// The state at the end of a run as the referee finds it.
pub(crate) fn referee(model: &Model, end: f64) -> Vec<f64> {
    let (scales, longest) = (model.scales(), 0.08 * model.shortest_time());
    let (mut time, mut state, mut step) = (0.0, model.initial(), 1e-4 * longest);
    while time < end {
        let knot = model
            .drive
            .as_ref()
            .map_or(f64::INFINITY, |drive| drive.next_knot(time));
        let stop = end.min(knot);
        let last = step > (1.0 - 1e-9) * (stop - time);
        let mut h = if last { stop - time } else { step };
        assert!(time + h > time, "the steps became too short");
        let Some((mut next, growth)) = extrapolated(model, (time, &state), h, &scales) else {
            step = 0.35 * h;
            continue;
        };
        let turned = |next: &[f64]| {
            let limited = |state: &[f64], j| model.limited(state, j);
            (1..=model.contacts()).any(|j| limited(&state, j) != limited(next, j))
        };
        let whole = h;
        if model.clipped && turned(&next) {
            let (mut low, mut high) = (0.0, h);
            while high - low > 1e-9 * whole {
                let middle = 0.5 * (low + high);
                match extrapolated(model, (time, &state), middle, &scales) {
                    Some((inside, _)) if !turned(&inside) => (low, next) = (middle, inside),
                    _ => high = middle,
                }
            }
            if low > 1e-6 * whole && low < (1.0 - 1e-6) * whole {
                h = low;
            } else if let Some((all, _)) = extrapolated(model, (time, &state), h, &scales) {
                next = all;
            }
        }
        state = next;
        time = if last && h == whole { stop } else { time + h };
        step = (whole * growth).min(longest);
    }
    state
}
