//! Impulse and energy that pass through a contact, and energy that the contact dissipates.
//!
//! # Design
//!
//! Contact j pushes bead j with F and body j - 1 with -F. The passing energy is counted on the near side, as
//! the work of body j - 1, ∫ F V[j-1] dt. Contact j thus belongs to bead j, as in the paper's E_n (eq. 4),
//! and the balance closes exactly: the energy that beads a..=b hold and dissipate is the energy that passes
//! contact a less that which passes contact b + 1, and less what a ground that drags takes from them. A wave
//! on its way back pushes while the beads move backwards, so its energy is negative. The wall's contact
//! belongs to the last bead, and only momentum passes through it.
//!
//! Contact energies include the work of a static load ([`Contact::energy`](crate::Contact::energy)), so
//! energy is counted with the part of F beyond the load. The impulse is counted with all of F.
//!
//! Each step is integrated by Gauss and Legendre's eight points over the dense output. A step in which the
//! contact opens or closes is divided there.

use crate::bisection::bisect;
use crate::model::Model;
use crate::quantity::StepSampler;
use crate::solution::Solution;

/// Impulse and energy that pass a contact during some time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Transfer {
    /// Momentum, ∫ F dt, N·s.
    pub impulse: f64,
    /// Energy, ∫ F V[j-1] dt, J, with F less the static load; negative if it goes back to the striker.
    pub energy: f64,
    /// The part of this energy that the contact dissipates, ∫ (F - F_Hertz) δ' dt, J.
    pub lost: f64,
}

impl Transfer {
    /// Returns the sum of this and `factor` times another.
    fn plus(self, factor: f64, other: Self) -> Self {
        Self {
            impulse: self.impulse + factor * other.impulse,
            energy: self.energy + factor * other.energy,
            lost: self.lost + factor * other.lost,
        }
    }
}

/// Impulse and energy through one contact over a run; see [`Solution::flow`].
#[derive(Debug, Clone)]
pub struct Flow<'a> {
    solution: &'a Solution,
    contact: usize,
    /// Sums from t = 0 to the end of each step.
    passed: Vec<Transfer>,
}

impl Solution {
    /// Integrates the impulse and energy through `contact` (from 1). This costs about as much as the run did.
    ///
    /// # Panics
    /// If there is no such contact.
    pub fn flow(&self, contact: usize) -> Flow<'_> {
        // An open contact passes nothing, except in a chain under a static load.
        let unloaded = self.model().contact(contact).load == 0.0;
        let mut sum = Transfer::default();
        let mut passed = vec![sum];
        for (step, ends) in self.times.windows(2).enumerate() {
            // Steps are far shorter than a collision: a contact open at both ends did not close between.
            let open = |knot: usize| unloaded && self.model().overlap(self.state(knot), contact).0 <= 0.0;
            if !(open(step) && open(step + 1)) {
                let inside = &mut StepSampler::new(self, step);
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
    /// Impulse and energy that pass from time `from` to time `to`, s.
    ///
    /// # Panics
    /// If a time is not within 0 to [`Solution::end`].
    pub fn between(&self, from: f64, to: f64) -> Transfer {
        self.until(to).plus(-1.0, self.until(from))
    }

    fn until(&self, t: f64) -> Transfer {
        let step = self.solution.step_at(t);
        let inside = &mut StepSampler::new(self.solution, step);
        let start = self.solution.times[step];
        self.passed[step].plus(1.0, integrate(inside, self.contact, start, t))
    }
}

/// Places and weights of Gauss and Legendre's rule of eight points on 0 to 1.
const SMOOTH: [(f64, f64); 8] = [
    (0.019_855_071_751_231_884, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_63, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_64),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_64),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];

fn integrate(inside: &mut StepSampler<'_>, contact: usize, from: f64, to: f64) -> Transfer {
    let mut closed = |t: f64| {
        let (model, y) = inside.at(t);
        model.overlap(y, contact).0 > 0.0
    };
    // The force has a root where a contact opens or closes: with t = root ± z² it is smooth in z.
    let root = (closed(from) != closed(to)).then(|| bisect(from, to, closed));
    let mut sum = Transfer::default();
    let mut part = |from: f64, to: f64, squared: bool| {
        for (place, weight) in SMOOTH {
            let by_square = (place * place, 2.0 * place * weight);
            let (place, weight) = if squared { by_square } else { (place, weight) };
            let (model, y) = inside.at(from + (to - from) * place);
            sum = sum.plus((to - from).abs() * weight, rate(model, y, contact));
        }
    };
    match root {
        None => part(from, to, false),
        Some(root) => {
            part(root, from, true);
            part(root, to, true);
        }
    }
    sum
}

fn rate(model: &Model, y: &[f64], contact: usize) -> Transfer {
    let (overlap, approach) = model.overlap(y, contact);
    let force = model.force(y, contact);
    Transfer {
        impulse: force,
        energy: model.force_beyond(y, contact) * y[model.layout().velocity(contact - 1)],
        lost: (force - model.contact(contact).elastic_force(overlap)) * approach,
    }
}
