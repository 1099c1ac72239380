//! Units of time, force and acceleration as instruments write them.

/// What a column is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is what it is called")]
pub enum Quantity {
    Time,
    Force,
    Acceleration,
}

impl Quantity {
    /// As messages name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Force => "force",
            Self::Acceleration => "acceleration",
        }
    }

    /// Its SI unit.
    pub const fn si(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Force => "N",
            Self::Acceleration => "m/s²",
        }
    }
}

/// Standard gravity, m/s² (ISO 80000-3).
const GRAVITY: f64 = 9.806_65;
/// A pound-force, N (NIST SP 811).
const POUND: f64 = 4.448_221_615_260_5;

/// Units in the form that [`unit`] brings them into, each with its size in the SI unit.
const UNITS: [(&str, Quantity, f64); 28] = [
    ("s", Quantity::Time, 1.0),
    ("sec", Quantity::Time, 1.0),
    ("second", Quantity::Time, 1.0),
    ("seconds", Quantity::Time, 1.0),
    ("ms", Quantity::Time, 1e-3),
    ("msec", Quantity::Time, 1e-3),
    ("us", Quantity::Time, 1e-6),
    ("usec", Quantity::Time, 1e-6),
    ("ns", Quantity::Time, 1e-9),
    ("n", Quantity::Force, 1.0),
    ("newton", Quantity::Force, 1.0),
    ("newtons", Quantity::Force, 1.0),
    ("un", Quantity::Force, 1e-6),
    ("mn", Quantity::Force, 1e-3),
    ("kn", Quantity::Force, 1e3),
    ("lbf", Quantity::Force, POUND),
    ("m/s2", Quantity::Acceleration, 1.0),
    ("m_s2", Quantity::Acceleration, 1.0),
    ("m_per_s2", Quantity::Acceleration, 1.0),
    ("mps2", Quantity::Acceleration, 1.0),
    ("ms-2", Quantity::Acceleration, 1.0),
    ("m/s/s", Quantity::Acceleration, 1.0),
    ("m/sec2", Quantity::Acceleration, 1.0),
    ("mm/s2", Quantity::Acceleration, 1e-3),
    ("km/s2", Quantity::Acceleration, 1e3),
    ("g", Quantity::Acceleration, GRAVITY),
    ("gn", Quantity::Acceleration, GRAVITY),
    ("g0", Quantity::Acceleration, GRAVITY),
];

/// A text that is longer is no unit, bytes. Names of columns can be as long as a file, and are looked through
/// for one.
const LONGEST: usize = 64;

/// The quantity of a unit, and its size in the SI unit. None if the unit is not known, or is of something
/// else.
pub fn unit(text: &str) -> Option<(Quantity, f64)> {
    if text.len() > LONGEST {
        return None;
    }
    let text = bare(text);
    // A meganewton is no millinewton, and a giganewton no standard gravity.
    if ["MN", "GN"].contains(&text) {
        return None;
    }
    let plain: String = text
        .chars()
        .filter(|c| !matches!(c, '^' | ' ' | '*'))
        .map(|c| match c {
            // Both signs that are in use.
            'µ' | 'μ' => 'u',
            '²' => '2',
            c => c.to_ascii_lowercase(),
        })
        .collect();
    let found = UNITS.iter().find(|(name, ..)| *name == plain);
    found.map(|(_, quantity, size)| (*quantity, *size))
}

/// Whether it is a unit of a voltage, which says nothing of a force.
pub fn is_volts(text: &str) -> bool {
    if text.len() > LONGEST {
        return false;
    }
    let plain = bare(text).to_ascii_lowercase();
    ["v", "mv", "volt", "volts", "uv", "kv"].contains(&plain.as_str())
}

fn bare(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_whitespace() || "()[]\"".contains(c))
}

/// A size with its unit, such as `8.9N` or `N`: its quantity, and how much of the SI unit it is.
pub fn size(text: &str) -> Option<(Quantity, f64)> {
    let text = text.trim();
    // What one of the column is may be named as well.
    let per = ["/V", "/v", "/FS", "/fs"];
    let text = per.iter().find_map(|per| text.strip_suffix(per)).unwrap_or(text);
    let boundary = |at: &usize| unit(&text[*at..]).is_some();
    // The longest unit that leaves a number: the `e` of `1e3N` is part of that.
    let starts = text.char_indices().map(|(at, _)| at).filter(boundary);
    for at in starts {
        let (number, name) = text.split_at(at);
        let (quantity, size) = unit(name)?;
        let number = number.trim();
        let times = if number.is_empty() {
            Some(1.0)
        } else {
            number.parse::<f64>().ok()
        };
        if let Some(times) = times.filter(|times| times.is_finite() && *times != 0.0) {
            return Some((quantity, times * size));
        }
    }
    None
}

/// The name of a column without its unit, and the unit: `Force (N)`, `force_n`, `F/N`, `t [ms]`, `N`.
pub fn split(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((stem, rest)) = name.strip_suffix(close).and_then(|name| name.rsplit_once(open)) {
            return (stem.trim(), Some(rest.trim()));
        }
    }
    let is_unit = |text: &str| unit(text).is_some() || is_volts(text);
    if is_unit(name) && name.len() > 1 || ["s", "N", "g"].contains(&name) {
        return (name, Some(name));
    }
    let breaks = name.char_indices().filter(|(_, c)| matches!(c, '_' | ' ' | '/'));
    let mut splits = breaks.map(|(at, _)| (&name[..at], &name[at + 1..]));
    // `Channel G` is the seventh of them. In brackets, G is gravity to many.
    match splits.find(|(stem, end)| !stem.is_empty() && *end != "G" && is_unit(end)) {
        Some((stem, end)) => (stem.trim(), Some(end)),
        None => (name, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_columns_tell_their_units_as_instruments_write_them() {
        for (name, stem, of, size) in [
            ("force_n", "force", Quantity::Force, 1.0),
            ("acceleration_mps2", "acceleration", Quantity::Acceleration, 1.0),
            ("acceleration_m_s2", "acceleration", Quantity::Acceleration, 1.0),
            (
                "acceleration_m_per_s2",
                "acceleration",
                Quantity::Acceleration,
                1.0,
            ),
            ("time_from_trigger_s", "time_from_trigger", Quantity::Time, 1.0),
            ("Force (kN)", "Force", Quantity::Force, 1e3),
            ("Kraft [mN]", "Kraft", Quantity::Force, 1e-3),
            ("t/ms", "t", Quantity::Time, 1e-3),
            ("a / m/s²", "a", Quantity::Acceleration, 1.0),
            ("t (µs)", "t", Quantity::Time, 1e-6),
            ("a (m/s^2)", "a", Quantity::Acceleration, 1.0),
            ("Accel (g)", "Accel", Quantity::Acceleration, 9.80665),
            ("N", "N", Quantity::Force, 1.0),
            ("seconds", "seconds", Quantity::Time, 1.0),
        ] {
            let (found, name_of_unit) = split(name);
            let found = (found.trim_end_matches([' ', '/']), name_of_unit.and_then(unit));
            assert_eq!(found, (stem, Some((of, size))), "{name}");
        }
        for name in [
            "CH1",
            "force",
            "TIME",
            "force_code",
            "MN",
            "GN",
            "Channel G",
            "time",
            "t",
            "a",
            "n",
        ] {
            assert_eq!(split(name), (name, None), "{name}");
        }
        assert_eq!(unit("GN"), None);
        // Blanks are no part of a unit, but nobody writes so many.
        let blanks = " ".repeat(LONGEST);
        assert_eq!(unit(&format!("{blanks}N")), None);
        assert!(!is_volts(&format!("{blanks}V")));
        assert_eq!(split("CH1 (V)"), ("CH1", Some("V")));
    }

    #[test]
    fn a_size_is_a_number_and_a_unit() {
        assert_eq!(size("8.9N"), Some((Quantity::Force, 8.9)));
        assert_eq!(size("8.9 N/V"), Some((Quantity::Force, 8.9)));
        assert_eq!(size("-1e3 mN"), Some((Quantity::Force, -1.0)));
        assert_eq!(size("N"), Some((Quantity::Force, 1.0)));
        assert_eq!(size("98.0m/s2"), Some((Quantity::Acceleration, 98.0)));
        assert_eq!(size("2 g"), Some((Quantity::Acceleration, 2.0 * 9.80665)));
        assert_eq!(size("ms"), Some((Quantity::Time, 1e-3)));
        for odd in ["", "8.9", "V", "0N", "nanN", "infN", "8.9.9N", "eight N"] {
            assert_eq!(size(odd), None, "{odd}");
        }
    }
}
