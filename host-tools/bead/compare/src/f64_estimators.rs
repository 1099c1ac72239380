//! Estimates A and B in f64, from the same samples that the bead had. They show what the bead's fixed point
//! and its single step for each sample cost.
//!
//! # Design
//! This code shares only the physics with the fixed-point code, so that an error in one shows against the
//! other. A integrates the intruder's first-order law exactly for an acceleration that is straight between
//! samples; B runs the reduced chain by Runge-Kutta with [`SUBSTEPS`] steps a sample, on a force interpolated
//! by cubics. Both return the running energy, sample by sample.

use bead_model::design::{Bead, Intruder, Neighbours};
use bead_model::reduced_chain::FOLLOWERS;

use crate::front_end::first_order_hold;

/// Runge-Kutta steps in one sample period: 2 MHz at 100 kHz.
pub const SUBSTEPS: usize = 20;

/// Removes a one-pole low-pass with this time constant, in samples, from its samples: `s = y + ẏ/ω`. The
/// derivative is the five-point central difference (fourth order); at either end the two last samples use the
/// samples there are. An unknown sample is NaN.
pub fn lead(samples: &[f64], in_samples: f64) -> Vec<f64> {
    let at = |i: isize| samples[i.clamp(0, samples.len() as isize - 1) as usize];
    (0..samples.len() as isize)
        .map(|i| {
            let near = (at(i + 1) - at(i - 1)) / 2.0;
            let far = (at(i + 2) - at(i - 2)) / 4.0;
            // A channel that is only known in part has the two nearest samples.
            let slope = if far.is_nan() {
                near
            } else {
                (4.0 * near - far) / 3.0
            };
            at(i) + in_samples * slope
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
    acceleration
        .iter()
        .map(|&a| {
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
        })
        .collect()
}

/// Estimate B: energy in J absorbed since the first sample, at each sample, from the total force at the
/// host's incoming contact in N. Everything is at rest, just touching, at the first sample. The followers
/// hold the intruders of `neighbours`.
pub fn predicted(bead: &Bead, neighbours: &Neighbours, force: &[f64], rate_hz: f64) -> Vec<f64> {
    let energies = energies(bead, neighbours, force, rate_hz);
    energies.into_iter().map(|[absorbed, _]| absorbed).collect()
}

/// The work in J that the force at the host's incoming contact has done on the host since the first sample,
/// at each sample: the energy that came in, less what went back. All else as in [`predicted`].
pub fn work(bead: &Bead, neighbours: &Neighbours, force: &[f64], rate_hz: f64) -> Vec<f64> {
    let energies = energies(bead, neighbours, force, rate_hz);
    energies.into_iter().map(|[_, work]| work).collect()
}

/// The energies that the reduced chain absorbs and takes up under a force.
fn energies(bead: &Bead, neighbours: &Neighbours, force: &[f64], rate_hz: f64) -> Vec<[f64; 2]> {
    let row = &row(bead, neighbours);
    let step = 1.0 / rate_hz / SUBSTEPS as f64;
    let at = |i: isize| force[i.clamp(0, force.len() as isize - 1) as usize];
    let mut state = State::default();
    let mut energies = Vec::with_capacity(force.len());
    for i in 0..force.len() as isize {
        energies.push([state.0[ENERGY], state.0[WORK]]);
        let points = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for substep in 0..SUBSTEPS {
            let phase = substep as f64 / SUBSTEPS as f64;
            let half = 0.5 / SUBSTEPS as f64;
            let phases = [phase, phase + half, phase + 2.0 * half];
            state = runge_kutta(bead, row, &state, step, phases.map(|phase| cubic(points, phase)));
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

/// The intruder of each body.
type Row = [Option<Intruder>; BODIES];

fn row(bead: &Bead, neighbours: &Neighbours) -> Row {
    let own = bead.intruder();
    std::array::from_fn(|body| match body.checked_sub(1) {
        None => Some(own),
        Some(follower) => neighbours.holds(follower).then(|| neighbours.intruder()),
    })
}

#[derive(Clone, Copy, Default)]
struct State([f64; WORK + 1]);

impl State {
    fn plus(&self, scale: f64, rate: &Self) -> Self {
        let mut sum = *self;
        for (value, rate) in sum.0.iter_mut().zip(rate.0) {
            *value += scale * rate;
        }
        sum
    }
}

fn rate(bead: &Bead, row: &Row, state: &State, incoming: f64) -> State {
    let y = &state.0;
    let mut rate = State::default();
    let mut push = incoming;
    for body in 0..BODIES {
        let velocity = BODIES + body;
        let outgoing = match body + 1 {
            BODIES => 0.0,
            next => contact_force(bead, y[body] - y[next], y[velocity] - y[velocity + 1]),
        };
        rate.0[body] = y[velocity];
        let (displacement, relative) = (INTRUDERS + body, INTRUDERS + BODIES + body);
        match row[body] {
            Some(Intruder {
                mass,
                stiffness,
                damping,
            }) => {
                let spring = stiffness * y[displacement] + damping * y[relative];
                rate.0[velocity] = (push - outgoing + spring) / (bead.mass - mass);
                rate.0[displacement] = y[relative];
                rate.0[relative] = -spring / mass - rate.0[velocity];
            }
            None => rate.0[velocity] = (push - outgoing) / bead.mass,
        }
        push = outgoing;
    }
    rate.0[ENERGY] = bead.damping * y[INTRUDERS + BODIES].powi(2);
    rate.0[WORK] = incoming * y[BODIES];
    rate
}

/// The paper's Eq. (1): Hertz and Kuwabara-Kono; no force where the beads have parted.
fn contact_force(bead: &Bead, overlap: f64, approach: f64) -> f64 {
    if overlap <= 0.0 {
        return 0.0;
    }
    bead.contact_stiffness * overlap.sqrt() * (overlap + 1.5 * bead.relaxation * approach)
}

fn runge_kutta(bead: &Bead, row: &Row, state: &State, step: f64, [start, middle, end]: [f64; 3]) -> State {
    let k1 = rate(bead, row, state, start);
    let k2 = rate(bead, row, &state.plus(0.5 * step, &k1), middle);
    let k3 = rate(bead, row, &state.plus(0.5 * step, &k2), middle);
    let k4 = rate(bead, row, &state.plus(step, &k3), end);
    state
        .plus(step / 6.0, &k1)
        .plus(step / 3.0, &k2)
        .plus(step / 3.0, &k3)
        .plus(step / 6.0, &k4)
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
        let fine = 20;
        let end = (scenario.duration * RATE) as usize;
        let sample = |mut signal: Box<dyn FnMut(f64) -> f64 + '_>| -> Vec<f64> {
            let mut filter = crate::front_end::LowPass::new(pole_hz, 1.0 / RATE / f64::from(fine), 0.0);
            let at = |i: i32| (f64::from(i) / RATE / f64::from(fine)).min(scenario.duration);
            (0..=end as i32 * fine)
                .map(|i| filter.advance(signal(at(i))))
                .step_by(fine as usize)
                .collect()
        };
        let force = sample(Box::new(|t| solution.at(t).force(8)));
        let acceleration = sample(Box::new(|t| solution.at(t).intruder_acceleration(8).unwrap()));
        let truth = solution.at(end as f64 / RATE).intruder_dissipated(8).unwrap();
        (bead, force, acceleration, truth)
    }

    fn error(energies: &[f64], truth: f64) -> f64 {
        energies.last().unwrap() / truth - 1.0
    }

    #[test]
    fn a_is_within_one_part_in_fifty_thousand_of_the_full_chain() {
        let (bead, _, acceleration, truth) = samples(None);
        let error = error(&measured(&bead, &acceleration, RATE), truth);
        println!("A, no pole: {error:.2e}");
        assert!(error.abs() < 2e-5, "{error:e}");
    }

    #[test]
    fn b_is_within_one_part_in_fifty_thousand_of_the_full_chain() {
        let (bead, force, _, truth) = samples(None);
        let error = error(&predicted(&bead, &Neighbours::default(), &force, RATE), truth);
        println!("B, no pole: {error:.2e}");
        assert!(error.abs() < 2e-5, "{error:e}");
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
        for host in [7, 10, 14] {
            let (bead, neighbours) = (bead_of(&solution, host).unwrap(), neighbours_of(&solution, host));
            let end = (scenario.duration * RATE) as usize;
            // As long as a window goes on after the wave has come.
            let forces: Vec<f64> = (0..=end)
                .map(|i| solution.at(i as f64 / RATE).force(host))
                .collect();
            let came = forces.iter().position(|force| *force > 0.1).unwrap();
            let forces = &forces[..end.min(came + 512)];
            let truth = solution
                .at(forces.len() as f64 / RATE)
                .intruder_dissipated(host)
                .unwrap();
            let among = error(&predicted(&bead, &neighbours, forces, RATE), truth);
            let alone = error(&predicted(&bead, &Neighbours::default(), forces, RATE), truth);
            println!("bead {host}: B {among:.2e} among others, {alone:.2e} as if alone");
            assert!(among.abs() < 1e-3, "{among:e}");
            assert!(alone.abs() > among.abs());
        }
    }

    #[test]
    fn compensation_takes_the_anti_alias_pole_out_of_both() {
        let (bead, force, acceleration, truth) = samples(Some(40e3));
        let a = |samples: &[f64]| error(&measured(&bead, samples, RATE), truth);
        let b = |samples: &[f64]| error(&predicted(&bead, &Neighbours::default(), samples, RATE), truth);
        let (raw_a, raw_b) = (a(&acceleration), b(&force));
        let (a, b) = (
            a(&lead(&acceleration, RATE / (std::f64::consts::TAU * 40e3))),
            b(&lead(&force, RATE / (std::f64::consts::TAU * 40e3))),
        );
        println!("pole at 40 kHz: A {raw_a:.2e} -> {a:.2e}, B {raw_b:.2e} -> {b:.2e}");
        assert!(raw_a.abs() > 1e-3, "the pole costs A something: {raw_a:e}");
        assert!(a.abs() < 2e-5, "{a:e}");
        assert!(b.abs() < 2e-5, "{b:e}");
    }

    #[test]
    fn a_constant_acceleration_offset_absorbs_nothing() {
        let (bead, ..) = samples(None);
        let energies = measured(&bead, &[3.0; 1000], RATE);
        assert!(energies.last().unwrap().abs() < 1e-25, "{energies:?}");
    }

    #[test]
    fn the_cubic_reproduces_a_cubic() {
        let f = |x: f64| 2.0 - x + 3.0 * x * x - 0.5 * x * x * x;
        let points = [f(-1.0), f(0.0), f(1.0), f(2.0)];
        for i in 0..=10 {
            let phase = f64::from(i) / 10.0;
            assert!((cubic(points, phase) - f(phase)).abs() < 1e-14);
        }
    }
}
