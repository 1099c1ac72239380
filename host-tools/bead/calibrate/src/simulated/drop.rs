//! A drop rig: a ball, a tube, a bead on a block.
//!
//! # Design
//! The ball's contact with the padded cap is integrated: m z'' = m g - F, F = k z (1 + λ z') (Hunt and
//! Crossley 1975, with a flat pad). Between contacts the ball flies. The force goes through the high-pass of
//! the front end, so what the converter sees has the undershoot of a real circuit.

use std::sync::Arc;

use bead_compare::front_end::SensorStimulus;
use bead_recording::file::RecordingError;
use bead_tables::whole::Target;

use crate::drop::DropInputs;
use crate::simulated::bead::{SimulatedBead, chance, deviate, truth};

/// Duration of a contact, s, and λ of the pad times the velocity of the impact. The pad takes about a fifth
/// of the velocity.
const CONTACT: f64 = 1.8e-3;
const LOSS: f64 = 0.4;
/// Step of the integration, s.
const STEP: f64 = 1e-6;
/// Time before the first landing, s: the detector arms itself and the zero is found.
const LEAD_IN: f64 = 0.06;
/// Landings after which the ball is caught.
const LANDINGS: usize = 3;
/// Pause after the longest flight before the next drop, s.
const PAUSE: f64 = 0.3;
/// Standard deviation of a single drop's height, m.
const HAND: f64 = 5e-5;

/// A drop that goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DropFault {
    /// The ball misses the cap after its bounce.
    Missed,
    /// The ball grazes the cap and hands over half of its momentum.
    Grazed,
}

/// A simulated drop test.
#[derive(Debug, Clone)]
pub struct DropRig {
    /// Statements of the operator, from which the truth is drawn.
    pub stated: DropInputs,
    /// Drops from each height.
    pub drops: usize,
    /// Drops that go wrong, counted over each series.
    pub faults: Vec<(usize, DropFault)>,
    /// Seed of the truth and of the noise.
    pub seed: u64,
}

impl DropRig {
    /// Records the drops from height number `height` with a bead.
    ///
    /// # Errors
    /// The file cannot be written, or there is no such height.
    pub fn record(&self, bead: &SimulatedBead, height: usize, target: &Target) -> Result<(), RecordingError> {
        let (landings, seconds) = self.landings(height);
        bead.record(target, &landings, seconds, self.seed.wrapping_add(height as u64))
    }

    /// The force of all drops from a height, and its length, s.
    pub fn landings(&self, height: usize) -> (Landings, f64) {
        let stated = &self.stated;
        // All series share ball, place and axis; each has its own height.
        let mut shared = chance(self.seed, 1);
        let mass = truth(stated.ball_mass, &mut shared);
        let gravity = truth(stated.gravity, &mut shared);
        let tilts = [(); 2].map(|()| stated.tilt * deviate(&mut shared));
        let tau = stated.high_pass.map(|tau| truth(tau, &mut shared));
        let mut own = chance(self.seed, 2 + height as u64);
        let stated_height = stated.heights[height];
        let level = truth(stated_height, &mut own);
        let flight = 2.0 * (2.0 * stated_height.value / stated.gravity.value).sqrt();
        let pad = Pad::under(mass, (2.0 * gravity * stated_height.value).sqrt());
        let cosine = tilts[0].hypot(tilts[1]).cos();
        let mut pulses = Vec::new();
        let mut time = LEAD_IN;
        for drop in 0..self.drops {
            let fault = self.faults.iter().find(|(number, _)| *number == drop);
            let fault = fault.map(|(_, fault)| *fault);
            let fallen = level + HAND * deviate(&mut own);
            let mut velocity = (2.0 * gravity * fallen).sqrt();
            // Drops are not synchronous with the sample clock.
            let mut begin = time + (deviate(&mut own).abs() * 1e-3).min(0.01);
            for _ in 0..LANDINGS {
                let (mut forces, outgoing, lasts) = pad.land(mass, gravity, velocity);
                let part = if fault == Some(DropFault::Grazed) {
                    0.5
                } else {
                    1.0
                };
                forces.iter_mut().for_each(|force| *force *= part * cosine);
                pulses.push((begin, forces));
                if fault == Some(DropFault::Missed) {
                    break;
                }
                begin += lasts + 2.0 * outgoing / gravity;
                velocity = outgoing;
            }
            time = begin + flight + PAUSE;
        }
        (Landings::new(pulses, tau), time)
    }
}

/// The pad on the cap.
#[derive(Debug, Clone, Copy)]
struct Pad {
    stiffness: f64,
    damping: f64,
}

impl Pad {
    /// The pad that lets a ball of this mass and velocity touch for [`CONTACT`].
    fn under(mass: f64, velocity: f64) -> Self {
        Self {
            stiffness: mass * (std::f64::consts::PI / CONTACT).powi(2),
            damping: LOSS / velocity,
        }
    }

    /// Forces of a contact every [`STEP`], the velocity after it, and its duration.
    fn land(&self, mass: f64, gravity: f64, velocity: f64) -> (Vec<f64>, f64, f64) {
        let force = |z: f64, v: f64| (self.stiffness * z * (1.0 + self.damping * v)).max(0.0);
        let rate = |z: f64, v: f64| (v, gravity - force(z, v) / mass);
        let (mut z, mut v) = (0.0, velocity);
        let mut forces = vec![0.0];
        loop {
            let (z1, v1) = rate(z, v);
            let (z2, v2) = rate(z + 0.5 * STEP * z1, v + 0.5 * STEP * v1);
            let (z3, v3) = rate(z + 0.5 * STEP * z2, v + 0.5 * STEP * v2);
            let (z4, v4) = rate(z + STEP * z3, v + STEP * v3);
            let next_z = z + STEP / 6.0 * (z1 + 2.0 * (z2 + z3) + z4);
            let next_v = v + STEP / 6.0 * (v1 + 2.0 * (v2 + v3) + v4);
            if next_z <= 0.0 {
                // The ball leaves between two steps.
                let part = z / (z - next_z);
                let outgoing = -(v + part * (next_v - v));
                let lasts = STEP * (forces.len() as f64 - 1.0 + part);
                forces.push(0.0);
                return (forces, outgoing, lasts);
            }
            (z, v) = (next_z, next_v);
            forces.push(force(z, v));
        }
    }
}

/// The force of landings after a high-pass, N over s.
#[derive(Debug, Clone)]
pub struct Landings {
    pulses: Arc<[Pulse]>,
    /// Time constant of the high-pass, s.
    tau: Option<f64>,
    near: usize,
}

/// A contact, and the undershoot after it.
#[derive(Debug)]
struct Pulse {
    begin: f64,
    forces: Vec<f64>,
    /// Force after the high-pass at the end of the contact, N.
    left: f64,
}

impl Landings {
    fn new(contacts: Vec<(f64, Vec<f64>)>, tau: Option<f64>) -> Self {
        // The low-pass part that the high-pass removes, and the time of this value.
        let (mut slow, mut since) = (0.0, 0.0);
        let pulses = contacts.into_iter().map(|(begin, mut forces)| {
            if let Some(tau) = tau {
                slow *= (-(begin - since) / tau).exp();
                let mut before = 0.0;
                for force in &mut forces {
                    slow += STEP / tau * (0.5 * (*force + before) - slow);
                    before = *force;
                    *force -= slow;
                }
                since = begin + STEP * (forces.len() - 1) as f64;
            }
            Pulse {
                begin,
                forces,
                left: -slow,
            }
        });
        Self {
            pulses: pulses.collect(),
            tau,
            near: 0,
        }
    }
}

impl SensorStimulus for Landings {
    fn force(&mut self, time: f64) -> f64 {
        if self.pulses.get(self.near).is_some_and(|pulse| pulse.begin > time) {
            self.near = 0;
        }
        while self
            .pulses
            .get(self.near + 1)
            .is_some_and(|next| next.begin <= time)
        {
            self.near += 1;
        }
        let Some(pulse) = self.pulses.get(self.near).filter(|pulse| pulse.begin <= time) else {
            return 0.0;
        };
        let place = (time - pulse.begin) / STEP;
        let at = place as usize;
        match pulse.forces.get(at..at + 2) {
            Some(pair) => pair[0] + (place - at as f64) * (pair[1] - pair[0]),
            None => {
                let since = time - pulse.begin - STEP * (pulse.forces.len() - 1) as f64;
                self.tau.map_or(0.0, |tau| pulse.left * (-since / tau).exp())
            }
        }
    }

    fn acceleration(&mut self, _: f64) -> f64 {
        0.0
    }

    fn silent_until(&self, time: f64) -> f64 {
        if self.tau.is_some() && self.pulses.first().is_some_and(|pulse| pulse.begin <= time) {
            return time;
        }
        let ends = |pulse: &Pulse| pulse.begin + STEP * pulse.forces.len() as f64;
        let next = self.pulses.iter().find(|pulse| ends(pulse) > time);
        next.map_or(f64::INFINITY, |pulse| pulse.begin.max(time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_hands_over_the_momentum_of_ball_and_weight() {
        let (mass, gravity, velocity) = (3.046e-3, 9.81, 1.4007);
        let (forces, outgoing, lasts) = Pad::under(mass, velocity).land(mass, gravity, velocity);
        let area: f64 = STEP * forces.iter().sum::<f64>();
        let momentum = mass * (velocity + outgoing + gravity * lasts);
        assert!((area / momentum - 1.0).abs() < 1e-6, "{area} {momentum}");
        assert!((0.5..0.9).contains(&(outgoing / velocity)), "{outgoing}");
    }

    #[test]
    fn behind_a_high_pass_an_area_decays_with_its_time_constant() {
        let tau = 0.5;
        let pulse = vec![(0.01, vec![1.0; 1001])];
        let mut landings = Landings::new(pulse, Some(tau));
        let area: f64 = (0..200_000)
            .map(|at| 1e-6 * landings.force(1e-6 * f64::from(at)))
            .sum();
        let expected = 1e-3 * (-(0.2 - 0.0105) / tau).exp();
        assert!((area / expected - 1.0).abs() < 2e-3, "{area} {expected}");
    }
}
