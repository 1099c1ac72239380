//! Exact integration of a contact that opens or closes inside a step.
//!
//! # Design
//!
//! Where a contact opens or closes, its force goes as δ^(3/2), and with viscosity as δ^(1/2). This is the one
//! place where the motion is not smooth, and where a Runge-Kutta method loses its order. But the overlap near
//! it is known ([`StepOverlap`]) from its value, rate and acceleration at both ends of the step. The stages
//! therefore keep the difference of the force from that of the known overlap, which is small and smoother,
//! and the integral of the latter is computed by Gauss' rule for a root at one end. No step is rejected and
//! no search is needed.

use super::overlap::{Ends, StepOverlap};

/// Abscissae of Gauss' rule for ∫ √y g(y) dy over 0 to 1.
const PLACES: [f64; 8] = [
    0.9812397722943839,
    0.9037839476903188,
    0.7748209677540003,
    0.6107641382868098,
    0.43253135366542583,
    0.26285158681802023,
    0.12336375165891973,
    0.03185660304424276,
];
/// Weights of this rule over √y.
const WEIGHTS: [f64; 8] = [
    0.047841433184096754,
    0.10544803404933117,
    0.14970429446183253,
    0.17487758678299006,
    0.17775058420605802,
    0.15795560796472996,
    0.11801675413579028,
    0.06302729990024045,
];

/// A contact that crosses δ = 0 once in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    /// Lane of the contact.
    pub(super) lane: usize,
    overlap: StepOverlap,
    /// The part of the step at which δ = 0.
    root: f64,
    closes: bool,
    stiffness: f64,
    /// (3/2) τ over the length of the step.
    viscosity: f64,
    /// One over the length of the step.
    pace: f64,
    /// True if the force is clipped at zero and all elastic energy is dissipated.
    cut: bool,
}

/// Integrals of a force F over a part of a step whose length counts as 1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Integrals {
    /// ∫ F.
    pub(super) once: f64,
    /// ∫∫ F.
    pub(super) twice: f64,
    /// ∫ of the dissipated power.
    pub(super) power: f64,
}

impl Integrals {
    /// Displacement and velocity that a step of this length adds, times a mass.
    pub(super) fn over(&self, length: f64) -> (f64, f64) {
        (length * length * self.twice, length * self.once)
    }
}

impl Crossing {
    /// A contact at `lane` whose overlap has opposite signs at the ends of a step of `length`. `compliance`
    /// is the sum of its bodies' inverse masses.
    #[inline(always)]
    pub(super) fn new(
        lane: usize,
        (stiffness, viscosity): (f64, f64),
        compliance: f64,
        length: f64,
        start: Ends,
        end: Ends,
    ) -> Self {
        let by_mass = stiffness * compliance;
        let (overlap, root) = StepOverlap::crossing(length, start, end, by_mass, viscosity);
        Self {
            lane,
            overlap,
            root,
            closes: end[0] > 0.0,
            stiffness,
            viscosity: viscosity / length,
            pace: 1.0 / length,
            cut: false,
        }
    }

    /// The part of the step at which δ = 0.
    pub(super) fn root(&self) -> f64 {
        self.root
    }

    /// Part of the impulse, over the length of the step, that depends on the end of the step alone, because
    /// the contact closes after the last stage inside the step. That end is computed without the contact's
    /// own force.
    pub(super) fn unseen(&self, last: f64) -> f64 {
        if !self.closes || self.root <= last {
            return 0.0;
        }
        let deep = self.overlap.at(1.0).0.max(0.0);
        1.5 * self.stiffness * deep.sqrt() * self.overlap.own_at_end() * (1.0 - self.root)
    }

    /// Changes this to a contact that opens while its force is clipped at zero.
    pub(super) fn cut_off(self) -> Self {
        Self { cut: true, ..self }
    }

    /// Force and dissipated power of the polynomial at the part `x` of the step.
    #[inline(always)]
    pub(super) fn force(&self, x: f64) -> (f64, f64) {
        let (overlap, slope) = self.overlap.at(x);
        let overlap = if overlap > 0.0 { overlap } else { 0.0 };
        let stiff = self.stiffness * overlap.sqrt();
        if self.cut {
            return (0.0, -stiff * overlap * (slope * self.pace));
        }
        let viscous = self.viscosity * slope;
        (stiff * (overlap + viscous), stiff * viscous * (slope * self.pace))
    }

    /// Forces and dissipated powers of the polynomial at many parts of the step.
    #[inline(always)]
    pub(super) fn forces<const N: usize>(&self, places: &[f64; N]) -> ([f64; N], [f64; N]) {
        let (mut forces, mut powers) = ([0.0; N], [0.0; N]);
        for at in 0..N {
            (forces[at], powers[at]) = self.force(places[at]);
        }
        (forces, powers)
    }

    /// ∫ F, ∫ x F and ∫ power from the root to `end`, where the contact is closed throughout.
    #[inline(always)]
    fn since_root(&self, end: f64) -> (f64, f64, f64) {
        let way = end - self.root;
        let mut places = PLACES;
        for place in &mut places {
            *place = self.root + way * *place;
        }
        let (forces, powers) = self.forces(&places);
        let (mut force, mut moment, mut power) = (0.0, 0.0, 0.0);
        for at in 0..places.len() {
            force += WEIGHTS[at] * forces[at];
            moment += WEIGHTS[at] * forces[at] * places[at];
            power += WEIGHTS[at] * powers[at];
        }
        (way * force, way * moment, way * power)
    }

    /// ∫ F `speed` from the start of the step to its part `x`: the work of the force on a body of this speed
    /// at each part, over the length of the step.
    pub(super) fn work(&self, x: f64, speed: impl Fn(f64) -> f64) -> f64 {
        let since_root = |end: f64| {
            let way = end - self.root;
            let parts = PLACES.iter().zip(WEIGHTS).map(|(place, weight)| {
                let place = self.root + way * place;
                weight * self.force(place).0 * speed(place)
            });
            way * parts.sum::<f64>()
        };
        if self.cut || (self.closes && x <= self.root) {
            return 0.0;
        }
        if self.closes {
            return since_root(x);
        }
        (if x < self.root { since_root(x) } else { 0.0 }) - since_root(0.0)
    }

    /// Integrals of force and power from the start of the step to its part `x`.
    #[inline(always)]
    pub(super) fn integrals(&self, x: f64) -> Integrals {
        if self.cut {
            let energy = |x: f64| {
                let overlap = self.overlap.at(x).0.max(0.0);
                0.4 * self.stiffness * overlap * overlap * overlap.sqrt()
            };
            return Integrals {
                power: (energy(0.0) - energy(x)) * self.pace,
                ..Integrals::default()
            };
        }
        let (force, moment, power) = if self.closes {
            if x <= self.root {
                return Integrals::default();
            }
            self.since_root(x)
        } else {
            let whole = self.since_root(0.0);
            let stays = x < self.root;
            let left = if stays {
                self.since_root(x)
            } else {
                (0.0, 0.0, 0.0)
            };
            (left.0 - whole.0, left.1 - whole.1, left.2 - whole.2)
        };
        Integrals {
            once: force,
            twice: x * force - moment,
            power,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact whose overlap is y - 0.1 y^(7/2) with y = x - 0.9, or its mirror image in time.
    #[test]
    fn what_rests_on_the_end_of_a_step_alone_is_what_the_contact_does_to_itself_after_the_last_stage() {
        let (length, stiffness) = (2.0, 3.0);
        let compliance = 0.1 * 35.0 / 4.0 / (length * length) / stiffness;
        let y = 0.1_f64;
        let (apart, pressed) = (
            [-0.9, 1.0 / length, 0.0],
            [
                y - 0.1 * y.powf(3.5),
                (1.0 - 0.35 * y.powf(2.5)) / length,
                -0.875 * y.powf(1.5) / (length * length),
            ],
        );
        let closes = Crossing::new(0, (stiffness, 0.0), compliance, length, apart, pressed);
        assert!((closes.root() - 0.9).abs() < 1e-9);
        assert_eq!(closes.unseen(0.95), 0.0);
        // dF/dδ = (3/2) κ √δ, for the time since the root.
        let expected = 1.5 * stiffness * pressed[0].sqrt() * (0.1 * y.powf(3.5)) * y;
        let unseen = closes.unseen(0.85);
        assert!(
            (unseen / expected - 1.0).abs() < 1e-5,
            "{unseen:e}, not {expected:e}"
        );

        let back = |[place, rate, bend]: Ends| [place, -rate, bend];
        let (from, to) = (back(pressed), back(apart));
        let opens = Crossing::new(0, (stiffness, 0.0), compliance, length, from, to);
        assert!((opens.root() - 0.1).abs() < 1e-9);
        assert_eq!(opens.unseen(0.05), 0.0);
    }
}
