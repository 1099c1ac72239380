//! Curves of one quantity over a run, for programs that read it at very many times.
//!
//! # Design
//!
//! A [`Sampler`](crate::Sampler) computes the motion of the whole chain at each time. A curve keeps one
//! coordinate of each step as a polynomial and computes that alone, some twenty times faster for the paper's
//! chain.

use std::sync::Arc;

use crate::model::Model;
use crate::solution::Solution;
use crate::solver::Glimpse;

/// A quantity over a run, from t = 0 to its end. Copies share the polynomials, and each remembers the step
/// that it read last.
///
/// ```
/// use hertz_chain::{Scenario, simulate};
///
/// let solution = simulate(&Scenario::paper())?;
/// let mut force = solution.force_curve(8);
/// let sampled = solution.at(1.6e-3).force(8);
/// assert!((force.at(1.6e-3) - sampled).abs() < 1e-12 * sampled);
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Curve {
    model: Arc<Model>,
    of: CurveQuantity,
    /// The coordinate in each step, one after another.
    steps: Arc<[Glimpse]>,
    /// The step that was read last.
    last: usize,
}

#[derive(Debug, Clone, Copy)]
enum CurveQuantity {
    /// The total force of a contact.
    Force(usize),
    /// The force of a contact beyond its static load.
    ForceBeyond(usize),
    /// The absolute acceleration of an intruder, given by its number.
    Acceleration(usize),
}

impl Solution {
    /// Total force of `contact`, N, positive in compression, as [`Snapshot::force`](crate::Snapshot::force).
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn force_curve(&self, contact: usize) -> Curve {
        self.model.contact(contact);
        self.curve(CurveQuantity::Force(contact))
    }

    /// Force of `contact` beyond its static load, N; negative while the contact carries less. A sensor that
    /// blocks constant forces shows this force.
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn force_beyond_curve(&self, contact: usize) -> Curve {
        if self.model.contact(contact).load == 0.0 {
            self.force_curve(contact)
        } else {
            self.curve(CurveQuantity::ForceBeyond(contact))
        }
    }

    /// Absolute acceleration of the intruder in `bead`, m/s²; `None` without an intruder.
    pub fn acceleration_curve(&self, bead: usize) -> Option<Curve> {
        let intruder = self.model.intruder_of(bead)?;
        Some(self.curve(CurveQuantity::Acceleration(intruder)))
    }

    fn curve(&self, of: CurveQuantity) -> Curve {
        let steps = 0..self.times.len() - 1;
        let glimpse = |step: usize| {
            let times = (self.times[step], self.times[step + 1]);
            match of {
                CurveQuantity::Force(contact) | CurveQuantity::ForceBeyond(contact) => {
                    self.dense(step).glimpse_contact(contact, times)
                }
                CurveQuantity::Acceleration(intruder) => self.dense(step).glimpse_guest(intruder, times),
            }
        };
        Curve {
            model: Arc::clone(&self.model),
            of,
            steps: steps.map(glimpse).collect(),
            last: 0,
        }
    }
}

impl Curve {
    /// Last time of the run, s.
    pub fn end(&self) -> f64 {
        self.steps[self.steps.len() - 1].to
    }

    /// The quantity at time `t`, s, in SI units.
    ///
    /// # Panics
    /// If `t` is not within the run.
    pub fn at(&mut self, t: f64) -> f64 {
        let end = self.end();
        assert!(
            (0.0..=end).contains(&t),
            "{t} s is not within the run, 0 to {end} s"
        );
        let holds = |step: &Glimpse| step.from <= t && t <= step.to;
        if !holds(&self.steps[self.last]) {
            // Most times follow the last one closely.
            let next = self.last + 1;
            self.last = if self.steps.get(next).is_some_and(holds) {
                next
            } else {
                self.steps.partition_point(|step| step.to < t)
            };
        }
        let [place, rate, _] = self.steps[self.last].at(t);
        match self.of {
            CurveQuantity::Force(contact) => self.model.force_at(contact, place, rate),
            CurveQuantity::ForceBeyond(contact) => self.model.force_beyond_at(contact, place, rate),
            CurveQuantity::Acceleration(intruder) => self.model.acceleration_at(intruder, place, rate),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Scenario, simulate};

    #[test]
    fn curves_are_what_the_whole_chain_is_at_any_time_in_any_order() {
        let mut elastic = Scenario::paper();
        elastic.intruders[0].beads = vec![3, 8];
        elastic.chain.relaxation = 0.0;
        for scenario in [Scenario::paper(), elastic] {
            let solution = simulate(&scenario).unwrap();
            let summary = solution.summary();
            let [highest, fastest] = [summary.peak_force[7].force, summary.intruders[0].acceleration_max];
            let mut force = solution.force_curve(8);
            let mut acceleration = solution.acceleration_curve(8).unwrap();
            let times = (0..=4000).map(|n| f64::from(n) * 1e-6);
            for t in times.chain([1.6e-3, 0.0, 3e-3, 2e-3]) {
                let there = solution.at(t);
                let apart = force.at(t) - there.force(8);
                assert!(apart.abs() < 1e-12 * highest, "{apart:e} N");
                let apart = acceleration.at(t) - there.intruder_acceleration(8).unwrap();
                assert!(apart.abs() < 1e-11 * fastest, "{apart:e} m/s²");
            }
        }
    }

    #[test]
    fn the_force_beyond_a_load_is_zero_at_rest_and_the_total_less_the_load_in_the_wave() {
        let mut scenario = Scenario::paper();
        scenario.chain.precompression = 2.0;
        let solution = simulate(&scenario).unwrap();
        let (mut total, mut beyond) = (solution.force_curve(8), solution.force_beyond_curve(8));
        assert!((total.at(0.0) - 2.0).abs() < 1e-12 && beyond.at(0.0) == 0.0);
        let mut highest = 0.0_f64;
        for n in 0..=400 {
            let t = f64::from(n) * 1e-5;
            highest = highest.max(beyond.at(t));
            assert!((total.at(t) - 2.0 - beyond.at(t)).abs() < 1e-9, "{t} s");
        }
        assert!(highest > 1.0, "{highest} N");
    }
}
