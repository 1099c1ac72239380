//! The strike of *Localized energy absorbers in Hertzian chains* (Phys. Rev. Applied 18, 014078), Fig. 2, and
//! all numbers taken from the paper.

use super::tables::{Chain, Intruder, Material, Scenario, Striker};
use crate::oscillator::Oscillator;

impl Material {
    /// The paper's beads, with Young's modulus as it was fitted; the nominal value is 3.9 GPa.
    pub const BAKELITE: Self = Self::new(1775.0, 4.5e9, 0.44);
    /// The paper's striker.
    pub const STEEL: Self = Self::new(7980.0, 203e9, 0.27);
}

impl Oscillator {
    /// The paper's intruder, of 1644 Hz. The paper prints a stiffness of 3.95 N/m, a slip of five decades.
    pub const PAPER: Self = Self::new(3.7e-3, 3.95e5, 12.0);
}

impl Chain {
    /// The paper's sixteen viscoelastic beads.
    pub const PAPER: Self = Self {
        relaxation: 4.2e-6,
        ..Self::new(16, 0.019, Material::BAKELITE)
    };
}

impl Striker {
    /// The paper's steel ball, 3.046 g at 0.45 m/s.
    pub const PAPER: Self = Self::new(0.0045, Material::STEEL, 0.45);
}

impl Scenario {
    /// The paper's strike: [`Striker::PAPER`] on [`Chain::PAPER`], with [`Oscillator::PAPER`] in bead 8.
    ///
    /// It lasts 6 ms, in which the intruder rings down. After the 4 ms of the figure, 0.09 % of the absorbed
    /// energy is missing.
    pub fn paper() -> Self {
        Self {
            title: "One absorber at bead 8".to_owned(),
            intruders: vec![Intruder::new([8], Oscillator::PAPER)],
            ..Self::new(0.006, Chain::PAPER, Striker::PAPER)
        }
    }
}
