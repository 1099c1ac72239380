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
    FrontMass "" "kg" "the part of it in front of the force sensor's crystal"
    IntruderMass "m" "kg" "the mass on the springs, with its accelerometer"
    IntruderStiffness "k" "N/m" "of its springs, from ring-downs"
    IntruderDamping "c" "N·s/m" "of its damper, from ring-downs"
    ContactStiffness "kappa" "N/m^1.5" "in F = kappa x^1.5: (R/2)^0.5 2Y / (3 (1 - nu^2))"
    ContactRelaxation "tau" "s" "viscoelastic relaxation time; 0 is elastic"
    Behind "" "" "which of the six beads behind hold an intruder, by place: 123456 for all, 0 for none"
    Elsewhere "" "" "1 if other beads near by hold one: in front, or further behind"
    CompanyMass "" "kg" "of the intruder in each of those behind; 0 without one"
    CompanyStiffness "" "N/m" "of its springs"
    CompanyDamping "" "N·s/m" "of its damper"
    ForcePerCode "" "N" "a code at the high gain, from the drop test"
    WideForcePerCode "" "N" "a code at the low gain"
    ForcePole "" "Hz" "of the filter before the converter, high gain; 0 for none"
    WideForcePole "" "Hz" "of the filter at the low gain; 0 for none"
    ForceNoise "" "N" "rms at the high gain, of a bead at rest"
    AccelerationPerCode "" "m/s²" "a code at the high gain, from the shaker"
    WideAccelerationPerCode "" "m/s²" "a code at the low gain"
    AccelerationPole "" "Hz" "of the filter before the converter, high gain; 0 for none"
    WideAccelerationPole "" "Hz" "of the filter at the low gain; 0 for none"
    AccelerationNoise "" "m/s²" "rms at the high gain; for people, since the bead measures it itself"
    SampleRate "" "Hz" "the image samples at 100000 and refuses another"
    Threshold "" "N" "a rise of the force that is a strike"
    Lookback "" "s" "the time in which it must rise so far"
    History "" "s" "kept of the time before; 1.28e-3 to 2.56e-3"
    Length "" "s" "of the whole window, up to 10.24e-3: the ring-down of the intruder is in it"
    Disagreement "" "" "a strike is flagged if A and B differ by more than this part"
    RingFrequencyTolerance "" "" "flagged if the ringing is off by more than this part"
    RingDecayTolerance "" "" "flagged if its decay is off by more than this part"
    Calibration "" "" "its certificate or record, up to 16 bytes"
    Calibrated "" "" "its day"
    ValidUntil "" "" "last day on which it holds"
    UForceGain "" "" "of the force's scale, which both gains share"
    UForceGainRatio "" "" "of its low gain over the high one"
    UForceFlatness "" "" "of its response up to 5 kHz, if a drop test calibrated it near 0 Hz"
    UAccelerationGain "" "" "of the acceleration's scale, which both gains share"
    UAccelerationGainRatio "" "" "of its low gain over the high one"
    UAccelerationFlatness "" "" "of its response up to 5 kHz, beside the shaker's frequency"
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
    ForceEnd "" "N" "the greatest force that its sensor tells"
    AccelerationEnd "" "m/s²" "the greatest acceleration that its sensor tells, of either sign"
    FollowersMass "" "kg" "of each bead behind, with its intruder, from the one next to this bead on"
    FollowersStiffness "" "N/m^1.5" "kappa of the contact in front of each; 0 where the chain has ended"
    FollowersRelaxation "" "s" "tau of that contact"
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
        "The intruders of the beads around. Leave it out for a bead that is alone.",
    ),
    (
        "force",
        "The force sensor at the contact that the wave comes in by.",
    ),
    ("acceleration", "The accelerometer on the intruder."),
    (
        "capture",
        "When a strike is taken, and when it is flagged. These may be left out.",
    ),
    (
        "uncertainty",
        "The calibration, and relative standard uncertainties: 0.01 for 1 %, k = 1. What is left out is unknown.",
    ),
    (
        "supply",
        "The converter's supply, which is its reference. Left out, it is unknown, and no strike is flagged for it.",
    ),
    (
        "sensor_end",
        "Where the sensors end, though the converter goes on: strikes that come within 1 % of it are flagged.",
    ),
    (
        "followers",
        "The six beads behind. Leave it out where they and their contacts are like this bead.",
    ),
];
