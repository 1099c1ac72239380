//! Derivatives of forces and crossings with respect to the overlap of a contact in a step.

use super::crossing::{RULE, SEARCH};
use super::method::{DISPLACEMENT, END, NODES, STAGES, VELOCITY};
use super::peak::{PlaceState, at, polynomial};

/// The overlap of a contact in a step, and its law.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepOverlap {
    pub(super) start: PlaceState,
    pub(super) end: PlaceState,
    /// Length of the step, s.
    pub(super) length: f64,
    /// κ, N/m^(3/2), and (3/2) τ, s.
    pub(super) stiffness: f64,
    pub(super) viscosity: f64,
}

/// Derivatives with respect to the overlap at the ends of a step, and to the law of the contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct OverlapSlopes {
    pub(super) start: PlaceState,
    pub(super) end: PlaceState,
    pub(super) stiffness: f64,
    pub(super) viscosity: f64,
}

/// Sums of derivatives by the polynomial's coefficients, by the law, and by the place x.
#[derive(Debug, Default)]
struct Sums {
    coefficients: [f64; 6],
    stiffness: f64,
    viscosity: f64,
}

impl StepOverlap {
    /// Derivatives of the force at the part `x` of the step, with `x` held fixed.
    pub(super) fn of_force(&self, x: f64) -> OverlapSlopes {
        let mut sums = Sums::default();
        self.add_force(&mut sums, &self.polynomial(), x, 1.0);
        self.slopes(&sums)
    }

    /// Derivatives of the sum of a crossing's displacement and velocity with these weights
    /// ([`Changes`](super::crossing::Changes)).
    pub(super) fn of_crossing(&self, displacement: f64, velocity: f64) -> OverlapSlopes {
        let h = self.length;
        let (of_once, of_twice) = (velocity * h, displacement * h * h);
        let overlap = self.polynomial();
        let closes = if self.end[0] > 0.0 { 1.0 } else { 0.0 };
        let root = root(&overlap, self.end[0], closes);
        let way = closes - root;
        let (mut sums, mut by_root) = (Sums::default(), 0.0);
        for (place, weight) in RULE {
            let x = root + way * place;
            let part = way.abs() * weight;
            let by_force = of_once + of_twice * (1.0 - x);
            let (force, rise) = self.add_force(&mut sums, &overlap, x, part * by_force);
            by_root += (1.0 - place) * part * (by_force * rise - of_twice * force);
            by_root -= (2.0 * closes - 1.0) * weight * force * by_force;
        }
        for stage in 0..STAGES {
            let weight = of_once * VELOCITY[END][stage] + of_twice * DISPLACEMENT[END][stage];
            if weight != 0.0 {
                self.add_force(&mut sums, &overlap, NODES[stage], -weight);
            }
        }
        // The root moves with the polynomial.
        let slope = at(&overlap, root).1;
        if slope != 0.0 {
            let mut power = 1.0;
            for coefficient in &mut sums.coefficients {
                *coefficient -= by_root / slope * power;
                power *= root;
            }
        }
        self.slopes(&sums)
    }

    fn polynomial(&self) -> [f64; 6] {
        polynomial(self.length, self.start, self.end)
    }

    /// Adds the derivatives of the force at x times a weight. Returns the force and its derivative by x.
    fn add_force(&self, sums: &mut Sums, overlap: &[f64; 6], x: f64, weight: f64) -> (f64, f64) {
        let (value, slope) = at(overlap, x);
        if value <= 0.0 {
            return (0.0, 0.0);
        }
        let (root, viscosity) = (value.sqrt(), self.viscosity / self.length);
        let pressed = root * (value + viscosity * slope);
        let by_value = self.stiffness * (1.5 * root + 0.5 * viscosity * slope / root);
        let by_slope = self.stiffness * viscosity * root;
        let (mut power, mut before, mut bend) = (1.0, 0.0, 0.0);
        for (at, (sum, coefficient)) in sums.coefficients.iter_mut().zip(overlap).enumerate() {
            *sum += weight * (by_value * power + by_slope * at as f64 * before);
            if at >= 2 {
                bend += coefficient * (at * (at - 1)) as f64 * x.powi(at as i32 - 2);
            }
            (power, before) = (power * x, power);
        }
        sums.stiffness += weight * pressed;
        sums.viscosity += weight * self.stiffness * root * slope / self.length;
        (self.stiffness * pressed, by_value * slope + by_slope * bend)
    }

    /// Derivatives by the values at the ends of the step, through the coefficients of the [`polynomial`].
    fn slopes(&self, sums: &Sums) -> OverlapSlopes {
        let (h, [p0, p1, p2, p3, p4, p5]) = (self.length, sums.coefficients);
        let place = 10.0 * p3 - 15.0 * p4 + 6.0 * p5;
        let rate = -4.0 * p3 + 7.0 * p4 - 3.0 * p5;
        let bend = 0.5 * p3 - p4 + 0.5 * p5;
        OverlapSlopes {
            start: [
                p0 - place,
                (p1 - place - rate) * h,
                (p2 - place - 2.0 * rate - 2.0 * bend) * 0.5 * h * h,
            ],
            end: [place, rate * h, bend * h * h],
            stiffness: sums.stiffness,
            viscosity: sums.viscosity,
        }
    }
}

/// The root of an overlap in a step, as a crossing finds it.
fn root(overlap: &[f64; 6], last: f64, closes: f64) -> f64 {
    let first = overlap[0];
    let (mut low, mut high) = (0.0, 1.0);
    let mut x = (first / (first - last)).clamp(0.0, 1.0);
    for _ in 0..SEARCH {
        let (value, slope) = at(overlap, x);
        if (value > 0.0) == (closes > 0.0) {
            high = x;
        } else {
            low = x;
        }
        let newton = x - value / slope;
        x = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
    }
    x
}
