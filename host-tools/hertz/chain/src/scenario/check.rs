//! Ranges of a scenario's values, and their check, which reports the first wrong value with advice.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::Path;

use super::drive::Drive;
use super::read::{InputError, TomlFile, read_text};
use super::tables::{Chain, ContactForce, Intruder, Scenario, Section, Striker, Wall};

/// Most beads of a chain. A longer one would take memory and time that nobody intended.
pub const MOST_BEADS: usize = 100_000;

/// Magnitudes that are accepted, in SI units. No body, contact or time has others, and products of others
/// would leave the range of an `f64`.
const SIZES: RangeInclusive<f64> = 1e-30..=1e30;

/// Values that a key accepts, with the words that the advice for any other value adds.
#[derive(Clone, Copy)]
pub(crate) enum ValueRange {
    /// Above zero: the unit and an example.
    Positive(&'static str),
    /// Zero or above: the whole advice.
    NotNegative(&'static str),
    /// Any number: the end of the sentence "value is" for one that is none, and the unit with both signs.
    AnySign(&'static str, &'static str),
    Poisson,
}

impl ValueRange {
    /// True if the range holds a value, the end of the sentence "value is" for any other, and both parts of
    /// the advice.
    fn judge(self, value: f64) -> (bool, &'static str, [&'static str; 2]) {
        match self {
            Self::Positive(unit) => (
                value.is_finite() && value > 0.0,
                "not a positive number",
                ["give a number above zero in ", unit],
            ),
            Self::NotNegative(advice) => (
                value.is_finite() && value >= 0.0,
                "not zero or a positive number",
                ["give ", advice],
            ),
            Self::AnySign(complement, unit) => (value.is_finite(), complement, ["give a number in ", unit]),
            Self::Poisson => (
                value > -1.0 && value <= 0.5,
                "not a Poisson's ratio",
                ["give a number above -1 and at most 0.5, such as ", "0.44"],
            ),
        }
    }
}

use ValueRange::{AnySign, NotNegative, Poisson, Positive};

const RELAXATION: ValueRange = NotNegative("a time in s, such as 4.2e-6, or 0 for an elastic contact");
const GRAVITY: ValueRange =
    NotNegative("an acceleration in m/s², such as 9.81, or leave it out for a horizontal chain");
const GAP: ValueRange = NotNegative("a length in m, such as 1e-6, or 0 for bodies that touch");
const VELOCITY: ValueRange = AnySign(
    "not a velocity",
    "m/s, below zero for a bead that flies towards the striker",
);
const DISPLACEMENT: ValueRange = AnySign("not a displacement", "m, below zero towards the striker");
const CUBIC_STIFFNESS: ValueRange = AnySign(
    "not a cubic stiffness",
    "N/m³, above zero for a spring that hardens, below for one that softens",
);
const DAMPING: ValueRange = NotNegative("zero or more in N·s/m, such as 12.0");
const LOAD: ValueRange =
    NotNegative("a force in N, such as 10.0, or leave it out for a chain that just touches");

impl Chain {
    fn check(&self, at: &TableCheck) -> Result<(), InputError> {
        at.check("radius", self.radius, Positive("m, such as 0.019"))?;
        at.check("density", self.density, Positive("kg/m³, such as 1775.0"))?;
        at.check("young", self.young, Positive("Pa, such as 4.5e9"))?;
        at.check("poisson", self.poisson, Poisson)?;
        at.check("relaxation", self.relaxation, RELAXATION)?;
        at.check("precompression", self.precompression, LOAD)?;
        at.check("gravity", self.gravity, GRAVITY)?;
        let none = Positive("s, such as 2e-3, or leave it out for a ground without drag");
        at.check("drag_time", self.drag_time, none)
    }
}

impl Striker {
    /// `rests` is true for a striker that need not move.
    fn check(&self, at: &TableCheck, rests: bool) -> Result<(), InputError> {
        at.check("radius", self.radius, Positive("m, such as 0.0045"))?;
        at.check("density", self.density, Positive("kg/m³, such as 7980.0"))?;
        at.check("young", self.young, Positive("Pa, such as 203e9"))?;
        at.check("poisson", self.poisson, Poisson)?;
        if !rests || self.velocity != 0.0 {
            at.check("velocity", self.velocity, Positive("m/s, such as 0.45"))?;
        }
        at.check("mass", self.mass, Positive("kg, such as 3.0e-3"))?;
        at.check("relaxation", self.relaxation, RELAXATION)
    }
}

impl Wall {
    fn check(&self, at: &TableCheck) -> Result<(), InputError> {
        at.check("young", self.young, Positive("Pa, such as 203e9"))?;
        at.check("poisson", self.poisson, Poisson)?;
        let flat = Positive("m, such as 0.1; a flat wall has none");
        at.check("radius", self.radius, flat)?;
        at.check("relaxation", self.relaxation, RELAXATION)?;
        at.check("gap", self.gap, GAP)
    }
}

impl Section {
    fn check(&self, at: &TableCheck) -> Result<(), InputError> {
        at.check("radius", self.radius, Positive("m, such as 0.019"))?;
        at.check("density", self.density, Positive("kg/m³, such as 1775.0"))?;
        at.check("young", self.young, Positive("Pa, such as 4.5e9"))?;
        at.check("poisson", self.poisson, Poisson)?;
        at.check("relaxation", self.relaxation, RELAXATION)
    }
}

impl Intruder {
    fn check(&self, at: &TableCheck) -> Result<(), InputError> {
        at.check("mass", self.mass, Positive("kg, such as 3.7e-3"))?;
        at.check("stiffness", self.stiffness, Positive("N/m, such as 3.95e5"))?;
        at.check("damping", self.damping, DAMPING)?;
        at.check("cubic_stiffness", self.cubic_stiffness, CUBIC_STIFFNESS)
    }
}

impl Scenario {
    /// Tables that a scenario file may hold for the programs around a simulation: the front end and the
    /// clocks of the beads. They are ignored here.
    pub const OTHER_TABLES: [&str; 3] = ["front_end", "clock", "analog_wire"];

    /// Reads and checks a scenario; `file` is its name in messages. [`OTHER_TABLES`](Self::OTHER_TABLES) are
    /// ignored.
    ///
    /// # Errors
    /// [`InputError`] with file, line and key: a value is missing, unknown or out of range.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, InputError> {
        let (text, _) = TomlFile::parse(text, file)?.split(&Self::OTHER_TABLES);
        let file = TomlFile::parse(&text, file)?;
        let mut scenario: Self = file.read()?;
        if let Some(drive) = &mut scenario.drive {
            drive.read_file(file.name()).map_err(|error| file.locate(error))?;
        }
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
        TableCheck::of("").check("duration", self.duration, Positive("s, such as 0.004"))?;
        let at = TableCheck::of("chain.");
        let beads = self.chain.beads;
        if !(1..=MOST_BEADS).contains(&beads) {
            let what = format!("a chain of {beads} beads cannot be simulated");
            return Err(at.error("beads", what, format!("give a number from 1 to {MOST_BEADS}")));
        }
        self.chain.check(&at)?;
        let rests = self.drive.is_some() || self.chain.gravity > 0.0 || !self.starts.is_empty();
        self.striker.check(&TableCheck::of("striker."), rests)?;
        if let Some(wall) = &self.wall {
            let at = TableCheck::of("wall.");
            wall.check(&at)?;
            self.check_gap(&at, wall.gap)?;
        }
        let mut owners = vec![None; beads];
        for (index, section) in self.sections.iter().enumerate() {
            let at = TableCheck::of(format!("section[{}].", index + 1));
            let other = ("is already in section", "put each bead in one section only");
            at.check_beads(&section.beads, (index, &mut owners), other)?;
            section.check(&at)?;
        }
        self.check_intruders()?;
        self.contact.as_ref().map_or(Ok(()), |law| {
            law.check(self.chain.contact_force == ContactForce::Clipped)
        })?;
        self.check_starts()?;
        let drive = self.drive.as_ref();
        drive.map_or(Ok(()), |drive| self.check_drive(drive))?;
        self.check_gravity(&at)
    }

    fn check_starts(&self) -> Result<(), InputError> {
        if self.starts.is_empty() {
            return Ok(());
        }
        let mut owners = vec![None; self.chain.beads];
        // Each host, with the least distance at which a spring in it no longer pulls back.
        let mut hosts = HashMap::new();
        for one in &self.intruders {
            let reach = one.oscillator().reach(one.cubic_stiffness);
            let reach = reach.unwrap_or(f64::INFINITY);
            for &bead in &one.beads {
                let least: &mut f64 = hosts.entry(bead).or_insert(reach);
                *least = least.min(reach);
            }
        }
        for (index, start) in self.starts.iter().enumerate() {
            let at = TableCheck::of(format!("start[{}].", index + 1));
            let other = ("is already in start", "put each bead in one start only");
            at.check_beads(&start.beads, (index, &mut owners), other)?;
            at.check("velocity", start.velocity, VELOCITY)?;
            at.check("gap", start.gap, GAP)?;
            at.check("displacement", start.displacement, DISPLACEMENT)?;
            at.check("intruder_displacement", start.intruder_displacement, DISPLACEMENT)?;
            at.check("intruder_velocity", start.intruder_velocity, VELOCITY)?;
            // The contact of a striker carries no load.
            if start.beads.iter().any(|&bead| bead > 1 || self.loads_striker()) {
                self.check_gap(&at, start.gap)?;
            }
            let moves_intruder = start.intruder_displacement != 0.0 || start.intruder_velocity != 0.0;
            let mut beads = start.beads.iter();
            if let Some(bead) = beads.find(|bead| moves_intruder && !hosts.contains_key(bead)) {
                let what = format!("bead {bead} has no intruder that could start displaced or moving");
                return Err(at.error("beads", what, "name hosts only, or add the intruder"));
            }
            let displacement = start.intruder_displacement;
            let reaches = start
                .beads
                .iter()
                .filter_map(|bead| Some((bead, hosts.get(bead)?)));
            if let Some((bead, reach)) = reaches
                .filter(|(_, reach)| displacement.abs() >= **reach)
                .min_by(|one, other| one.1.total_cmp(other.1))
            {
                let what =
                    format!("at {displacement} m the softening spring in bead {bead} no longer pulls back");
                let advice = format!("stay below {reach:.3e} m, or give a cubic_stiffness nearer to zero");
                return Err(at.error("intruder_displacement", what, advice));
            }
        }
        Ok(())
    }

    fn check_drive(&self, drive: &Drive) -> Result<(), InputError> {
        let velocity = self.striker.velocity;
        if velocity != 0.0 {
            let what = format!("a body that a drive moves cannot strike at {velocity} m/s");
            let advice = "give 0.0, or leave out the drive";
            return Err(InputError::at("striker.velocity", what, advice));
        }
        drive.check(self.duration)
    }

    /// True if the contact of body 0 with bead 1 carries a static load: below a driven body, or below a
    /// striker that rests on a vertical chain.
    pub(crate) fn loads_striker(&self) -> bool {
        let apart = self
            .starts
            .iter()
            .any(|start| start.gap > 0.0 && start.beads.contains(&1));
        let lies = self.chain.gravity > 0.0 && self.striker.velocity == 0.0 && !apart;
        let driven = self.drive.is_some() && (self.chain.precompression > 0.0 || self.chain.gravity > 0.0);
        lies || driven
    }

    /// Refuses a vertical chain that nothing carries.
    fn check_gravity(&self, at: &TableCheck) -> Result<(), InputError> {
        if self.chain.gravity > 0.0 && self.wall.is_none() {
            let what = "a vertical chain without a wall below falls";
            return Err(at.error("gravity", what, "add [wall], or leave gravity out"));
        }
        Ok(())
    }

    /// Returns `true` if a bead holds several intruders.
    pub fn holds_several(&self) -> bool {
        let beads: usize = self.intruders.iter().map(|one| one.beads.len()).sum();
        self.hosts().len() < beads
    }

    fn check_intruders(&self) -> Result<(), InputError> {
        let mut owners = vec![None; self.chain.beads];
        let mut held = vec![0.0; self.chain.beads];
        let spheres = self.spheres();
        for (index, intruder) in self.intruders.iter().enumerate() {
            let at = TableCheck::of(format!("intruder[{}].", index + 1));
            at.need_beads(&intruder.beads, owners.len())?;
            for &bead in &intruder.beads {
                // A bead may hold intruders of several tables.
                at.claim("beads", bead, index, &mut owners)?;
            }
            intruder.check(&at)?;
            self.check_inside(&at, index)?;
            if intruder.cubic_stiffness != 0.0 && self.chain.gravity > 0.0 {
                let what = "the stiffness of a nonlinear spring changes when a weight hangs from it";
                let advice = "leave out cubic_stiffness or chain.gravity";
                return Err(at.error("cubic_stiffness", what, advice));
            }
            for &bead in &intruder.beads {
                let (mass, host) = (intruder.mass, spheres[bead - 1].mass());
                held[bead - 1] += mass;
                if held[bead - 1] >= host {
                    let with = if held[bead - 1] > mass {
                        ", with the intruders before it,"
                    } else {
                        ""
                    };
                    let what = format!(
                        "{mass} kg{with} is at least as heavy as its host, bead {bead} of {host:.3e} kg"
                    );
                    let advice = "give less: the intruder's mass is part of the bead's";
                    return Err(at.error("mass", what, advice));
                }
            }
        }
        Ok(())
    }

    /// Refuses an intruder that is inside anything but an earlier intruder of the same beads.
    fn check_inside(&self, at: &TableCheck, index: usize) -> Result<(), InputError> {
        let Intruder { beads, inside, .. } = &self.intruders[index];
        let Some(number) = *inside else { return Ok(()) };
        if !(1..=index).contains(&number) {
            let what = format!("intruder[{number}] does not come before intruder[{}]", index + 1);
            let advice = "give the number of an earlier [[intruder]] table, counted from 1, or leave it out: \
                          then the bead itself carries the intruder";
            return Err(at.error("inside", what, advice));
        }
        let carriers = &self.intruders[number - 1].beads;
        if let Some(bead) = beads.iter().find(|bead| !carriers.contains(bead)) {
            let what = format!("bead {bead} holds no intruder[{number}] that could carry this one");
            let advice = format!("name beads of intruder[{number}] only, or add {bead} to them");
            return Err(at.error("inside", what, advice));
        }
        Ok(())
    }

    /// Refuses a gap in a chain under a load, which would close it.
    fn check_gap(&self, at: &TableCheck, gap: f64) -> Result<(), InputError> {
        let Chain {
            gravity,
            precompression: load,
            ..
        } = self.chain;
        if gap == 0.0 || (load == 0.0 && gravity == 0.0) {
            return Ok(());
        }
        if load == 0.0 {
            let what = format!("a gap of {gap} m cannot be in a vertical chain at rest");
            return Err(at.error("gap", what, "leave out the gap or chain.gravity"));
        }
        let what = format!("a gap of {gap} m cannot be in a chain under a load of {load} N");
        Err(at.error("gap", what, "leave out the gap or chain.precompression"))
    }
}

/// The table whose values are checked, as the prefix of its keys.
pub(crate) struct TableCheck(String);

impl TableCheck {
    /// A table whose keys begin with `prefix`.
    pub(crate) fn of(prefix: impl Into<String>) -> Self {
        Self(prefix.into())
    }

    pub(super) fn error(&self, key: &str, what: impl Into<String>, advice: impl Into<String>) -> InputError {
        InputError::at(format!("{}{key}", self.0), what, advice)
    }

    /// Refuses a value outside of its range, if there is a value.
    pub(crate) fn check(
        &self,
        key: &str,
        value: impl Into<Option<f64>>,
        range: ValueRange,
    ) -> Result<(), InputError> {
        let Some(value) = value.into() else { return Ok(()) };
        let (holds, complement, advice) = range.judge(value);
        if !holds {
            return Err(self.error(key, format!("{value} is {complement}"), advice.concat()));
        }
        if value == 0.0 || matches!(range, Poisson) || SIZES.contains(&value.abs()) {
            return Ok(());
        }
        let (least, most) = (SIZES.start(), SIZES.end());
        let what = format!("{value:e} is out of the range of sizes that can be computed");
        let advice = format!("give a number from {least:e} to {most:e}, in SI units");
        Err(self.error(key, what, advice))
    }

    /// Makes table `index` of its kind the owner of `beads`. `owners` has an entry for each bead of the
    /// chain. `belongs` and `advice` are the message for a bead that another table owns.
    fn check_beads(
        &self,
        beads: &[usize],
        (index, owners): (usize, &mut [Option<usize>]),
        (belongs, advice): (&str, &str),
    ) -> Result<(), InputError> {
        self.need_beads(beads, owners.len())?;
        for &bead in beads {
            if let Some(other) = self.claim("beads", bead, index, owners)? {
                let what = format!("bead {bead} {belongs}[{}]", other + 1);
                return Err(self.error("beads", what, advice));
            }
        }
        Ok(())
    }

    /// Refuses a table that names none of the `count` beads.
    fn need_beads(&self, beads: &[usize], count: usize) -> Result<(), InputError> {
        if beads.is_empty() {
            let advice = format!("name at least one from 1 to {count}, or leave the table out");
            return Err(self.error("beads", "names no bead", advice));
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
