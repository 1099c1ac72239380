//! The columns of a table that hold time, force and acceleration.

use std::borrow::Cow;
use std::path::Path;

use crate::choice::{Choice, ColumnAddress, Wanted, option};
use crate::error::WaveformError;
use bead_tables::printable::{beginning, first_of};
use bead_tables::unit::{self, Quantity, Unit};

/// A column of numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColumnHeader {
    /// Its place in the table, from 0.
    pub(super) place: usize,
    pub(super) name: String,
    /// Its unit, where the file states it outside of the name.
    pub(super) unit: Option<String>,
}

impl ColumnHeader {
    /// A column named by its number.
    pub(super) fn without_name(place: usize) -> Self {
        Self {
            place,
            name: (place + 1).to_string(),
            unit: None,
        }
    }

    fn stem(&self) -> &str {
        unit::split(&self.name).0
    }

    fn written_unit(&self) -> Option<&str> {
        self.unit.as_deref().or_else(|| unit::split(&self.name).1)
    }

    fn unit(&self) -> Option<&'static Unit> {
        // In a column of mass, `g` is a gram.
        let is_mass = self.stem().to_lowercase().starts_with("mass");
        self.written_unit().and_then(unit::parse).filter(|_| !is_mass)
    }

    fn is_in(&self, quantity: Quantity) -> bool {
        self.unit().is_some_and(|unit| unit.quantity == quantity)
    }

    fn suggests(&self) -> Option<Quantity> {
        let stem = self.stem().to_lowercase();
        match stem.as_str() {
            _ if stem.ends_with("_code") => None,
            "t" | "x" | "x-axis" | "second" | "seconds" | "s" | "zeit" => Some(Quantity::Time),
            "f" | "fz" | "load" | "n" | "kraft" => Some(Quantity::Force),
            "a" => Some(Quantity::Acceleration),
            _ if stem.starts_with("time") => Some(Quantity::Time),
            _ if stem.starts_with("force") => Some(Quantity::Force),
            _ if stem.starts_with("acc") => Some(Quantity::Acceleration),
            _ => None,
        }
    }

    /// Its name and unit for messages.
    fn shown(&self) -> String {
        let name = beginning(self.name.trim(), LETTERS);
        match &self.unit {
            Some(unit) => format!("{name} ({})", beginning(unit, LETTERS)),
            None => name.into_owned(),
        }
    }

    /// Its address for an option; a long name gives way to the number.
    fn typed(&self) -> Cow<'_, str> {
        match beginning(self.name.trim(), LETTERS) {
            Cow::Owned(_) => (self.place + 1).to_string().into(),
            whole => whole,
        }
    }

    /// Its number and name, for the remark on the columns used.
    fn numbered(&self) -> String {
        let number = (self.place + 1).to_string();
        if self.name.trim() == number {
            return format!("column {number}");
        }
        format!("column {number} `{}`", self.shown())
    }
}

/// Greatest number of names in a message, and of characters in each: a file may have millions.
const NAMES: usize = 20;
const LETTERS: usize = 40;

/// Lists the first of some columns for a message.
pub(super) fn few<'a>(headers: impl Iterator<Item = &'a ColumnHeader>) -> String {
    first_of(headers.map(ColumnHeader::shown), NAMES)
}

/// A column that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Picked {
    /// Its place in the table, from 0.
    pub(super) place: usize,
    /// Size of 1 in the SI unit.
    pub(super) size: f64,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Picks {
    /// `None` if a rate takes its place.
    pub(super) time: Option<Picked>,
    pub(super) force: Option<Picked>,
    pub(super) acceleration: Option<Picked>,
    /// The column with the strike, in a table of `bead export`.
    pub(super) strike: Option<usize>,
    pub(super) remarks: Vec<String>,
}

/// Columns of `bead export` beside force and acceleration.
const EXPORTED: [&str; 4] = ["id", "sample_index", "force_code", "acceleration_code"];

/// Finds the columns.
///
/// # Errors
/// A column is missing or ambiguous, has no unit, or is chosen twice.
pub(super) fn pick(path: &Path, headers: &[ColumnHeader], choice: &Choice) -> Result<Picks, WaveformError> {
    let mut picks = Picks::default();
    let table = NamedColumns { path, headers };
    picks.force = table.signal(choice, Quantity::Force)?;
    picks.acceleration = table.signal(choice, Quantity::Acceleration)?;
    if picks.force.is_none() && picks.acceleration.is_none() {
        return table.unfit(format!(
            "has no column of force or acceleration with a unit among {}; say which, and what 1 in it means: \
             --read force=CH1:8.9N or --read acceleration=CH2:98m/s2",
            table.shown()
        ));
    }
    if choice.rate_hz.is_none() {
        let (time, remark) = table.time(choice)?;
        picks.time = Some(time);
        picks.remarks.extend(remark);
    }
    table.check_distinct(&picks)?;
    picks.remarks.push(table.taken(&picks));
    let place = |name: &str| {
        headers
            .iter()
            .find(|header| header.name == name)
            .map(|header| header.place)
    };
    if EXPORTED.iter().all(|name| place(name).is_some()) {
        picks.strike = place("id");
    }
    Ok(picks)
}

impl Picks {
    fn each(&self) -> impl Iterator<Item = (Quantity, Picked)> {
        let each = [
            (Quantity::Time, self.time),
            (Quantity::Force, self.force),
            (Quantity::Acceleration, self.acceleration),
        ];
        each.into_iter()
            .filter_map(|(quantity, picked)| Some((quantity, picked?)))
    }
}

struct NamedColumns<'a> {
    path: &'a Path,
    headers: &'a [ColumnHeader],
}

impl NamedColumns<'_> {
    fn unfit<T>(&self, what: String) -> Result<T, WaveformError> {
        Err(WaveformError::unfit(self.path, what))
    }

    fn shown(&self) -> String {
        few(self.headers.iter())
    }

    fn at(&self, place: usize) -> Option<&ColumnHeader> {
        self.headers.iter().find(|header| header.place == place)
    }

    fn named(&self, wanted: &Wanted, quantity: Quantity) -> Result<&ColumnHeader, WaveformError> {
        let (ColumnAddress::Either(text) | ColumnAddress::Name(text) | ColumnAddress::Number(text)) =
            &wanted.column;
        let is_name = |other: &str| other.trim().to_lowercase() == text.to_lowercase();
        let by_name = || {
            let whole = self.headers.iter().find(|header| is_name(&header.name));
            whole.or_else(|| self.headers.iter().find(|header| is_name(header.stem())))
        };
        let by_number = || self.at(text.parse::<usize>().ok()?.checked_sub(1)?);
        let found = match &wanted.column {
            ColumnAddress::Name(_) => by_name(),
            ColumnAddress::Number(_) => by_number(),
            ColumnAddress::Either(_) => match (by_name(), by_number()) {
                (Some(name), Some(number)) if name.place != number.place => {
                    return self.unfit(format!(
                        "{}{text}: it is the name of column {} and the number of column `{}`; give name={text} or \
                         number={text}",
                        option(quantity),
                        name.place + 1,
                        number.shown(),
                    ));
                }
                (name, number) => name.or(number),
            },
        };
        found.ok_or_else(|| {
            let what = format!(
                "{}{}: it has no such column of numbers; there are {}",
                option(quantity),
                wanted.column,
                self.shown()
            );
            WaveformError::unfit(self.path, what)
        })
    }

    /// The size of 1 in a column: by the option, else by the header.
    fn size(
        &self,
        header: &ColumnHeader,
        wanted: Option<&Wanted>,
        quantity: Quantity,
    ) -> Result<f64, WaveformError> {
        let given = wanted.and_then(|wanted| wanted.size);
        let own = header.unit().map(|unit| (unit.quantity, unit.size));
        let column = header.typed();
        // In a column in mV, 1 is a thousandth of a volt.
        let volts = match own.filter(|_| wanted.is_some_and(|wanted| wanted.per_volt)) {
            Some((Quantity::Voltage, volts)) => volts,
            None => 1.0,
            Some((of, _)) => {
                return self.unfit(format!(
                    "{}{column}: the unit given is per volt, but the column is in a unit of {}; leave the unit out",
                    option(quantity),
                    of.name()
                ));
            }
        };
        let why = match given.or(own) {
            Some((of, size)) if of == quantity => return Ok(size * volts),
            Some((Quantity::Voltage, _)) => format!("is in {}", header.written_unit().unwrap_or("V")),
            Some((of, _)) => {
                return self.unfit(format!(
                    "{}{column}: its unit is a unit of {}; give a unit of {}",
                    option(quantity),
                    of.name(),
                    quantity.name()
                ));
            }
            None => match header.written_unit() {
                Some(unit) => format!(
                    "is in `{}`, which is not a known unit of {}",
                    beginning(unit, LETTERS),
                    quantity.name()
                ),
                None => "has no unit".to_owned(),
            },
        };
        let example = match quantity {
            Quantity::Time => "ms",
            Quantity::Force => "8.9N",
            _ => "98m/s2",
        };
        self.unfit(format!(
            "column {column} {why}; say what 1 in it means: {}{column}:{example}",
            option(quantity)
        ))
    }

    /// The column of force or of acceleration, if there is one.
    fn signal(&self, choice: &Choice, quantity: Quantity) -> Result<Option<Picked>, WaveformError> {
        let wanted = choice.of(quantity);
        let of_unit: Vec<_> = self
            .headers
            .iter()
            .filter(|header| header.is_in(quantity))
            .collect();
        let header = match (wanted, &of_unit[..]) {
            (Some(wanted), _) => self.named(wanted, quantity)?,
            (None, [one]) => one,
            (None, []) => {
                // If a name suggests the quantity, the error says how to give its unit.
                let suggested = self
                    .headers
                    .iter()
                    .find(|header| header.suggests() == Some(quantity));
                let has_no_unit = |header: &&ColumnHeader| {
                    header
                        .unit()
                        .is_none_or(|unit| unit.quantity == Quantity::Voltage)
                };
                match suggested.filter(has_no_unit) {
                    Some(header) => header,
                    None => return Ok(None),
                }
            }
            (None, several) => {
                return self.unfit(format!(
                    "has {} columns of {}: {}; say which with {}COLUMN",
                    several.len(),
                    quantity.name(),
                    few(several.iter().copied()),
                    option(quantity)
                ));
            }
        };
        let size = self.size(header, wanted, quantity)?;
        let place = header.place;
        Ok(Some(Picked { place, size }))
    }

    /// The column of time, and a remark if seconds are assumed.
    fn time(&self, choice: &Choice) -> Result<(Picked, Option<String>), WaveformError> {
        if let Some(wanted) = &choice.time {
            let header = self.named(wanted, Quantity::Time)?;
            let size = self.size(header, Some(wanted), Quantity::Time)?;
            let place = header.place;
            return Ok((Picked { place, size }, None));
        }
        let is_time = |header: &&ColumnHeader| match header.written_unit() {
            Some(_) => header.is_in(Quantity::Time),
            None => header.suggests() == Some(Quantity::Time),
        };
        let Some(header) = self.headers.iter().find(is_time) else {
            return self.unfit(format!(
                "has no column of time among {}; say which with --read time=COLUMN, or give the rate of its rows in Hz with \
                 --read rate=HZ",
                self.shown()
            ));
        };
        let place = header.place;
        let Some(unit) = header.unit() else {
            let remark = format!(
                "column {} has no unit and is taken to be in seconds",
                header.shown()
            );
            return Ok((Picked { place, size: 1.0 }, Some(remark)));
        };
        let size = unit.size;
        Ok((Picked { place, size }, None))
    }

    fn check_distinct(&self, picks: &Picks) -> Result<(), WaveformError> {
        for (quantity, picked) in picks.each() {
            let twin = picks
                .each()
                .find(|(other, twin)| *other != quantity && twin.place == picked.place);
            if let Some((other, _)) = twin {
                let column = self
                    .at(picked.place)
                    .map_or_else(String::new, ColumnHeader::numbered);
                return self.unfit(format!(
                    "{column} is used for the {} and for the {}; give each its own with {}COLUMN and {}COLUMN",
                    quantity.name(),
                    other.name(),
                    option(quantity),
                    option(other)
                ));
            }
        }
        Ok(())
    }

    fn taken(&self, picks: &Picks) -> String {
        let taken = picks.each().filter_map(|(quantity, picked)| {
            let column = self.at(picked.place)?.numbered();
            let unit = match (picked.size, quantity.si()) {
                (1.0, si) => format!("in {si}"),
                (size, si) => format!("of {size} {si}"),
            };
            Some(format!("{} from {column} {unit}", quantity.name()))
        });
        taken.collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(names: &[&str]) -> Vec<ColumnHeader> {
        let header = |(place, name): (usize, &&str)| ColumnHeader {
            name: (*name).to_owned(),
            ..ColumnHeader::without_name(place)
        };
        names.iter().enumerate().map(header).collect()
    }

    fn picked(names: &[&str], choice: &Choice) -> Result<Picks, String> {
        pick(Path::new("f"), &headers(names), choice).map_err(|error| error.to_string())
    }

    fn force(wanted: &str) -> Choice {
        Choice {
            force: Some(wanted.parse().unwrap()),
            ..Choice::default()
        }
    }

    #[test]
    fn columns_are_found_by_their_units() {
        let pick = |place, size| Some(Picked { place, size });
        let found = picked(&["t (ms)", "Force (kN)", "a [m/s²]"], &Choice::default()).unwrap();
        assert_eq!((found.time, found.force), (pick(0, 1e-3), pick(1, 1e3)));
        assert_eq!((found.acceleration, found.strike), (pick(2, 1.0), None));
        let exported = "id sample_index time_s time_from_trigger_s force_n acceleration_mps2 force_code acceleration_code";
        let exported: Vec<_> = exported.split(' ').collect();
        let found = picked(&exported, &Choice::default()).unwrap();
        assert_eq!((found.time, found.force), (pick(2, 1.0), pick(4, 1.0)));
        assert_eq!(found.strike, Some(0));
        // `g` of a mass is a gram, and the `G` of a channel's name is no unit.
        let found = picked(&["t (s)", "mass_g", "Channel G", "a (G)"], &Choice::default()).unwrap();
        assert_eq!(found.acceleration.map(|picked| picked.place), Some(3));
    }

    #[test]
    fn columns_are_named_by_name_or_number_with_what_1_of_them_is() {
        let names = ["TIME", "CH1", "CH2"];
        for wanted in ["CH1:8.9N", "ch1:8.9N", "2:8.9 N/V"] {
            let found = picked(&names, &force(wanted)).unwrap();
            assert_eq!(found.force, Some(Picked { place: 1, size: 8.9 }), "{wanted}");
            assert!(found.remarks[0].contains("taken to be in seconds"));
            let taken = "time from column 1 `TIME` in s, force from column 2 `CH1` of 8.9 N";
            assert_eq!(found.remarks[1], taken);
        }
    }

    #[test]
    fn a_number_that_is_another_column_s_name_is_refused_and_can_be_told_apart() {
        let keysight = ["x-axis", "1", "2"];
        let error = picked(&keysight, &force("2:N")).unwrap_err();
        let wanted = "--read force=2: it is the name of column 3 and the number of column `1`; give name=2 or number=2";
        assert!(error.ends_with(wanted), "{error}");
        for (wanted, place) in [("name=2:N", 2), ("number=2:N", 1), ("3:N", 2), ("name=1:N", 1)] {
            let found = picked(&keysight, &force(wanted)).unwrap();
            assert_eq!(found.force.map(|picked| picked.place), Some(place), "{wanted}");
        }
        // Channels of a WAV file are named by their numbers.
        let of_wav = Choice {
            rate_hz: Some(1e5),
            ..force("2:N")
        };
        assert_eq!(
            picked(&["1", "2"], &of_wav).unwrap().remarks,
            ["force from column 2 in N"]
        );
    }

    #[test]
    fn a_size_by_volt_is_that_of_the_column_s_own_volts() {
        for (name, size) in [("CH1 (mV)", 8.9e-3), ("CH1 (V)", 8.9), ("CH1", 8.9)] {
            let found = picked(&["t (s)", name], &force("2:8.9N/V")).unwrap().force;
            assert!(
                found.is_some_and(|picked| (picked.size / size - 1.0).abs() < 1e-12),
                "{name}"
            );
        }
        // Without `/V`, the size is that of 1 in the column.
        let found = picked(&["t (s)", "CH1 (mV)"], &force("2:8.9N")).unwrap();
        assert_eq!(found.force, Some(Picked { place: 1, size: 8.9 }));
        let why = picked(&["t (s)", "F (N)"], &force("2:8.9N/V")).unwrap_err();
        assert!(
            why.contains("per volt, but the column is in a unit of force"),
            "{why}"
        );
    }

    #[test]
    fn one_column_is_not_taken_twice() {
        let both = Choice {
            acceleration: "CH1:g".parse().ok(),
            ..force("CH1:N")
        };
        let error = picked(&["TIME", "CH1"], &both).unwrap_err();
        let wanted = "column 2 `CH1` is used for the force and for the acceleration; give each its own with";
        assert!(error.contains(wanted), "{error}");
        let error = picked(&["TIME", "CH1"], &force("TIME:N")).unwrap_err();
        assert!(error.contains("for the time and for the force"), "{error}");
    }

    #[test]
    fn refusals_show_some_names_and_the_beginning_of_each() {
        let long = "n".repeat(1 << 20);
        let mut names = vec!["CH1"; 300_000];
        names[0] = long.as_str();
        // The message suggests a column with a long name by its number.
        let named = format!("force {long}");
        for (names, part) in [
            (&names[..], ", CH1 and 299980 more; say which"),
            (&["t (s)", &named], "what 1 in it means: --read force=2:8.9N"),
        ] {
            let why = picked(names, &Choice::default()).unwrap_err();
            assert!(why.contains(part) && why.len() < 500, "{why:.400}");
        }
    }

    #[test]
    fn a_missing_column_or_unit_is_named_with_what_to_type() {
        for (names, wanted, part) in [
            (
                "TIME|CH1|CH2",
                "",
                "TIME, CH1, CH2; say which, and what 1 in it means: --read force=CH1:8.9N",
            ),
            ("t (s)|mass_g", "", "no column of force or acceleration"),
            ("t (s)|Channel G", "", "no column of force or"),
            ("t (s)|force", "", "force has no unit; say what 1 in it means:"),
            ("t (s)|Force (V)", "", "is in V; say what 1"),
            ("F (N)", "", "no column of time among F (N); say which with"),
            ("t (s)|F1 (N)|F2 (N)", "", "2 columns of force: F1 (N), F2"),
            ("t (s)|F (N)", "G:N", "no such column of numbers; there"),
            ("t (s)|F (N)", "F:ms", "is a unit of time; give a unit of force"),
        ] {
            let names: Vec<_> = names.split('|').collect();
            let choice = Choice {
                force: wanted.parse().ok(),
                ..Choice::default()
            };
            let why = picked(&names, &choice).unwrap_err();
            assert!(why.contains(part), "{why}");
        }
    }
}
