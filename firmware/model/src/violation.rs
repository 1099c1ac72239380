//! A refused setting, and the bound that it violates.

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

/// A bound of a setting. Its text is about a setting that violates it.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Bound {
    /// Finite and above 0.
    #[error("must be above 0")]
    Positive,
    /// Finite, and 0 or more.
    #[error("must be 0 or more")]
    NotNegative,
    /// Below the mass of the bead.
    #[error("must be below the mass of the bead")]
    BelowBead,
    /// 0 or more, and below the mass of the bead without its intruder.
    #[error("must be 0 or more, and below the bead's mass without its intruder")]
    BelowHost,
    /// From `least` to `most`, in the unit of the setting.
    #[error("is out of its range")]
    Range {
        /// The least allowed value.
        least: f64,
        /// The greatest allowed value.
        most: f64,
    },
    /// Not 255, the address of every bead.
    #[error("is 255, the address of every bead")]
    OneBead,
    /// Text without control characters.
    #[error("is not UTF-8, or has a control character")]
    Text,
    /// Digits from 1 to 6, each at most once.
    #[error("is not a set of beads behind")]
    Places,
    /// 0 to 6.
    #[error("is not the place of one of the six beads behind")]
    Place,
    /// At least 1/64 of the mass of the bead.
    #[error("must be at least 1/64 of the mass of the bead")]
    NotLight,
    /// 0 or 1.
    #[error("must be 0 or 1")]
    Flag,
    /// A wave of 1 m/s at least [`LEAST_WIDTH`](crate::physics::LEAST_WIDTH) samples wide.
    #[error("makes a wave of 1 m/s too short for the sample rate")]
    Width {
        /// Full width at half its height, samples.
        samples: f64,
    },
    /// A coefficient that its format holds to 1e-4 of itself.
    #[error("gives a coefficient that does not fit its format")]
    Format {
        /// The coefficient.
        coefficient: Coefficient,
        /// Its value in the units of the sample rate.
        value: f64,
        /// Range of the format.
        range: [f64; 2],
    },
    /// A unit per code that its format holds to 1e-4 of itself.
    #[error("does not fit its format")]
    Unit {
        /// Range of the format, in the unit of the setting.
        range: [f64; 2],
    },
    /// A pole above f_s/4π.
    #[error("is below f_s/4π")]
    Pole,
    /// Codes that reach less far than the sums: 32 kN, less for a small bead, or 65 km/s².
    #[error("gives codes that reach beyond 32 kN (less for a small bead) or 65 km/s²")]
    Reach,
    /// A history of at least 128 samples.
    #[error("is shorter than 128 samples: 64 for the zeros, 32 for the noise, 32 for the wave's foot")]
    LongHistory,
    /// A history of at most 256 samples.
    #[error("is longer than 256 samples")]
    ShortHistory,
    /// A window longer than its history.
    #[error("is not longer than the history")]
    LongWindow,
    /// A window of at most 1024 samples.
    #[error("is longer than 1024 samples")]
    ShortWindow,
    /// A time above 0 and below the history.
    #[error("is not between 0 and the history")]
    Lookback,
    /// A rise of 1 to 4095 codes.
    #[error("is not a rise of 1 to 4095 codes")]
    Codes,
    /// A rise of at least twice the gate: six standard deviations of the noise.
    #[error("is within the noise: below twice the gate, six standard deviations")]
    AboveNoise,
    /// Not before the day of the calibration.
    #[error("is before the calibration")]
    AfterCalibration,
    /// With the two other correlations a matrix of correlations: positive semidefinite.
    #[error("is not possible together with the other two correlations")]
    Correlations,
}

/// A setting outside its bound. Its text has no numbers: formatting those would take 4 KiB of the image.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{} {bound}", key.path())]
pub struct Violation {
    /// The setting.
    pub key: SettingKey,
    /// The bound.
    pub bound: Bound,
}

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
