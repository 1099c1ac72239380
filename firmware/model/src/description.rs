//! The settings of a bead as its owner states them: physics, calibration and capture, in SI units.
//!
//! A [`Description`] is the content of a settings block, of the file `bead.toml` and of the `settings` in
//! JSON. [`Settings`](crate::Settings) has the coefficients that follow from it.

use serde::{Deserialize, Serialize};

use crate::capture::Capture;
use crate::company::FOLLOWERS;
use crate::front_end::{FrontEnd, SensorEnds, SensorScale};
use crate::name::Name;
use crate::physics::{Bead, Followers, Intruder, LEAST_WIDTH, Neighbours, Surroundings};
use crate::uncertainty::Uncertainty;
use crate::violation::{Bound, SettingKey as Key, Violation, check_each, check_ranges, require};

/// Address that every bead answers.
const EVERY_BEAD: u8 = 0xFF;
/// Greatest noise of a sensor, in its unit, rms: three times of it is a gate that its format holds.
const NOISE_MOST: f64 = 1e4;
/// Range of VDDA, V: that of the part (DocID022152, general operating conditions).
const SUPPLY: [f64; 2] = [1.8, 3.6];
/// Greatest ratio of the host's mass to that of a bead behind it.
const LIGHTEST: f64 = 64.0;
/// Range of a tolerance. A smaller one loses more than 1 % in its format.
const TOLERANCE: [f64; 2] = [1e-3, 1e4];
/// Range of the intruder's stiffness, N/m. With a softer spring it swings once in minutes, and coefficients
/// of its ring-down leave their formats.
const STIFFNESS: [f64; 2] = [1e-6, 1e15];

/// All settings of a bead, SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// The name that its owner gave the bead.
    #[serde(default)]
    #[cfg_attr(feature = "schema", schemars(with = "&str"))]
    pub name: Name,
    /// Address of the bead, 0 to 254: it tells beads apart on a shared line and in merged streams. 0 where
    /// nobody gave it one.
    #[serde(default)]
    pub address: u8,
    /// The host.
    pub bead: Host,
    /// The mass on springs inside it.
    pub intruder: Intruder,
    /// The contacts of the chain.
    pub contact: Contact,
    /// The intruders of the beads near by.
    #[serde(default)]
    pub company: Neighbours,
    /// The force sensor; quantities in N.
    pub force: SensorScale,
    /// The acceleration sensor; quantities in m/s².
    pub acceleration: SensorScale,
    /// When a strike is taken.
    #[serde(default)]
    pub capture: Capture,
    /// Uncertainties of these settings, where their calibration stated them.
    #[serde(default)]
    pub uncertainty: Option<Uncertainty>,
    /// The supply during calibration; `None` if it is not known.
    #[serde(default)]
    pub supply: Option<Supply>,
    /// Where the sensors end, if that is known.
    #[serde(default)]
    pub sensor_end: Option<SensorEnds>,
    /// The beads behind, if they are not like this one.
    #[serde(default)]
    pub followers: Option<Followers>,
}

/// The bead around the intruder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Host {
    /// M, its mass with the intruder, kg.
    pub mass: f64,
    /// The part of it in front of the crystal of the force sensor, kg.
    #[serde(default)]
    pub front_mass: f64,
}

/// A contact between two beads.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// κ, N/m^1.5.
    pub stiffness: f64,
    /// τ, relaxation time, s.
    pub relaxation: f64,
}

/// The supply of the converter, which is its reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Supply {
    /// VDDA while the gains were calibrated, as the bead itself measured it, V.
    pub voltage: f64,
}

impl Description {
    /// A bead without a name, with address 0.
    pub fn new(bead: &Bead, around: &Surroundings, front_end: &FrontEnd, capture: &Capture) -> Self {
        Self {
            name: Name::default(),
            address: 0,
            bead: Host {
                mass: bead.mass,
                front_mass: bead.front_mass,
            },
            intruder: bead.intruder(),
            contact: Contact {
                stiffness: bead.contact_stiffness,
                relaxation: bead.relaxation,
            },
            company: around.intruders,
            force: front_end.force,
            acceleration: front_end.acceleration,
            capture: *capture,
            uncertainty: None,
            supply: None,
            sensor_end: None,
            followers: around.followers,
        }
    }

    /// The beads around.
    pub fn surroundings(&self) -> Surroundings {
        Surroundings {
            intruders: self.company,
            followers: self.followers,
        }
    }

    /// The bead with its intruder and its contacts.
    pub fn physics(&self) -> Bead {
        Bead {
            mass: self.bead.mass,
            intruder_mass: self.intruder.mass,
            front_mass: self.bead.front_mass,
            stiffness: self.intruder.stiffness,
            damping: self.intruder.damping,
            contact_stiffness: self.contact.stiffness,
            relaxation: self.contact.relaxation,
        }
    }

    /// Checks each setting by itself, before anything is computed from it.
    ///
    /// # Errors
    /// The first setting outside its bound.
    pub(crate) fn check(&self) -> Result<(), Violation> {
        require(self.name.is_text(), Key::Name, Bound::Text)?;
        require(self.address != EVERY_BEAD, Key::Address, Bound::OneBead)?;
        self.check_numbers()?;
        self.check_masses()?;
        self.check_followers()?;
        self.uncertainty.as_ref().map_or(Ok(()), Uncertainty::check)?;
        let samples = self.physics().pulse_width(1.0) * f64::from(self.capture.sample_rate_hz);
        require(
            samples >= LEAST_WIDTH,
            Key::ContactStiffness,
            Bound::Width { samples },
        )
    }

    /// Checks signs and ranges.
    fn check_numbers(&self) -> Result<(), Violation> {
        let Self {
            bead,
            intruder,
            contact,
            force,
            acceleration,
            capture,
            ..
        } = self;
        let ends = self.sensor_end.unwrap_or_default();
        let positive = [
            (Key::BeadMass, bead.mass),
            (Key::IntruderMass, intruder.mass),
            (Key::IntruderStiffness, intruder.stiffness),
            (Key::IntruderDamping, intruder.damping),
            (Key::ContactStiffness, contact.stiffness),
            (Key::ForcePerCode, force.per_code),
            (Key::WideForcePerCode, force.wide_per_code),
            (Key::AccelerationPerCode, acceleration.per_code),
            (Key::WideAccelerationPerCode, acceleration.wide_per_code),
            (Key::SampleRate, capture.sample_rate_hz.into()),
            (Key::Threshold, capture.threshold),
            (Key::ForceEnd, ends.force.map_or(1.0, f64::from)),
            (Key::AccelerationEnd, ends.acceleration.map_or(1.0, f64::from)),
        ];
        check_each(&positive, Bound::Positive, |value| value > 0.0)?;
        let not_negative = [
            (Key::ContactRelaxation, contact.relaxation),
            (Key::ForcePole, force.pole),
            (Key::WideForcePole, force.wide_pole),
            (Key::AccelerationPole, acceleration.pole),
            (Key::WideAccelerationPole, acceleration.wide_pole),
            (Key::CompanyMass, self.company.mass),
            (Key::CompanyStiffness, self.company.stiffness),
            (Key::CompanyDamping, self.company.damping),
            (Key::Lookback, capture.lookback),
            (Key::History, capture.history),
            (Key::Length, capture.length),
        ];
        check_each(&not_negative, Bound::NotNegative, |value| value >= 0.0)?;
        check_ranges(&[(Key::IntruderStiffness, intruder.stiffness)], STIFFNESS)?;
        check_ranges(
            &[
                (Key::ForceNoise, force.noise),
                (Key::AccelerationNoise, acceleration.noise),
            ],
            [0.0, NOISE_MOST],
        )?;
        check_ranges(
            &[
                (Key::Disagreement, capture.disagreement),
                (Key::RingFrequencyTolerance, capture.ring_frequency_tolerance),
                (Key::RingDecayTolerance, capture.ring_decay_tolerance),
            ],
            TOLERANCE,
        )?;
        match self.supply {
            Some(supply) => check_ranges(&[(Key::SupplyVoltage, supply.voltage)], SUPPLY),
            None => Ok(()),
        }
    }

    /// Checks the beads behind, where they are not like the host.
    fn check_followers(&self) -> Result<(), Violation> {
        let Some(followers) = &self.followers else {
            return Ok(());
        };
        let Followers {
            mass,
            stiffness,
            relaxation,
            wall,
            load,
        } = followers;
        let lightest = self.bead.mass / LIGHTEST;
        let is_bead = |mass: &f32| (lightest..).contains(&f64::from(*mass)) && mass.is_finite();
        require(mass.iter().all(is_bead), Key::FollowersMass, Bound::NotLight)?;
        let holds = |values: &[f32]| values.iter().all(|value| value.is_finite() && *value >= 0.0);
        require(holds(stiffness), Key::FollowersStiffness, Bound::NotNegative)?;
        require(holds(relaxation), Key::FollowersRelaxation, Bound::NotNegative)?;
        require(usize::from(*wall) <= FOLLOWERS, Key::Wall, Bound::Place)?;
        require(holds(&[*load]), Key::Load, Bound::NotNegative)?;
        let places = self.company.places().unwrap_or(0);
        let has_room = |(n, mass): (usize, &f32)| {
            let is_held = places >> n & 1 == 1;
            !is_held || !followers.is_wall(n) && self.company.mass < f64::from(*mass)
        };
        require(
            mass.iter().enumerate().all(has_room),
            Key::CompanyMass,
            Bound::BelowBead,
        )
    }

    /// Checks that each mass is below the one that contains it, and checks the intruders behind.
    fn check_masses(&self) -> Result<(), Violation> {
        let (bead, intruder) = (&self.bead, &self.intruder);
        require(intruder.mass < bead.mass, Key::IntruderMass, Bound::BelowBead)?;
        let holds = (0.0..bead.mass - intruder.mass).contains(&bead.front_mass);
        require(holds, Key::FrontMass, Bound::BelowHost)?;
        require(self.company.elsewhere <= 1, Key::Elsewhere, Bound::Flag)?;
        let company = &self.company;
        let behind = company.places().ok_or(Violation {
            key: Key::Behind,
            bound: Bound::Places,
        })?;
        if behind == 0 {
            return Ok(());
        }
        let positive = [
            (Key::CompanyMass, company.mass),
            (Key::CompanyStiffness, company.stiffness),
            (Key::CompanyDamping, company.damping),
        ];
        check_each(&positive, Bound::Positive, |value| value > 0.0)?;
        require(company.mass < bead.mass, Key::CompanyMass, Bound::BelowBead)
    }
}
