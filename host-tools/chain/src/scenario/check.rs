//! Whether a scenario makes sense. The first value that does not is answered with what would do.

use std::ops::RangeInclusive;
use std::path::Path;

use super::read::{InputError, TomlFile, read_text};
use super::tables::Scenario;

impl Scenario {
    /// Tables that a scenario file may hold for the programs around a simulation: the front end and the
    /// clocks of the beads. They are passed over here.
    pub const OTHER_TABLES: [&str; 2] = ["front_end", "clock"];

    /// Reads and checks a scenario; `file` is its name in messages. [`OTHER_TABLES`](Self::OTHER_TABLES) are
    /// passed over.
    ///
    /// # Errors
    /// [`InputError`] with file, line, key, what is wrong and what would do.
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
    /// As [`Scenario::from_toml`], and when the file cannot be read.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, InputError> {
        let path = path.as_ref();
        let text = read_text(path, "a scenario file in TOML")?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Checks every value of a scenario built in code.
    ///
    /// # Errors
    /// [`InputError`] without file and line.
    pub fn check(&self) -> Result<(), InputError> {
        Table::root().positive("duration", self.duration, "s", "0.004")?;

        let (at, chain) = (Table::named("chain"), &self.chain);
        if chain.beads < 1 || chain.beads > MOST_BEADS {
            let what = format!("a chain of {} beads cannot be simulated", chain.beads);
            return Err(at.error("beads", what, format!("give a number from 1 to {MOST_BEADS}")));
        }
        at.positive("radius", chain.radius, "m", RADIUS)?;
        at.positive("density", chain.density, "kg/m³", DENSITY)?;
        at.positive("young", chain.young, "Pa", YOUNG)?;
        at.poisson(chain.poisson)?;
        at.not_negative("relaxation", chain.relaxation, RELAXATION)?;
        at.not_negative(
            "precompression",
            chain.precompression,
            "give a force in N, such as 10.0, or leave it out for a chain that just touches",
        )?;

        let (at, striker) = (Table::named("striker"), &self.striker);
        at.positive("radius", striker.radius, "m", "0.0045")?;
        at.positive("density", striker.density, "kg/m³", "7980.0")?;
        at.positive("young", striker.young, "Pa", "203e9")?;
        at.poisson(striker.poisson)?;
        at.positive("velocity", striker.velocity, "m/s", "0.45")?;
        at.positive("mass", striker.mass, "kg", "3.0e-3")?;
        at.not_negative("relaxation", striker.relaxation, RELAXATION)?;

        if let Some(wall) = &self.wall {
            let at = Table::named("wall");
            at.positive("young", wall.young, "Pa", "203e9")?;
            at.poisson(wall.poisson)?;
            at.positive("radius", wall.radius, "m", "0.1; a flat wall has none")?;
            at.not_negative("relaxation", wall.relaxation, RELAXATION)?;
            at.not_negative("gap", wall.gap, GAP)?;
            self.check_gap(&at, wall.gap)?;
        }

        self.check_sections()?;
        self.check_intruders()?;
        self.check_starts()
    }

    fn check_sections(&self) -> Result<(), InputError> {
        let mut taken = vec![None; self.chain.beads];
        for (index, section) in self.sections.iter().enumerate() {
            let at = Table::entry("section", index);
            at.beads(
                &section.beads,
                index,
                &mut taken,
                "is already in section",
                "put each bead in one section only",
            )?;
            at.positive("radius", section.radius, "m", RADIUS)?;
            at.positive("density", section.density, "kg/m³", DENSITY)?;
            at.positive("young", section.young, "Pa", YOUNG)?;
            at.poisson(section.poisson)?;
            at.not_negative("relaxation", section.relaxation, RELAXATION)?;
        }
        Ok(())
    }

    fn check_intruders(&self) -> Result<(), InputError> {
        let mut taken = vec![None; self.chain.beads];
        let spheres = self.spheres();
        for (index, intruder) in self.intruders.iter().enumerate() {
            let at = Table::entry("intruder", index);
            at.beads(
                &intruder.beads,
                index,
                &mut taken,
                "already holds intruder",
                "give each bead one intruder at most",
            )?;
            at.positive("mass", intruder.mass, "kg", "3.7e-3")?;
            at.positive("stiffness", intruder.stiffness, "N/m", "3.95e5")?;
            at.not_negative(
                "damping",
                intruder.damping,
                "give zero or more in N·s/m, such as 12.0",
            )?;
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
}

impl Scenario {
    fn check_starts(&self) -> Result<(), InputError> {
        let mut taken = vec![None; self.chain.beads];
        for (index, start) in self.starts.iter().enumerate() {
            let at = Table::entry("start", index);
            at.beads(
                &start.beads,
                index,
                &mut taken,
                "is already in start",
                "put each bead in one start only",
            )?;
            at.ensure(
                "velocity",
                start.velocity,
                f64::is_finite,
                "no velocity",
                "give a number in m/s, below zero for a bead that flies towards the striker",
            )?;
            at.in_range("velocity", start.velocity)?;
            at.not_negative("gap", start.gap, GAP)?;
            self.check_gap(&at, start.gap)?;
        }
        Ok(())
    }

    /// A load closes every gap.
    fn check_gap(&self, at: &Table, gap: f64) -> Result<(), InputError> {
        if gap == 0.0 || self.chain.precompression == 0.0 {
            return Ok(());
        }
        let what = format!(
            "a gap of {gap} m cannot be in a chain under a load of {} N",
            self.chain.precompression
        );
        Err(at.error("gap", what, "leave out the gap or chain.precompression"))
    }
}

/// Beads of a chain at most. Longer chains are refused: they would ask for memory and time that nobody meant.
pub const MOST_BEADS: usize = 100_000;

/// Values other than 0 outside of this are refused, in SI units: no body, contact or time has them, and the
/// products of some would leave the range of an `f64`.
const RANGE: RangeInclusive<f64> = 1e-30..=1e30;

const GAP: &str = "give a length in m, such as 1e-6, or 0 for bodies that touch";
const RELAXATION: &str = "give a time in s, such as 4.2e-6, or 0 for an elastic contact";
const RADIUS: &str = "0.019";
const DENSITY: &str = "1775.0";
const YOUNG: &str = "4.5e9";

/// The table whose values are being checked, as a prefix of its keys. Values that are left out are in order.
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

    /// Refuses a value that does not fit; `wrong` says what it is instead.
    fn ensure(
        &self,
        key: &str,
        value: impl Into<Option<f64>>,
        fits: fn(f64) -> bool,
        wrong: &str,
        advice: &str,
    ) -> Result<(), InputError> {
        match value.into().filter(|value| !fits(*value)) {
            Some(value) => Err(self.error(key, format!("{value} is {wrong}"), advice)),
            None => Ok(()),
        }
    }

    pub(crate) fn positive(
        &self,
        key: &str,
        value: impl Into<Option<f64>>,
        unit: &str,
        example: &str,
    ) -> Result<(), InputError> {
        let value = value.into();
        let advice = format!("give a number above zero in {unit}, such as {example}");
        let fits = |value: f64| value.is_finite() && value > 0.0;
        self.ensure(key, value, fits, "not a positive number", &advice)?;
        self.in_range(key, value)
    }

    fn not_negative(&self, key: &str, value: impl Into<Option<f64>>, advice: &str) -> Result<(), InputError> {
        let value = value.into();
        let fits = |value: f64| value.is_finite() && value >= 0.0;
        self.ensure(key, value, fits, "not zero or a positive number", advice)?;
        self.in_range(key, value)
    }

    /// Refuses a number that is out of [`RANGE`].
    fn in_range(&self, key: &str, value: impl Into<Option<f64>>) -> Result<(), InputError> {
        let fits = |value: &f64| *value == 0.0 || RANGE.contains(&value.abs());
        let Some(value) = value.into().filter(|value| !fits(value)) else {
            return Ok(());
        };
        let (least, most) = (RANGE.start(), RANGE.end());
        Err(self.error(
            key,
            format!("{value:e} is out of the range of sizes that are computed with"),
            format!("give a number from {least:e} to {most:e}, in SI units"),
        ))
    }

    fn poisson(&self, value: impl Into<Option<f64>>) -> Result<(), InputError> {
        let fits = |value: f64| value > -1.0 && value <= 0.5;
        let advice = "give a number above -1 and at most 0.5, such as 0.44";
        self.ensure("poisson", value, fits, "no Poisson's ratio", advice)
    }

    /// Notes in `taken`, which has an entry for each bead of the chain, that `beads` belong to table `index`
    /// of their kind. `belongs` and `advice` answer a bead that belongs to an earlier one.
    fn beads(
        &self,
        beads: &[usize],
        index: usize,
        taken: &mut [Option<usize>],
        belongs: &str,
        advice: &str,
    ) -> Result<(), InputError> {
        if beads.is_empty() {
            let advice = format!(
                "name at least one from 1 to {}, or leave the table out",
                taken.len()
            );
            return Err(self.error("beads", "names no bead".to_owned(), advice));
        }
        for &bead in beads {
            if let Some(other) = self.claim("beads", bead, index, taken)? {
                let what = format!("bead {bead} {belongs}[{}]", other + 1);
                return Err(self.error("beads", what, advice));
            }
        }
        Ok(())
    }

    /// Notes in `taken` that `bead` belongs to table `index`, and gives the other table that it belongs to.
    /// Refuses a bead that is not in the chain, and one that the table names twice.
    pub(crate) fn claim(
        &self,
        key: &str,
        bead: usize,
        index: usize,
        taken: &mut [Option<usize>],
    ) -> Result<Option<usize>, InputError> {
        let count = taken.len();
        if bead < 1 || bead > count {
            let advice = format!("beads are counted from 1 to {count} (chain.beads)");
            return Err(self.error(key, format!("bead {bead} is not in the chain"), advice));
        }
        let other = taken[bead - 1].replace(index);
        if other == Some(index) {
            let what = format!("bead {bead} is named twice");
            return Err(self.error(key, what, "name each bead once"));
        }
        Ok(other)
    }
}
