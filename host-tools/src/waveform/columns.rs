//! Which column of a table has which quantity.

use std::borrow::Cow;
use std::path::Path;

use crate::recording::printable::{beginning, first_of};
use crate::waveform::choice::{Choice, Wanted, option};
use crate::waveform::error::WaveformError;
use crate::waveform::unit::{self, Quantity};

/// A column of numbers: its place in the table, its name, and its unit where that does not stand in the name.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) place: usize,
    pub(super) name: String,
    pub(super) unit: Option<String>,
}

impl Header {
    fn stem(&self) -> &str {
        unit::split(&self.name).0
    }

    fn unit(&self) -> Option<&str> {
        self.unit.as_deref().or_else(|| unit::split(&self.name).1)
    }

    /// The quantity that its unit tells, and the size of the unit. Of a mass, `g` is a gram.
    fn size(&self) -> Option<(Quantity, f64)> {
        let unit = self.unit().and_then(unit::unit)?;
        let is_mass = self.stem().to_lowercase().starts_with("mass");
        (!is_mass).then_some(unit)
    }

    /// The quantity that its name tells.
    fn called(&self) -> Option<Quantity> {
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

    /// As messages name it.
    fn shown(&self) -> String {
        let name = beginning(self.name.trim(), LETTERS);
        match &self.unit {
            Some(unit) => format!("{name} ({})", beginning(unit, LETTERS)),
            None => name.into_owned(),
        }
    }

    /// As a user can type it: a long name by its number.
    fn typed(&self) -> Cow<'_, str> {
        match beginning(self.name.trim(), LETTERS) {
            Cow::Owned(_) => (self.place + 1).to_string().into(),
            whole => whole,
        }
    }
}

/// Names in a message at most, and characters of each: in a file they may be millions.
const NAMES: usize = 20;
const LETTERS: usize = 40;

/// The first of some columns, as messages name them.
pub(super) fn few<'a>(headers: impl Iterator<Item = &'a Header>) -> String {
    first_of(headers.map(Header::shown), NAMES)
}

/// A column that is read, and what 1 of it is in the SI unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Picked {
    pub(super) place: usize,
    pub(super) size: f64,
}

/// What of a table is read.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Picks {
    /// None where the rate says it.
    pub(super) time: Option<Picked>,
    pub(super) force: Option<Picked>,
    pub(super) acceleration: Option<Picked>,
    /// The column that tells strikes apart, in a table that `bead export` wrote.
    pub(super) strike: Option<usize>,
    pub(super) remarks: Vec<String>,
}

/// Columns that `bead export` writes beside force and acceleration.
const EXPORTED: [&str; 4] = ["id", "sample_index", "force_code", "acceleration_code"];

/// Finds the columns.
pub(super) fn pick(path: &Path, headers: &[Header], choice: &Choice) -> Result<Picks, WaveformError> {
    let mut picks = Picks::default();
    let table = Table { path, headers };
    picks.force = table.one(choice, Quantity::Force)?;
    picks.acceleration = table.one(choice, Quantity::Acceleration)?;
    if picks.force.is_none() && picks.acceleration.is_none() {
        return Err(table.nothing());
    }
    if choice.rate_hz.is_none() {
        let (time, remark) = table.time(choice)?;
        picks.time = Some(time);
        picks.remarks.extend(remark);
    }
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

struct Table<'a> {
    path: &'a Path,
    headers: &'a [Header],
}

impl Table<'_> {
    fn unfit<T>(&self, what: String) -> Result<T, WaveformError> {
        Err(WaveformError::unfit(self.path, what))
    }

    fn shown(&self) -> String {
        few(self.headers.iter())
    }

    /// The column that the caller names.
    fn named(&self, wanted: &Wanted, quantity: Quantity) -> Result<&Header, WaveformError> {
        let name = wanted.column.as_str();
        let same = |other: &str| other.trim().to_lowercase() == name.to_lowercase();
        let by_name = self.headers.iter().find(|header| same(&header.name));
        let by_stem = || self.headers.iter().find(|header| same(header.stem()));
        let by_number = || {
            let number: usize = name.parse().ok()?;
            self.headers.iter().find(|header| header.place + 1 == number)
        };
        let found = by_name.or_else(by_stem).or_else(by_number);
        found.ok_or_else(|| {
            let what = format!(
                "{} {name}: it has no such column of numbers; there are {}",
                option(quantity),
                self.shown()
            );
            WaveformError::unfit(self.path, what)
        })
    }

    /// What 1 of a column is: as the caller says, else as its header does.
    fn size(
        &self,
        header: &Header,
        wanted: Option<&Wanted>,
        quantity: Quantity,
    ) -> Result<f64, WaveformError> {
        let said = wanted.and_then(|wanted| wanted.size).or_else(|| header.size());
        let column = header.typed();
        match said {
            Some((of, size)) if of == quantity => Ok(size),
            Some((of, _)) => self.unfit(format!(
                "{} {column}: its unit is one of {}; give one of {}",
                option(quantity),
                of.name(),
                quantity.name()
            )),
            None => {
                let example = match quantity {
                    Quantity::Time => "ms",
                    Quantity::Force => "8.9N",
                    Quantity::Acceleration => "98m/s2",
                };
                let why = match header.unit() {
                    Some(unit) if unit::is_volts(unit) => format!("is in {unit}"),
                    Some(unit) => format!(
                        "is in `{}`, which is no unit of {} that is known",
                        beginning(unit, LETTERS),
                        quantity.name()
                    ),
                    None => "has no unit".to_owned(),
                };
                self.unfit(format!(
                    "column {column} {why}; say what 1 of it is: {} {column}:{example}",
                    option(quantity)
                ))
            }
        }
    }

    /// The column of force or of acceleration, if there is one.
    fn one(&self, choice: &Choice, quantity: Quantity) -> Result<Option<Picked>, WaveformError> {
        let wanted = choice.of(quantity);
        let of_unit: Vec<_> = self
            .headers
            .iter()
            .filter(|header| header.size().is_some_and(|(of, _)| of == quantity))
            .collect();
        let header = match (wanted, &of_unit[..]) {
            (Some(wanted), _) => self.named(wanted, quantity)?,
            (None, [one]) => one,
            (None, []) => {
                // A name without a unit counts as meant, and is told of.
                let mut called = self
                    .headers
                    .iter()
                    .filter(|header| header.called() == Some(quantity));
                match called.next() {
                    Some(header) if header.size().is_none() => header,
                    _ => return Ok(None),
                }
            }
            (None, several) => {
                return self.unfit(format!(
                    "has {} columns of {}: {}; say which with {}",
                    several.len(),
                    quantity.name(),
                    few(several.iter().copied()),
                    option(quantity)
                ));
            }
        };
        let size = self.size(header, wanted, quantity)?;
        Ok(Some(Picked {
            place: header.place,
            size,
        }))
    }

    /// The column of time, and what is taken for granted of it.
    fn time(&self, choice: &Choice) -> Result<(Picked, Option<String>), WaveformError> {
        if let Some(wanted) = &choice.time {
            let header = self.named(wanted, Quantity::Time)?;
            let size = self.size(header, Some(wanted), Quantity::Time)?;
            let place = header.place;
            return Ok((Picked { place, size }, None));
        }
        let is_time = |header: &&Header| match header.size() {
            Some((of, _)) => of == Quantity::Time,
            None => header.called() == Some(Quantity::Time) && header.unit().is_none(),
        };
        let Some(header) = self.headers.iter().find(is_time) else {
            return self.unfit(format!(
                "has no column of time among {}; say which with --time-column, or give the rate of its rows in Hz with \
                 --sample-rate",
                self.shown()
            ));
        };
        let place = header.place;
        let granted = || format!("column {} has no unit and is taken for seconds", header.shown());
        Ok(match header.size() {
            Some((_, size)) => (Picked { place, size }, None),
            None => (Picked { place, size: 1.0 }, Some(granted())),
        })
    }

    fn nothing(&self) -> WaveformError {
        WaveformError::unfit(
            self.path,
            format!(
                "has no column of force or acceleration with a unit among {}; say which, and what 1 of it is: \
                 --force-column CH1:8.9N or --acceleration-column CH2:98m/s2",
                self.shown()
            ),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(names: &[&str]) -> Vec<Header> {
        let header = |(place, name): (usize, &&str)| Header {
            place,
            name: (*name).to_owned(),
            unit: None,
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
        let found = picked(&["t (ms)", "Force (kN)", "a [m/s²]"], &Choice::default()).unwrap();
        let pick = |place, size| Some(Picked { place, size });
        assert_eq!(
            (found.time, found.force, found.acceleration),
            (pick(0, 1e-3), pick(1, 1e3), pick(2, 1.0))
        );
        let exported = [
            "id",
            "sample_index",
            "time_s",
            "time_from_trigger_s",
            "force_n",
            "acceleration_mps2",
            "force_code",
            "acceleration_code",
        ];
        let found = picked(&exported, &Choice::default()).unwrap();
        assert_eq!((found.time, found.force), (pick(2, 1.0), pick(4, 1.0)));
        assert_eq!(found.strike, Some(0));
    }

    #[test]
    fn columns_are_named_by_name_or_number_with_what_1_of_them_is() {
        let names = ["TIME", "CH1", "CH2"];
        for wanted in ["CH1:8.9N", "ch1:8.9N", "2:8.9 N/V"] {
            let found = picked(&names, &force(wanted)).unwrap();
            assert_eq!(found.force, Some(Picked { place: 1, size: 8.9 }), "{wanted}");
            assert!(found.remarks[0].contains("taken for seconds"));
        }
    }

    #[test]
    fn refusals_tell_some_names_and_the_beginning_of_each() {
        let long = "n".repeat(1 << 20);
        let mut names = vec!["CH1"; 300_000];
        names[0] = long.as_str();
        let why = picked(&names, &Choice::default()).unwrap_err();
        assert!(
            why.contains(&format!("among {}…, CH1, ", "n".repeat(40))),
            "{why:.400}"
        );
        assert!(why.contains(", CH1 and 299980 more; say which"), "{why:.400}");
        assert!(why.len() < 500, "{}", why.len());
        // What has a long name is typed by its number.
        let force_of = format!("force {long}");
        let why = picked(&["t (s)", &force_of], &Choice::default()).unwrap_err();
        assert!(
            why.contains("column 2 has no unit; say what 1 of it is: --force-column 2:8.9N"),
            "{why:.400}"
        );
        let of_unit = format!("force ({long})");
        let why = picked(&["t (s)", &of_unit], &Choice::default()).unwrap_err();
        assert!(why.contains("is in `nnn") && why.len() < 300, "{why:.400}");
        let time = format!("time {long}");
        let found = picked(&[&time, "F (N)"], &Choice::default()).unwrap();
        assert!(found.remarks[0].len() < 100, "{:.200}", found.remarks[0]);
        let several = vec!["F (N)"; 1000];
        assert!(
            picked(&several, &Choice::default())
                .unwrap_err()
                .contains("and 980 more; say")
        );
    }

    #[test]
    fn a_gram_is_no_gravity() {
        let why = picked(&["t (s)", "mass_g"], &Choice::default()).unwrap_err();
        assert!(why.contains("no column of force or acceleration"), "{why}");
        let why = picked(&["t (s)", "Channel G"], &Choice::default()).unwrap_err();
        assert!(why.contains("no column of force or acceleration"), "{why}");
        let found = picked(&["t (s)", "mass_g", "a (G)"], &Choice::default()).unwrap();
        assert_eq!(found.acceleration.map(|picked| picked.place), Some(2));
    }

    #[test]
    fn what_is_missing_is_told_with_what_to_type() {
        let says = |names: &[&str], choice: &Choice| picked(names, choice).unwrap_err();
        let none = Choice::default();
        let why = says(&["TIME", "CH1", "CH2"], &none);
        assert!(
            why.contains("TIME, CH1, CH2; say which, and what 1 of it is: --force-column CH1:8.9N"),
            "{why}"
        );
        let why = says(&["t (s)", "force"], &none);
        assert!(
            why.contains("column force has no unit; say what 1 of it is: --force-column force:8.9N"),
            "{why}"
        );
        let why = says(&["t (s)", "Force (V)"], &none);
        assert!(why.contains("is in V; say what 1"), "{why}");
        let why = says(&["F (N)"], &none);
        assert!(
            why.contains("no column of time among F (N); say which with --time-column"),
            "{why}"
        );
        let why = says(&["t (s)", "F1 (N)", "F2 (N)"], &none);
        assert!(why.contains("2 columns of force: F1 (N), F2 (N)"), "{why}");
        let why = says(&["t (s)", "F (N)"], &force("G:N"));
        assert!(
            why.contains("no such column of numbers; there are t (s), F (N)"),
            "{why}"
        );
        let why = says(&["t (s)", "F (N)"], &force("F:ms"));
        assert!(
            why.contains("its unit is one of time; give one of force"),
            "{why}"
        );
    }
}
