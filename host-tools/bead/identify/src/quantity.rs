//! The quantities that strikes identify.

use schemars::JsonSchema;
use serde::Serialize;

/// A quantity of a bead or its chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// k, N/m.
    Stiffness,
    /// c, N·s/m.
    Damping,
    /// m, kg.
    IntruderMass,
    /// M, kg, as the mass of all beads of the chain.
    BeadMass,
    /// Young's modulus Y of the chain's beads, Pa.
    Young,
    /// τ, s.
    Relaxation,
    /// Factor by which the force is greater than the settings' `per_code` has it.
    ForceGain,
    /// Factor of the acceleration.
    AccelerationGain,
}

/// All quantities, in the order of parameters.
pub const QUANTITIES: [Quantity; 8] = [
    Quantity::Stiffness,
    Quantity::Damping,
    Quantity::IntruderMass,
    Quantity::BeadMass,
    Quantity::Young,
    Quantity::Relaxation,
    Quantity::ForceGain,
    Quantity::AccelerationGain,
];

/// Number of quantities.
pub const COUNT: usize = QUANTITIES.len();

impl Quantity {
    /// Place among [`QUANTITIES`].
    pub fn place(self) -> usize {
        self as usize
    }

    /// Name on a command line.
    pub fn name(self) -> &'static str {
        FACTS[self.place()].0
    }

    /// The quantity with a name.
    pub fn named(name: &str) -> Option<Self> {
        QUANTITIES
            .into_iter()
            .find(|one| one.name() == name || one.symbol() == name)
    }

    /// Letter in tables.
    pub fn symbol(self) -> &'static str {
        FACTS[self.place()].1
    }

    /// Unit.
    pub fn unit(self) -> &'static str {
        FACTS[self.place()].2
    }

    /// Relative change of its value in the samples with that of the clock: a bead whose clock is fast has
    /// longer times at the same forces and masses.
    pub(crate) fn by_clock(self) -> f64 {
        FACTS[self.place()].3
    }

    /// Place in the order in which quantities are held, first to last, where the data cannot tell some apart:
    /// what a balance or a certificate knows comes first.
    pub fn held_before(self) -> usize {
        FACTS[self.place()].4
    }
}

/// Name, letter, unit, change with the clock, and place in the order of holding, of each quantity.
const FACTS: [(&str, &str, &str, f64, usize); COUNT] = [
    ("stiffness", "k", "N/m", -2.0, 7),
    ("damping", "c", "N·s/m", -1.0, 6),
    ("intruder-mass", "m", "kg", 0.0, 1),
    ("bead-mass", "M", "kg", 0.0, 0),
    ("young", "Y", "Pa", -3.0, 5),
    ("relaxation", "tau", "s", 1.0, 4),
    ("force-gain", "gF", "", 0.0, 2),
    ("acceleration-gain", "ga", "", 0.0, 3),
];

/// Values of all quantities, in SI units.
pub type Values = [f64; COUNT];

/// Values of k, c and m, and of M, Y and τ, with gains of 1.
pub(crate) fn ungained([k, c, m]: [f64; 3], [mass, young, relaxation]: [f64; 3]) -> Values {
    [k, c, m, mass, young, relaxation, 1.0, 1.0]
}

/// Values moved by steps: the logarithm of each quantity by its step.
pub fn moved(start: &Values, steps: &[f64; COUNT]) -> Values {
    std::array::from_fn(|place| start[place] * steps[place].exp())
}
