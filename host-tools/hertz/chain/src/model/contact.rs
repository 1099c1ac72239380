//! Contacts of a chain: Hertz' law of two bodies, or another one.

use crate::power_law::{ContactPowers, PowerLaw, power};
use crate::scenario::{ContactLaw, Damping};

/// A contact, which joins bodies j - 1 and j. The contact after the last bead joins that bead and the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Contact {
    /// Hertz stiffness κ, N/m^(3/2).
    pub stiffness: f64,
    /// Relaxation time τ, s, of both bodies together.
    pub relaxation: f64,
    /// Static load F₀ that it carries at rest, N.
    pub load: f64,
    /// Overlap at rest, (F₀/κ)^(2/3), m.
    pub static_overlap: f64,
    /// Powers and friction of a law other than Hertz' with damping exponent 1/2 and no friction; κ is then
    /// in N/mⁿ, and `relaxation` is 0.
    pub(crate) powers: Option<ContactPowers>,
}

/// θ = 3 (1 - ν²) / (4 Y) of a body at a contact, 1/Pa.
pub(crate) fn compliance(young: f64, poisson: f64) -> f64 {
    0.75 * (1.0 - poisson * poisson) / young
}

/// Relaxation time of a contact, s, from the compliance θ, 1/Pa, and the relaxation time, s, of each body.
///
/// Each body is a Kelvin-Voigt element: the same force presses both, each takes the part θ/(θa + θb) of the
/// overlap, and its viscous force is its own τ times the rate of its elastic one. To first order in τ the
/// contact is then one such element with τ = (θa τa + θb τb)/(θa + θb). Like bodies give their own τ exactly.
pub(crate) fn series_relaxation(
    (near_compliance, near): (f64, f64),
    (far_compliance, far): (f64, f64),
) -> f64 {
    near + (far - near) * (far_compliance / (near_compliance + far_compliance))
}

impl Contact {
    /// A contact with these sums over both bodies: `compliance` in 1/Pa and `curvature` in 1/m.
    pub(super) fn new(compliance: f64, curvature: f64, relaxation: f64, load: f64) -> Self {
        let stiffness = 1.0 / (compliance * curvature.sqrt());
        Self {
            stiffness,
            relaxation,
            load,
            static_overlap: (load / stiffness).powf(2.0 / 3.0),
            powers: None,
        }
    }

    /// Applies another law to the contact of bodies with this curvature, 1/m, and reduced mass, kg.
    pub(super) fn with_law(mut self, law: &ContactLaw, curvature: f64, reduced_mass: f64) -> Self {
        let (n, p) = (law.exponent, law.damping_power());
        self.stiffness = law.stiffness.unwrap_or(self.stiffness);
        let coefficient = match law.damping {
            Damping::Viscoelastic => n * self.relaxation * self.stiffness,
            Damping::Linear | Damping::Power => law.coefficient,
            Damping::LammpsMaterial => law.coefficient * reduced_mass / curvature.sqrt(),
            Damping::LammpsTsuji => law.coefficient * (reduced_mass * self.stiffness).sqrt(),
        };
        if law.is_usual() {
            self.static_overlap = (self.load / self.stiffness).powf(2.0 / 3.0);
            if law.damping != Damping::Viscoelastic {
                self.relaxation = coefficient / (1.5 * self.stiffness);
            }
            return self;
        }
        self.static_overlap = (self.load / self.stiffness).powf(1.0 / n);
        self.relaxation = 0.0;
        self.powers = Some(ContactPowers {
            elastic: n,
            damping: p,
            coefficient,
            friction: law.friction,
            friction_speed: law.friction_speed,
        });
        self
    }

    /// The elastic law of the contact.
    pub fn law(&self) -> PowerLaw {
        PowerLaw::new(self.powers.map_or(1.5, |powers| powers.elastic), self.stiffness)
    }

    /// Hertz' part of the force, N, at an overlap in m.
    pub fn elastic_force(&self, overlap: f64) -> f64 {
        if let Some(powers) = &self.powers {
            return self.stiffness * power(overlap, powers.elastic);
        }
        if overlap > 0.0 {
            self.stiffness * overlap * overlap.sqrt()
        } else {
            0.0
        }
    }

    /// The viscous part of the force, N, with any friction, at an overlap in m that grows by `rate` in m/s.
    pub fn viscous_force(&self, overlap: f64, rate: f64) -> f64 {
        if let Some(powers) = self.powers.as_ref().filter(|_| overlap > 0.0) {
            return powers.damping_force(self.stiffness, overlap, rate);
        }
        if overlap > 0.0 {
            1.5 * self.relaxation * self.stiffness * overlap.sqrt() * rate
        } else {
            0.0
        }
    }

    /// Elastic energy, J, at an overlap in m. It counts from the state at rest, less the work of the static
    /// load: (2/5) κ (δ^(5/2) - δ₀^(5/2)) - F₀ (δ - δ₀). It is zero at rest and positive elsewhere.
    pub fn energy(&self, overlap: f64) -> f64 {
        self.energy_beyond(overlap - self.static_overlap)
    }

    /// [`Contact::energy`] as a function of the change of the overlap since rest, m. With r = √(δ/δ₀) it is
    /// (2/5) κ δ₀^(5/2) (r - 1)² (r³ + 2r² + 3r + 3/2).
    pub(crate) fn energy_beyond(&self, change: f64) -> f64 {
        if let Some(powers) = &self.powers {
            return powers.energy_beyond((self.load, self.static_overlap), self.stiffness, change);
        }
        let overlap = self.static_overlap + change;
        if self.load == 0.0 {
            return 0.4 * overlap * self.elastic_force(overlap);
        }
        if overlap <= 0.0 {
            return -self.load * (change + 0.4 * self.static_overlap);
        }
        let r = (overlap / self.static_overlap).sqrt();
        // r - 1, exact for a small change too.
        let growth = change / (self.static_overlap * (r + 1.0));
        let cubic = ((r + 2.0) * r + 3.0) * r + 1.5;
        0.4 * self.load * self.static_overlap * growth * growth * cubic
    }

    /// Hertz' part of the force less the static load, N, as a function of the change of the overlap since
    /// rest, m. With a² = δ and b² = δ₀ it is κ (a³ - b³) = κ (δ - δ₀) (a² + ab + b²) / (a + b).
    pub(crate) fn elastic_force_beyond(&self, change: f64) -> f64 {
        if let Some(powers) = &self.powers {
            if self.static_overlap + change <= 0.0 {
                return -self.load;
            }
            return powers.force_beyond((self.load, self.static_overlap), self.stiffness, change);
        }
        let overlap = self.static_overlap + change;
        if self.load == 0.0 {
            return self.elastic_force(overlap);
        }
        if overlap <= 0.0 {
            return -self.load;
        }
        let (a, b) = (overlap.sqrt(), self.static_overlap.sqrt());
        self.stiffness * change * (overlap + a * b + self.static_overlap) / (a + b)
    }

    /// Stiffness against small changes of the overlap at rest, (3/2) κ^(2/3) F₀^(1/3), N/m. Zero without
    /// load, unless the law is linear.
    pub fn linear_stiffness(&self) -> f64 {
        if let Some(powers) = &self.powers {
            return powers.elastic * self.stiffness * power(self.static_overlap, powers.elastic - 1.0);
        }
        1.5 * self.stiffness * self.static_overlap.sqrt()
    }
}
