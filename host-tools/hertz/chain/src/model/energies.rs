//! Energies of a whole chain.

/// Energies at one time, J.
///
/// [`Energies::total`] equals [`Model::initial_energy`](crate::Model::initial_energy), the striker's unless
/// beads move at t = 0. The balance closes only with M - m for a host's shell beside its intruder's own
/// energy. The paper prints M instead; that sum is `chain_as_printed`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Energies {
    /// Kinetic energy of the striker; zero if it follows a displacement.
    pub striker: f64,
    /// Beads 1..=N without their intruders, and all contacts: Σ ½ (M - m) V² + Σ (2/5) κ δ^(5/2). Under a
    /// static load, contacts count from rest, less the work of that load
    /// ([`Contact::energy`](crate::Contact::energy)).
    pub chain: f64,
    /// `chain` with M in place of M - m for every bead: the paper's E_T.
    pub chain_as_printed: f64,
    /// Kinetic and elastic energy of the intruders: Σ ½ m u'² + ½ k x² + ¼ k₃ x⁴.
    pub intruders: f64,
    /// Dissipated in all contacts so far: ∫ (F - F_Hertz) δ' dt.
    pub dissipated_contacts: f64,
    /// Dissipated in all intruders so far: Σ ∫ c x'² dt.
    pub dissipated_intruders: f64,
    /// Dissipated on the ground so far: Σ ∫ M V²/τ dt. Zero unless it drags.
    pub dissipated_ground: f64,
    /// Work of the drive so far, beyond that of static loads; of the weight too if a striker falls. Zero
    /// without a drive.
    pub supplied: f64,
}

impl Energies {
    /// The sum less what was supplied, which is constant over a run except for the error of the integration.
    pub fn total(&self) -> f64 {
        let bodies = self.striker + self.chain + self.intruders;
        bodies + self.dissipated_contacts + self.dissipated_intruders - self.supplied + self.dissipated_ground
    }
}
