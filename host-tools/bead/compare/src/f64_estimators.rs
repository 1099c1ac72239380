//! Estimates A and B in f64, from the same samples that the bead had. They show the cost of the bead's fixed
//! point and of its single step for each sample.
//!
//! # Design
//! This code shares only the physics with the fixed-point code, so that an error in one shows against the
//! other. A integrates the intruder's first-order law exactly for an acceleration that is straight between
//! samples; B runs the reduced chain by Runge-Kutta with [`SUBSTEPS`] steps a sample, on a force interpolated
//! by cubics.

use bead_model::design::{Bead, Intruder, Surroundings};
use bead_model::reduced_chain::FOLLOWERS;

use crate::front_end::first_order_hold;

/// Runge-Kutta steps in one sample period: 2 MHz at 100 kHz.
pub const SUBSTEPS: usize = 20;

/// Removes a one-pole low-pass with the time constant `lag`, and a `delay`, both in samples, from its
/// samples: `s = y + ẏ (lag - delay) + ÿ (delay²/2 - lag delay)`. The derivatives are five-point central
/// differences (fourth order); the two outermost samples at either end use the samples that exist. An unknown
/// sample is NaN.
pub fn lead(samples: &[f64], lag: f64, delay: f64) -> Vec<f64> {
    let at = |i: isize| samples[i.clamp(0, samples.len() as isize - 1) as usize];
    (0..samples.len() as isize)
        .map(|i| {
            let near = [(at(i + 1) - at(i - 1)) / 2.0, at(i + 1) - 2.0 * at(i) + at(i - 1)];
            let far = [
                (at(i + 2) - at(i - 2)) / 4.0,
                (at(i + 2) - 2.0 * at(i) + at(i - 2)) / 4.0,
            ];
            // A channel that is only known in part has the two nearest samples.
            let [first, second] = [0, 1].map(|order| {
                let is_near = far[order].is_nan();
                if is_near {
                    near[order]
                } else {
                    (4.0 * near[order] - far[order]) / 3.0
                }
            });
            at(i) + (lag - delay) * first + delay * (0.5 * delay - lag) * second
        })
        .collect()
}

/// Estimate A: energy in J absorbed since the first sample, at each sample, from the intruder's absolute
/// acceleration in m/s². The intruder is at rest on its springs at the first sample.
pub fn measured(bead: &Bead, acceleration: &[f64], rate_hz: f64) -> Vec<f64> {
    let period = 1.0 / rate_hz;
    let [decay, old, new] = first_order_hold(bead.stiffness / bead.damping * period);
    let quasi_static = -bead.intruder_mass / bead.stiffness;
    let mut displacement = quasi_static * acceleration.first().copied().unwrap_or(0.0);
    let mut energy = 0.0;
    let mut previous: Option<(f64, f64)> = None;
    let after = |&a: &f64| {
        if let Some((a_old, _)) = previous {
            displacement = decay * displacement + quasi_static * (old * a_old + new * a);
        }
        let velocity = -(bead.intruder_mass * a + bead.stiffness * displacement) / bead.damping;
        let power = bead.damping * velocity * velocity;
        if let Some((_, power_old)) = previous {
            energy += 0.5 * period * (power_old + power);
        }
        previous = Some((a, power));
        energy
    };
    acceleration.iter().map(after).collect()
}

/// Estimate B: energy absorbed since the first sample, and work that the force at the host's incoming contact
/// has done on the host, J, at each sample, from that force in N beyond a static load. The work is the energy
/// that came in, less what went back. Everything is at rest at the first sample. The chain goes on behind the
/// last follower (`FarEnd`).
pub fn predicted(bead: &Bead, around: &Surroundings, force: &[f64], rate_hz: f64) -> Vec<[f64; 2]> {
    let chain = &Chain::new(bead, around);
    let step = 1.0 / rate_hz / SUBSTEPS as f64;
    let at = |i: isize| force[i.clamp(0, force.len() as isize - 1) as usize];
    let mut state = [0.0; WORK + 1];
    let mut end = FarEnd::new(chain, step);
    let mut energies = Vec::with_capacity(force.len());
    for i in 0..force.len() as isize {
        energies.push([state[ENERGY], state[WORK]]);
        let points = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for substep in 0..SUBSTEPS {
            let phase = substep as f64 / SUBSTEPS as f64;
            let half = 0.5 / SUBSTEPS as f64;
            let phases = [phase, phase + half, phase + 2.0 * half];
            let behind = end.push(chain.force(FOLLOWERS - 1, &state));
            let incoming = phases.map(|phase| cubic(points, phase));
            state = chain.runge_kutta(&state, step, incoming, behind);
        }
    }
    energies
}

/// The cubic through four equidistant points, between the middle two.
fn cubic([before, start, end, after]: [f64; 4], phase: f64) -> f64 {
    let (p, q) = (phase, 1.0 - phase);
    // Lagrange's form at the nodes -1, 0, 1, 2.
    -before * p * q * (1.0 + q) / 6.0
        + start * q * (1.0 + p) * (1.0 + q) / 2.0
        + end * p * (1.0 + p) * (1.0 + q) / 2.0
        - after * p * q * (1.0 + p) / 6.0
}

/// Bodies: the host, then its followers. Layout: displacements, velocities; displacements and velocities of
/// the intruders relative to these; energy absorbed by the host's; work done on the host.
const BODIES: usize = FOLLOWERS + 1;
const INTRUDERS: usize = 2 * BODIES;
const ENERGY: usize = 4 * BODIES;
const WORK: usize = ENERGY + 1;

type ReducedState = [f64; WORK + 1];

fn plus(state: &ReducedState, scale: f64, rate: &ReducedState) -> ReducedState {
    std::array::from_fn(|value| state[value] + scale * rate[value])
}

/// The reduced chain.
struct Chain {
    /// Masses with their intruders, kg; infinite for a wall.
    masses: [f64; BODIES],
    intruders: [Option<Intruder>; BODIES],
    /// κ, τ and overlap at rest, of the contact behind each body but the last.
    contacts: [[f64; 3]; FOLLOWERS],
    /// Static load, N.
    load: f64,
}

impl Chain {
    fn new(bead: &Bead, around: &Surroundings) -> Self {
        let neighbours = &around.intruders;
        let contact = [bead.contact_stiffness, bead.relaxation, 0.0];
        let mut chain = Self {
            masses: [bead.mass; BODIES],
            intruders: std::array::from_fn(|body| match body.checked_sub(1) {
                None => Some(bead.intruder()),
                Some(follower) => neighbours.holds(follower).then(|| neighbours.intruder()),
            }),
            contacts: [contact; FOLLOWERS],
            load: 0.0,
        };
        if let Some(followers) = &around.followers {
            chain.load = followers.load.into();
            for n in 0..FOLLOWERS {
                let [mass, stiffness, relaxation] =
                    [followers.mass[n], followers.stiffness[n], followers.relaxation[n]].map(f64::from);
                let is_wall = followers.is_wall(n);
                chain.masses[n + 1] = if is_wall { f64::INFINITY } else { mass };
                let overlap = if stiffness > 0.0 {
                    (chain.load / stiffness).powf(2.0 / 3.0)
                } else {
                    0.0
                };
                chain.contacts[n] = [stiffness, relaxation, overlap];
            }
        }
        chain
    }

    /// Eq. 1 with the paper's Eq. 2 for the viscous part, less the static load: the force of the contact
    /// behind body `body`.
    fn force(&self, body: usize, y: &ReducedState) -> f64 {
        let [stiffness, relaxation, at_rest] = self.contacts[body];
        let load = if at_rest > 0.0 { self.load } else { 0.0 };
        let overlap = y[body] - y[body + 1] + at_rest;
        let approach = y[BODIES + body] - y[BODIES + body + 1];
        if overlap <= 0.0 {
            return -load;
        }
        stiffness * overlap.sqrt() * (overlap + 1.5 * relaxation * approach) - load
    }

    fn rate(&self, y: &ReducedState, incoming: f64, behind: f64) -> ReducedState {
        let mut rate = [0.0; WORK + 1];
        let mut push = incoming;
        for body in 0..BODIES {
            let velocity = BODIES + body;
            let outgoing = if body < FOLLOWERS {
                self.force(body, y)
            } else {
                behind
            };
            rate[body] = y[velocity];
            let (displacement, relative) = (INTRUDERS + body, INTRUDERS + BODIES + body);
            match self.intruders[body] {
                Some(intruder) => {
                    let spring = intruder.stiffness * y[displacement] + intruder.damping * y[relative];
                    rate[velocity] = (push - outgoing + spring) / (self.masses[body] - intruder.mass);
                    rate[displacement] = y[relative];
                    rate[relative] = -spring / intruder.mass - rate[velocity];
                }
                None => rate[velocity] = (push - outgoing) / self.masses[body],
            }
            push = outgoing;
        }
        let damping = self.intruders[0].map_or(0.0, |intruder| intruder.damping);
        rate[ENERGY] = damping * y[INTRUDERS + BODIES].powi(2);
        rate[WORK] = incoming * y[BODIES];
        rate
    }

    fn runge_kutta(
        &self,
        state: &ReducedState,
        step: f64,
        [start, middle, end]: [f64; 3],
        behind: f64,
    ) -> ReducedState {
        let k1 = self.rate(state, start, behind);
        let k2 = self.rate(&plus(state, 0.5 * step, &k1), middle, behind);
        let k3 = self.rate(&plus(state, 0.5 * step, &k2), middle, behind);
        let k4 = self.rate(&plus(state, step, &k3), end, behind);
        let parts = [(6.0, k1), (3.0, k2), (3.0, k3), (6.0, k4)];
        parts
            .iter()
            .fold(*state, |sum, (part, rate)| plus(&sum, step / part, rate))
    }
}

/// The force behind the last bead: the force in front of it, delayed by the travel time of the wave. That
/// time follows from the wave's peak: the greatest force of the last two spans, each two travel times long.
struct FarEnd {
    forces: Vec<f64>,
    /// The travel time of a wave of 1 N, and the reduction of it by the viscosity of a contact, in steps.
    unit: f64,
    sooner: f64,
    /// The force that speeds up a wave as much as the load does, N.
    load: f64,
    peaks: [f64; 2],
    /// The step at which this span began, and its length in steps.
    began: f64,
    span: f64,
    /// The step of the force that now arrives. It never goes back, so no wave is felt twice.
    then: f64,
}

impl FarEnd {
    fn new(chain: &Chain, step: f64) -> Self {
        let [stiffness, relaxation, _] = chain.contacts[FOLLOWERS - 1];
        Self {
            forces: Vec::new(),
            unit: 1.104_44 * chain.masses[FOLLOWERS].sqrt() / stiffness.cbrt() / step,
            sooner: relaxation / step,
            // A weak wave takes √(M/K) from contact to contact, with K = 1.5 κ^(2/3) load^(1/3).
            load: chain.load * (1.104_44 * 1.5_f64.sqrt()).powi(6),
            peaks: [0.0; 2],
            began: 0.0,
            span: 0.0,
            then: 0.0,
        }
    }

    fn push(&mut self, force: f64) -> f64 {
        let now = self.forces.len() as f64;
        self.forces.push(force);
        if now - self.began >= self.span {
            self.began = now;
            self.peaks = [self.peaks[1], 0.0];
        }
        self.peaks[1] = self.peaks[1].max(force);
        let peak = self.load + self.peaks[0].max(self.peaks[1]);
        let took = self.unit * peak.powf(-1.0 / 6.0);
        // 250 samples at most, while there is hardly a force.
        self.span = (2.0 * took).min(250.0 * SUBSTEPS as f64);
        self.then = self.then.max(now - (took - self.sooner).max(0.0));
        let [before, after] = [self.then.floor(), self.then.ceil()].map(|step| self.forces[step as usize]);
        before + (after - before) * self.then.fract()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensed::{bead_of, surroundings_of};
    use hertz_chain::Scenario;

    const RATE: f64 = 100e3;

    /// Samples of the paper's strike without noise and without rounding, behind `pole`, with the energy that
    /// the intruder of the full chain dissipates until the last of them.
    fn samples(pole_hz: Option<f64>) -> (Bead, Vec<f64>, Vec<f64>, f64) {
        let scenario = Scenario::paper();
        let solution = hertz_chain::simulate(&scenario).unwrap();
        let bead = bead_of(&solution, 8).unwrap();
        let (fine, period) = (20, 1.0 / RATE);
        let end = (scenario.duration * RATE) as usize;
        let sample = |mut signal: Box<dyn FnMut(f64) -> f64 + '_>| -> Vec<f64> {
            let mut filter = crate::front_end::LowPass::new(pole_hz, period / fine as f64, 0.0);
            let at = |i: usize| (i as f64 / RATE / fine as f64).min(scenario.duration);
            let all = (0..=end * fine).map(|i| filter.advance(signal(at(i))));
            all.step_by(fine).collect()
        };
        let force = sample(Box::new(|t| solution.at(t).force(8)));
        let acceleration = sample(Box::new(|t| solution.at(t).intruder_acceleration(8).unwrap()));
        let truth = solution.at(end as f64 / RATE).intruder_dissipated(8).unwrap();
        (bead, force, acceleration, truth)
    }

    fn error_a(bead: &Bead, acceleration: &[f64], truth: f64) -> f64 {
        measured(bead, acceleration, RATE).last().unwrap() / truth - 1.0
    }

    fn error_b(bead: &Bead, around: &Surroundings, force: &[f64], truth: f64) -> f64 {
        predicted(bead, around, force, RATE).last().unwrap()[0] / truth - 1.0
    }

    #[test]
    fn both_are_within_one_part_in_fifty_thousand_of_the_full_chain_also_behind_a_pole() {
        let nobody = Surroundings::default();
        let (bead, force, acceleration, truth) = samples(None);
        let errors = [
            error_a(&bead, &acceleration, truth),
            error_b(&bead, &nobody, &force, truth),
        ];
        println!("no pole: {errors:?}");
        assert!(errors.iter().all(|error| error.abs() < 2e-5), "{errors:?}");
        // A constant acceleration absorbs nothing.
        let energies = measured(&bead, &[3.0; 1000], RATE);
        assert!(energies.last().unwrap().abs() < 1e-25, "{energies:?}");

        let (bead, force, acceleration, truth) = samples(Some(40e3));
        let raw = error_a(&bead, &acceleration, truth);
        assert!(raw.abs() > 1e-3, "the pole costs A something: {raw:e}");
        let in_samples = RATE / (std::f64::consts::TAU * 40e3);
        let [force, acceleration] = [force, acceleration].map(|samples| lead(&samples, in_samples, 0.0));
        let errors = [
            error_a(&bead, &acceleration, truth),
            error_b(&bead, &nobody, &force, truth),
        ];
        println!("pole at 40 kHz: A {raw:.2e} -> {errors:?}");
        assert!(errors.iter().all(|error| error.abs() < 2e-5), "{errors:?}");
    }

    #[test]
    fn b_in_a_row_of_absorbers_is_within_a_thousandth_of_the_full_chain_with_its_neighbours_and_not_without()
    {
        let scenario = crate::testing::scenario("ten-intruders");
        let solution = crate::sensed::simulate_with_ring_down(&scenario).unwrap();
        let end = (scenario.duration * RATE) as usize;
        for host in [7, 10, 14] {
            let bead = bead_of(&solution, host).unwrap();
            let around = surroundings_of(&solution, host);
            let force = |i: usize| solution.at(i as f64 / RATE).force(host);
            let forces: Vec<f64> = (0..=end).map(force).collect();
            // The length of a window after the wave has come.
            let came = forces.iter().position(|force| *force > 0.1).unwrap();
            let forces = &forces[..end.min(came + 512)];
            let last = solution.at(forces.len() as f64 / RATE);
            let truth = last.intruder_dissipated(host).unwrap();
            let among = error_b(&bead, &around, forces, truth);
            let alone = error_b(&bead, &Surroundings::default(), forces, truth);
            println!("bead {host}: B {among:.2e} among others, {alone:.2e} as if alone");
            assert!(among.abs() < 1e-3, "{among:e}");
            assert!(alone.abs() > among.abs());
        }
    }
}
