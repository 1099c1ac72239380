//! Whether a scenario makes sense, and if not, the one line that says where, what and what would do.
//!
//! # Design
//!
//! Values are checked on the plain [`Scenario`], so that one built in code gets the same answers as one from a file. A
//! complaint carries the path of its key (`intruder`, 1, `mass`); reading from TOML looks that path up in the parsed
//! document to find the line.

use std::fmt;
use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::tables::Scenario;

/// What is wrong with a scenario: where, what, and what would do. Its text is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioError {
    /// The file, as it was named; none for a scenario built in code.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// The key, such as `chain.radius` or `intruder[2].mass` (tables of an array are counted from 1).
    pub key: String,
    /// What is wrong.
    pub what: String,
    /// What would do.
    pub advice: String,
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{file}:")?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            write!(f, " ")?;
        }
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        write!(f, "{}; {}", self.what, self.advice)
    }
}

impl std::error::Error for ScenarioError {}

impl ScenarioError {
    pub(crate) fn unreadable(file: &str, error: &std::io::Error) -> Self {
        Self {
            file: Some(file.to_owned()),
            line: None,
            key: String::new(),
            what: format!("cannot be read ({error})"),
            advice: "name a scenario file in TOML".to_owned(),
        }
    }

    pub(crate) fn of(complaint: Complaint) -> Self {
        Self {
            file: None,
            line: None,
            key: dotted(&complaint.path),
            what: complaint.what,
            advice: complaint.advice,
        }
    }
}

/// One step of the way to a key.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Key {
    Name(String),
    Index(usize),
}

/// What is wrong, before file and line are known.
#[derive(Debug)]
pub(crate) struct Complaint {
    path: Vec<Key>,
    what: String,
    advice: String,
}

fn dotted(path: &[Key]) -> String {
    let mut text = String::new();
    for key in path {
        match key {
            Key::Name(name) if text.is_empty() => text.push_str(name),
            Key::Name(name) => text.push_str(&format!(".{name}")),
            Key::Index(index) => text.push_str(&format!("[{}]", index + 1)),
        }
    }
    text
}

/// A table of the scenario while its values are checked.
#[derive(Clone)]
struct At(Vec<Key>);

impl At {
    fn table(name: &str) -> Self {
        Self(vec![Key::Name(name.to_owned())])
    }

    fn entry(name: &str, index: usize) -> Self {
        Self(vec![Key::Name(name.to_owned()), Key::Index(index)])
    }

    fn complaint(&self, key: &str, what: String, advice: impl Into<String>) -> Complaint {
        let mut path = self.0.clone();
        path.push(Key::Name(key.to_owned()));
        Complaint {
            path,
            what,
            advice: advice.into(),
        }
    }

    fn positive(&self, key: &str, value: f64, unit: &str, example: &str) -> Result<(), Complaint> {
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        let advice = format!("give a number above zero in {unit}, such as {example}");
        Err(self.complaint(key, format!("{value} is not a positive number"), advice))
    }

    fn not_negative(&self, key: &str, value: f64, advice: &str) -> Result<(), Complaint> {
        if value.is_finite() && value >= 0.0 {
            return Ok(());
        }
        Err(self.complaint(key, format!("{value} is not zero or a positive number"), advice))
    }

    fn poisson(&self, value: f64) -> Result<(), Complaint> {
        if value > -1.0 && value <= 0.5 {
            return Ok(());
        }
        Err(self.complaint(
            "poisson",
            format!("{value} is no Poisson's ratio"),
            "give a number above -1 and at most 0.5, such as 0.44",
        ))
    }

    /// Notes in `taken` that these beads belong to table `index`; `belongs` says so of one that belongs to an earlier table.
    fn beads(
        &self,
        beads: &[usize],
        index: usize,
        taken: &mut Taken,
        belongs: impl Fn(usize, usize) -> (String, &'static str),
    ) -> Result<(), Complaint> {
        let count = taken.0.len();
        if beads.is_empty() {
            return Err(self.complaint(
                "beads",
                "names no bead".to_owned(),
                format!("name at least one from 1 to {count}, or leave the table out"),
            ));
        }
        for &bead in beads {
            if bead < 1 || bead > count {
                let advice = format!("beads are counted from 1 to {count} (chain.beads)");
                return Err(self.complaint("beads", format!("bead {bead} is not in the chain"), advice));
            }
            if let Some(other) = taken.0[bead - 1].replace(index) {
                let (what, advice) = if other == index {
                    (format!("bead {bead} is named twice"), "name each bead once")
                } else {
                    belongs(bead, other + 1)
                };
                return Err(self.complaint("beads", what, advice));
            }
        }
        Ok(())
    }
}

/// Which table of its kind each bead belongs to, from bead 1.
struct Taken(Vec<Option<usize>>);

const RELAXATION: &str = "give a time in s, such as 4.2e-6, or 0 for an elastic contact";
const RADIUS: &str = "0.019";
const DENSITY: &str = "1775.0";
const YOUNG: &str = "4.5e9";

/// Chains longer than this are refused: they would ask for memory and time that nobody meant.
pub(crate) const MOST_BEADS: usize = 100_000;

/// Checks every value; the first that is wrong is reported.
pub(crate) fn values(scenario: &Scenario) -> Result<(), Complaint> {
    At(Vec::new()).positive("duration", scenario.duration, "s", "0.004")?;

    let (at, chain) = (At::table("chain"), &scenario.chain);
    if chain.beads < 1 || chain.beads > MOST_BEADS {
        let what = format!("a chain of {} beads cannot be simulated", chain.beads);
        return Err(at.complaint("beads", what, format!("give a number from 1 to {MOST_BEADS}")));
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

    let (at, striker) = (At::table("striker"), &scenario.striker);
    at.positive("radius", striker.radius, "m", "0.0045")?;
    at.positive("density", striker.density, "kg/m³", "7980.0")?;
    at.positive("young", striker.young, "Pa", "203e9")?;
    at.poisson(striker.poisson)?;
    at.positive("velocity", striker.velocity, "m/s", "0.45")?;
    if let Some(mass) = striker.mass {
        at.positive("mass", mass, "kg", "3.0e-3")?;
    }
    if let Some(relaxation) = striker.relaxation {
        at.not_negative("relaxation", relaxation, RELAXATION)?;
    }

    if let Some(wall) = &scenario.wall {
        let at = At::table("wall");
        at.positive("young", wall.young, "Pa", "203e9")?;
        at.poisson(wall.poisson)?;
        if let Some(radius) = wall.radius {
            at.positive("radius", radius, "m", "0.1; a flat wall has none")?;
        }
        if let Some(relaxation) = wall.relaxation {
            at.not_negative("relaxation", relaxation, RELAXATION)?;
        }
    }

    sections(scenario)?;
    intruders(scenario)
}

fn sections(scenario: &Scenario) -> Result<(), Complaint> {
    let mut taken = Taken(vec![None; scenario.chain.beads]);
    for (index, section) in scenario.sections.iter().enumerate() {
        let at = At::entry("section", index);
        at.beads(&section.beads, index, &mut taken, |bead, other| {
            (
                format!("bead {bead} is already in section[{other}]"),
                "put each bead in one section only",
            )
        })?;
        for (key, value, unit, example) in [
            ("radius", section.radius, "m", RADIUS),
            ("density", section.density, "kg/m³", DENSITY),
            ("young", section.young, "Pa", YOUNG),
        ] {
            value.map_or(Ok(()), |value| at.positive(key, value, unit, example))?;
        }
        section.poisson.map_or(Ok(()), |value| at.poisson(value))?;
        section
            .relaxation
            .map_or(Ok(()), |value| at.not_negative("relaxation", value, RELAXATION))?;
    }
    Ok(())
}

fn intruders(scenario: &Scenario) -> Result<(), Complaint> {
    let mut taken = Taken(vec![None; scenario.chain.beads]);
    let spheres = scenario.spheres();
    for (index, intruder) in scenario.intruders.iter().enumerate() {
        let at = At::entry("intruder", index);
        at.beads(&intruder.beads, index, &mut taken, |bead, other| {
            (
                format!("bead {bead} already holds intruder[{other}]"),
                "give each bead one intruder at most",
            )
        })?;
        at.positive("mass", intruder.mass, "kg", "3.7e-3")?;
        at.positive("stiffness", intruder.stiffness, "N/m", "3.95e5")?;
        at.not_negative(
            "damping",
            intruder.damping,
            "give zero or more in N·s/m, such as 12.0",
        )?;
        for &bead in &intruder.beads {
            let host = spheres[bead - 1].mass();
            if intruder.mass >= host {
                let what = format!(
                    "{} kg is as heavy as its host, bead {bead} of {host:.3e} kg",
                    intruder.mass
                );
                let advice = "give less: the intruder's mass is part of the bead's";
                return Err(at.complaint("mass", what, advice));
            }
        }
    }
    Ok(())
}

/// Reads a scenario from TOML.
pub(crate) fn read(text: &str, file: &str) -> Result<Scenario, ScenarioError> {
    let place = |span: Option<Range<usize>>| span.map(|span| text[..span.start].matches('\n').count() + 1);
    let table = DeTable::parse(text).map_err(|error| ScenarioError {
        file: Some(file.to_owned()),
        line: place(error.span()),
        key: String::new(),
        what: format!("not TOML ({})", one_line(error.message())),
        advice: "mend the line".to_owned(),
    })?;
    let table = table.into_inner();
    let found = |complaint: Complaint| ScenarioError {
        file: Some(file.to_owned()),
        line: place(span_of(&table, &complaint.path)),
        ..ScenarioError::of(complaint)
    };
    known_keys(&table).map_err(found)?;
    let scenario: Scenario = toml::from_str(text).map_err(|error| {
        let span = error.span();
        let path = span.as_ref().map_or_else(Vec::new, |span| path_at(&table, span));
        ScenarioError {
            file: Some(file.to_owned()),
            line: place(span),
            key: dotted(&path),
            what: one_line(error.message()),
            advice: advice_for(error.message()),
        }
    })?;
    values(&scenario).map_err(found)?;
    Ok(scenario)
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn advice_for(message: &str) -> String {
    if message.starts_with("missing field") {
        "add it, in SI units"
    } else {
        "give a value of that kind"
    }
    .to_owned()
}

const TOP: &[&str] = &[
    "title", "duration", "chain", "striker", "wall", "intruder", "section",
];
const CHAIN: &[&str] = &[
    "beads",
    "radius",
    "density",
    "young",
    "poisson",
    "relaxation",
    "contact_force",
    "precompression",
];
const STRIKER: &[&str] = &[
    "radius",
    "density",
    "young",
    "poisson",
    "velocity",
    "mass",
    "relaxation",
];
const WALL: &[&str] = &["young", "poisson", "radius", "relaxation"];
const INTRUDER: &[&str] = &["beads", "mass", "stiffness", "damping"];
const SECTION: &[&str] = &["beads", "radius", "density", "young", "poisson", "relaxation"];

fn known_keys(table: &DeTable<'_>) -> Result<(), Complaint> {
    keys_of(&At(Vec::new()), table, TOP)?;
    for (name, known) in [("chain", CHAIN), ("striker", STRIKER), ("wall", WALL)] {
        if let Some(DeValue::Table(inner)) = table.get(name).map(|value| value.get_ref()) {
            keys_of(&At::table(name), inner, known)?;
        }
    }
    for (name, known) in [("intruder", INTRUDER), ("section", SECTION)] {
        if let Some(DeValue::Array(entries)) = table.get(name).map(|value| value.get_ref()) {
            for (index, entry) in entries.iter().enumerate() {
                if let DeValue::Table(inner) = entry.get_ref() {
                    keys_of(&At::entry(name, index), inner, known)?;
                }
            }
        }
    }
    Ok(())
}

fn keys_of(at: &At, table: &DeTable<'_>, known: &[&str]) -> Result<(), Complaint> {
    for key in table.keys() {
        let key: &str = key.get_ref();
        if !known.contains(&key) {
            let near = known.iter().map(|name| (distance(key, name), name)).min();
            let advice = match near {
                Some((distance, name)) if distance <= 2.max(key.len() / 3) => {
                    format!("did you mean `{name}`?")
                }
                _ => format!("known here are {}", known.join(", ")),
            };
            return Err(at.complaint(key, "unknown key".to_owned(), advice));
        }
    }
    Ok(())
}

/// Levenshtein's: how many letters to insert, delete or replace to make `b` of `a`.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let replace = diagonal + usize::from(letter != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = replace.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

/// Where the key of a path stands, or as much of the path as there is.
fn span_of(table: &DeTable<'_>, path: &[Key]) -> Option<Range<usize>> {
    let mut span = None;
    let mut value: Option<&DeValue<'_>> = None;
    for key in path {
        let inner = match (key, value) {
            (Key::Name(name), None) => table.get_key_value(name.as_str()),
            (Key::Name(name), Some(DeValue::Table(table))) => table.get_key_value(name.as_str()),
            (Key::Index(index), Some(DeValue::Array(array))) => {
                let entry = array.get(*index)?;
                span = Some(entry.span());
                value = Some(entry.get_ref());
                continue;
            }
            _ => None,
        };
        let Some((name, inner)) = inner else { break };
        span = Some(name.span());
        value = Some(inner.get_ref());
    }
    span
}

/// The innermost key whose value holds `span`.
fn path_at(table: &DeTable<'_>, span: &Range<usize>) -> Vec<Key> {
    let holds = |outer: Range<usize>| outer.start <= span.start && span.end <= outer.end;
    for (name, value) in table {
        let name_key = Key::Name(name.get_ref().to_string());
        match value.get_ref() {
            DeValue::Array(entries) => {
                for (index, entry) in entries.iter().enumerate() {
                    if let DeValue::Table(inner) = entry.get_ref() {
                        let deeper = path_at(inner, span);
                        if !deeper.is_empty() || holds(entry.span()) {
                            return [vec![name_key, Key::Index(index)], deeper].concat();
                        }
                    }
                }
            }
            DeValue::Table(inner) => {
                let deeper = path_at(inner, span);
                if !deeper.is_empty() {
                    return [vec![name_key], deeper].concat();
                }
            }
            _ => {}
        }
        if holds(value.span()) {
            return vec![name_key];
        }
    }
    Vec::new()
}
