//! Sweep files: a scenario, axes and outputs in TOML.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use hertz_chain::{InputError, Scenario, TomlFile, read_table, read_text};
use serde::Deserialize;
use toml::{Table, Value};

use crate::axis::{Along, SweepAxis};
use crate::axis_table::AxisTable;
use crate::outputs::SweepOutputs;

/// A sweep, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// A title, for people.
    pub title: String,
    /// The results to keep of each run.
    pub outputs: SweepOutputs,
    /// The axes; the last turns fastest.
    pub axes: Vec<SweepAxis>,
    /// The scenario that every point starts from.
    scenario: Table,
    /// The whole file, with the scenario in it.
    file: Table,
}

/// The content of a sweep's file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepFile {
    #[serde(default)]
    title: String,
    scenario: Base,
    #[serde(default)]
    outputs: SweepOutputs,
    axis: Vec<AxisTable>,
}

/// A scenario in a file of its own, or in the sweep's.
#[derive(Deserialize)]
#[serde(untagged)]
enum Base {
    File(PathBuf),
    Table(Table),
}

impl Definition {
    /// Reads a file, and the scenario that it names, and checks them.
    ///
    /// # Errors
    /// The file or its scenario is wrong: file, line, key, and advice.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let text = read_text(path, "a sweep's file in TOML")?;
        Self::read(&text, &path.display().to_string(), |file, scenario| {
            let scenario = path.parent().unwrap_or(Path::new("")).join(scenario);
            let text = read_text(&scenario, "a scenario file in TOML").map_err(|error| {
                file.locate(InputError {
                    key: "scenario".to_owned(),
                    ..error
                })
            })?;
            let name = scenario.display().to_string();
            let checked = Scenario::from_toml(&text, &name)?;
            let mut table: Table = TomlFile::parse(&text, &name)?.read()?;
            // A record in a file of its own becomes part of the sweep.
            if let Some(Value::Table(drive)) = table.get_mut("drive")
                && drive.remove("file").is_some()
            {
                let samples = checked.drive.into_iter().flat_map(|drive| drive.samples);
                let samples = samples.map(|sample| Value::from(sample.to_vec()));
                drive.insert("samples".to_owned(), Value::Array(samples.collect()));
            }
            Ok(table)
        })
    }

    /// Reads the text that [`Definition::to_toml`] wrote.
    ///
    /// # Errors
    /// As [`Definition::load`], and a sweep that names a file in place of its scenario.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, InputError> {
        Self::read(text, name, |file, _| {
            let what = "names a file, but must hold the scenario's tables";
            Err(file.locate(InputError::at("scenario", what, "make the plan anew")))
        })
    }

    /// The sweep as one text, equal for equal sweeps.
    pub fn to_toml(&self) -> String {
        self.file.to_string()
    }

    /// The scenario that every point starts from.
    pub fn scenario(&self) -> &Table {
        &self.scenario
    }

    fn read(
        text: &str,
        name: &str,
        load: impl FnOnce(&TomlFile<'_>, &Path) -> Result<Table, InputError>,
    ) -> Result<Self, InputError> {
        let file = TomlFile::parse(text, name)?;
        let content: SweepFile = file.read()?;
        let mut scenario = match content.scenario {
            Base::File(path) => load(&file, &path)?,
            Base::Table(table) => table,
        };
        for other in Scenario::OTHER_TABLES {
            scenario.remove(other);
        }
        let mut whole: Table = file.read()?;
        whole.insert("scenario".to_owned(), scenario.clone().into());
        let definition = Self {
            title: content.title,
            outputs: content.outputs,
            axes: Vec::new(),
            scenario,
            file: whole,
        };
        definition
            .with_axes(&content.axis)
            .map_err(|error| file.locate(error))
    }

    /// Adds the axes, and checks the whole sweep: each key belongs to a scenario, occurs once, and accepts
    /// its values.
    fn with_axes(mut self, tables: &[AxisTable]) -> Result<Self, InputError> {
        let base = self.base()?;
        self.check_outputs(&base, tables)?;
        if tables.is_empty() {
            let advice = "write [[axis]] with a key of the scenario and its values";
            return Err(InputError::at("axis", "the sweep has no axis", advice));
        }
        let outputs = self.outputs.columns().into_iter().map(|column| column.name);
        let mut columns: HashSet<String> = outputs.chain(["point", "error"].map(str::to_owned)).collect();
        for (table, number) in tables.iter().zip(1..) {
            let at = format!("axis[{number}]");
            let axis = table.axis(&at)?;
            for along in &axis.along {
                if !columns.insert(along.key.column()) {
                    let what = format!("{} is swept twice", along.key);
                    return Err(InputError::at(at, what, "give each key one axis"));
                }
            }
            if let Some(name) = &axis.name
                && !columns.insert(name.clone())
            {
                let what = format!("`{name}` is the name of another column");
                return Err(InputError::at(format!("{at}.name"), what, "give another name"));
            }
            self.axes.push(axis);
        }
        self.check_keys()?;
        Ok(self)
    }

    fn base(&self) -> Result<Scenario, InputError> {
        let scenario: Result<Scenario, _> = read_table(self.scenario.clone());
        let checked = scenario.and_then(|scenario| scenario.check().map(|()| scenario));
        checked.map_err(|error| InputError {
            key: format!("scenario.{}", error.key).trim_end_matches('.').to_owned(),
            ..error
        })
    }

    fn check_outputs(&self, base: &Scenario, tables: &[AxisTable]) -> Result<(), InputError> {
        let outputs = &self.outputs;
        if outputs.columns().is_empty() {
            let advice = "ask for absorbed, energies, intruders, peaks, arrivals or transmission";
            return Err(InputError::at("outputs", "no result of the runs is kept", advice));
        }
        let sweeps = |is_such: fn(&str) -> bool| tables.iter().any(|table| table.keys().any(is_such));
        let beads = if sweeps(|key| key == "chain.beads") {
            usize::MAX - 1
        } else {
            base.chain.beads
        };
        let walls = usize::from(base.wall.is_some() || sweeps(|key| key.starts_with("wall.")));
        for (name, of, most) in [
            ("intruders", &outputs.intruders, beads),
            ("peaks", &outputs.peaks, beads + walls),
            ("arrivals", &outputs.arrivals, beads + walls),
            ("transmission", &outputs.transmission, beads),
        ] {
            let key = format!("outputs.{name}");
            if let Some(wrong) = of.iter().find(|n| **n < 1 || **n > most) {
                let (what, advice) = (
                    format!("{wrong} is not in the chain"),
                    format!("give numbers from 1 to {most}"),
                );
                return Err(InputError::at(key, what, advice));
            }
            let mut seen = HashSet::new();
            if let Some(twice) = of.iter().find(|n| !seen.insert(**n)) {
                let what = format!("{twice} is named twice");
                return Err(InputError::at(key, what, "name it once"));
            }
        }
        Ok(())
    }

    /// Checks that a scenario has the keys and takes their kinds of values. All are tried together, and the
    /// first wrong one is found by bisection: a sweep may have thousands of keys.
    fn check_keys(&self) -> Result<(), InputError> {
        let axes = self.axes.iter().zip(1..);
        let keys: Vec<(i32, &Along)> = axes
            .flat_map(|(axis, number)| axis.along.iter().map(move |along| (number, along)))
            .collect();
        let reads = |count: usize| {
            let mut table = self.scenario.clone();
            let mut set = |(_, along): &(i32, &Along)| along.key.set(&mut table, along.value(0)).is_ok();
            keys[..count].iter().all(&mut set) && table.try_into::<Scenario>().is_ok()
        };
        if reads(keys.len()) {
            return Ok(());
        }
        let places: Vec<usize> = (0..keys.len()).collect();
        let wrong = places.partition_point(|place| reads(place + 1));
        keys.get(wrong)
            .map_or(Ok(()), |(number, along)| self.check_key(*number, along))
    }

    fn check_key(&self, number: i32, along: &Along) -> Result<(), InputError> {
        let (key, at) = (&along.key, format!("axis[{number}].key"));
        let mut table = self.scenario.clone();
        key.set(&mut table, along.value(0)).map_err(|error| InputError {
            key: at.clone(),
            ..error
        })?;
        let read: Result<Scenario, _> = read_table(table);
        read.map(drop)
            .map_err(|error| InputError::at(&at, format!("{key}: {}", error.what), error.advice))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::definition as read;

    #[test]
    fn a_plan_that_names_a_file_in_place_of_its_scenario_is_refused() {
        let text = "scenario = \"a.toml\"\n[[axis]]\nkey = \"striker.velocity\"\nvalues = [1.0]";
        let refused = Definition::from_toml(text, "plan.toml").unwrap_err().to_string();
        let why =
            "plan.toml:1: scenario: names a file, but must hold the scenario's tables; make the plan anew";
        assert_eq!(refused, why);
    }

    #[test]
    fn a_record_that_the_scenario_names_is_part_of_the_sweep() {
        let place = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).unwrap();
        write("record.csv", "time_s,force_n\n0,0\n0.002,1.5\n0.01,0\n");
        let mut paper = Scenario::paper();
        paper.striker.velocity = 0.0;
        let drive = "[drive]\nquantity = \"force\"\nfile = \"record.csv\"\n";
        write("driven.toml", &format!("{}{drive}", paper.to_toml()));
        let axis = "[[axis]]\nkey = \"drive.amplitude\"\nvalues = [1.0, 2.0]\n";
        write("sweep.toml", &format!("scenario = \"driven.toml\"\n{axis}"));
        let definition = Definition::load(&place.path().join("sweep.toml")).unwrap();
        place.close().unwrap();
        let again = Definition::from_toml(&definition.to_toml(), "plan.toml").unwrap();
        assert_eq!(again, definition);
        let drive = definition.base().unwrap().drive.unwrap();
        assert_eq!(drive.samples, [[0.0, 0.0], [0.002, 1.5], [0.01, 0.0]]);
    }

    #[test]
    fn every_kind_of_axis_is_read_and_written() {
        let definition = read(
            r#"
            [[axis]]
            key = "intruder.1.stiffness"
            logspace = [1e4, 1e6, 5]
            [[axis]]
            key = "striker.velocity"
            range = [0.1, 0.7, 0.1]
            [[axis]]
            name = "tuned"
            zip = [{ key = "intruder.1.mass", linspace = [1e-3, 3e-3, 3] }, { key = "intruder.1.beads", values = [7, 8, [9, 10]] }]
            [[axis]]
            quasirandom = 10
            seed = 3
            over = [{ key = "chain.relaxation", uniform = [0, 8e-6] }, { key = "chain.young", loguniform = [1e9, 1e10] }]
            [outputs]
            peaks = [1, 8]
            "#,
        )
        .unwrap();
        let axes = definition
            .axes
            .iter()
            .map(|axis| format!("{} {}", axis.index(), axis.count));
        let expected = "intruder_1_stiffness_n_per_m 5, striker_velocity_mps 7, tuned 3, sample 10";
        assert_eq!(axes.collect::<Vec<_>>().join(", "), expected);
        let again = Definition::from_toml(&definition.to_toml(), "again").unwrap();
        assert_eq!((&again, again.to_toml()), (&definition, definition.to_toml()));
    }

    #[test]
    fn beads_are_drawn_with_both_ends() {
        for bounds in ["uniform", "loguniform"] {
            let axes =
                format!("[[axis]]\nrandom = 1000\nover = [{{ key = \"chain.beads\", {bounds} = [2, 9] }}]");
            let axes = read(&axes).unwrap().axes;
            let drawn = (0..1000).map(|place| axes[0].along[0].value(place).as_integer().unwrap());
            let drawn: std::collections::BTreeSet<i64> = drawn.collect();
            assert!(drawn.into_iter().eq(2..=9), "{bounds}");
        }
    }

    #[test]
    fn of_many_keys_the_first_that_is_wrong_is_told() {
        let keys = "duration chain.young chain.density striker.velocity striker.radius";
        let keys: Vec<_> = keys.split(' ').collect();
        for wrong in 0..keys.len() {
            let axis = |(place, key): (usize, &&str)| {
                let end = if [wrong, wrong + 2].contains(&place) {
                    "_"
                } else {
                    ""
                };
                format!("[[axis]]\nkey = \"{key}{end}\"\nvalues = [1.0]\n")
            };
            let axes: String = keys.iter().enumerate().map(axis).collect();
            let said = read(&axes).unwrap_err().to_string();
            let first = format!("axis[{}].key: {}_: unknown key", wrong + 1, keys[wrong]);
            assert!(said.contains(&first), "{said}");
        }
    }

    /// The keys of the last two make a table that the scenario does not have; neither key would be valid
    /// alone.
    #[test]
    fn beads_are_whole_and_keys_may_make_a_table_together() {
        let young = "key = \"wall.young\"\nvalues = [1e9, 2e9]\n[[axis]]";
        for sound in [
            "key = \"chain.beads\"\nlogspace = [1, 1024, 11]",
            "key = \"chain.beads\"\nlinspace = [16, 10, 3]",
            "key = \"chain.beads\"\nvalues = [16.0, 12]",
            "key = \"intruder.1.beads\"\nvalues = [8, [7, 8]]",
            &format!("{young}\nkey = \"wall.poisson\"\nvalues = [0.3]"),
            &format!("{young}\nkey = \"wall.poisson\"\nvalues = [0.3]\n[outputs]\npeaks = [17]"),
        ] {
            read(&format!("[[axis]]\n{sound}")).unwrap();
        }
    }

    /// Lines of a file, separated by ` \n `, the defect, and the advice; `axis:` begins an axis.
    const REFUSALS: &str = r#"
 => sweep.toml: => the key `axis` is missing
axis = [] => sweep.toml:1: axis: the sweep has no axis => [[axis]]
axis: key = "intruder.1.stifness" \n values = [1.0] => sweep.toml:2: axis[1].key: intruder.1.stifness: unknown key => did you mean `stiffness`?
axis: key = "intruder.3.mass" \n values = [1.0] => axis[1].key: intruder.3.mass is not in the scenario => intruder.1
axis: key = "duration" \n range = [1.0, 0.5, 0.1] => sweep.toml:3: axis[1].range: the range from 1 to 0.5 in steps of 0.1 is empty => [first, last, step]
axis: key = "duration" \n values = [] => axis[1].values: it is empty => give
axis: key = "duration" \n linspace = [1, 2, 0] => axis[1].linspace: it is empty => whole
axis: key = "duration" \n linspace = [1, 2, 1.5] => 1.5 is not a number of values => whole
axis: key = "duration" \n logspace = [0, 2, 3] => no equal factors => linspace
axis: key = "duration" \n linspace = [-1e308, 1e308, 3] => axis[1].linspace: -1e308 is out of range => 1e30
axis: key = "duration" \n logspace = [1e-320, 1, 3] => axis[1].logspace: 1e-320 is out of range => 1e-30
axis: key = "duration" \n values = [1, inf] => axis[1].values: inf is out of range => 1e30
axis: key = "duration" \n values = [1, 1.0] => the value 1.0 occurs twice => once
axis: key = "duration" => duration needs exactly one set of values => linspace
axis: values = [1] => no key => striker.velocity
axis: key = "duration" \n values = ["long"] => axis[1].key: duration: the text => that kind
axis: key = "chain.beads" \n values = [1.5] => axis[1].values: chain.beads: 1.5 is not a bead number => 1 to 100000
axis: key = "chain.beads" \n linspace = [1, 16, 5] => axis[1]: chain.beads: 4.75 is not a bead number => 1 to 100000
axis: key = "chain.beads" \n logspace = [1, 2, 1e12] => 1000000000000 values from 1 to 2 cannot all be beads => fewer
axis: key = "intruder.1.beads" \n values = [8, [7, 0]] => axis[1].values: intruder.1.beads: 0 is not a bead number => 1 to 100000
axis: key = "intruder.1.beads" \n values = [8, [7, 8.5]] => a list has entries that are not whole numbers => by their numbers
axis: key = "chain.beads" \n values = [8, "9"] => a value is not a number => numbers of beads
axis: random = 9 \n over = [{ key = "chain.beads", loguniform = [0.5, 30] }] => axis[1].over[1]: chain.beads: 0.5 is not a bead number => 1 to 100000
axis: key = "duration" \n values = [0.1, 0.9, "1.2"] => axis[1].values: duration: some values are numbers and some are not => one kind
axis: random = 10 => draws points over no key => over =
axis: zip = [{ key = "duration", values = [1, 2] }, { key = "chain.young", values = [1] }] => axis[1].zip[2]: it has 1 values, but the first key of the zip has 2 => equally many
axis: key = "duration" \n values = [1] \n [[axis]] \n key = "duration" \n values = [1] => sweep.toml:4: axis[2]: duration is swept twice => one axis
axis: key = "duration" \n values = [1] \n [outputs] \n peaks = [99] => outputs.peaks: 99 is not in the chain => 1 to 16
axis: key = "wall.young" \n values = [1e9] => axis[1].key: wall.young: the key `poisson` is missing => poisson
axis: key = "wall.gap" \n values = [1] \n [outputs] \n peaks = [18] => outputs.peaks: 18 is not in the chain => 1 to 17
axis: key = "duration" \n values = [1] \n [outputs] \n peak = [9] => outputs.peak: unknown key => did you mean `peaks`?
"#;

    #[test]
    fn each_refusal_has_line_key_and_advice() {
        for row in REFUSALS.trim().lines() {
            let [axes, defect, advice] = row.split("=>").map(str::trim).collect::<Vec<_>>()[..] else {
                panic!("{row}");
            };
            let axes = axes.replace("axis: ", "[[axis]]\n").replace(" \\n ", "\n");
            let error = read(&axes).unwrap_err().to_string();
            let is_told = error.contains(defect) && error.contains(advice);
            assert!(is_told && error.lines().count() == 1, "{axes}: {error}");
        }
    }
}
