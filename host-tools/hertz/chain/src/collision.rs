//! Two free spheres that meet: Hertz' closed forms, eqs. (9) and (10) of the paper with the factor of (10)
//! corrected, and the rebound of viscoelastic spheres.

use crate::model::Model;

/// A body that meets another at rest; SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Collision {
    /// Mass of the body that moves, kg.
    pub striker: f64,
    /// Mass of the body at rest, kg.
    pub target: f64,
    /// Hertz stiffness κ of their contact, N/m^(3/2).
    pub stiffness: f64,
    /// Speed V at which they meet, m/s.
    pub speed: f64,
}

/// 4 √π Γ(2/5) / (5 Γ(9/10)): contact time times speed over depth. Landau and Lifshitz, Elasticity, §9.
const CONTACT_TIME: f64 = 2.943_275_184;

/// e = 1 - C₁ x + C₂ x² - C₃ x³ + C₄ x⁴ with x = (3/2) α, for a force that acts until the overlap is gone.
///
/// C₁ = √π Γ(3/5) / (2^(1/5) 5^(2/5) Γ(21/10)) and C₂ = (3/5) C₁² are those of Ramírez et al., Phys. Rev. E
/// 60, 4465 (1999). C₃ comes from integrating the collision to an error of 1e-13. C₄ = (35 C₁ C₃ - 7 C₁⁴) /
/// 25 comes from running it backwards in time, where e becomes 1/e.
const RESTITUTION: [f64; 4] = [1.153_448_858_1, 0.798_266_560_9, 0.522_882_5, 0.348_743];

impl Collision {
    /// The striker of a chain and its first bead, as if that bead were alone.
    pub fn of_striker(model: &Model) -> Self {
        Self {
            striker: model.mass(0),
            target: model.mass(1),
            stiffness: model.contact(1).stiffness,
            speed: model.striker_speed(),
        }
    }

    /// Reduced mass μ, kg.
    pub fn reduced_mass(&self) -> f64 {
        self.striker * self.target / (self.striker + self.target)
    }

    /// Greatest overlap, (5 μ V² / 4 κ)^(2/5), m.
    pub fn greatest_overlap(&self) -> f64 {
        (1.25 * self.reduced_mass() * self.speed * self.speed / self.stiffness).powf(0.4)
    }

    /// Time of contact, s: eq. (9), 2.943 (5/4)^(2/5) (μ/κ)^(2/5) V^(-1/5).
    pub fn duration(&self) -> f64 {
        CONTACT_TIME * self.greatest_overlap() / self.speed
    }

    /// Greatest force, N: eq. (10) with the right factor, (5/4)^(3/5) (μ³ κ²)^(1/5) V^(6/5). The paper's
    /// factor (5/4)^(7/5) is 1.195 times too large.
    pub fn greatest_force(&self) -> f64 {
        self.stiffness * self.greatest_overlap().powf(1.5)
    }

    /// Part of the energy that an elastic collision hands over, 4 r / (1 + r)² with r the ratio of the
    /// masses. Equal masses hand over all of it.
    pub fn transferred(&self) -> f64 {
        let mass = self.striker + self.target;
        4.0 * self.striker * self.target / (mass * mass)
    }

    /// Viscosity parameter of the collision, α = τ (κ/μ)^(2/5) V^(1/5), for a relaxation time τ in s.
    pub fn viscosity(&self, relaxation: f64) -> f64 {
        relaxation * (self.stiffness / self.reduced_mass()).powf(0.4) * self.speed.powf(0.2)
    }

    /// Coefficient of restitution for a relaxation time τ in s:
    /// `1 - 1.73017 α + 1.79610 α² - 1.76473 α³ + 1.76551 α⁴`. Kuwabara and Kono's force acts until the
    /// overlap is gone. The error is 1.8 α⁵; keep α below 0.2.
    pub fn restitution(&self, relaxation: f64) -> f64 {
        let x = -1.5 * self.viscosity(relaxation);
        1.0 + x * RESTITUTION.iter().rev().fold(0.0, |sum, c| sum * x + c)
    }
}
