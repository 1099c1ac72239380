//! Numbers as people read them.

/// A unit of energy, and so the number of digits before the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyUnit {
    /// Its symbol, such as `nJ`.
    pub symbol: &'static str,
    /// Its number in a joule.
    pub scale: f64,
}

impl EnergyUnit {
    const ALL: [(&str, f64); 4] = [("nJ", 1e9), ("µJ", 1e6), ("mJ", 1e3), ("J", 1.0)];

    /// The common unit of energies, J, that are shown together: the smallest that keeps all below 10 000.
    pub fn of(energies: impl IntoIterator<Item = f64>) -> Self {
        let greatest = energies.into_iter().map(f64::abs).fold(0.0, f64::max);
        let fits = |(_, scale): &&(&str, f64)| greatest * scale < 1e4;
        let &(symbol, scale) = Self::ALL.iter().find(fits).unwrap_or(&Self::ALL[3]);
        Self { symbol, scale }
    }

    /// An energy in J as a number of this unit.
    pub fn number(&self, joules: f64, digits: usize) -> String {
        number(joules * self.scale, digits)
    }
}

/// A value in the common unit of energies, with its symbol.
pub fn energy(joules: f64) -> String {
    let unit = EnergyUnit::of([joules]);
    format!("{} {}", unit.number(joules, 3), unit.symbol)
}

/// A number with a minus if it is negative, U+2212 as in all our text.
pub fn number(value: f64, digits: usize) -> String {
    format!("{value:.digits$}").replace('-', "−")
}

/// A number with its sign.
pub fn signed(value: f64, digits: usize) -> String {
    format!("{value:+.digits$}").replace('-', "−")
}

/// A deviation in percent, with its sign.
pub fn percent(part: f64) -> String {
    format!("{} %", signed(part * 100.0, 3))
}

/// A deviation in percent, with its uncertainty if it has one.
pub fn percent_within(part: f64, uncertainty: Option<f64>) -> String {
    let Some(within) = uncertainty else {
        return percent(part);
    };
    format!("{} ± {:.3} %", signed(part * 100.0, 3), within * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_that_stand_together_have_one_unit_of_at_most_four_digits() {
        for (energies, shown) in [
            (vec![829.7e-9, -1.0e-9], "829.700 nJ"),
            (vec![9.9994e-6], "9999.400 nJ"),
            (vec![8.418_627_77e-3], "8418.628 µJ"),
            (vec![1_470.265_361_88], "1470.265 J"),
            (vec![1e6], "1000000.000 J"),
            (vec![0.0], "0.000 nJ"),
        ] {
            let unit = EnergyUnit::of(energies.iter().copied());
            assert_eq!(format!("{} {}", unit.number(energies[0], 3), unit.symbol), shown);
        }
        assert_eq!(energy(-2e-6), "−2000.000 nJ");
    }
}
