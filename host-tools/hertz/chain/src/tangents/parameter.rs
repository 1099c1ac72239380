//! Parameters of a strike that tangents are taken along.

use super::dual::Dual;
use crate::scenario::Scenario;

/// A parameter of a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Parameter {
    /// Young's modulus of all beads that have the chain's, Pa.
    Young,
    /// Relaxation time τ of all beads that have the chain's, s.
    Relaxation,
    /// Density of all beads that have the chain's, kg/m³: their masses, at the same radius.
    Density,
    /// Velocity of the striker, m/s.
    StrikerVelocity,
    /// Stiffness k of the intruders of one `[[intruder]]` table, counted from 0, N/m.
    Stiffness(usize),
    /// Their damping c, N·s/m.
    Damping(usize),
    /// Their mass m, kg. The mass of the bead stays.
    IntruderMass(usize),
    /// Their cubic stiffness k₃, N/m³: the spring's force is k x + k₃ x³.
    CubicStiffness(usize),
    /// Factor of the force that pushes body 0.
    PushGain,
}

impl Parameter {
    /// Value of the parameter in a scenario, in its own unit; `None` if the scenario lacks its table.
    pub fn value(self, scenario: &Scenario) -> Option<f64> {
        let intruder = |table: usize| scenario.intruders.get(table);
        Some(match self {
            Self::Young => scenario.chain.young,
            Self::Relaxation => scenario.chain.relaxation,
            Self::Density => scenario.chain.density,
            Self::StrikerVelocity => scenario.striker.velocity,
            Self::Stiffness(table) => intruder(table)?.stiffness,
            Self::Damping(table) => intruder(table)?.damping,
            Self::IntruderMass(table) => intruder(table)?.mass,
            Self::CubicStiffness(table) => intruder(table)?.cubic_stiffness,
            Self::PushGain => 1.0,
        })
    }
}

/// The direction of each parameter among P.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seeds<'a, const P: usize>(&'a [Parameter]);

impl<'a, const P: usize> Seeds<'a, P> {
    pub(super) fn new(parameters: &'a [Parameter]) -> Self {
        Self(parameters)
    }

    /// `None` for a parameter that no tangent is taken along.
    pub(super) fn direction(&self, of: Parameter) -> Option<usize> {
        self.0.iter().take(P).position(|parameter| *parameter == of)
    }

    /// The value of a parameter.
    pub(super) fn seeded(&self, of: Parameter, value: f64) -> Dual<P> {
        let mut dual = Dual::constant(value);
        if let Some(direction) = self.direction(of) {
            dual.by[direction] = 1.0;
        }
        dual
    }
}
