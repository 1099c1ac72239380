//! Quantities that a limit can be on.

/// A quantity of a strike, of the strikes of a bead, or of those of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A value of a strike.
    Scalar(Scalar),
    /// Change of a value from the first strike to the last, as a part of its mean.
    Drift(Scalar),
    /// Energy that all beads of a recording absorb, as a part of that which came to the first.
    RowShare,
    /// Shock response spectrum.
    Srs,
}

/// A value of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// Absorbed energy, estimate A, J.
    Measured,
    /// Absorbed energy, estimate B, J.
    Predicted,
    /// A over B.
    Ratio,
    /// Highest force, N.
    PeakForce,
    /// Greatest acceleration to either side, m/s².
    PeakAcceleration,
    /// Energy of the wave that came, by the law of a solitary wave, J.
    Incident,
    /// Frequency of the intruder's ringing, Hz.
    RingFrequency,
}

impl Scalar {
    /// All of them, in their order.
    pub const ALL: [Self; 7] = [
        Self::Measured,
        Self::Predicted,
        Self::Ratio,
        Self::PeakForce,
        Self::PeakAcceleration,
        Self::Incident,
        Self::RingFrequency,
    ];

    /// Its name in a file of limits.
    pub const fn name(self) -> &'static str {
        FACTS[self as usize].0
    }

    /// Its unit; empty for a ratio.
    pub const fn unit(self) -> &'static str {
        FACTS[self as usize].1
    }

    /// The value of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.name() == name)
    }
}

/// Name and unit of each scalar.
const FACTS: [(&str, &str); Scalar::ALL.len()] = [
    ("absorbed_measured", "J"),
    ("absorbed_predicted", "J"),
    ("ratio", ""),
    ("peak_force", "N"),
    ("peak_acceleration", "m/s²"),
    ("incident_energy", "J"),
    ("ring_frequency", "Hz"),
];

/// Names of the quantities that are not scalars.
pub(crate) const DRIFT: &str = "drift";
pub(crate) const ROW_SHARE: &str = "row_share";
pub(crate) const SRS: &str = "srs";

impl Quantity {
    /// Its name, with that of the value that drifts.
    pub fn name(self) -> String {
        match self {
            Self::Scalar(scalar) => scalar.name().to_owned(),
            Self::Drift(of) => format!("{DRIFT} of {}", of.name()),
            Self::RowShare => ROW_SHARE.to_owned(),
            Self::Srs => SRS.to_owned(),
        }
    }

    /// Names of all quantities, for messages.
    pub fn names() -> String {
        let scalars = Scalar::ALL.map(Scalar::name).join(", ");
        format!("{scalars}, {DRIFT}, {ROW_SHARE}, {SRS}")
    }
}
