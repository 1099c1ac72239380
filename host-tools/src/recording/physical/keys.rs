//! The keys, each with its unit and what it is.

/// A key of the physical settings.
#[derive(Debug)]
pub struct Key {
    /// Its place: `intruder.stiffness`.
    pub path: &'static str,
    /// The letter that physicists write for it, which `set` takes as well; empty for none.
    pub letter: &'static str,
    /// Its unit; empty for a text or a number.
    pub unit: &'static str,
    /// What it is.
    pub what: &'static str,
    /// What `bead_model::design` calls it when it refuses its value.
    pub(super) refused_as: &'static str,
}

macro_rules! keys {
    ($($path:literal $letter:literal $unit:literal $what:literal $refused_as:literal)*) => {
        /// Every key, in the order of the file.
        pub const KEYS: &[Key] = &[$(Key {
            path: $path,
            letter: $letter,
            unit: $unit,
            what: $what,
            refused_as: $refused_as,
        }),*];
    };
}

keys! {
    "name" "" "" "for people, up to 16 bytes" ""
    "address" "" "" "0 to 254; tells beads apart on a shared line" ""
    "bead.mass" "M" "kg" "the bead with its intruder: weigh it" "bead mass"
    "bead.front_mass" "" "kg" "the part of it in front of the force sensor's crystal" "front mass"
    "intruder.mass" "m" "kg" "the mass on the springs, with its accelerometer" "intruder mass"
    "intruder.stiffness" "k" "N/m" "of its springs, from ring-downs" "intruder stiffness"
    "intruder.damping" "c" "N·s/m" "of its damper, from ring-downs" "intruder damping"
    "contact.stiffness" "kappa" "N/m^1.5" "in F = kappa x^1.5: (R/2)^0.5 2Y / (3 (1 - nu^2))" "contact stiffness"
    "contact.relaxation" "tau" "s" "viscoelastic relaxation time; 0 is elastic" "relaxation"
    "company.behind" "" "" "which of the four beads behind hold an intruder, by place: 1234 for all, 0 for none" ""
    "company.elsewhere" "" "" "1 if other beads near by hold one: in front, or further behind" ""
    "company.mass" "" "kg" "of the intruder in each of those behind; 0 without one" "mass of the intruders behind"
    "company.stiffness" "" "N/m" "of its springs" "stiffness of the intruders behind"
    "company.damping" "" "N·s/m" "of its damper" "damping of the intruders behind"
    "force.per_code" "" "N" "a code at the high gain, from the drop test" "force per code"
    "force.wide_per_code" "" "N" "a code at the low gain" "wide force per code"
    "force.pole" "" "Hz" "of the filter before the converter, high gain; 0 for none" "force pole"
    "force.wide_pole" "" "Hz" "the same at the low gain" "wide force pole"
    "force.noise" "" "N" "rms at the high gain, of a bead at rest" "force noise"
    "acceleration.per_code" "" "m/s²" "a code at the high gain, from the shaker" "acceleration per code"
    "acceleration.wide_per_code" "" "m/s²" "a code at the low gain" "wide acceleration per code"
    "acceleration.pole" "" "Hz" "of the filter before the converter, high gain; 0 for none" "acceleration pole"
    "acceleration.wide_pole" "" "Hz" "the same at the low gain" "wide acceleration pole"
    "acceleration.noise" "" "m/s²" "rms at the high gain; for people, since the bead measures it itself" ""
    "capture.sample_rate" "" "Hz" "the image samples at 100000 and refuses another" "sample rate"
    "capture.threshold" "" "N" "a rise of the force that is a strike" "trigger threshold"
    "capture.lookback" "" "s" "the time in which it must rise so far" ""
    "capture.history" "" "s" "kept of the time before; 1.28e-3 to 2.56e-3" ""
    "capture.length" "" "s" "of the whole window, up to 10.24e-3: the ring-down of the intruder is in it" ""
    "capture.disagreement" "" "" "a strike is flagged if A and B differ by more than this part" "disagreement"
    "capture.ring_frequency_tolerance" "" "" "flagged if the ringing is off by more than this part" "tolerance of the frequency"
    "capture.ring_decay_tolerance" "" "" "the same of its decay" "tolerance of the decay"
}

/// What stands above each table of a file.
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
];
