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
        match self {
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::IntruderMass => "intruder-mass",
            Self::BeadMass => "bead-mass",
            Self::Young => "young",
            Self::Relaxation => "relaxation",
            Self::ForceGain => "force-gain",
            Self::AccelerationGain => "acceleration-gain",
        }
    }

    /// The quantity with a name.
    pub fn named(name: &str) -> Option<Self> {
        QUANTITIES
            .into_iter()
            .find(|one| one.name() == name || one.symbol() == name)
    }

    /// Letter in tables.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Stiffness => "k",
            Self::Damping => "c",
            Self::IntruderMass => "m",
            Self::BeadMass => "M",
            Self::Young => "Y",
            Self::Relaxation => "tau",
            Self::ForceGain => "gF",
            Self::AccelerationGain => "ga",
        }
    }

    /// Unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Stiffness => "N/m",
            Self::Damping => "N·s/m",
            Self::IntruderMass | Self::BeadMass => "kg",
            Self::Young => "Pa",
            Self::Relaxation => "s",
            Self::ForceGain | Self::AccelerationGain => "",
        }
    }

    /// Relative change of its value in the samples with that of the clock: a bead whose clock is fast has
    /// longer times at the same forces and masses.
    pub(crate) fn by_clock(self) -> f64 {
        match self {
            Self::Stiffness => -2.0,
            Self::Damping => -1.0,
            Self::Young => -3.0,
            Self::Relaxation => 1.0,
            Self::IntruderMass | Self::BeadMass | Self::ForceGain | Self::AccelerationGain => 0.0,
        }
    }

    /// Place in the order in which quantities are held, first to last, where the data cannot tell some apart:
    /// what a balance or a certificate knows comes first.
    pub fn held_before(self) -> usize {
        match self {
            Self::BeadMass => 0,
            Self::IntruderMass => 1,
            Self::ForceGain => 2,
            Self::AccelerationGain => 3,
            Self::Relaxation => 4,
            Self::Young => 5,
            Self::Damping => 6,
            Self::Stiffness => 7,
        }
    }
}

/// Values of all quantities, in SI units.
pub type Values = [f64; COUNT];

/// Values moved by steps: the logarithm of each quantity by its step.
pub fn moved(start: &Values, steps: &[f64; COUNT]) -> Values {
    std::array::from_fn(|place| start[place] * steps[place].exp())
}
