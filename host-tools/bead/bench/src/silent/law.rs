//! A chain whose one intruder hangs on springs that no settings can state: they harden, rub, or creep.
//!
//! # Design
//! `hertz-chain`, like the bead, knows only linear springs. Here the masses and contacts are those of its
//! model, and classical Runge-Kutta steps of a fifth of a microsecond integrate any law of the springs.
//! With a linear law, the energy agrees with that of `hertz-chain` to a part in ten thousand.

use hertz_chain::{Contact, Model, Oscillator};

/// Force of the springs and the damper between host and intruder, beyond the linear ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SpringLaw {
    /// Stiffness k (1 + h (x/x₀)²): `part` is h, the part by which the spring is stiffer at `stroke`, x₀.
    Hardening {
        /// h, below 0 for a spring that softens.
        part: f64,
        /// x₀, m.
        stroke: f64,
    },
    /// Coulomb friction of this force, N, smoothed below 1 mm/s.
    Friction(f64),
    /// A spring of `part` of k in series with a damper that lets it creep in `time`, s, beside the linear
    /// spring.
    Maxwell {
        /// Stiffness over k.
        part: f64,
        /// Time in which the force decays, s.
        time: f64,
    },
}

/// Samples of a strike at the bead.
#[derive(Debug, Clone, Default)]
pub(super) struct LawStrike {
    /// Force at the incoming contact, N, at each [`STEP`].
    pub(super) force: Vec<f64>,
    /// Absolute acceleration of the intruder, m/s².
    pub(super) acceleration: Vec<f64>,
    /// Energy that the intruder's damper and its law took up, J.
    pub(super) absorbed: f64,
}

/// Time from sample to sample, s.
pub(super) const STEP: f64 = 0.2e-6;

/// Positions and velocities of the bodies and of the intruder, the force of a Maxwell arm, and the energy
/// taken up.
#[derive(Clone)]
struct LawState {
    bodies: Vec<[f64; 2]>,
    intruder: [f64; 2],
    arm: f64,
    absorbed: f64,
}

impl LawState {
    fn plus(&self, rate: &Self, dt: f64) -> Self {
        let two = |a: [f64; 2], b: [f64; 2]| [a[0] + dt * b[0], a[1] + dt * b[1]];
        let bodies = self.bodies.iter().zip(&rate.bodies);
        Self {
            bodies: bodies.map(|(&a, &b)| two(a, b)).collect(),
            intruder: two(self.intruder, rate.intruder),
            arm: self.arm + dt * rate.arm,
            absorbed: self.absorbed + dt * rate.absorbed,
        }
    }
}

/// The chain of a model with one host.
pub(super) struct LawChain<'a> {
    model: &'a Model,
    host: usize,
    oscillator: Oscillator,
    law: SpringLaw,
}

impl<'a> LawChain<'a> {
    /// The chain of `model`, whose intruder in `host` hangs on springs of this law. It has no wall, no gap
    /// and no static load. `None` if no intruder is in `host`.
    pub(super) fn new(model: &'a Model, host: usize, law: SpringLaw) -> Option<Self> {
        let hosted = model.intruders().iter().find(|one| one.bead == host)?;
        Some(Self {
            model,
            host,
            oscillator: hosted.oscillator,
            law,
        })
    }

    /// Integrates `seconds` from the striker's first touch.
    pub(super) fn strike(&self, seconds: f64) -> LawStrike {
        let mut state = LawState {
            bodies: vec![[0.0; 2]; self.model.bodies()],
            intruder: [0.0; 2],
            arm: 0.0,
            absorbed: 0.0,
        };
        state.bodies[0][1] = self.model.striker_speed();
        let mut strike = LawStrike::default();
        for _ in 0..(seconds / STEP) as usize {
            let (rate, force) = self.rate(&state);
            strike.force.push(force);
            strike.acceleration.push(rate.intruder[1]);
            let second = self.rate(&state.plus(&rate, STEP / 2.0)).0;
            let third = self.rate(&state.plus(&second, STEP / 2.0)).0;
            let fourth = self.rate(&state.plus(&third, STEP)).0;
            for (rate, weight) in [(rate, 1.0), (second, 2.0), (third, 2.0), (fourth, 1.0)] {
                state = state.plus(&rate, weight * STEP / 6.0);
            }
        }
        strike.absorbed = state.absorbed;
        strike
    }

    /// Rates of change, and the force at the host's incoming contact, N.
    fn rate(&self, state: &LawState) -> (LawState, f64) {
        let model = self.model;
        let mut pushes = vec![0.0; model.bodies()];
        let mut incoming = 0.0;
        for contact in 1..model.bodies() {
            let [before, after] = [state.bodies[contact - 1], state.bodies[contact]];
            let force = force_of(
                &model.contact(contact),
                before[0] - after[0],
                before[1] - after[1],
            );
            pushes[contact - 1] -= force;
            pushes[contact] += force;
            if contact == self.host {
                incoming = force;
            }
        }
        let oscillator = self.oscillator;
        let host = state.bodies[self.host];
        let [stroke, rate] = [0, 1].map(|at| state.intruder[at] - host[at]);
        let (beyond, arm) = self.beyond(oscillator.stiffness, stroke, rate, state.arm);
        let pull = oscillator.stiffness * stroke + oscillator.damping * rate + beyond;
        let shell = |body: usize| model.mass(body) - if body == self.host { oscillator.mass } else { 0.0 };
        pushes[self.host] += pull;
        let bodies = state.bodies.iter().enumerate();
        let taken_up = match self.law {
            SpringLaw::Friction(_) => beyond * rate,
            SpringLaw::Maxwell { part, time } => state.arm * state.arm / (part * oscillator.stiffness * time),
            SpringLaw::Hardening { .. } => 0.0,
        };
        let rates = LawState {
            bodies: bodies
                .map(|(body, state)| [state[1], pushes[body] / shell(body)])
                .collect(),
            intruder: [state.intruder[1], -pull / oscillator.mass],
            arm,
            absorbed: oscillator.damping * rate * rate + taken_up,
        };
        (rates, incoming)
    }

    /// Force of the law beyond the linear spring and damper, N, and the rate of the Maxwell arm's force, N/s.
    fn beyond(&self, stiffness: f64, stroke: f64, rate: f64, arm: f64) -> (f64, f64) {
        match self.law {
            SpringLaw::Hardening { part, stroke: peak } => {
                (stiffness * stroke * part * (stroke / peak).powi(2), 0.0)
            }
            SpringLaw::Friction(force) => (force * (rate / 1e-3).tanh(), 0.0),
            SpringLaw::Maxwell { part, time } => (arm, part * stiffness * rate - arm / time),
        }
    }
}

/// Force of a contact, N, as the paper prints it: no force where the bodies do not touch.
fn force_of(contact: &Contact, overlap: f64, rate: f64) -> f64 {
    if overlap <= 0.0 {
        return 0.0;
    }
    contact.elastic_force(overlap) + contact.viscous_force(overlap, rate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_compare::sensed::Truth;
    use hertz_chain::{Scenario, simulate};

    #[test]
    fn linear_springs_absorb_what_the_simulator_says_and_others_more_or_less() {
        let scenario = Scenario::paper();
        let solution = simulate(&scenario).unwrap();
        let truth = Truth::of(&scenario, &solution, 8).unwrap();
        let of = |law| {
            LawChain::new(solution.model(), 8, law)
                .unwrap()
                .strike(scenario.duration)
        };
        let stroke = 2e-6;
        let hardening = |part| of(SpringLaw::Hardening { part, stroke });
        let strike = hardening(0.0);
        assert!(
            (strike.absorbed / truth.absorbed - 1.0).abs() < 1e-4,
            "{}",
            strike.absorbed
        );
        let peak = strike.force.iter().copied().fold(0.0, f64::max);
        assert!((peak / truth.peak_force - 1.0).abs() < 1e-4, "{peak}");
        // A stiffer spring is further out of tune with the wave.
        let [hard, soft] = [0.2, -0.2].map(|part| hardening(part).absorbed);
        assert!(hard < strike.absorbed && strike.absorbed < soft, "{hard} {soft}");
        assert!(LawChain::new(solution.model(), 7, SpringLaw::Friction(0.1)).is_none());
    }
}
