//! Equations of motion, (1) to (3) of the paper.
//!
//! With overlap δ = U[j-1] - U[j] of contact j and nothing acting where δ ≤ 0:
//!
//! ```text
//! F = κ δ^(3/2) + (3/2) τ κ δ^(1/2) δ'          Hertz, and Kuwabara and Kono's viscous part
//! κ = 1 / (θa + θb) / √(1/Ra + 1/Rb)            θ = 3 (1 - ν²) / (4 Y)
//! τ = (θa τa + θb τb) / (θa + θb)               two Kelvin-Voigt halves in series
//! (M - m) U'' = ΣF + k x + c x'                 a bead and, in a host, x = u - U
//! m u'' = -k x - c x'                           the intruder; -k x - k₃ x³ - c x' on a spring that hardens
//! ```
//!
//! A ground that drags adds -M V/τ to the force on each bead.
//!
//! An intruder may be carried by another one. Then x is its displacement relative to its carrier, on which
//! its spring and damper act in place of the bead.
//!
//! Eq. (1) as printed lacks the condition on δ.
//!
//! A static load F₀ on the chain adds a constant to the force of every contact but the striker's, and is
//! balanced at either end. It is left out on both sides: displacements count from the loaded chain at rest,
//! and beads are accelerated by the part of the contact forces *beyond* F₀. That part is computed without
//! subtracting two large numbers, so a weak wave on a strongly loaded chain is as exact as any.
//!
//! On a vertical chain each contact has a load of its own: F₀ and the weight of all bodies above. The weights
//! are thereby left out as F₀ is. Only a striker that no contact carries yet falls by its weight.
//!
//! A drive acts on body 0: as a force beside its contact's, or as its motion, which no force then changes.
//!
//! The energies dissipated by the contacts' viscous parts and by the intruders' dampers are components of the
//! state. They are integrated with the motion and are as exact.

mod contact;
mod energies;
mod hosted;
mod layout;
mod start;
#[cfg(test)]
mod symmetry;

use std::ops::Range;
use std::sync::Arc;

pub use self::contact::Contact;
pub(crate) use self::contact::{compliance, series_relaxation};
pub use self::energies::Energies;
pub use self::hosted::HostedIntruder;
pub(crate) use self::layout::StateLayout;
use self::start::{intruder_starts, loads, starts};
use crate::drive::EndDrive;
use crate::power_law::power;
use crate::scenario::{ContactForce, InputError, Material, Scenario, Sphere};

/// The bodies, contacts and intruders of a scenario. Methods panic if a body or contact is not in the chain.
#[derive(Debug, Clone)]
pub struct Model {
    /// Radii of bodies 0..=N, m.
    radii: Vec<f64>,
    /// Mass of bodies 0..=N, intruders included, kg.
    masses: Vec<f64>,
    /// Masses without the intruders, kg, which contacts and springs accelerate directly.
    pub(crate) shells: Vec<f64>,
    /// Contacts 1..=N, and N + 1 if there is a wall, at index j - 1.
    contacts: Vec<Contact>,
    /// Intruders in the order of their beads, those of a bead in the order of their tables.
    intruders: Vec<HostedIntruder>,
    /// True if an intruder carries another one.
    nests: bool,
    /// True if contact forces are clipped at zero.
    pub(crate) clipped: bool,
    /// Displacement, m, and velocity, m/s, of each body at t = 0. Displacements would be zero if all bodies
    /// stood in contact, the last bead at the wall.
    pub(crate) starts: Vec<(f64, f64)>,
    /// Displacement, m, and velocity, m/s, of each intruder at t = 0 relative to its host or carrier.
    intruder_starts: Vec<(f64, f64)>,
    /// 1/τ of a ground that drags, 1/s; zero for one that does not.
    drag: f64,
    /// Forces on body 0 other than that of its contact, or its motion.
    pub(crate) drive: Option<Arc<EndDrive>>,
    /// Speed that a drive, gravity or displaced bodies give, m/s; zero for a strike.
    given_speed: f64,
}

/// Reduced mass at each contact of bodies of these masses, kg. At a wall it is the mass of the last bead.
fn reduced(masses: &[f64]) -> impl Iterator<Item = f64> {
    let pairs = masses.windows(2);
    pairs
        .map(|pair| pair[0] * pair[1] / (pair[0] + pair[1]))
        .chain(masses.last().copied())
}

impl Model {
    /// Builds the model of a scenario that has been checked.
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let striker = &scenario.striker;
        let beads = scenario.spheres();
        let first = Sphere {
            radius: striker.radius,
            material: striker.material(),
            relaxation: striker.relaxation.unwrap_or(beads[0].relaxation),
        };
        let bodies: Vec<_> = std::iter::once(first).chain(beads).collect();
        let mut masses: Vec<f64> = bodies.iter().map(Sphere::mass).collect();
        masses[0] = striker.mass.unwrap_or(masses[0]);

        let side = |body: &Sphere| {
            let Material { young, poisson, .. } = body.material;
            (compliance(young, poisson), 1.0 / body.radius, body.relaxation)
        };
        let mut sides: Vec<(f64, f64, f64)> = bodies.iter().map(side).collect();
        sides.extend(scenario.wall.as_ref().map(|wall| {
            let relaxation = wall.relaxation.unwrap_or(bodies[bodies.len() - 1].relaxation);
            let curvature = wall.radius.map_or(0.0, |radius| 1.0 / radius);
            (compliance(wall.young, wall.poisson), curvature, relaxation)
        }));
        let joints = sides
            .windows(2)
            .zip(loads(scenario, &masses))
            .zip(reduced(&masses));
        let contacts = joints.map(|((pair, load), reduced_mass)| {
            let [(near, near_curvature, near_time), (far, far_curvature, far_time)] = [pair[0], pair[1]];
            let (relaxation, curvature) = (
                series_relaxation((near, near_time), (far, far_time)),
                near_curvature + far_curvature,
            );
            let contact = Contact::new(near + far, curvature, relaxation, load);
            let law = scenario.contact.as_ref();
            law.map_or(contact, |law| contact.with_law(law, curvature, reduced_mass))
        });
        let contacts: Vec<Contact> = contacts.collect();

        let intruders = hosted::of(scenario);
        let mut shells = masses.clone();
        for intruder in &intruders {
            shells[intruder.bead] -= intruder.oscillator.mass;
        }
        let clipped = scenario.chain.contact_force == ContactForce::Clipped;
        let falls = scenario.chain.gravity > 0.0 && !scenario.loads_striker();
        let weight = if falls {
            masses[0] * scenario.chain.gravity
        } else {
            0.0
        };
        let drive = EndDrive::new(scenario.drive.as_ref(), weight, masses[0]);
        let mut starts = starts(scenario);
        if let Some(start) = drive.as_ref().and_then(|drive| drive.motion(0.0)) {
            starts[0] = start;
            shells[0] = f64::INFINITY;
        }
        let intruder_starts = intruder_starts(scenario, &intruders);
        let mut model = Self {
            radii: bodies.iter().map(|body| body.radius).collect(),
            masses,
            shells,
            contacts,
            nests: intruders.iter().any(|intruder| intruder.carrier.is_some()),
            intruders,
            clipped,
            starts,
            intruder_starts,
            drag: scenario.chain.drag_time.map_or(0.0, f64::recip),
            drive: drive.map(Arc::new),
            given_speed: 0.0,
        };
        model.given_speed = model.speed_of_what_is_given(scenario);
        model
    }

    /// Estimate of the greatest speed, m/s, that a drive, gravity and displaced bodies may give a body. The
    /// accuracy of a step is relative to it.
    fn speed_of_what_is_given(&self, scenario: &Scenario) -> f64 {
        let contact = &self.contacts[0];
        let driven = self.drive.as_ref().map_or(0.0, |drive| {
            let greatest = drive.greatest();
            if drive.prescribed || greatest == 0.0 {
                return greatest;
            }
            // A force F that changes slowly moves a lattice at F / √(K M).
            let hertz = 1.5 * contact.stiffness.powf(2.0 / 3.0) * greatest.cbrt();
            greatest / (hertz.max(contact.linear_stiffness()) * self.masses[1]).sqrt()
        });
        let gap = (self.starts[1].0 - self.starts[0].0).max(0.0);
        let fallen = (2.0 * scenario.chain.gravity * gap).sqrt();
        let displaced = scenario.starts.iter().any(|start| start.displacement != 0.0);
        let stored = displaced || self.intruder_starts.iter().any(|start| *start != (0.0, 0.0));
        let released = if stored {
            let lightest = self.masses.iter().copied().fold(f64::INFINITY, f64::min);
            let energies = self.energies(&self.initial());
            (2.0 * (energies.chain + energies.intruders) / lightest).sqrt()
        } else {
            0.0
        };
        driven
            .max(if self.drive.is_some() { fallen } else { 0.0 })
            .max(released)
    }

    /// Checks a scenario and builds its model. Nothing is integrated.
    ///
    /// # Errors
    /// [`InputError`]: a value of the scenario is out of range.
    pub fn of(scenario: &Scenario) -> Result<Self, InputError> {
        scenario.check()?;
        let model = Self::new(scenario);
        model.check_loads(scenario)?;
        Ok(model)
    }

    /// Refuses a load that presses a body flat.
    fn check_loads(&self, scenario: &Scenario) -> Result<(), InputError> {
        for (number, contact) in (1..)
            .zip(&self.contacts)
            .filter(|(_, contact)| contact.load > 0.0)
        {
            let far = self.radii.get(number).copied().unwrap_or(f64::INFINITY);
            let (radius, overlap) = (self.radii[number - 1].min(far), contact.static_overlap);
            if overlap >= radius {
                let what = format!(
                    "a load of {:.3e} N presses the bodies of contact {number} together by {overlap:.3e} m, as much as the \
                     radius of {radius} m or more",
                    contact.load
                );
                let is_pressed = scenario.chain.precompression > 0.0;
                let key = if is_pressed {
                    "chain.precompression"
                } else {
                    "chain.gravity"
                };
                return Err(InputError::at(key, what, "give less, or check young"));
            }
        }
        Ok(())
    }

    /// Number of bodies: the striker and the beads.
    pub fn bodies(&self) -> usize {
        self.masses.len()
    }

    /// Mass of a body, kg, an intruder included.
    pub fn mass(&self, body: usize) -> f64 {
        self.masses[body]
    }

    /// Radius of a body, m.
    pub fn radius(&self, body: usize) -> f64 {
        self.radii[body]
    }

    /// Number of contacts, which are counted from 1. There are as many as beads, and one more with a wall.
    pub fn contacts(&self) -> usize {
        self.contacts.len()
    }

    /// Contact `contact`, which joins bodies `contact - 1` and `contact`, or the last bead and the wall.
    pub fn contact(&self, contact: usize) -> Contact {
        *self.contact_at(contact)
    }

    /// [`Model::contact`] without a copy.
    #[inline]
    pub(crate) fn contact_at(&self, contact: usize) -> &Contact {
        assert!(
            (1..=self.contacts.len()).contains(&contact),
            "contact {contact} is not of this chain"
        );
        &self.contacts[contact - 1]
    }

    /// The intruders, in the order of their beads.
    pub fn intruders(&self) -> &[HostedIntruder] {
        &self.intruders
    }

    /// Kinetic energy of the striker at t = 0, J.
    pub fn striker_energy(&self) -> f64 {
        self.kinetic(0)
    }

    /// Kinetic energy of a body at t = 0, J; zero for a body that follows a displacement.
    fn kinetic(&self, body: usize) -> f64 {
        let velocity = self.starts[body].1;
        if body == 0 {
            return self.striker_energy_at(velocity);
        }
        0.5 * self.masses[body] * velocity * velocity
    }

    /// True if a drive or the weight of a falling striker acts on body 0.
    pub fn is_driven(&self) -> bool {
        self.drive.is_some()
    }

    /// Coefficient M/τ of the ground's drag on a body, N·s/m.
    pub(crate) fn drag_on(&self, body: usize) -> f64 {
        if body == 0 {
            0.0
        } else {
            self.masses[body] * self.drag
        }
    }

    /// True if the ground drags.
    pub(crate) fn is_dragged(&self) -> bool {
        self.drag > 0.0
    }

    /// True if body 0 follows a displacement.
    pub(crate) fn is_prescribed(&self) -> bool {
        self.shells[0] == f64::INFINITY
    }

    /// Kinetic energy of body 0 at a velocity in m/s, J.
    pub(crate) fn striker_energy_at(&self, velocity: f64) -> f64 {
        if self.is_prescribed() {
            return 0.0;
        }
        0.5 * self.masses[0] * velocity * velocity
    }

    /// Energy of all bodies at t = 0, J: that of the striker, and of beads and intruders that move or are
    /// displaced then.
    pub fn initial_energy(&self) -> f64 {
        if self.given_speed > 0.0 {
            return self.energies(&self.initial()).total();
        }
        (0..self.bodies()).map(|body| self.kinetic(body)).sum()
    }

    /// True if beads or intruders are displaced at t = 0, or intruders move in their hosts.
    pub(crate) fn starts_displaced(&self) -> bool {
        self.given_speed > 0.0
    }

    /// Speed of the striker at t = 0, m/s.
    pub fn striker_speed(&self) -> f64 {
        self.starts[0].1
    }

    /// The scale of velocities, m/s: the greatest difference of velocities at t = 0, zero among them.
    pub(crate) fn speed_scale(&self) -> f64 {
        // A free end or a wall is at rest.
        let velocities = || self.starts.iter().map(|start| start.1);
        let apart = velocities().fold(0.0, f64::max) - velocities().fold(0.0, f64::min);
        apart.max(self.given_speed)
    }

    pub(crate) fn layout(&self) -> StateLayout {
        StateLayout {
            bodies: self.masses.len(),
            intruders: self.intruders.len(),
            walled: self.contacts.len() == self.masses.len(),
            driven: self.drive.is_some(),
            dragged: self.drag > 0.0,
        }
    }

    /// The state at t = 0.
    pub(crate) fn initial(&self) -> Vec<f64> {
        let layout = self.layout();
        let mut state = vec![0.0; layout.dimension()];
        for (body, (displacement, velocity)) in self.starts.iter().enumerate() {
            state[body] = *displacement;
            state[layout.velocity(body)] = *velocity;
        }
        for (intruder, (displacement, velocity)) in self.intruder_starts.iter().enumerate() {
            state[layout.relative(intruder)] = *displacement;
            state[layout.relative_velocity(intruder)] = *velocity;
        }
        state
    }

    /// Change of the overlap of contact `j` (from 1) since rest, m, and its rate, m/s.
    pub(crate) fn change(&self, y: &[f64], j: usize) -> (f64, f64) {
        let (displacement, rest) = y.split_at(self.masses.len());
        // The wall does not move.
        let difference = |of: &[f64]| of[j - 1] - if j < self.masses.len() { of[j] } else { 0.0 };
        (difference(displacement), difference(rest))
    }

    /// Overlap of contact `j` (from 1), m, and its rate, m/s.
    pub(crate) fn overlap(&self, y: &[f64], j: usize) -> (f64, f64) {
        let (change, rate) = self.change(y, j);
        (self.contacts[j - 1].static_overlap + change, rate)
    }

    /// Total force of contact `j` (from 1), N.
    pub(crate) fn force(&self, y: &[f64], j: usize) -> f64 {
        let (change, rate) = self.change(y, j);
        self.force_at(j, change, rate)
    }

    pub(crate) fn force_at(&self, j: usize, change: f64, rate: f64) -> f64 {
        let contact = &self.contacts[j - 1];
        let overlap = contact.static_overlap + change;
        let force = contact.elastic_force(overlap) + contact.viscous_force(overlap, rate);
        if self.clipped { force.max(0.0) } else { force }
    }

    /// Force of contact `j` (from 1) beyond its static load, N.
    pub(crate) fn force_beyond(&self, y: &[f64], j: usize) -> f64 {
        if self.contacts[j - 1].load == 0.0 {
            return self.force(y, j);
        }
        let (change, rate) = self.change(y, j);
        self.force_beyond_at(j, change, rate)
    }

    pub(crate) fn force_beyond_at(&self, j: usize, change: f64, rate: f64) -> f64 {
        self.push(&self.contacts[j - 1], change, rate).0
    }

    /// Returns true if the force of contact `j` (from 1) is clipped at zero.
    #[cfg(test)]
    pub(crate) fn limited(&self, y: &[f64], j: usize) -> bool {
        let (overlap, approach) = self.overlap(y, j);
        self.limits(&self.contacts[j - 1], overlap, approach)
    }

    fn limits(&self, contact: &Contact, overlap: f64, approach: f64) -> bool {
        // Without the common factor (κ/2) √δ.
        self.clipped && overlap > 0.0 && 2.0 * overlap + 3.0 * contact.relaxation * approach < 0.0
    }

    /// Force of a contact beyond its static load, and the part of the force that dissipates energy, N.
    /// `change` is the change of the overlap since rest, m, and `approach` its rate, m/s.
    #[inline]
    fn push(&self, contact: &Contact, change: f64, approach: f64) -> (f64, f64) {
        let overlap = contact.static_overlap + change;
        if overlap <= 0.0 {
            return (-contact.load, 0.0);
        }
        if let Some(powers) = &contact.powers {
            let viscous = powers.damping_force(contact.stiffness, overlap, approach);
            return (contact.elastic_force_beyond(change) + viscous, viscous);
        }
        let stiffness = contact.stiffness * overlap.sqrt();
        let elastic = stiffness * overlap;
        let viscous = 1.5 * contact.relaxation * stiffness * approach;
        if self.clipped && elastic + viscous < 0.0 {
            return (-contact.load, -elastic);
        }
        if contact.load == 0.0 {
            let force = elastic + viscous;
            return (force, force - elastic);
        }
        (contact.elastic_force_beyond(change) + viscous, viscous)
    }

    /// The shortest contact time of two of these bodies that meet at the greatest speed, s. It is Hertz'
    /// time, 2.943 (5/4)^(2/5) (μ/κ)^(2/5) V^(-1/5) (eq. 9; the factor is 4 √π Γ(2/5) / (5 Γ(9/10))).
    pub(crate) fn shortest_contact(&self) -> f64 {
        let speed = self.speed_scale();
        let contacts = self.contacts.iter().zip(reduced(&self.masses));
        let time = |(contact, reduced): (&Contact, f64)| {
            if contact.powers.is_some() {
                return if speed > 0.0 {
                    contact.law().contact_time(reduced, speed)
                } else {
                    f64::INFINITY
                };
            }
            2.943_275_184 * (1.25 * reduced / contact.stiffness).powf(0.4) * speed.powf(-0.2)
        };
        contacts.map(time).fold(f64::INFINITY, f64::min)
    }

    /// The fastest rate of an intruder or of a loaded contact, 1/s: that of its spring or of its damper.
    pub(crate) fn fastest_rate(&self) -> f64 {
        let contacts = self.contacts.iter().zip(reduced(&self.masses));
        let loaded = contacts.map(|(contact, reduced)| {
            // A bead has a contact on either side, so the stiffness is twice that of one.
            let rate = 2.0 * contact.linear_stiffness() / reduced;
            if let Some(powers) = &contact.powers {
                let slope = powers.damping_slope(contact.stiffness, contact.static_overlap);
                let damped = 2.0 * slope / reduced;
                return rate.sqrt().max(damped);
            }
            rate.sqrt().max(rate * contact.relaxation)
        });
        let intruders = (0..self.intruders.len()).map(|number| self.rate_of(number));
        let dragged = (0..self.bodies()).map(|body| self.drag_on(body) / self.shells[body]);
        intruders.chain(loaded).chain(dragged).fold(0.0, f64::max)
    }

    fn rate_of(&self, number: usize) -> f64 {
        let intruder = &self.intruders[number];
        let (host, shell) = (self.masses[intruder.bead], self.shells[intruder.bead]);
        let mass = intruder.oscillator.mass;
        // A mass is divided equally among the springs that it is attached to.
        let springs = |number: usize| 1.0 + self.carried_by(number).count() as f64;
        let reduced = match intruder.carrier {
            None => mass * shell / host / springs(number),
            Some(carrier) => {
                let other = self.intruders[carrier].oscillator.mass;
                mass * other / (springs(number) * other + springs(carrier) * mass)
            }
        };
        let undamped = (intruder.oscillator.stiffness / reduced).sqrt();
        undamped.max(intruder.oscillator.damping / reduced)
    }

    /// Host and rate, 1/s, of an intruder 100,000 times faster than any collision; no resonator is so fast.
    pub(crate) fn absurd_intruder(&self) -> Option<(usize, f64)> {
        let of = |number: usize| (self.intruders[number].bead, self.rate_of(number));
        let fastest = (0..self.intruders.len())
            .map(of)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        fastest.filter(|(_, rate)| rate * self.shortest_contact() > 6e5)
    }

    /// The longest step, s, of a run whose accuracy has this [`longest_step`](crate::Accuracy::longest_step).
    /// The method is stable for steps of up to about 6 of the shortest time constants.
    pub(crate) fn longest_step(&self, longest_step: f64) -> f64 {
        (longest_step * self.shortest_time()).min(6.0 / self.fastest_rate())
    }

    /// The shortest contact time, or the shortest period of a drive if that is less, s.
    pub(crate) fn shortest_time(&self) -> f64 {
        let period = self.drive.as_ref().map_or(f64::INFINITY, |drive| drive.period());
        self.shortest_contact().min(period)
    }

    /// The scale of displacements, m: the depth to which the body of greatest energy presses into a bead at
    /// rest.
    pub(crate) fn displacement_scale(&self) -> f64 {
        let energies = (0..self.bodies()).map(|body| self.kinetic(body));
        let given = 0.5 * self.masses[1] * self.given_speed * self.given_speed;
        let most = energies.fold(given, f64::max);
        if self.contacts[0].powers.is_some() {
            // The energy of a reduced mass of 2 kg at a speed of √E.
            return self.contacts[0].law().greatest_overlap(2.0, most.sqrt());
        }
        (2.5 * most / self.contacts[0].stiffness).powf(0.4)
    }

    /// Writes the rate of change of the state `y` at time `t`, s, to `rate`, which has the same length.
    pub(crate) fn rate(&self, t: f64, y: &[f64], rate: &mut [f64]) {
        let layout = self.layout();
        let (displacement, rest) = y.split_at(layout.bodies);
        let velocity = &rest[..layout.bodies];
        let (displacement_rate, rest) = rate.split_at_mut(layout.bodies);
        let (acceleration, rest) = rest.split_at_mut(layout.bodies);
        displacement_rate.copy_from_slice(velocity);
        acceleration.fill(0.0);

        let mut loss = 0.0;
        let beads = layout.bodies - 1;
        for (j, contact) in self.contacts[..beads].iter().enumerate() {
            let approach = velocity[j] - velocity[j + 1];
            let (force, viscous) = self.push(contact, displacement[j] - displacement[j + 1], approach);
            loss += viscous * approach;
            acceleration[j] -= force;
            acceleration[j + 1] += force;
        }
        let mut wall_force = 0.0;
        if let Some(wall) = self.contacts.get(beads) {
            let (force, viscous) = self.push(wall, displacement[beads], velocity[beads]);
            loss += viscous * velocity[beads];
            acceleration[beads] -= force;
            wall_force = force;
        }

        // `rest` begins where the intruders' relative displacements do.
        let base = 2 * layout.bodies;
        if let Some(index) = layout.wall_impulse() {
            rest[index - base] = wall_force;
        }
        for (i, intruder) in self.intruders.iter().enumerate() {
            let x = y[layout.relative(i)];
            let x_rate = y[layout.relative_velocity(i)];
            let oscillator = &intruder.oscillator;
            let pull = intruder.pull(x, x_rate);
            match intruder.carrier {
                None => acceleration[intruder.bead] += pull,
                Some(carrier) => {
                    rest[layout.relative_velocity(carrier) - base] +=
                        pull / self.intruders[carrier].oscillator.mass;
                }
            }
            rest[layout.relative(i) - base] = x_rate;
            rest[layout.relative_velocity(i) - base] = -pull / oscillator.mass;
            rest[layout.intruder_loss(i) - base] = oscillator.damping * x_rate * x_rate;
        }
        rest[layout.contact_loss() - base] = loss;
        if let Some(index) = layout.ground_loss() {
            let pulls = (1..layout.bodies).map(|body| (body, self.drag_on(body) * velocity[body]));
            rest[index - base] = 0.0;
            for (body, pull) in pulls {
                acceleration[body] -= pull;
                rest[index - base] += pull * velocity[body];
            }
        }
        if let (Some(drive), Some(index)) = (&self.drive, layout.drive_work()) {
            let push = if drive.prescribed {
                -acceleration[0]
            } else {
                drive.force(t)
            };
            rest[index - base] = push * velocity[0];
        }
        for (acceleration, shell) in acceleration.iter_mut().zip(&self.shells) {
            *acceleration /= shell;
        }
        if let Some(drive) = &self.drive {
            acceleration[0] += drive.acceleration(t);
        }
        // Carried intruders come first, while the rate of their carrier is still its own acceleration.
        for (i, intruder) in self.intruders.iter().enumerate().rev() {
            rest[layout.relative_velocity(i) - base] -= match intruder.carrier {
                None => acceleration[intruder.bead],
                Some(carrier) => rest[layout.relative_velocity(carrier) - base],
            };
        }
    }

    /// Energy of contact `j` (from 1), J.
    pub(crate) fn contact_energy(&self, y: &[f64], j: usize) -> f64 {
        self.contacts[j - 1].energy_beyond(self.change(y, j).0)
    }

    pub(crate) fn energies(&self, y: &[f64]) -> Energies {
        let layout = self.layout();
        let kinetic = |mass: f64, velocity: f64| 0.5 * mass * velocity * velocity;
        let mut energies = Energies {
            striker: self.striker_energy_at(y[layout.velocity(0)]),
            supplied: layout.drive_work().map_or(0.0, |index| y[index]),
            ..Energies::default()
        };
        for j in 1..layout.bodies {
            let velocity = y[layout.velocity(j)];
            let elastic = self.contact_energy(y, j);
            energies.chain += kinetic(self.shells[j], velocity) + elastic;
            energies.chain_as_printed += kinetic(self.masses[j], velocity) + elastic;
        }
        if self.contacts.len() == layout.bodies {
            let elastic = self.contact_energy(y, layout.bodies);
            energies.chain += elastic;
            energies.chain_as_printed += elastic;
        }
        for (i, intruder) in self.intruders.iter().enumerate() {
            let x = y[layout.relative(i)];
            let velocity = y[layout.velocity(intruder.bead)] + self.velocity_in_host(y, i);
            energies.intruders += kinetic(intruder.oscillator.mass, velocity) + intruder.elastic_energy(x);
            energies.dissipated_intruders += y[layout.intruder_loss(i)];
        }
        energies.dissipated_contacts = y[layout.contact_loss()];
        energies.dissipated_ground = layout.ground_loss().map_or(0.0, |index| y[index]);
        energies
    }

    /// Σ M V over the bodies, with intruders at their own velocity, kg·m/s.
    pub(crate) fn momentum(&self, y: &[f64]) -> f64 {
        self.momentum_from(y, 0)
    }

    /// Momentum of the bodies from this one to the last, with their intruders, kg·m/s.
    pub(crate) fn momentum_from(&self, y: &[f64], first: usize) -> f64 {
        let layout = self.layout();
        let body = |n: usize| self.masses[n] * y[layout.velocity(n)];
        let intruder = |i: usize| self.intruders[i].oscillator.mass * self.velocity_in_host(y, i);
        let bodies: f64 = (first..layout.bodies).map(body).sum();
        let hosted = (0..layout.intruders).filter(|&i| self.intruders[i].bead >= first);
        let intruders: f64 = hosted.map(intruder).sum();
        bodies + intruders
    }

    /// The number of the intruder in `bead`, unless it holds none or several.
    pub(crate) fn intruder_of(&self, bead: usize) -> Option<usize> {
        let numbers = self.intruders_of(bead);
        Some(numbers.start).filter(|_| numbers.len() == 1)
    }

    /// The place of an intruder among those of a bead that holds several, from 1.
    pub fn place_in_host(&self, intruder: usize) -> Option<usize> {
        let others = self.intruders_of(self.intruders[intruder].bead);
        (others.len() > 1).then(|| intruder - others.start + 1)
    }

    /// Numbers of the intruders in a bead, in the order of their tables, as in [`Model::intruders`].
    pub fn intruders_of(&self, bead: usize) -> Range<usize> {
        let before = |bead: usize| self.intruders.partition_point(|intruder| intruder.bead < bead);
        before(bead)..before(bead + 1)
    }

    /// Numbers of the intruders that an intruder carries.
    pub(crate) fn carried_by(&self, intruder: usize) -> impl Iterator<Item = usize> + '_ {
        let others = intruder + 1..if self.nests { self.intruders.len() } else { 0 };
        let bead = self.intruders[intruder].bead;
        others
            .take_while(move |&other| self.intruders[other].bead == bead)
            .filter(move |&other| self.intruders[other].carrier == Some(intruder))
    }

    /// Coordinate of an intruder relative to its host: the sum, over the intruder and its carriers, of the
    /// coordinate relative to host or carrier.
    pub(crate) fn in_host(&self, intruder: usize, relative: impl Fn(usize) -> f64) -> f64 {
        let mut sum = relative(intruder);
        let mut inner = intruder;
        while let Some(carrier) = self.intruders[inner].carrier {
            sum += relative(carrier);
            inner = carrier;
        }
        sum
    }

    /// Velocity of an intruder relative to its host, m/s.
    pub(crate) fn velocity_in_host(&self, y: &[f64], intruder: usize) -> f64 {
        let layout = self.layout();
        self.in_host(intruder, |number| y[layout.relative_velocity(number)])
    }

    /// Acceleration u'' of an intruder, m/s². `motion` returns displacement, m, and velocity, m/s, relative
    /// to host or carrier: of this intruder and of those that it carries.
    pub(crate) fn acceleration_at(&self, intruder: usize, motion: impl Fn(usize) -> (f64, f64)) -> f64 {
        self.accelerate(intruder, |number| {
            let (place, rate) = motion(number);
            self.intruders[number].pull(place, rate)
        })
    }

    /// Rate of [`Model::acceleration_at`], m/s³. `motion` also returns the relative acceleration, m/s².
    pub(crate) fn acceleration_rate_at(&self, intruder: usize, motion: impl Fn(usize) -> [f64; 3]) -> f64 {
        self.accelerate(intruder, |number| {
            let [place, rate, acceleration] = motion(number);
            self.intruders[number].pull_rate(place, rate, acceleration)
        })
    }

    /// Acceleration of an intruder by its own pull and those of the intruders that it carries.
    fn accelerate(&self, intruder: usize, pull: impl Fn(usize) -> f64) -> f64 {
        let mut net = pull(intruder);
        for carried in self.carried_by(intruder) {
            net -= pull(carried);
        }
        -net / self.intruders[intruder].oscillator.mass
    }

    /// True if the spring of an intruder hardens or softens.
    pub(crate) fn has_cubic_springs(&self) -> bool {
        self.intruders
            .iter()
            .any(|intruder| intruder.cubic_stiffness != 0.0)
    }

    /// Reference length for displacements of a driven chain, m: the greatest static overlap of a contact, or
    /// `displacement_scale` without a load.
    pub(crate) fn displacement_size(&self) -> f64 {
        let overlaps = self.contacts.iter().map(|contact| contact.static_overlap);
        let loaded = overlaps.fold(0.0, f64::max);
        if loaded > 0.0 {
            loaded
        } else {
            self.displacement_scale()
        }
    }

    /// The scale of each component of the state.
    #[cfg(test)]
    pub(crate) fn scales(&self) -> Vec<f64> {
        let layout = self.layout();
        let mut scales = vec![self.striker_energy(); layout.dimension()];
        scales[..layout.velocity(0)].fill(self.displacement_scale());
        scales[layout.velocity(0)..layout.relative(0)].fill(self.speed_scale());
        scales[layout.relative(0)..layout.relative_velocity(0)].fill(self.displacement_scale());
        scales[layout.relative_velocity(0)..layout.contact_loss()].fill(self.speed_scale());
        if let Some(index) = layout.wall_impulse() {
            scales[index] = self.masses[0] * self.speed_scale();
        }
        if self.given_speed > 0.0 {
            let energy = 0.5 * self.masses[1] * self.speed_scale().powi(2);
            scales[layout.contact_loss()..].fill(energy);
            if let Some(index) = layout.wall_impulse() {
                scales[index] = self.masses[1] * self.speed_scale();
            }
        }
        scales
    }

    /// Rate of the total force of contact `j` (from 1), N/s, where the state changes by `dy` a second.
    pub(crate) fn force_rate(&self, y: &[f64], dy: &[f64], j: usize) -> f64 {
        let (change, approach) = self.change(y, j);
        let (_, acceleration) = self.change(dy, j);
        self.force_rate_at(j, change, approach, acceleration)
    }

    /// Rate of the force of contact `j`, N/s, at a change of the overlap since rest, its rate and
    /// acceleration (SI).
    pub(crate) fn force_rate_at(&self, j: usize, change: f64, approach: f64, acceleration: f64) -> f64 {
        let contact = &self.contacts[j - 1];
        let overlap = contact.static_overlap + change;
        if overlap <= 0.0 || self.limits(contact, overlap, approach) {
            return 0.0;
        }
        if let Some(powers) = &contact.powers {
            let n = powers.elastic;
            let elastic = n * contact.stiffness * power(overlap, n - 1.0) * approach;
            let motion = [overlap, approach, acceleration];
            return elastic + powers.damping_force_rate(contact.stiffness, motion);
        }
        let root = overlap.sqrt();
        let viscous = contact.relaxation * (0.5 * approach * approach / root + root * acceleration);
        1.5 * contact.stiffness * (root * approach + viscous)
    }
}
