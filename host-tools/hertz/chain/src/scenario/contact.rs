//! The law of the contacts.

use serde::{Deserialize, Serialize};

use super::drive::is_zero;

/// Law of all contacts of a chain, F = κ δⁿ (1 + f tanh(δ'/v₀)) + η δᵖ δ'. Without it, κ is Hertz' of the
/// materials, n is 3/2, f is 0, and the damping is that of their relaxation times.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ContactLaw {
    /// Exponent n of the overlap, from 1 to 8.
    #[serde(default = "hertz", skip_serializing_if = "is_hertz")]
    pub exponent: f64,
    /// Stiffness κ of every contact, N/mⁿ; without it Hertz' of the materials, for n = 3/2 only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Style of the damping.
    #[serde(default)]
    pub damping: Damping,
    /// Coefficient of the damping, with a unit that depends on its style.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub coefficient: f64,
    /// Exponent p of [`Damping::Power`], from 0 to 8.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping_exponent: Option<f64>,
    /// Coefficient f of a friction in proportion to the elastic force, below 1. It opposes the approach of
    /// the bodies and their parting alike, as that of surfaces that rub or roll on one another does, at any
    /// speed well above [`ContactLaw::friction_speed`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub friction: f64,
    /// Rate v₀ of the overlap, m/s, at which the friction has tanh(1) = 76 % of its full value.
    #[serde(default = "slow", skip_serializing_if = "is_slow")]
    pub friction_speed: f64,
}

/// Damping of a contact: coefficient η and exponent p of its force η δᵖ δ'.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Damping {
    /// The rate of the elastic force times τ of the materials, η = n τ κ and p = n - 1 (Kuwabara and Kono).
    #[default]
    Viscoelastic,
    /// A dashpot, p = 0; η in N·s/m. Its force begins at once when bodies meet.
    Linear,
    /// η in N·s/m^(p+1) and p as given.
    Power,
    /// LAMMPS' `hertz/material` with damping `viscoelastic`: η = coefficient · μ √R, p = 1/2, with the
    /// coefficient in 1/(s·m), the reduced mass μ and 1/R = 1/Ra + 1/Rb.
    LammpsMaterial,
    /// LAMMPS' `tsuji`: η = coefficient · √(μ κ), p = (n - 1)/2, the coefficient a number. The
    /// restitution is the same at any speed.
    LammpsTsuji,
}

fn hertz() -> f64 {
    1.5
}

fn is_hertz(value: &f64) -> bool {
    *value == 1.5
}

fn slow() -> f64 {
    1e-3
}

fn is_slow(value: &f64) -> bool {
    *value == slow()
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self {
            exponent: 1.5,
            stiffness: None,
            damping: Damping::Viscoelastic,
            coefficient: 0.0,
            damping_exponent: None,
            friction: 0.0,
            friction_speed: slow(),
        }
    }
}

impl ContactLaw {
    /// The law κ δⁿ with an exponent and a stiffness in N/mⁿ, and with the damping of the materials.
    pub fn power(exponent: f64, stiffness: f64) -> Self {
        Self {
            exponent,
            stiffness: Some(stiffness),
            ..Self::default()
        }
    }

    /// This law with a damping of a style and a coefficient.
    #[must_use]
    pub fn damped(self, damping: Damping, coefficient: f64) -> Self {
        Self {
            damping,
            coefficient,
            ..self
        }
    }

    /// This law with a friction of coefficient f, which reaches tanh(δ'/v₀) of its full value at a rate
    /// δ' of the overlap; v₀ in m/s.
    #[must_use]
    pub fn rubbing(self, friction: f64, friction_speed: f64) -> Self {
        Self {
            friction,
            friction_speed,
            ..self
        }
    }

    /// True if the solver for Hertz' contacts suits the law.
    pub(crate) fn is_usual(&self) -> bool {
        self.exponent == 1.5 && self.damping_power() == 0.5 && self.friction == 0.0
    }

    /// Exponent p of the damping.
    pub(crate) fn damping_power(&self) -> f64 {
        match self.damping {
            Damping::Viscoelastic => self.exponent - 1.0,
            Damping::Linear => 0.0,
            Damping::Power => self.damping_exponent.unwrap_or(0.0),
            Damping::LammpsMaterial => 0.5,
            Damping::LammpsTsuji => 0.5 * (self.exponent - 1.0),
        }
    }
}
