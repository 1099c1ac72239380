//! Energy of a part of the chain, by kind.

use std::ops::RangeInclusive;

use crate::model::Model;

/// Energies of some neighbouring beads at one time, J. A bead has the contact on its left, as in the paper's
/// E_n (eq. 4). The last bead has the contact with the wall too.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct RegionEnergies {
    /// Kinetic energy of the beads, with M - m for a host's shell: Σ ½ (M - m) V².
    pub kinetic: f64,
    /// `kinetic` with M in place of M - m for every bead, as the paper prints it.
    pub kinetic_as_printed: f64,
    /// Elastic energy of the beads' contacts: Σ (2/5) κ δ^(5/2). Under a static load it counts from rest
    /// ([`Contact::energy`](crate::Contact::energy)).
    pub elastic: f64,
    /// Kinetic energy of the intruders: Σ ½ m u'².
    pub intruder_kinetic: f64,
    /// Energy of the intruders' springs: Σ ½ k x² + ¼ k₃ x⁴.
    pub intruder_elastic: f64,
    /// Energy that the intruders have dissipated so far: Σ ∫ c x'² dt.
    pub intruder_dissipated: f64,
}

impl RegionEnergies {
    /// Energy of beads, contacts and intruders, and the energy that the intruders have dissipated, J. It
    /// grows by the energy that passes the first bead's contact less that which passes the contact after the
    /// last bead ([`Solution::flow`](crate::Solution::flow)), and falls by the energy that the contacts
    /// and a ground that drags dissipate.
    pub fn total(&self) -> f64 {
        self.mechanical() + self.intruder_dissipated
    }

    /// Energy of beads, contacts and intruders, J.
    pub fn mechanical(&self) -> f64 {
        self.kinetic + self.elastic + self.intruder_kinetic + self.intruder_elastic
    }

    /// The paper's Σ E_n over these beads, eq. (4), J.
    pub fn as_printed(&self) -> f64 {
        self.kinetic_as_printed + self.elastic
    }
}

impl Model {
    pub(crate) fn region_energies(&self, y: &[f64], beads: RangeInclusive<usize>) -> RegionEnergies {
        let layout = self.layout();
        let square = |body: usize| y[layout.velocity(body)] * y[layout.velocity(body)];
        let mut energies = RegionEnergies::default();
        for body in beads.clone() {
            energies.kinetic += 0.5 * self.shells[body] * square(body);
            energies.kinetic_as_printed += 0.5 * self.mass(body) * square(body);
            if body > 0 {
                energies.elastic += self.contact_energy(y, body);
            }
            // Only the wall's contact has a number that no body has.
            if body + 1 == self.bodies() && self.contacts() == self.bodies() {
                energies.elastic += self.contact_energy(y, self.bodies());
            }
        }
        for (i, intruder) in self.intruders().iter().enumerate() {
            if beads.contains(&intruder.bead) {
                let x = y[layout.relative(i)];
                let velocity = y[layout.velocity(intruder.bead)] + self.velocity_in_host(y, i);
                energies.intruder_kinetic += 0.5 * intruder.oscillator.mass * velocity * velocity;
                energies.intruder_elastic += intruder.elastic_energy(x);
                energies.intruder_dissipated += y[layout.intruder_loss(i)];
            }
        }
        energies
    }
}
