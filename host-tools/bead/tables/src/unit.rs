//! Units: at the ends of columns' names, at the axes of charts, and as other instruments write them.

/// A physical quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is what it is called")]
pub enum Quantity {
    Time,
    Force,
    Acceleration,
    Voltage,
    Frequency,
    Length,
    Velocity,
    Mass,
    Density,
    Energy,
    Pressure,
    Stiffness,
    Damping,
    Impulse,
}

impl Quantity {
    /// Its name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Force => "force",
            Self::Acceleration => "acceleration",
            Self::Voltage => "voltage",
            Self::Frequency => "frequency",
            Self::Length => "length",
            Self::Velocity => "velocity",
            Self::Mass => "mass",
            Self::Density => "density",
            Self::Energy => "energy",
            Self::Pressure => "pressure",
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::Impulse => "impulse",
        }
    }

    /// The symbol of its SI unit.
    pub fn si(self) -> &'static str {
        let is_own = |unit: &&Unit| unit.quantity == self && unit.size == 1.0;
        UNITS.iter().find(is_own).map_or("", |unit| unit.symbol)
    }
}

/// A unit.
#[derive(Debug, PartialEq)]
pub struct Unit {
    /// Its quantity.
    pub quantity: Quantity,
    /// Its size in the SI unit.
    pub size: f64,
    /// Its symbol, such as `N/m`.
    pub symbol: &'static str,
    /// The end of a column's name in this program's tables, such as `n_per_m`; empty for units that they do
    /// not use.
    pub ending: &'static str,
    /// Other programs' spellings, in lower case without blanks; see [`parse`].
    spellings: &'static [&'static str],
}

/// Standard gravity, m/s² (ISO 80000-3).
pub const GRAVITY: f64 = 9.806_65;
/// A pound-force, N (NIST SP 811).
const POUND: f64 = 4.448_221_615_260_5;

const fn unit(
    quantity: Quantity,
    size: f64,
    symbol: &'static str,
    ending: &'static str,
    spellings: &'static [&'static str],
) -> Unit {
    Unit {
        quantity,
        size,
        symbol,
        ending,
        spellings,
    }
}

#[rustfmt::skip]
static UNITS: [Unit; 29] = [
    unit(Quantity::Time, 1.0, "s", "s", &["s", "sec", "second", "seconds"]),
    unit(Quantity::Time, 1e-3, "ms", "", &["ms", "msec"]),
    unit(Quantity::Time, 1e-6, "µs", "", &["us", "usec"]),
    unit(Quantity::Time, 1e-9, "ns", "", &["ns"]),
    unit(Quantity::Force, 1.0, "N", "n", &["n", "newton", "newtons"]),
    unit(Quantity::Force, 1e-6, "µN", "", &["un"]),
    unit(Quantity::Force, 1e-3, "mN", "", &["mn"]),
    unit(Quantity::Force, 1e3, "kN", "", &["kn"]),
    unit(Quantity::Force, POUND, "lbf", "", &["lbf"]),
    unit(Quantity::Acceleration, 1.0, "m/s²", "mps2",
        &["m/s2", "m_s2", "m_per_s2", "mps2", "ms-2", "m/s/s", "m/sec2"]),
    unit(Quantity::Acceleration, 1e-3, "mm/s²", "", &["mm/s2"]),
    unit(Quantity::Acceleration, 1e3, "km/s²", "", &["km/s2"]),
    unit(Quantity::Acceleration, GRAVITY, "g", "", &["g", "gn", "g0"]),
    unit(Quantity::Voltage, 1.0, "V", "v", &["v", "volt", "volts"]),
    unit(Quantity::Voltage, 1e-6, "µV", "", &["uv"]),
    unit(Quantity::Voltage, 1e-3, "mV", "", &["mv"]),
    unit(Quantity::Voltage, 1e3, "kV", "", &["kv"]),
    unit(Quantity::Frequency, 1.0, "Hz", "hz", &[]),
    unit(Quantity::Frequency, 1.0, "1/s", "per_s", &[]),
    unit(Quantity::Length, 1.0, "m", "m", &[]),
    unit(Quantity::Velocity, 1.0, "m/s", "mps", &[]),
    unit(Quantity::Mass, 1.0, "kg", "kg", &[]),
    unit(Quantity::Density, 1.0, "kg/m³", "kg_per_m3", &[]),
    unit(Quantity::Energy, 1.0, "J", "j", &[]),
    unit(Quantity::Pressure, 1.0, "Pa", "pa", &[]),
    unit(Quantity::Stiffness, 1.0, "N/m", "n_per_m", &[]),
    unit(Quantity::Stiffness, 1.0, "N/m^1.5", "n_per_m1p5", &[]),
    unit(Quantity::Damping, 1.0, "N·s/m", "n_s_per_m", &[]),
    unit(Quantity::Impulse, 1.0, "N·s", "n_s", &[]),
];

/// Prefixes of units at the axes of charts.
const PREFIXES: [(&str, f64); 8] = [
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("", 1.0),
    ("m", 1e-3),
    ("µ", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
];

impl Unit {
    /// The unit of a column of this program's tables, and the rest of the column's name: `peak_force` and N
    /// for `peak_force_n`.
    pub fn of_column(name: &str) -> Option<(&str, &'static Self)> {
        let own = UNITS.iter().filter(|unit| !unit.ending.is_empty());
        let found = own.filter_map(|unit| Some((name.strip_suffix(unit.ending)?.strip_suffix('_')?, unit)));
        // The longest ending: `_n_per_m` also ends with `_m`.
        found.min_by_key(|(stem, _)| stem.len())
    }

    /// The unit of a symbol of this program's tables, such as `N/m`.
    pub fn of_symbol(symbol: &str) -> Option<&'static Self> {
        UNITS.iter().find(|unit| unit.symbol == symbol)
    }

    /// The symbol with the prefix that makes numbers up to `greatest` short, and the divisor for them.
    pub fn prefixed(&self, greatest: f64) -> (String, f64) {
        // Prefixes of a mass go with the gram. A density in kg/m³ and a unit with a power take none.
        let (symbol, size) = match self.symbol {
            "kg" => ("g", 1e-3),
            "kg/m³" | "N/m^1.5" | "1/s" => return (self.symbol.to_owned(), 1.0),
            symbol => (symbol, 1.0),
        };
        let fits = |(_, prefix): &&(&str, f64)| greatest >= prefix * size;
        let (letter, prefix) = PREFIXES.iter().find(fits).unwrap_or(&("", 1.0));
        (format!("{letter}{symbol}"), prefix * size)
    }
}

/// The unit that an instrument writes as `text`: a time, a force, an acceleration or a voltage.
pub fn parse(text: &str) -> Option<&'static Unit> {
    let text = text.trim_matches(|c: char| c.is_whitespace() || "()[]\"".contains(c));
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
    UNITS.iter().find(|unit| unit.spellings.contains(&plain.as_str()))
}

/// The quantity of a size with its unit, such as `8.9N` or `N`, and its value in the SI unit. `None` for a
/// voltage, as its force is unknown.
pub fn parse_size(text: &str) -> Option<(Quantity, f64)> {
    let text = text.trim();
    // The divisor may be named: newtons per volt, or per full scale.
    let per = ["/V", "/v", "/FS", "/fs"];
    let text = per.iter().find_map(|per| text.strip_suffix(per)).unwrap_or(text);
    // The longest unit that leaves a number: the `e` of `1e3N` is part of the number.
    for (at, _) in text.char_indices() {
        let (number, name) = text.split_at(at);
        let Some(unit) = parse(name) else { continue };
        if unit.quantity == Quantity::Voltage {
            return None;
        }
        let number = number.trim();
        let times = if number.is_empty() {
            Ok(1.0)
        } else {
            number.parse::<f64>()
        };
        if let Ok(times) = times
            && times.is_finite()
            && times != 0.0
        {
            return Some((unit.quantity, times * unit.size));
        }
    }
    None
}

/// The name of an instrument's column without its unit, and the unit: `Force (N)`, `force_n`, `F/N`,
/// `t [ms]`, `N`.
pub fn split(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((stem, rest)) = name.strip_suffix(close).and_then(|name| name.rsplit_once(open)) {
            return (stem.trim(), Some(rest.trim()));
        }
    }
    let is_unit = |text: &str| parse(text).is_some();
    if is_unit(name) && name.len() > 1 || ["s", "N", "g"].contains(&name) {
        return (name, Some(name));
    }
    let breaks = name.char_indices().filter(|(_, c)| matches!(c, '_' | ' ' | '/'));
    let mut splits = breaks.map(|(at, _)| (&name[..at], &name[at + 1..]));
    // `Channel G` is the seventh channel. In brackets, G is gravity to many.
    match splits.find(|(stem, end)| !stem.is_empty() && *end != "G" && is_unit(end)) {
        Some((stem, end)) => (stem.trim(), Some(end)),
        None => (name, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_instruments_give_their_units() {
        for (name, stem, quantity, size) in [
            ("force_n", "force", Quantity::Force, 1.0),
            ("a_mps2", "a", Quantity::Acceleration, 1.0),
            ("a_m_s2", "a", Quantity::Acceleration, 1.0),
            ("a_m_per_s2", "a", Quantity::Acceleration, 1.0),
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
            ("CH1 (V)", "CH1", Quantity::Voltage, 1.0),
        ] {
            let (found, unit) = split(name);
            let unit = unit.and_then(parse).map(|unit| (unit.quantity, unit.size));
            let found = (found.trim_end_matches([' ', '/']), unit);
            assert_eq!(found, (stem, Some((quantity, size))), "{name}");
        }
        for name in "CH1|force|TIME|force_code|MN|GN|Channel G|time|t|a|n".split('|') {
            assert_eq!(split(name), (name, None), "{name}");
        }
        assert_eq!(parse("GN"), None);
    }

    #[test]
    fn a_size_is_a_number_and_a_unit() {
        assert_eq!(parse_size("8.9N"), Some((Quantity::Force, 8.9)));
        assert_eq!(parse_size("8.9 N/V"), Some((Quantity::Force, 8.9)));
        assert_eq!(parse_size("-1e3 mN"), Some((Quantity::Force, -1.0)));
        assert_eq!(parse_size("N"), Some((Quantity::Force, 1.0)));
        assert_eq!(parse_size("98.0m/s2"), Some((Quantity::Acceleration, 98.0)));
        assert_eq!(parse_size("2 g"), Some((Quantity::Acceleration, 2.0 * 9.80665)));
        assert_eq!(parse_size("ms"), Some((Quantity::Time, 1e-3)));
        for odd in ["", "8.9", "V", "0N", "nanN", "infN", "8.9.9N", "eight N"] {
            assert_eq!(parse_size(odd), None, "{odd}");
        }
    }

    #[test]
    fn a_column_has_the_unit_of_its_longest_ending_with_a_prefix_for_its_numbers() {
        for (column, stem, greatest, symbol, divisor) in [
            ("absorbed_j", "absorbed", 12e-6, "µJ", 1e-6),
            ("intruder_1_mass_kg", "intruder_1_mass", 3.7e-3, "g", 1e-3),
            ("chain_young_pa", "chain_young", 4.5e9, "GPa", 1e9),
            ("stiffness_n_per_m", "stiffness", 3.95e5, "kN/m", 1e3),
            ("chain_density_kg_per_m3", "chain_density", 1775.0, "kg/m³", 1.0),
        ] {
            let (found, unit) = Unit::of_column(column).unwrap();
            assert_eq!(found, stem);
            assert_eq!(unit.prefixed(greatest), (symbol.to_owned(), divisor), "{column}");
        }
        assert_eq!(Unit::of_column("absorbed_of_injected"), None);
    }
}
