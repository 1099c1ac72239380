//! Curves of one quantity over a run, for programs that read it at very many times.
//!
//! # Design
//!
//! A [`Sampler`](crate::Sampler) computes the motion of the whole chain at each time. A curve keeps one
//! coordinate of each step as a polynomial and computes only that, some twenty times faster.

use std::sync::Arc;

use crate::model::Model;
use crate::solution::Solution;
use crate::solver::Glimpse;

/// A quantity over a run, from t = 0 to its end. Copies share the polynomials; each remembers its last step.
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
    /// Total force of `contact`, N, as [`Snapshot::force`](crate::Snapshot::force); panics if there is none.
    pub fn force_curve(&self, contact: usize) -> Curve {
        self.model.contact(contact);
        self.curve(CurveQuantity::Force(contact))
    }

    /// Force of `contact` beyond its static load, N; negative while the contact carries less. A sensor that
    /// blocks constant forces shows this force. Panics if there is no such contact.
    pub fn force_beyond_curve(&self, contact: usize) -> Curve {
        if self.model.contact(contact).load == 0.0 {
            self.force_curve(contact)
        } else {
            self.curve(CurveQuantity::ForceBeyond(contact))
        }
    }

    /// Absolute acceleration of the intruder in `bead`, m/s²; `None` without an intruder, or with several.
    pub fn acceleration_curve(&self, bead: usize) -> Option<Curve> {
        let intruder = self.model.intruder_of(bead)?;
        Some(self.curve(CurveQuantity::Acceleration(intruder)))
    }

    fn curve(&self, of: CurveQuantity) -> Curve {
        let mut dense = self.dense();
        let glimpse = |step: usize| {
            self.load(&mut dense, step);
            match of {
                CurveQuantity::Force(contact) | CurveQuantity::ForceBeyond(contact) => {
                    dense.glimpse_contact(contact)
                }
                CurveQuantity::Acceleration(intruder) => dense.glimpse_guest(intruder),
            }
        };
        let steps = 0..self.times.len() - 1;
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
            CurveQuantity::Acceleration(intruder) => {
                // The only intruder in its bead, so it carries no other.
                self.model.acceleration_at(intruder, |_| (place, rate))
            }
        }
    }
}
