//! One coordinate inside one step: the overlap of a contact, or the displacement of an intruder.
//!
//! A glimpse costs a few sums, where dense output costs as many for each body, and it outlives its step.

use super::crossing::Crossing;
use super::lanes::Lanes;
use super::method::{POWERS, TERMS, Weight};
use super::work::{Work, place};

/// A coordinate as a polynomial of the part of the step, with the exact parts of contacts that open or close.
#[derive(Debug, Clone)]
pub(crate) struct Glimpse {
    pub(crate) from: f64,
    pub(crate) to: f64,
    /// Start and length of its step, s.
    step: (f64, f64),
    /// The coordinate at the start of the step, and its rate.
    start: [f64; 2],
    /// Contribution of the step to both, in the powers of [`POWERS`].
    powers: [Weight; TERMS],
    /// Contacts, and the acceleration of the coordinate by one unit of their force.
    crossings: Vec<(Crossing, f64)>,
}

impl Glimpse {
    /// The coordinate at time `t`, its rate, and its acceleration.
    pub(crate) fn at(&self, t: f64) -> [f64; 3] {
        let (from, length) = self.step;
        let x = ((t - from) / length).clamp(0.0, 1.0);
        let (mut once, mut twice, mut rate) = (0.0, 0.0, 0.0);
        for weight in self.powers.iter().rev() {
            rate = rate * (x - 0.5) + once;
            once = once * (x - 0.5) + weight.velocity;
            twice = twice * (x - 0.5) + weight.displacement;
        }
        rate = rate * x + once;
        (once, twice) = (once * x, twice * x);
        for (crossing, factor) in &self.crossings {
            let integrals = crossing.integrals(x);
            once += factor * integrals.once;
            twice += factor * integrals.twice;
            rate += factor * crossing.force(x).0;
        }
        let [place, speed] = self.start;
        [
            place + (x * length * speed + length * length * twice),
            speed + length * once,
            rate,
        ]
    }
}

fn powers(rate: impl Fn(usize) -> f64) -> [Weight; TERMS] {
    let mut sums = [Weight::ZERO; TERMS];
    for (stage, weights) in POWERS.iter().enumerate() {
        let rate = rate(stage);
        for (sum, weight) in sums.iter_mut().zip(weights) {
            sum.velocity += weight.velocity * rate;
            sum.displacement += weight.displacement * rate;
        }
    }
    sums
}

impl Work {
    /// Overlap at `lane` less that at rest, in the step that [`Work::prepare`] was called for, which has this
    /// start and length. It will be read between the times `from` and `to`.
    pub(super) fn glimpse_contact(
        &self,
        lanes: &Lanes,
        lane: usize,
        step: (f64, f64),
        (from, to): (f64, f64),
    ) -> Glimpse {
        let (near, far) = (lane - 1, lane);
        let difference = |of: &[f64]| of[near] - of[far];
        let (near_push, far_push) = (lanes.inverse[near], lanes.inverse[far]);
        let factor = |crossing: &Crossing| match crossing.lane {
            own if own == lane => -(near_push + far_push),
            before if before + 1 == lane => near_push,
            behind if behind == lane + 1 => far_push,
            _ => 0.0,
        };
        Glimpse {
            from,
            to,
            step,
            start: [difference(&self.start.u), difference(&self.start.v)],
            powers: powers(|stage| self.rates[place(near, stage)] - self.rates[place(far, stage)]),
            crossings: self.crossings_that(factor),
        }
    }

    /// Displacement of an intruder relative to its host or carrier.
    pub(super) fn glimpse_guest(
        &self,
        lanes: &Lanes,
        guest: usize,
        step: (f64, f64),
        (from, to): (f64, f64),
    ) -> Glimpse {
        let (host, lane) = (lanes.guests.hosts[guest], lanes.guests.lane(guest));
        let is_nested = lanes.guests.carriers[guest].is_some();
        let factor = |crossing: &Crossing| match crossing.lane {
            // A contact accelerates the host, not the carrier.
            _ if is_nested => 0.0,
            before if before == host => -lanes.inverse[host],
            behind if behind == host + 1 => lanes.inverse[host],
            _ => 0.0,
        };
        Glimpse {
            from,
            to,
            step,
            start: [self.start.u[lane], self.start.v[lane]],
            powers: powers(|stage| self.rates[place(lane, stage)]),
            crossings: self.crossings_that(factor),
        }
    }

    fn crossings_that(&self, factor: impl Fn(&Crossing) -> f64) -> Vec<(Crossing, f64)> {
        let factors = self
            .crossings
            .iter()
            .map(|crossing| (*crossing, factor(crossing)));
        factors.filter(|(_, factor)| *factor != 0.0).collect()
    }
}
