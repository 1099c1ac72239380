//! Numbers of beads named on a command line: `8`, `7-16`, `7,9,12-14` or `all`.

use std::str::FromStr;

use hertz_chain::Scenario;

use bead_bench::error::BenchError;
use bead_compare::sensed::BEADS_TOLD;
use bead_tables::printable::first_of;

/// The value of `--bead`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BeadNumbers {
    /// A single number.
    One(usize),
    /// A list or a range, in ascending order.
    Several(Vec<usize>),
    /// Every bead with an intruder.
    All,
}

/// Greatest number of a bead, above that of any chain whose beads are emulated.
const MOST: usize = 100_000;

impl FromStr for BeadNumbers {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self::All);
        }
        if let Ok(bead) = text.parse() {
            return Ok(Self::One(bead));
        }
        let odd = || format!("{text:?} names no beads; give 8, 7-16, 7,9,12-14 or all");
        let mut beads = Vec::new();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let number = |text: &str| text.trim().parse::<usize>().map_err(|_| odd());
            let (first, last) = (number(first)?, number(last)?);
            if last < first {
                return Err(format!("{part} counts down; give {last}-{first}"));
            }
            if last > MOST {
                return Err(odd());
            }
            // More than MOST numbers of at most MOST: one is named twice.
            if beads.len() > MOST + 1 {
                break;
            }
            beads.extend(first..=last);
        }
        beads.sort_unstable();
        match beads.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(format!("bead {} is named twice; name it once", pair[0])),
            None => Ok(Self::Several(beads)),
        }
    }
}

/// Parses the value of `--bead` of a command for one bead.
///
/// # Errors
/// A line that says what to give instead.
pub fn one_bead(text: &str) -> Result<usize, String> {
    match text.parse()? {
        BeadNumbers::One(bead) => Ok(bead),
        _ => Err(format!(
            "{text} is not a single number, and this command is for one bead; give a number such as 8"
        )),
    }
}

impl BeadNumbers {
    /// The beads, in ascending order, with an intruder or without.
    ///
    /// # Errors
    /// All are asked for, and no bead has an intruder.
    pub fn listed(&self, scenario: &Scenario) -> Result<Vec<usize>, BenchError> {
        let beads = match self {
            Self::One(bead) => vec![*bead],
            Self::Several(beads) => beads.clone(),
            Self::All => scenario.hosts(),
        };
        if beads.is_empty() {
            return Err(BenchError::Unfit(
                "no bead of this scenario has an intruder; add an [[intruder]] to it".to_owned(),
            ));
        }
        Ok(beads)
    }

    /// The beads, in ascending order. Each has an intruder.
    ///
    /// # Errors
    /// A bead that is named has none, or none has.
    pub fn of(&self, scenario: &Scenario) -> Result<Vec<usize>, BenchError> {
        let with = scenario.hosts();
        if with.is_empty() {
            return Self::All.listed(scenario);
        }
        let named = self.listed(scenario)?;
        let has_none = |bead: &&usize| with.binary_search(bead).is_err();
        let without: Vec<_> = named.iter().filter(has_none).collect();
        let (has, these) = match without.len() {
            0 => return Ok(named),
            1 => ("has", "bead"),
            _ => ("have", "beads"),
        };
        Err(BenchError::Unfit(format!(
            "--bead: {these} {} {has} no intruder; those with one are {}",
            first_of(without, BEADS_TOLD),
            first_of(&with, BEADS_TOLD)
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_ranges_lists_and_all_are_understood() {
        let read = |text: &str| text.parse::<BeadNumbers>();
        assert_eq!(read("8"), Ok(BeadNumbers::One(8)));
        assert_eq!(read("7-9"), Ok(BeadNumbers::Several(vec![7, 8, 9])));
        assert_eq!(read("12-13,7"), Ok(BeadNumbers::Several(vec![7, 12, 13])));
        assert_eq!(read("all"), Ok(BeadNumbers::All));
        for odd in ["", "x", "7-", "-7", "1-1000000", "7;8"] {
            assert!(read(odd).unwrap_err().contains("names no beads"), "{odd}");
        }
        assert_eq!(read("9-7"), Err("9-7 counts down; give 7-9".to_owned()));
        assert!(one_bead("7-9").is_err_and(|why| why.contains("not a single number")));
    }

    #[test]
    fn beads_without_an_intruder_are_refused_by_the_first_of_them() {
        let mut scenario = Scenario::paper();
        scenario.chain.beads = 20_000;
        scenario.intruders[0].beads = (1..=10_000).rev().collect();
        assert_eq!(BeadNumbers::All.of(&scenario).unwrap()[..2], [1, 2]);
        let named = BeadNumbers::Several((9_000..=20_000).collect());
        assert_eq!(
            named.of(&scenario).unwrap_err().to_string(),
            "--bead: beads 10001, 10002, 10003, 10004, 10005, 10006, 10007, 10008, 10009, 10010 and 9990 more have no \
             intruder; those with one are 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 9990 more"
        );
        scenario.intruders.clear();
        assert!(BeadNumbers::All.of(&scenario).is_err());
    }
}
