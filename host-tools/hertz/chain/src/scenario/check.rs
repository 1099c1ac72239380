//! Ranges of a scenario's values, and their check. The first value that cannot be used is reported with
//! advice.

use std::ops::RangeInclusive;
use std::path::Path;

use super::read::{InputError, TomlFile, read_text};
use super::tables::{Chain, Intruder, Scenario, Section, Start, Striker, Wall};

/// Most beads of a chain. A longer one would take memory and time that nobody intended.
pub const MOST_BEADS: usize = 100_000;

/// Absolute values that are computed with, in SI units. No body, contact or time has others, and their
/// products would leave the range of an `f64`.
const SIZES: RangeInclusive<f64> = 1e-30..=1e30;

/// Values that a key accepts, with the words that the advice for any other value adds.
#[derive(Clone, Copy)]
pub(crate) enum Range {
    /// Above zero: the unit and an example.
    Positive(&'static str),
    /// Zero or above: the whole advice.
    NotNegative(&'static str),
    /// A velocity of either sign.
    Velocity,
    Poisson,
}

impl Range {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::Positive(_) => value.is_finite() && value > 0.0,
            Self::NotNegative(_) => value.is_finite() && value >= 0.0,
            Self::Velocity => value.is_finite(),
            Self::Poisson => value > -1.0 && value <= 0.5,
        }
    }

    /// Completes the sentence that begins with a value outside of the range and "is".
    const fn complement(self) -> &'static str {
        match self {
            Self::Positive(_) => "not a positive number",
            Self::NotNegative(_) => "not zero or a positive number",
            Self::Velocity => "no velocity",
            Self::Poisson => "no Poisson's ratio",
        }
    }

    fn advice(self) -> String {
        match self {
            Self::Positive(unit) => format!("give a number above zero in {unit}"),
            Self::NotNegative(advice) => format!("give {advice}"),
            Self::Velocity => {
                "give a number in m/s, below zero for a bead that flies towards the striker".to_owned()
            }
            Self::Poisson => "give a number above -1 and at most 0.5, such as 0.44".to_owned(),
        }
    }
}

use Range::{NotNegative, Poisson, Positive, Velocity};

/// A key of a table, its value if it has one, and its range.
type Rule<T> = (&'static str, fn(&T) -> Option<f64>, Range);

const RELAXATION: Range = NotNegative("a time in s, such as 4.2e-6, or 0 for an elastic contact");
const GAP: Range = NotNegative("a length in m, such as 1e-6, or 0 for bodies that touch");
const LOAD: Range = NotNegative("a force in N, such as 10.0, or leave it out for a chain that just touches");

const CHAIN: &[Rule<Chain>] = &[
    ("radius", |of| Some(of.radius), Positive("m, such as 0.019")),
    (
        "density",
        |of| Some(of.density),
        Positive("kg/m³, such as 1775.0"),
    ),
    ("young", |of| Some(of.young), Positive("Pa, such as 4.5e9")),
    ("poisson", |of| Some(of.poisson), Poisson),
    ("relaxation", |of| Some(of.relaxation), RELAXATION),
    ("precompression", |of| Some(of.precompression), LOAD),
];
const STRIKER: &[Rule<Striker>] = &[
    ("radius", |of| Some(of.radius), Positive("m, such as 0.0045")),
    (
        "density",
        |of| Some(of.density),
        Positive("kg/m³, such as 7980.0"),
    ),
    ("young", |of| Some(of.young), Positive("Pa, such as 203e9")),
    ("poisson", |of| Some(of.poisson), Poisson),
    ("velocity", |of| Some(of.velocity), Positive("m/s, such as 0.45")),
    ("mass", |of| of.mass, Positive("kg, such as 3.0e-3")),
    ("relaxation", |of| of.relaxation, RELAXATION),
];
const WALL: &[Rule<Wall>] = &[
    ("young", |of| Some(of.young), Positive("Pa, such as 203e9")),
    ("poisson", |of| Some(of.poisson), Poisson),
    (
        "radius",
        |of| of.radius,
        Positive("m, such as 0.1; a flat wall has none"),
    ),
    ("relaxation", |of| of.relaxation, RELAXATION),
    ("gap", |of| Some(of.gap), GAP),
];
const SECTION: &[Rule<Section>] = &[
    ("radius", |of| of.radius, Positive("m, such as 0.019")),
    ("density", |of| of.density, Positive("kg/m³, such as 1775.0")),
    ("young", |of| of.young, Positive("Pa, such as 4.5e9")),
    ("poisson", |of| of.poisson, Poisson),
    ("relaxation", |of| of.relaxation, RELAXATION),
];
const INTRUDER: &[Rule<Intruder>] = &[
    ("mass", |of| Some(of.mass), Positive("kg, such as 3.7e-3")),
    (
        "stiffness",
        |of| Some(of.stiffness),
        Positive("N/m, such as 3.95e5"),
    ),
    (
        "damping",
        |of| Some(of.damping),
        NotNegative("zero or more in N·s/m, such as 12.0"),
    ),
];
const START: &[Rule<Start>] = &[
    ("velocity", |of| Some(of.velocity), Velocity),
    ("gap", |of| Some(of.gap), GAP),
];

impl Scenario {
    /// Tables that a scenario file may hold for the programs around a simulation: the front end and the
    /// clocks of the beads. They are passed over here.
    pub const OTHER_TABLES: [&str; 2] = ["front_end", "clock"];

    /// Reads and checks a scenario; `file` is its name in messages. [`OTHER_TABLES`](Self::OTHER_TABLES) are
    /// passed over.
    ///
    /// # Errors
    /// [`InputError`] with file, line and key: a value is missing, unknown or out of range.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, InputError> {
        let (text, _) = TomlFile::parse(text, file)?.split(&Self::OTHER_TABLES);
        let file = TomlFile::parse(&text, file)?;
        let scenario: Self = file.read()?;
        scenario.check().map_err(|error| file.locate(error))?;
        Ok(scenario)
    }

    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// As [`Scenario::from_toml`], and if the file cannot be read.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, InputError> {
        let path = path.as_ref();
        let text = read_text(path, "a scenario file in TOML")?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Checks every value, as for a scenario from a file.
    ///
    /// # Errors
    /// [`InputError`] without file and line.
    pub fn check(&self) -> Result<(), InputError> {
        Table::root().check("duration", self.duration, Positive("s, such as 0.004"))?;
        let at = Table::named("chain");
        let beads = self.chain.beads;
        if !(1..=MOST_BEADS).contains(&beads) {
            let what = format!("a chain of {beads} beads cannot be simulated");
            return Err(at.error("beads", what, format!("give a number from 1 to {MOST_BEADS}")));
        }
        at.check_all(&self.chain, CHAIN)?;
        Table::named("striker").check_all(&self.striker, STRIKER)?;
        if let Some(wall) = &self.wall {
            let at = Table::named("wall");
            at.check_all(wall, WALL)?;
            self.check_gap(&at, wall.gap)?;
        }
        let mut owners = vec![None; beads];
        for (index, section) in self.sections.iter().enumerate() {
            let at = Table::entry("section", index);
            let other = ("is already in section", "put each bead in one section only");
            at.check_beads(&section.beads, (index, &mut owners), other)?;
            at.check_all(section, SECTION)?;
        }
        self.check_intruders()?;
        owners.fill(None);
        for (index, start) in self.starts.iter().enumerate() {
            let at = Table::entry("start", index);
            let other = ("is already in start", "put each bead in one start only");
            at.check_beads(&start.beads, (index, &mut owners), other)?;
            at.check_all(start, START)?;
            self.check_gap(&at, start.gap)?;
        }
        Ok(())
    }

    fn check_intruders(&self) -> Result<(), InputError> {
        let mut owners = vec![None; self.chain.beads];
        let spheres = self.spheres();
        for (index, intruder) in self.intruders.iter().enumerate() {
            let at = Table::entry("intruder", index);
            let other = ("already holds intruder", "give each bead one intruder at most");
            at.check_beads(&intruder.beads, (index, &mut owners), other)?;
            at.check_all(intruder, INTRUDER)?;
            for &bead in &intruder.beads {
                let (mass, host) = (intruder.mass, spheres[bead - 1].mass());
                if mass >= host {
                    let what = format!("{mass} kg is as heavy as its host, bead {bead} of {host:.3e} kg");
                    let advice = "give less: the intruder's mass is part of the bead's";
                    return Err(at.error("mass", what, advice));
                }
            }
        }
        Ok(())
    }

    /// Refuses a gap in a chain under a load, which would close it.
    fn check_gap(&self, at: &Table, gap: f64) -> Result<(), InputError> {
        let load = self.chain.precompression;
        if gap == 0.0 || load == 0.0 {
            return Ok(());
        }
        let what = format!("a gap of {gap} m cannot be in a chain under a load of {load} N");
        Err(at.error("gap", what, "leave out the gap or chain.precompression"))
    }
}

/// The table whose values are checked, as the prefix of its keys.
pub(crate) struct Table(String);

impl Table {
    pub(crate) fn root() -> Self {
        Self(String::new())
    }

    fn named(name: &str) -> Self {
        Self(format!("{name}."))
    }

    fn entry(name: &str, index: usize) -> Self {
        Self(format!("{name}[{}].", index + 1))
    }

    fn error(&self, key: &str, what: String, advice: impl Into<String>) -> InputError {
        InputError::at(format!("{}{key}", self.0), what, advice)
    }

    /// Refuses a value outside of its range.
    pub(crate) fn check(&self, key: &str, value: f64, range: Range) -> Result<(), InputError> {
        if !range.holds(value) {
            let what = format!("{value} is {}", range.complement());
            return Err(self.error(key, what, range.advice()));
        }
        if value == 0.0 || matches!(range, Poisson) || SIZES.contains(&value.abs()) {
            return Ok(());
        }
        let (least, most) = (SIZES.start(), SIZES.end());
        let what = format!("{value:e} is out of the range of sizes that are computed with");
        let advice = format!("give a number from {least:e} to {most:e}, in SI units");
        Err(self.error(key, what, advice))
    }

    /// Checks the values that a table has.
    fn check_all<T>(&self, table: &T, rules: &[Rule<T>]) -> Result<(), InputError> {
        rules
            .iter()
            .filter_map(|(key, value, range)| Some((key, value(table)?, range)))
            .try_for_each(|(key, value, range)| self.check(key, value, *range))
    }

    /// Makes table `index` of its kind the owner of `beads`. `owners` has an entry for each bead of the
    /// chain. `belongs` and `advice` are the message for a bead that another table owns.
    fn check_beads(
        &self,
        beads: &[usize],
        (index, owners): (usize, &mut [Option<usize>]),
        (belongs, advice): (&str, &str),
    ) -> Result<(), InputError> {
        if beads.is_empty() {
            let count = owners.len();
            let advice = format!("name at least one from 1 to {count}, or leave the table out");
            return Err(self.error("beads", "names no bead".to_owned(), advice));
        }
        for &bead in beads {
            if let Some(other) = self.claim("beads", bead, index, owners)? {
                let what = format!("bead {bead} {belongs}[{}]", other + 1);
                return Err(self.error("beads", what, advice));
            }
        }
        Ok(())
    }

    /// Makes table `index` the owner of a bead, and returns its previous owner. Refuses a bead that is not in
    /// the chain, and one that the table names twice.
    pub(crate) fn claim(
        &self,
        key: &str,
        bead: usize,
        index: usize,
        owners: &mut [Option<usize>],
    ) -> Result<Option<usize>, InputError> {
        let count = owners.len();
        if bead < 1 || bead > count {
            let advice = format!("beads are counted from 1 to {count} (chain.beads)");
            return Err(self.error(key, format!("bead {bead} is not in the chain"), advice));
        }
        let other = owners[bead - 1].replace(index);
        if other == Some(index) {
            let what = format!("bead {bead} is named twice");
            return Err(self.error(key, what, "name each bead once"));
        }
        Ok(other)
    }
}
