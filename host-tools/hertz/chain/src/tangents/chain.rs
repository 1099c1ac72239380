//! A chain whose parameters carry derivatives, and its equations of motion.
//!
//! # Design
//! The viscous part of a contact's force is a total derivative, τ dF_H/dt. With the momentum
//!
//! ```text
//! w = (M - m) V - τ_in F_in + τ_out F_out        w' = F_in - F_out + k x + k₃ x³ + c x'
//! ```
//!
//! in place of the velocity, only Hertz' part F = κ δ^(3/2) is left in the rates, whose first derivative is
//! continuous where a contact opens or closes. So are the tangents of the motion there: the factor δ^(-1/2)
//! of the printed equation's tangent does not arise. The low-pass of a sensor at a contact, y' = ω (F_total -
//! y), is integrated as z = y - ω τ F for the same reason.

use super::dual::Dual;
use super::parameter::{Parameter, Seeds};
use crate::model::{Model, compliance};
use crate::scenario::{ContactForce, InputError, Scenario, Section, Sphere};

/// Contact between two bodies, or the last one and the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct DualContact<const P: usize> {
    pub(super) stiffness: Dual<P>,
    pub(super) relaxation: Dual<P>,
    pub(super) rest: Dual<P>,
    pub(super) load: f64,
}

/// A mass on a spring and damper in a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct DualIntruder<const P: usize> {
    pub(super) body: usize,
    pub(super) inverse_mass: Dual<P>,
    pub(super) stiffness: Dual<P>,
    pub(super) damping: Dual<P>,
    cubic: Dual<P>,
}

/// The bodies, contacts and intruders of a scenario.
#[derive(Debug, Clone)]
pub(super) struct DualChain<const P: usize> {
    /// 1/(M - m) of each body, 1/kg.
    pub(super) inverse_shells: Vec<Dual<P>>,
    pub(super) shells: Vec<Dual<P>>,
    /// Coefficient M/τ of the ground's drag on each body, N·s/m, if it drags.
    pub(super) drags: Option<Vec<Dual<P>>>,
    /// Contact j joins bodies j - 1 and j; at index j - 1.
    pub(super) contacts: Vec<DualContact<P>>,
    pub(super) intruders: Vec<DualIntruder<P>>,
    /// Displacement and velocity of each body at t = 0.
    pub(super) starts: Vec<(f64, Dual<P>)>,
    pub(super) push_gain: Dual<P>,
}

/// One body of a contact.
#[derive(Debug, Clone, Copy)]
struct ContactSide {
    /// θ, 1/Pa.
    theta: f64,
    /// The part of θ that goes with the chain's modulus, 1/Pa.
    theta_of_chain: f64,
    /// τ of the material, s.
    relaxation: f64,
    /// 1 if that is the chain's, else 0.
    relaxes: f64,
}

/// The parts of masses, stiffnesses and relaxation times that go with the chain's own material.
struct Materials<'a, const P: usize> {
    scenario: &'a Scenario,
    spheres: Vec<Sphere>,
    seeds: Seeds<'a, P>,
}

impl<const P: usize> Materials<'_, P> {
    /// True if a bead has a value of its own in place of the chain's.
    fn owns(&self, bead: usize, of: fn(&Section) -> Option<f64>) -> bool {
        let named = |section: &&Section| section.beads.contains(&bead);
        let last = self.scenario.sections.iter().rev().find(named);
        last.is_some_and(|section| of(section).is_some())
    }

    /// Compliance and relaxation time of the bodies before and after contact j (from 1).
    fn sides(&self, j: usize) -> [ContactSide; 2] {
        let Scenario { striker, wall, .. } = self.scenario;
        let bead = |bead: usize| {
            let sphere = &self.spheres[bead - 1];
            let theta = compliance(sphere.material.young, sphere.material.poisson);
            let of_chain = |of: fn(&Section) -> Option<f64>| f64::from(u8::from(!self.owns(bead, of)));
            ContactSide {
                theta,
                theta_of_chain: theta * of_chain(|section| section.young),
                relaxation: sphere.relaxation,
                relaxes: of_chain(|section| section.relaxation),
            }
        };
        // A striker or wall without a relaxation time has that of the bead that it touches.
        let other = |theta: f64, relaxation: Option<f64>, touched: ContactSide| ContactSide {
            theta,
            theta_of_chain: 0.0,
            relaxation: relaxation.unwrap_or(touched.relaxation),
            relaxes: if relaxation.is_none() {
                touched.relaxes
            } else {
                0.0
            },
        };
        match (j, wall) {
            (1, _) => {
                let theta = compliance(striker.young, striker.poisson);
                [other(theta, striker.relaxation, bead(1)), bead(1)]
            }
            (_, Some(wall)) if j > self.spheres.len() => {
                let theta = compliance(wall.young, wall.poisson);
                [bead(j - 1), other(theta, wall.relaxation, bead(j - 1))]
            }
            _ => [bead(j - 1), bead(j)],
        }
    }

    /// Contact j (from 1) of the model.
    fn contact(&self, model: &Model, j: usize) -> DualContact<P> {
        let contact = model.contact(j);
        let [a, b] = self.sides(j);
        let (theta, young) = (a.theta + b.theta, self.scenario.chain.young);
        let mut stiffness = Dual::constant(contact.stiffness);
        let mut relaxation = Dual::constant(contact.relaxation);
        if let Some(direction) = self.seeds.direction(Parameter::Young) {
            let of_chain = a.theta_of_chain + b.theta_of_chain;
            stiffness.by[direction] = contact.stiffness * of_chain / theta / young;
            // τ = τa + (τb - τa) θb/(θa + θb), and θ of the chain goes as 1/Y.
            let turn = b.theta * a.theta_of_chain - a.theta * b.theta_of_chain;
            relaxation.by[direction] = (b.relaxation - a.relaxation) * turn / (theta * theta) / young;
        }
        if let Some(direction) = self.seeds.direction(Parameter::Relaxation) {
            relaxation.by[direction] = (a.theta * a.relaxes + b.theta * b.relaxes) / theta;
        }
        // δ₀ = (F₀/κ)^(2/3).
        let mut rest = Dual::constant(contact.static_overlap);
        for (rest, stiffness) in rest.by.iter_mut().zip(stiffness.by) {
            *rest = -2.0 / 3.0 * contact.static_overlap * stiffness / contact.stiffness;
        }
        DualContact {
            stiffness,
            relaxation,
            rest,
            load: contact.load,
        }
    }
}

impl<const P: usize> DualChain<P> {
    /// The chain of a strike.
    ///
    /// # Errors
    /// The scenario is out of range, or its contact forces are clipped, which have no smooth tangent.
    pub(super) fn new(scenario: &Scenario, parameters: &[Parameter]) -> Result<Self, InputError> {
        let model = Model::of(scenario)?;
        let advice = "leave them out: only a strike on Hertz' contacts has tangents";
        let other = [
            (model.drive.is_some(), "chain", "a driven or vertical chain has"),
            (
                model.is_dragged(),
                "chain.drag_time",
                "a chain that the ground drags has",
            ),
            (
                model.starts_displaced(),
                "start",
                "bodies displaced at t = 0 have",
            ),
        ];
        if let Some((_, key, what)) = other.into_iter().find(|(is_there, ..)| *is_there) {
            return Err(InputError::at(key, format!("{what} no tangents"), advice));
        }
        Self::of(&model, scenario, parameters)
    }

    /// The chain of a scenario with this model. A drive has no derivatives.
    ///
    /// # Errors
    /// Contact forces are clipped, or follow another law than Hertz'.
    pub(super) fn of(
        model: &Model,
        scenario: &Scenario,
        parameters: &[Parameter],
    ) -> Result<Self, InputError> {
        if scenario.chain.contact_force == ContactForce::Clipped {
            let what = "clipped forces have no tangents";
            let advice = "leave it out: contacts may then pull a little while they open";
            return Err(InputError::at("chain.contact_force", what, advice));
        }
        if scenario.holds_several() {
            let what = "beads that hold several intruders have no tangents";
            return Err(InputError::at("intruder", what, "give each bead one at most"));
        }
        if model.contact_at(1).powers.is_some() {
            let what = "contacts of another law than Hertz' have no tangents";
            return Err(InputError::at("contact", what, "leave it out"));
        }
        let seeds = Seeds::<P>::new(parameters);
        let materials = Materials {
            scenario,
            spheres: scenario.spheres(),
            seeds,
        };
        let mut shells: Vec<Dual<P>> = (0..model.bodies())
            .map(|body| {
                if body == 0 && model.is_prescribed() {
                    // The motion of a driven body does not depend on its mass.
                    return Dual::default();
                }
                let mut mass = Dual::constant(model.mass(body));
                if body > 0
                    && !materials.owns(body, |section| section.density)
                    && let Some(direction) = seeds.direction(Parameter::Density)
                {
                    mass.by[direction] = mass.value / scenario.chain.density;
                }
                mass
            })
            .collect();
        let rate = scenario.chain.drag_time.map(f64::recip);
        let drags = rate.map(|rate| {
            let of = |(body, mass): (usize, &Dual<P>)| {
                if body == 0 { Dual::default() } else { *mass * rate }
            };
            shells.iter().enumerate().map(of).collect()
        });
        let mut intruders = Vec::new();
        for (table, intruder) in scenario.intruders.iter().enumerate() {
            let mass = seeds.seeded(Parameter::IntruderMass(table), intruder.mass);
            for &body in &intruder.beads {
                shells[body] -= mass;
                intruders.push(DualIntruder {
                    body,
                    inverse_mass: mass.inverse(),
                    stiffness: seeds.seeded(Parameter::Stiffness(table), intruder.stiffness),
                    damping: seeds.seeded(Parameter::Damping(table), intruder.damping),
                    cubic: seeds.seeded(Parameter::CubicStiffness(table), intruder.cubic_stiffness),
                });
            }
        }
        let contacts = (1..=model.contacts()).map(|j| materials.contact(model, j));
        let contacts = contacts.collect();
        let starts = model.starts.iter().enumerate().map(|(body, &(place, velocity))| {
            let velocity = if body == 0 {
                seeds.seeded(Parameter::StrikerVelocity, velocity)
            } else {
                Dual::constant(velocity)
            };
            (place, velocity)
        });
        let inverse = |shell: &Dual<P>| {
            if shell.value > 0.0 {
                shell.inverse()
            } else {
                Dual::default()
            }
        };
        Ok(Self {
            starts: starts.collect(),
            inverse_shells: shells.iter().map(inverse).collect(),
            shells,
            drags,
            contacts,
            intruders,
            push_gain: seeds.seeded(Parameter::PushGain, 1.0),
        })
    }

    /// Number of bodies.
    pub(super) fn bodies(&self) -> usize {
        self.shells.len()
    }

    /// Change of the overlap of contact j (from 1) since rest, m.
    #[inline(always)]
    fn change(&self, places: &[Dual<P>], j: usize) -> Dual<P> {
        let near = places[j - 1];
        if j < self.bodies() { near - places[j] } else { near }
    }

    /// Hertz' part of the force of contact j (from 1) beyond its load, N.
    #[inline(always)]
    pub(super) fn force(&self, places: &[Dual<P>], j: usize) -> Dual<P> {
        let contact = &self.contacts[j - 1];
        let overlap = self.change(places, j) + contact.rest;
        if overlap.value <= 0.0 {
            return Dual::constant(-contact.load);
        }
        let mut force = contact.stiffness * overlap * overlap.sqrt();
        force.value -= contact.load;
        force
    }

    /// The value of [`DualChain::force`] alone.
    #[inline(always)]
    pub(super) fn force_value(&self, places: &[Dual<P>], j: usize) -> f64 {
        let near = places[j - 1].value;
        let change = if j < self.bodies() {
            near - places[j].value
        } else {
            near
        };
        let contact = &self.contacts[j - 1];
        let overlap = change + contact.rest.value;
        if overlap <= 0.0 {
            return -contact.load;
        }
        contact.stiffness.value * overlap * overlap.sqrt() - contact.load
    }

    /// Elastic energy of contact j (from 1), counted from rest, less the work of its load, J.
    pub(super) fn elastic_energy(&self, places: &[Dual<P>], j: usize) -> Dual<P> {
        let (contact, change) = (&self.contacts[j - 1], self.change(places, j));
        let stored = |overlap: Dual<P>| {
            if overlap.value <= 0.0 {
                return Dual::default();
            }
            contact.stiffness * overlap * overlap * overlap.sqrt() * 0.4
        };
        stored(change + contact.rest) - stored(contact.rest) - change * contact.load
    }

    /// Energy of all bodies, contacts and intruders at t = 0, J.
    pub(super) fn energy_at_start(&self) -> Dual<P> {
        let places: Vec<_> = self.starts.iter().map(|start| Dual::constant(start.0)).collect();
        let mut energy = Dual::default();
        for (shell, (_, velocity)) in self.shells.iter().zip(&self.starts) {
            energy += *shell * *velocity * *velocity * 0.5;
        }
        for intruder in &self.intruders {
            let velocity = self.starts[intruder.body].1;
            energy += intruder.inverse_mass.inverse() * velocity * velocity * 0.5;
        }
        for contact in 1..=self.contacts.len() {
            energy += self.elastic_energy(&places, contact);
        }
        energy
    }

    /// Factor of the rate of a contact's overlap in its viscous force, N s/m.
    #[inline(always)]
    pub(super) fn viscosity(&self, places: &[Dual<P>], j: usize) -> Dual<P> {
        let contact = &self.contacts[j - 1];
        let overlap = self.change(places, j) + contact.rest;
        if overlap.value <= 0.0 {
            return Dual::default();
        }
        contact.relaxation * contact.stiffness * overlap.sqrt() * 1.5
    }

    /// Force of spring and damper on the host, N.
    #[inline(always)]
    pub(super) fn pull(intruder: &DualIntruder<P>, way: Dual<P>, rate: Dual<P>) -> Dual<P> {
        let mut pull = intruder.stiffness * way + intruder.damping * rate;
        let square = way.value * way.value;
        let (cube, slope) = (square * way.value, 3.0 * intruder.cubic.value * square);
        pull.value += intruder.cubic.value * cube;
        for ((pull, cubic), way) in pull.by.iter_mut().zip(intruder.cubic.by).zip(way.by) {
            *pull += cubic * cube + slope * way;
        }
        pull
    }

    /// Energy of the spring, J.
    pub(super) fn spring_energy(intruder: &DualIntruder<P>, way: Dual<P>) -> Dual<P> {
        let square = way * way;
        (intruder.stiffness + intruder.cubic * square * 0.5) * square * 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{Material, Wall};

    /// A chain with brass-like beads in it, a striker and a wall that have relaxation times of their own or
    /// not.
    fn unlike(own: Option<f64>) -> Scenario {
        let mut scenario = Scenario::paper();
        let mut section = Section::of([3, 4]);
        (section.young, section.relaxation) = (Some(8e9), Some(1e-6));
        scenario.sections = vec![section, Section::of([6])];
        scenario.sections[1].relaxation = Some(9e-6);
        scenario.striker.relaxation = own;
        let mut wall = Wall::flat(Material::STEEL);
        (wall.young, wall.relaxation) = (2e9, own);
        scenario.wall = Some(wall);
        scenario
    }

    #[test]
    fn the_parts_of_contacts_are_differences_of_models() {
        let parameters = [Parameter::Young, Parameter::Relaxation];
        for scenario in [unlike(None), unlike(Some(2e-6))] {
            let chain = DualChain::<2>::new(&scenario, &parameters).unwrap();
            for (direction, parameter) in parameters.into_iter().enumerate() {
                let moved = |factor: f64| {
                    let mut moved = scenario.clone();
                    match parameter {
                        Parameter::Young => moved.chain.young *= factor,
                        _ => moved.chain.relaxation *= factor,
                    }
                    Model::of(&moved).unwrap()
                };
                let [less, more] = [1.0 - 1e-4, 1.0 + 1e-4].map(moved);
                let value = match parameter {
                    Parameter::Young => scenario.chain.young,
                    _ => scenario.chain.relaxation,
                };
                for (contact, j) in chain.contacts.iter().zip(1..) {
                    let [low, high] = [&less, &more].map(|model| model.contact(j));
                    for (dual, difference) in [
                        (contact.relaxation, high.relaxation - low.relaxation),
                        (contact.stiffness, high.stiffness - low.stiffness),
                    ] {
                        let off = dual.by[direction] * value - difference / 2e-4;
                        assert!(
                            off.abs() < 1e-7 * dual.value,
                            "{parameter:?}, contact {j}: {off:e}"
                        );
                    }
                }
            }
        }
    }
}
