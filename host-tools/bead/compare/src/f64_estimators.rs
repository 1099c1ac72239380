//! Estimates A and B in f64, from the same samples that the bead had. They show the cost of the bead's fixed
//! point and of its single step for each sample.
//!
//! # Design
//! This code shares only the physics with the fixed-point code, so that an error in one shows against the
//! other. A integrates the intruder's first-order law exactly for an acceleration that is straight between
//! samples; B runs the reduced chain by Runge-Kutta with [`SUBSTEPS`] steps a sample, on a force interpolated
//! by cubics.

use bead_model::design::{Bead, Intruder, Neighbours};
use bead_model::reduced_chain::FOLLOWERS;

use crate::front_end::first_order_hold;

/// Runge-Kutta steps in one sample period: 2 MHz at 100 kHz.
pub const SUBSTEPS: usize = 20;

/// Removes a one-pole low-pass with the time constant `lag`, and a `delay`, both in samples, from its
/// samples: `s = y + ẏ (lag - delay) + ÿ (delay²/2 - lag delay)`. The derivatives are five-point central
/// differences (fourth order); at either end the two last samples use the samples there are. An unknown
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
/// has done on the host, J, at each sample, from that total force in N. The work is the energy that came in,
/// less what went back. Everything is at rest, just touching, at the first sample. The followers hold the
/// intruders of `neighbours`.
pub fn predicted(bead: &Bead, neighbours: &Neighbours, force: &[f64], rate_hz: f64) -> Vec<[f64; 2]> {
    let held = &held(bead, neighbours);
    let step = 1.0 / rate_hz / SUBSTEPS as f64;
    let at = |i: isize| force[i.clamp(0, force.len() as isize - 1) as usize];
    let mut state = [0.0; WORK + 1];
    let mut energies = Vec::with_capacity(force.len());
    for i in 0..force.len() as isize {
        energies.push([state[ENERGY], state[WORK]]);
        let points = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for substep in 0..SUBSTEPS {
            let phase = substep as f64 / SUBSTEPS as f64;
            let half = 0.5 / SUBSTEPS as f64;
            let phases = [phase, phase + half, phase + 2.0 * half];
            state = runge_kutta(bead, held, &state, step, phases.map(|phase| cubic(points, phase)));
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

type Held = [Option<Intruder>; BODIES];

fn held(bead: &Bead, neighbours: &Neighbours) -> Held {
    std::array::from_fn(|body| match body.checked_sub(1) {
        None => Some(bead.intruder()),
        Some(follower) => neighbours.holds(follower).then(|| neighbours.intruder()),
    })
}

type ReducedState = [f64; WORK + 1];

fn plus(state: &ReducedState, scale: f64, rate: &ReducedState) -> ReducedState {
    std::array::from_fn(|value| state[value] + scale * rate[value])
}

fn rate(bead: &Bead, held: &Held, y: &ReducedState, incoming: f64) -> ReducedState {
    let mut rate = [0.0; WORK + 1];
    let mut push = incoming;
    for body in 0..BODIES {
        let velocity = BODIES + body;
        let outgoing = match body + 1 {
            BODIES => 0.0,
            next => contact_force(bead, y[body] - y[next], y[velocity] - y[velocity + 1]),
        };
        rate[body] = y[velocity];
        let (displacement, relative) = (INTRUDERS + body, INTRUDERS + BODIES + body);
        match held[body] {
            Some(intruder) => {
                let spring = intruder.stiffness * y[displacement] + intruder.damping * y[relative];
                rate[velocity] = (push - outgoing + spring) / (bead.mass - intruder.mass);
                rate[displacement] = y[relative];
                rate[relative] = -spring / intruder.mass - rate[velocity];
            }
            None => rate[velocity] = (push - outgoing) / bead.mass,
        }
        push = outgoing;
    }
    rate[ENERGY] = bead.damping * y[INTRUDERS + BODIES].powi(2);
    rate[WORK] = incoming * y[BODIES];
    rate
}

/// The paper's Eq. (1): Hertz and Kuwabara-Kono; no force where the beads have parted.
fn contact_force(bead: &Bead, overlap: f64, approach: f64) -> f64 {
    if overlap <= 0.0 {
        return 0.0;
    }
    bead.contact_stiffness * overlap.sqrt() * (overlap + 1.5 * bead.relaxation * approach)
}

fn runge_kutta(
    bead: &Bead,
    held: &Held,
    state: &ReducedState,
    step: f64,
    [start, middle, end]: [f64; 3],
) -> ReducedState {
    let k1 = rate(bead, held, state, start);
    let k2 = rate(bead, held, &plus(state, 0.5 * step, &k1), middle);
    let k3 = rate(bead, held, &plus(state, 0.5 * step, &k2), middle);
    let k4 = rate(bead, held, &plus(state, step, &k3), end);
    let parts = [(6.0, k1), (3.0, k2), (3.0, k3), (6.0, k4)];
    parts
        .iter()
        .fold(*state, |sum, (part, rate)| plus(&sum, step / part, rate))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensed::{bead_of, neighbours_of};
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

    fn error_b(bead: &Bead, neighbours: &Neighbours, force: &[f64], truth: f64) -> f64 {
        predicted(bead, neighbours, force, RATE).last().unwrap()[0] / truth - 1.0
    }

    #[test]
    fn both_are_within_one_part_in_fifty_thousand_of_the_full_chain_also_behind_a_pole() {
        let nobody = Neighbours::default();
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
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../../docs/scenarios/ten-intruders.toml"
        );
        let scenario = Scenario::load(file).unwrap();
        let solution = crate::sensed::simulate_with_ring_down(&scenario).unwrap();
        let end = (scenario.duration * RATE) as usize;
        for host in [7, 10, 14] {
            let (bead, neighbours) = (bead_of(&solution, host).unwrap(), neighbours_of(&solution, host));
            let force = |i: usize| solution.at(i as f64 / RATE).force(host);
            let forces: Vec<f64> = (0..=end).map(force).collect();
            // As long as a window goes on after the wave has come.
            let came = forces.iter().position(|force| *force > 0.1).unwrap();
            let forces = &forces[..end.min(came + 512)];
            let last = solution.at(forces.len() as f64 / RATE);
            let truth = last.intruder_dissipated(host).unwrap();
            let among = error_b(&bead, &neighbours, forces, truth);
            let alone = error_b(&bead, &Neighbours::default(), forces, truth);
            println!("bead {host}: B {among:.2e} among others, {alone:.2e} as if alone");
            assert!(among.abs() < 1e-3, "{among:e}");
            assert!(alone.abs() > among.abs());
        }
    }
}
