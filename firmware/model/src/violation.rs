//! Which setting is refused, and which bound it violates.

use core::fmt;

macro_rules! keys {
    ($($name:ident $path:literal)*) => {
        /// A setting that the owner states, by its place in `bead.toml`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum SettingKey {
            $(#[doc = concat!("`", $path, "`.")] $name),*
        }

        impl SettingKey {
            /// Its place: `intruder.stiffness`.
            pub const fn path(self) -> &'static str {
                match self {
                    $(Self::$name => $path),*
                }
            }
        }
    };
}

keys! {
    Name "name"
    Address "address"
    BeadMass "bead.mass"
    FrontMass "bead.front_mass"
    IntruderMass "intruder.mass"
    IntruderStiffness "intruder.stiffness"
    IntruderDamping "intruder.damping"
    ContactStiffness "contact.stiffness"
    ContactRelaxation "contact.relaxation"
    Behind "company.behind"
    Elsewhere "company.elsewhere"
    CompanyMass "company.mass"
    CompanyStiffness "company.stiffness"
    CompanyDamping "company.damping"
    ForcePerCode "force.per_code"
    WideForcePerCode "force.wide_per_code"
    ForcePole "force.pole"
    WideForcePole "force.wide_pole"
    ForceNoise "force.noise"
    AccelerationPerCode "acceleration.per_code"
    WideAccelerationPerCode "acceleration.wide_per_code"
    AccelerationPole "acceleration.pole"
    WideAccelerationPole "acceleration.wide_pole"
    AccelerationNoise "acceleration.noise"
    SampleRate "capture.sample_rate"
    Threshold "capture.threshold"
    Lookback "capture.lookback"
    History "capture.history"
    Length "capture.length"
    Disagreement "capture.disagreement"
    RingFrequencyTolerance "capture.ring_frequency_tolerance"
    RingDecayTolerance "capture.ring_decay_tolerance"
    Calibration "uncertainty.calibration"
    Calibrated "uncertainty.calibrated"
    ValidUntil "uncertainty.valid_until"
    UForceGain "uncertainty.force_gain"
    UForceGainRatio "uncertainty.force_gain_ratio"
    UForceFlatness "uncertainty.force_flatness"
    UAccelerationGain "uncertainty.acceleration_gain"
    UAccelerationGainRatio "uncertainty.acceleration_gain_ratio"
    UAccelerationFlatness "uncertainty.acceleration_flatness"
    USupply "uncertainty.supply"
    UBeadMass "uncertainty.bead_mass"
    UFrontMass "uncertainty.front_mass"
    UIntruderMass "uncertainty.intruder_mass"
    UStiffness "uncertainty.stiffness"
    UDamping "uncertainty.damping"
    UContactStiffness "uncertainty.contact_stiffness"
    URelaxation "uncertainty.relaxation"
    StiffnessWithDamping "uncertainty.stiffness_with_damping"
    StiffnessWithMass "uncertainty.stiffness_with_mass"
    DampingWithMass "uncertainty.damping_with_mass"
    SupplyVoltage "supply.voltage"
    ForceEnd "sensor_end.force"
    AccelerationEnd "sensor_end.acceleration"
    FollowersMass "followers.mass"
    FollowersStiffness "followers.stiffness"
    FollowersRelaxation "followers.relaxation"
    Wall "followers.wall"
    Load "followers.load"
}

/// A coefficient that follows from the settings; its format may not hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coefficient {
    /// [`Observer::start`](crate::observer::Observer::start).
    OldAcceleration,
    /// [`Observer::end`](crate::observer::Observer::end).
    NewAcceleration,
    /// [`Observer::energy`](crate::observer::Observer::energy).
    EnergyByAcceleration,
    /// [`ReducedChain::contact`](crate::reduced_chain::ReducedChain::contact).
    Contact,
    /// [`ReducedChain::relaxation`](crate::reduced_chain::ReducedChain::relaxation).
    Relaxation,
    /// [`ReducedChain::incoming`](crate::reduced_chain::ReducedChain::incoming).
    Incoming,
    /// [`ReducedChain::stiffness`](crate::reduced_chain::ReducedChain::stiffness).
    Stiffness,
    /// [`ReducedChain::damping`](crate::reduced_chain::ReducedChain::damping).
    Damping,
    /// [`ReducedChain::intruder`](crate::reduced_chain::ReducedChain::intruder).
    Intruder,
    /// [`ReducedChain::host`](crate::reduced_chain::ReducedChain::host).
    Host,
    /// [`ReducedChain::energy`](crate::reduced_chain::ReducedChain::energy).
    EnergyByVelocity,
    /// [`Settings::incident`](crate::Settings::incident).
    Incident,
    /// [`Ringing::frequency`](crate::shape::Ringing::frequency).
    RingFrequency,
    /// [`Ringing::decay`](crate::shape::Ringing::decay).
    RingDecay,
    /// [`Company::stiffness`](crate::company::Company::stiffness).
    CompanyStiffness,
    /// [`Company::damping`](crate::company::Company::damping).
    CompanyDamping,
    /// [`Follower::ratio`](crate::company::Follower::ratio).
    CompanyRatio,
}

/// A bound of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// Finite and above 0.
    Positive,
    /// Finite, and 0 or more.
    NotNegative,
    /// Below the mass of the bead.
    BelowBead,
    /// 0 or more, and below the mass of the bead without its intruder.
    BelowHost,
    /// From `least` to `most`, in the unit of the setting.
    Range {
        /// The least allowed value.
        least: f64,
        /// The greatest allowed value.
        most: f64,
    },
    /// Not 255, the address of every bead.
    OneBead,
    /// Text without control characters.
    Text,
    /// Digits from 1 to 6, each at most once.
    Places,
    /// 0 to 6.
    Place,
    /// At least 1/64 of the mass of the bead.
    NotLight,
    /// 0 or 1.
    Flag,
    /// A wave of 1 m/s at least [`LEAST_WIDTH`](crate::physics::LEAST_WIDTH) samples wide.
    Width {
        /// Full width at half its height, samples.
        samples: f64,
    },
    /// A coefficient that its format holds to 1e-4 of itself.
    Format {
        /// The coefficient.
        coefficient: Coefficient,
        /// Its value in the units of the sample rate.
        value: f64,
        /// Range of the format.
        range: [f64; 2],
    },
    /// A unit per code that its format holds to 1e-4 of itself.
    Unit {
        /// Range of the format, in the unit of the setting.
        range: [f64; 2],
    },
    /// A pole above f_s/4π.
    Pole,
    /// Codes that reach less far than the sums: 32 kN, less for a small bead, or 65 km/s².
    Reach,
    /// A history of at least 128 samples.
    LongHistory,
    /// A history of at most 256 samples.
    ShortHistory,
    /// A window longer than its history.
    LongWindow,
    /// A window of at most 1024 samples.
    ShortWindow,
    /// A time above 0 and below the history.
    Lookback,
    /// A rise of 1 to 4095 codes.
    Codes,
    /// A rise of at least twice the gate: six standard deviations of the noise.
    AboveNoise,
    /// Not before the day of the calibration.
    AfterCalibration,
    /// With the two other correlations a matrix of correlations: positive semidefinite.
    Correlations,
}

impl Bound {
    /// Text about a setting that violates the bound.
    pub const fn text(&self) -> &'static str {
        match self {
            Self::Positive => "must be above 0",
            Self::NotNegative => "must be 0 or more",
            Self::BelowBead => "must be below the mass of the bead",
            Self::BelowHost => "must be a part of the bead's mass without its intruder",
            Self::Range { .. } => "is out of its range",
            Self::OneBead => "is 255, the address of every bead",
            Self::Text => "is not UTF-8, or has a control character",
            Self::Places => "names no beads behind",
            Self::Place => "is not the place of one of the six beads behind",
            Self::NotLight => "must be at least 1/64 of the mass of the bead",
            Self::Flag => "must be 0 or 1",
            Self::Width { .. } => "makes a wave of 1 m/s too short for the sample rate",
            Self::Format { .. } => "gives a coefficient that its format does not hold",
            Self::Unit { .. } => "does not fit its format",
            Self::Pole => "is below f_s/4π",
            Self::Reach => "gives codes that reach beyond 32 kN, for a small bead less, or 65 km/s²",
            Self::LongHistory => {
                "is shorter than 128 samples: 64 for the zeros, 32 for the noise, 32 of the wave's foot"
            }
            Self::ShortHistory => "is longer than 256 samples",
            Self::LongWindow => "is not longer than the history",
            Self::ShortWindow => "is longer than 1024 samples",
            Self::Lookback => "is not between 0 and the history",
            Self::Codes => "is not a rise of 1 to 4095 codes",
            Self::AfterCalibration => "is before the calibration",
            Self::Correlations => "is not possible beside the two other correlations",
            Self::AboveNoise => "is within the noise: below twice the gate, six standard deviations",
        }
    }
}

/// A setting outside its bound. Its text has no numbers: formatting those would take 4 KiB of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// The setting.
    pub key: SettingKey,
    /// The bound.
    pub bound: Bound,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.key.path())?;
        f.write_str(" ")?;
        f.write_str(self.bound.text())
    }
}

impl core::error::Error for Violation {}

/// Checks that each value is finite and `holds`. Never inlined: the loop would be unrolled for each list,
/// which takes 2 KiB of the image.
#[inline(never)]
pub(crate) fn check_each(
    values: &[(SettingKey, f64)],
    bound: Bound,
    holds: fn(f64) -> bool,
) -> Result<(), Violation> {
    match values
        .iter()
        .find(|(_, value)| !(value.is_finite() && holds(*value)))
    {
        Some(&(key, _)) => Err(Violation { key, bound }),
        None => Ok(()),
    }
}

/// Checks that each value is in a range.
#[inline(never)]
pub(crate) fn check_ranges(values: &[(SettingKey, f64)], [least, most]: [f64; 2]) -> Result<(), Violation> {
    match values.iter().find(|(_, value)| !(least..=most).contains(value)) {
        Some(&(key, _)) => Err(Violation {
            key,
            bound: Bound::Range { least, most },
        }),
        None => Ok(()),
    }
}

/// Refuses the setting `key` unless its bound `holds`.
pub(crate) fn require(holds: bool, key: SettingKey, bound: Bound) -> Result<(), Violation> {
    if holds {
        Ok(())
    } else {
        Err(Violation { key, bound })
    }
}
