//! Wiring from the outputs to the inputs.

use bead_line::conversation::{Conversation, LineError};

use super::levels::hold;
use super::report::CheckRow;

/// Codes of PA4 and PA5 before and after a step: one rises, the other falls.
const BEFORE: [u16; 2] = [1400, 2600];
const AFTER: [u16; 2] = [2400, 1600];
const STEP: f64 = 1000.0;
/// Least part of the step by which an input moves that follows an output: a divider leaves less.
const FOLLOWS: f64 = 0.5;

const INPUTS: [&str; 2] = ["PA0", "PA2"];
const OUTPUTS: [&str; 2] = ["PA4", "PA5"];
const NEXT: &str = "connect PA4 to PA0 and PA5 to PA2, as docs/bench.md shows";

/// For each of PA0 and PA2, the output that it follows, if any: 0 is PA4, 1 is PA5.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wiring(pub [Option<usize>; 2]);

impl Wiring {
    /// Finds the wiring of a bead.
    ///
    /// # Errors
    /// The bead refuses or does not answer.
    pub fn find(bead: &mut Conversation) -> Result<Self, LineError> {
        let [before, after] = [hold(bead, BEFORE)?, hold(bead, AFTER)?];
        Ok(Self([0, 1].map(|input| {
            let moved = (after[input].mean - before[input].mean) / STEP;
            match moved {
                moved if moved > FOLLOWS => Some(0),
                moved if moved < -FOLLOWS => Some(1),
                _ => None,
            }
        })))
    }

    /// Returns `true` if each input follows its own output.
    pub fn is_right(self) -> bool {
        self.0 == [Some(0), Some(1)]
    }

    /// The fault of the wires, in one line.
    pub fn wrong(self) -> Option<String> {
        let follows = |input: usize| match self.0[input] {
            Some(output) => format!("{} follows {}", INPUTS[input], OUTPUTS[output]),
            None => format!("{} follows no output", INPUTS[input]),
        };
        Some(match self.0 {
            [Some(0), Some(1)] => return None,
            [None, None] => format!("no wire: neither PA0 nor PA2 follows an output; {NEXT}"),
            [Some(1), Some(0)] => {
                "the wires are exchanged: PA0 follows PA5 and PA2 follows PA4; swap them".to_owned()
            }
            [Some(0), None] => format!("the wire from PA5 to PA2 is missing: {}; {NEXT}", follows(1)),
            [None, Some(1)] => format!("the wire from PA4 to PA0 is missing: {}; {NEXT}", follows(0)),
            _ => format!("the wires are wrong: {} and {}; {NEXT}", follows(0), follows(1)),
        })
    }

    pub(super) fn row(self) -> CheckRow {
        let right = "PA0 follows PA4, PA2 follows PA5";
        CheckRow::of(
            "wires",
            self.wrong().unwrap_or_else(|| right.to_owned()),
            right,
            self.is_right(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_wrong_wiring_has_a_line_of_its_own_that_says_what_to_do() {
        let ways = [None, Some(0), Some(1)];
        let all = ways
            .iter()
            .flat_map(|a| ways.iter().map(move |b| Wiring([*a, *b])));
        let mut lines: Vec<_> = all.filter_map(Wiring::wrong).collect();
        assert_eq!(lines.len(), 8, "one of nine is right");
        let says = |line: &String| line.contains("connect PA4") || line.contains("swap");
        assert!(lines.iter().all(says), "{lines:?}");
        lines.sort();
        lines.dedup();
        assert_eq!(lines.len(), 8);
    }
}
