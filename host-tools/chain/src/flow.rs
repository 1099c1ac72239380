//! What passes through a contact: impulse, energy, and what the contact itself dissipates.
//!
//! # Design
//!
//! Contact j pushes bead j with F and body j - 1 with -F. The energy that passes is counted on the near side,
//! as the work of body j - 1, ∫ F V[j-1] dt. So contact j belongs to bead j, as in the paper's E_n (eq. 4),
//! and the books close exactly: the energy that beads a..=b have and lose is what passes contact a less what
//! passes contact b + 1. A wave on its way back pushes while the beads move backwards, so its energy is
//! negative. The wall's contact belongs to the last bead, and only momentum passes it.
//!
//! The energies of the contacts hold the work of a static load ([`Contact::energy`](crate::Contact::energy)),
//! so energy is counted with the part of F beyond the load. The impulse is that of all of F.
//!
//! Each step is integrated by Gauss and Legendre's five points over the dense output. That is exact to the
//! order of the method itself.

use crate::model::Model;
use crate::quantity::Inside;
use crate::solution::Solution;

/// What has passed a contact in some time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Passed {
    /// Momentum, ∫ F dt, N·s.
    pub impulse: f64,
    /// Energy, ∫ F V[j-1] dt, J, with F less the static load; negative if it goes back to the striker.
    pub energy: f64,
    /// The part of it that the contact dissipates, ∫ (F - F_Hertz) δ' dt, J.
    pub lost: f64,
}

impl Passed {
    /// The sum with `factor` times another.
    fn plus(self, factor: f64, other: Self) -> Self {
        Self {
            impulse: self.impulse + factor * other.impulse,
            energy: self.energy + factor * other.energy,
            lost: self.lost + factor * other.lost,
        }
    }
}

/// What passes one contact over a run; see [`Solution::flow`].
#[derive(Debug, Clone)]
pub struct Flow<'a> {
    solution: &'a Solution,
    contact: usize,
    /// Since t = 0, at the end of every step.
    passed: Vec<Passed>,
}

impl Solution {
    /// What passes `contact` (from 1), for any stretch of time. It costs about as much as the run did.
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn flow(&self, contact: usize) -> Flow<'_> {
        // An open contact passes nothing, unless it should carry a static load.
        let unloaded = self.model().contact(contact).load == 0.0;
        let mut sum = Passed::default();
        let mut passed = vec![sum];
        for (step, ends) in self.step_times().windows(2).enumerate() {
            // Steps are far shorter than any contact lasts: a contact open at both ends did not close
            // between.
            let open = |knot: usize| unloaded && self.model().overlap(self.state(knot), contact).0 <= 0.0;
            if !(open(step) && open(step + 1)) {
                let inside = &mut Inside::new(self, step);
                sum = sum.plus(1.0, integrate(inside, contact, ends[0], ends[1]));
            }
            passed.push(sum);
        }
        Flow {
            solution: self,
            contact,
            passed,
        }
    }
}

impl Flow<'_> {
    /// What passes from `from` to `to`, s.
    ///
    /// # Panics
    /// If a time is not within 0 to [`Solution::end`].
    pub fn between(&self, from: f64, to: f64) -> Passed {
        self.until(to).plus(-1.0, self.until(from))
    }

    fn until(&self, t: f64) -> Passed {
        let step = self.solution.step_at(t);
        let (inside, start) = (&mut Inside::new(self.solution, step), self.solution.times[step]);
        self.passed[step].plus(1.0, integrate(inside, self.contact, start, t))
    }
}

/// Abscissae and weights of Gauss and Legendre's rule of five points on -1 to 1.
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

fn integrate(inside: &mut Inside<'_>, contact: usize, from: f64, to: f64) -> Passed {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sum = Passed::default();
    for (place, weight) in GAUSS {
        let (model, y) = inside.at(middle + half * place);
        sum = sum.plus(half * weight, rate(model, y, contact));
    }
    sum
}

fn rate(model: &Model, y: &[f64], contact: usize) -> Passed {
    let (overlap, approach) = model.overlap(y, contact);
    let force = model.force(y, contact);
    Passed {
        impulse: force,
        energy: model.force_beyond(y, contact) * y[model.layout().velocity(contact - 1)],
        lost: (force - model.contact(contact).elastic_force(overlap)) * approach,
    }
}
