//! The table of keys: unit and meaning of each setting.

use bead_model::violation::SettingKey;

/// A row of the table.
#[derive(Debug)]
pub struct KeyRow {
    /// The setting.
    pub key: SettingKey,
    /// The letter that physicists write for it, which `set` takes as well; empty for none.
    pub letter: &'static str,
    /// Its unit; empty for a text or a number.
    pub unit: &'static str,
    /// Its meaning.
    pub what: &'static str,
}

impl KeyRow {
    /// Place of the setting: `intruder.stiffness`.
    pub fn path(&self) -> &'static str {
        self.key.path()
    }
}

macro_rules! keys {
    ($($key:ident $letter:literal $unit:literal $what:literal)*) => {
        /// Every key, in the order of the file.
        pub const KEYS: &[KeyRow] = &[$(KeyRow {
            key: SettingKey::$key,
            letter: $letter,
            unit: $unit,
            what: $what,
        }),*];
    };
}

keys! {
    Name "" "" "for people, up to 16 bytes"
    Address "" "" "0 to 254; tells beads apart on a shared line"
    BeadMass "M" "kg" "the bead with its intruder: weigh it"
    FrontMass "" "kg" "the part of the bead in front of the force sensor's crystal"
    IntruderMass "m" "kg" "the mass on the springs, with its accelerometer"
    IntruderStiffness "k" "N/m" "of its springs, from ring-downs"
    IntruderDamping "c" "N·s/m" "of its damper, from ring-downs"
    ContactStiffness "kappa" "N/m^1.5" "in F = kappa x^1.5: (R/2)^0.5 2Y / (3 (1 - nu^2))"
    ContactRelaxation "tau" "s" "viscoelastic relaxation time; 0 is elastic"
    Behind "" "" "which of the six beads behind have an intruder, by place: 123456 for all, 0 for none"
    Elsewhere "" "" "1 if other beads nearby have an intruder: in front, or further behind"
    CompanyMass "" "kg" "of the intruder in each of these beads; 0 without one"
    CompanyStiffness "" "N/m" "of its springs"
    CompanyDamping "" "N·s/m" "of its damper"
    ForcePerCode "" "N" "per code at the high gain, from the drop test"
    WideForcePerCode "" "N" "per code at the low gain"
    ForcePole "" "Hz" "of the filter before the converter, high gain; 0 for none"
    WideForcePole "" "Hz" "of the filter at the low gain; 0 for none"
    ForceNoise "" "N" "rms at the high gain, of a bead at rest"
    AccelerationPerCode "" "m/s²" "per code at the high gain, from the shaker"
    WideAccelerationPerCode "" "m/s²" "per code at the low gain"
    AccelerationPole "" "Hz" "of the filter before the converter, high gain; 0 for none"
    WideAccelerationPole "" "Hz" "of the filter at the low gain; 0 for none"
    AccelerationNoise "" "m/s²" "rms at the high gain; for people, since the bead measures it itself"
    SampleRate "" "Hz" "the image samples at 100000 and refuses any other rate"
    Threshold "" "N" "a rise of the force that counts as a strike"
    Lookback "" "s" "the time in which the force must rise by that much"
    History "" "s" "time kept before the trigger; 1.28e-3 to 2.56e-3"
    Length "" "s" "of the whole window, which includes the ring-down of the intruder; up to 10.24e-3"
    Disagreement "" "" "a strike is flagged if A and B differ by more than this fraction"
    RingFrequencyTolerance "" "" "flagged if the frequency of the ringing is off by more than this fraction"
    RingDecayTolerance "" "" "flagged if the decay of the ringing is off by more than this fraction"
    Calibration "" "" "name of its certificate or record, up to 16 bytes"
    Calibrated "" "" "day of the calibration"
    ValidUntil "" "" "last day on which the calibration is valid"
    UForceGain "" "" "of the force's scale, which both gains share"
    UForceGainRatio "" "" "of the force's low gain over its high one"
    UForceFlatness "" "" "of the force's response up to 5 kHz, if a drop test calibrated it near 0 Hz"
    UAccelerationGain "" "" "of the acceleration's scale, which both gains share"
    UAccelerationGainRatio "" "" "of the acceleration's low gain over its high one"
    UAccelerationFlatness "" "" "of the acceleration's response up to 5 kHz, away from the shaker's frequency"
    USupply "" "" "of the converter's supply, which scales both sensors"
    UBeadMass "" "" "of M"
    UFrontMass "" "" "of the mass in front of the crystal"
    UIntruderMass "" "" "of m"
    UStiffness "" "" "of k"
    UDamping "" "" "of c"
    UContactStiffness "" "" "of kappa"
    URelaxation "" "" "of tau"
    StiffnessWithDamping "" "" "correlation of k and c, from -1 to 1: one ring-down gives both"
    StiffnessWithMass "" "" "correlation of k and m"
    DampingWithMass "" "" "correlation of c and m"
    SupplyVoltage "" "V" "VDDA during calibration, as the bead measured it: `supply` of its strikes"
    ForceEnd "" "N" "the greatest force that the sensor can measure"
    AccelerationEnd "" "m/s²" "the greatest acceleration that the sensor can measure, of either sign"
    FollowersMass "" "kg" "of each bead behind, with its intruder, from the one next to this bead on"
    FollowersStiffness "" "N/m^1.5" "kappa of the contact in front of each of these beads; 0 beyond the end of the chain"
    FollowersRelaxation "" "s" "tau of the contact in front of each of these beads"
    Wall "" "" "place of a wall in place of a bead, 1 to 6; 0 for none"
    Load "" "N" "force that presses the chain together at rest"
}

/// Comment above each table of a file.
pub(super) const TABLES: &[(&str, &str)] = &[
    ("bead", "The host: a sphere of the chain."),
    ("intruder", "The mass on springs inside it."),
    ("contact", "The contacts between the beads of the chain."),
    (
        "company",
        "The intruders of the beads nearby. Leave this table out if there are none.",
    ),
    (
        "force",
        "The force sensor at the contact through which the wave comes in.",
    ),
    ("acceleration", "The accelerometer on the intruder."),
    (
        "capture",
        "When a strike is taken, and when it is flagged. These keys may be left out.",
    ),
    (
        "uncertainty",
        "The calibration, and relative standard uncertainties: 0.01 for 1 %, k = 1. A key that is left out is unknown.",
    ),
    (
        "supply",
        "The converter's supply, which is its reference. If left out, it is unknown, and no strike is flagged for it.",
    ),
    (
        "sensor_end",
        "Where the sensors reach their limits before the converter does: strikes within 1 % of a limit are flagged.",
    ),
    (
        "followers",
        "The six beads behind. Leave this table out if they and their contacts are the same as for this bead.",
    ),
];
