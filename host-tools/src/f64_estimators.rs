//! Estimates A and B in f64, from the same samples that the bead had: what its fixed point and its step a sample
//! cost.
//!
//! # Design
//! Nothing here is shared with the fixed-point code but the physics, so that an error in one shows against the
//! other. A integrates the intruder's first-order law exactly for an acceleration that is straight between samples;
//! B runs the reduced chain by Runge-Kutta with [`SUBSTEPS`] steps a sample, on a force interpolated by cubics. Both
//! return the running energy, sample by sample.

use crate::front_end::first_order_hold;

/// Beads behind the host in the reduced chain: a free end after four is within 0.006 % of the endless chain.
pub const FOLLOWERS: usize = 4;
/// Runge-Kutta steps in one sample period: 2 MHz at 100 kHz.
pub const SUBSTEPS: usize = 20;

/// What the estimates know of the bead, in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plant {
    /// Mass of a bead, the host's intruder included, in kg.
    pub bead_mass: f64,
    /// Mass of the intruder in kg.
    pub intruder_mass: f64,
    /// Stiffness of the intruder's suspension in N/m.
    pub stiffness: f64,
    /// Damping of the intruder's suspension in N·s/m.
    pub damping: f64,
    /// Hertz stiffness κ of a contact between two beads in N/m^1.5.
    pub contact: f64,
    /// Relaxation time τ of a contact between two beads in s.
    pub relaxation: f64,
}

/// Takes a one-pole low-pass out of its samples: `s = y + ẏ/ω`, with the derivative by the five-point central
/// difference (fourth order). The two samples at either end take what derivative they can.
pub fn compensate(samples: &[f64], pole_hz: f64, rate_hz: f64) -> Vec<f64> {
    let in_samples = rate_hz / (std::f64::consts::TAU * pole_hz);
    let at = |i: isize| samples[i.clamp(0, samples.len() as isize - 1) as usize];
    (0..samples.len() as isize)
        .map(|i| {
            let slope = (8.0 * (at(i + 1) - at(i - 1)) - (at(i + 2) - at(i - 2))) / 12.0;
            at(i) + in_samples * slope
        })
        .collect()
}

/// Estimate A: energy in J absorbed since the first sample, at each sample, from the intruder's absolute
/// acceleration in m/s². The intruder is at rest on its springs at the first sample.
pub fn measured(plant: &Plant, acceleration: &[f64], rate_hz: f64) -> Vec<f64> {
    let period = 1.0 / rate_hz;
    let [decay, old, new] = first_order_hold(plant.stiffness / plant.damping * period);
    let quasi_static = -plant.intruder_mass / plant.stiffness;
    let mut displacement = quasi_static * acceleration.first().copied().unwrap_or(0.0);
    let mut energy = 0.0;
    let mut previous: Option<(f64, f64)> = None;
    acceleration
        .iter()
        .map(|&a| {
            if let Some((a_old, _)) = previous {
                displacement = decay * displacement + quasi_static * (old * a_old + new * a);
            }
            let velocity = -(plant.intruder_mass * a + plant.stiffness * displacement) / plant.damping;
            let power = plant.damping * velocity * velocity;
            if let Some((_, power_old)) = previous {
                energy += 0.5 * period * (power_old + power);
            }
            previous = Some((a, power));
            energy
        })
        .collect()
}

/// Estimate B: energy in J absorbed since the first sample, at each sample, from the total force at the host's
/// incoming contact in N. Everything is at rest, just touching, at the first sample.
pub fn predicted(plant: &Plant, force: &[f64], rate_hz: f64) -> Vec<f64> {
    let step = 1.0 / rate_hz / SUBSTEPS as f64;
    let at = |i: isize| force[i.clamp(0, force.len() as isize - 1) as usize];
    let mut state = State::default();
    let mut energies = Vec::with_capacity(force.len());
    for i in 0..force.len() as isize {
        energies.push(state.0[ENERGY]);
        let points = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for substep in 0..SUBSTEPS {
            let phase = substep as f64 / SUBSTEPS as f64;
            let half = 0.5 / SUBSTEPS as f64;
            state = runge_kutta(
                plant,
                &state,
                step,
                [
                    cubic(points, phase),
                    cubic(points, phase + half),
                    cubic(points, phase + 2.0 * half),
                ],
            );
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

/// Bodies: the host, then its followers. Layout: displacements, velocities, intruder relative displacement and
/// velocity, energy absorbed.
const BODIES: usize = FOLLOWERS + 1;
const INTRUDER: usize = 2 * BODIES;
const ENERGY: usize = INTRUDER + 2;

#[derive(Clone, Copy, Default)]
struct State([f64; ENERGY + 1]);

impl State {
    fn plus(&self, scale: f64, rate: &Self) -> Self {
        let mut sum = *self;
        for (value, rate) in sum.0.iter_mut().zip(rate.0) {
            *value += scale * rate;
        }
        sum
    }
}

fn rate(plant: &Plant, state: &State, incoming: f64) -> State {
    let y = &state.0;
    let mut rate = State::default();
    let mut push = incoming;
    let suspension = plant.stiffness * y[INTRUDER] + plant.damping * y[INTRUDER + 1];
    for body in 0..BODIES {
        let outgoing = if body + 1 < BODIES {
            contact_force(
                plant,
                y[body] - y[body + 1],
                y[BODIES + body] - y[BODIES + body + 1],
            )
        } else {
            0.0
        };
        let (mass, spring) = if body == 0 {
            (plant.bead_mass - plant.intruder_mass, suspension)
        } else {
            (plant.bead_mass, 0.0)
        };
        rate.0[body] = y[BODIES + body];
        rate.0[BODIES + body] = (push - outgoing + spring) / mass;
        push = outgoing;
    }
    rate.0[INTRUDER] = y[INTRUDER + 1];
    rate.0[INTRUDER + 1] = -suspension / plant.intruder_mass - rate.0[BODIES];
    rate.0[ENERGY] = plant.damping * y[INTRUDER + 1] * y[INTRUDER + 1];
    rate
}

/// The paper's Eq. (1): Hertz and Kuwabara-Kono, nothing where the beads have parted.
fn contact_force(plant: &Plant, overlap: f64, approach: f64) -> f64 {
    if overlap <= 0.0 {
        return 0.0;
    }
    plant.contact * overlap.sqrt() * (overlap + 1.5 * plant.relaxation * approach)
}

fn runge_kutta(plant: &Plant, state: &State, step: f64, [start, middle, end]: [f64; 3]) -> State {
    let k1 = rate(plant, state, start);
    let k2 = rate(plant, &state.plus(0.5 * step, &k1), middle);
    let k3 = rate(plant, &state.plus(0.5 * step, &k2), middle);
    let k4 = rate(plant, &state.plus(step, &k3), end);
    state
        .plus(step / 6.0, &k1)
        .plus(step / 3.0, &k2)
        .plus(step / 3.0, &k3)
        .plus(step / 6.0, &k4)
}
