//! A budget in words: tables for the terminal, and a page.

use crate::budget::combined::Combined;
use crate::budget::monte_carlo::{Drawn, MonteCarlo};
use crate::budget::ratio::BeadRatio;
use crate::budget::strike::{BudgetInput, StrikeBudget};
use crate::report::{Chapter, DASH, EnergyUnit, Fact, Grid, GridCell, Report, number};

/// Budgets of one or several beads.
#[derive(Debug)]
pub struct BudgetTables<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// One for each bead.
    pub budgets: &'a [StrikeBudget],
    /// Ratios to the first bead.
    pub ratios: &'a [BeadRatio],
    /// Facts about the page.
    pub made: &'a [Fact],
}

impl BudgetTables<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        let inputs = self
            .budgets
            .iter()
            .fold(Chapter::new("Inputs"), |chapter, budget| {
                chapter.table(input_table(budget).group(self.name(budget)))
            });
        let results = self
            .budgets
            .iter()
            .fold(Chapter::new("Results"), |chapter, budget| {
                chapter.table(result_table(budget).group(self.name(budget)))
            });
        let lines = self.budgets.iter().flat_map(lines);
        let results = lines.fold(results, |chapter, line| chapter.line(Some(line)));
        let mut sections = vec![inputs, results];
        sections.extend((!self.ratios.is_empty()).then(|| ratio_section(self.ratios)));
        sections.push(Chapter::facts("How this was made", self.made.iter().cloned()));
        let doubtful = self
            .budgets
            .iter()
            .find(|budget| !budget.agrees() && budget.unknown.is_empty());
        let verdict = match doubtful {
            Some(budget) => Err(format!(
                "bead {}: A and B differ by more than the uncertainty of their difference",
                budget.bead
            )),
            None => Ok("uncertainty budget"),
        };
        let tiles = self.budgets.iter().flat_map(|budget| {
            let unit = EnergyUnit::of([budget.measured.value, budget.predicted.value]);
            [
                ("A", &budget.measured),
                ("B", &budget.predicted),
                ("A − B", &budget.difference),
            ]
            .map(|(name, result)| (within(result, unit), format!("{name}, {}", self.name(budget))))
        });
        Report {
            above: self.recording.to_owned(),
            title: "Uncertainty of the absorbed energy".to_owned(),
            verdict,
            tiles: tiles.collect(),
            sections,
        }
    }

    fn name(&self, budget: &StrikeBudget) -> String {
        format!("bead {}, strike {}", budget.bead, budget.strike)
    }
}

/// A result with its expanded uncertainty.
fn within(result: &Combined, unit: EnergyUnit) -> String {
    let [value, expanded] = [result.value, result.expanded].map(|joules| unit.number(joules, 2));
    format!("{value} ± {expanded} {}", unit.symbol)
}

/// A number of some significant digits.
pub fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..7).contains(&exponent) {
        return format!("{value:.*e}", (digits - 1) as usize).replace('-', "−");
    }
    number(value, (digits - 1 - exponent).max(0) as usize)
}

const HEADINGS: &str = "input | value | u | ~unit | type | ~distribution | ~ν | A by +1 % (nJ) | B by +1 % (nJ) | % of A | \
                        % of B | % of A − B";

fn input_table(budget: &StrikeBudget) -> Grid {
    let percent = |share: f64| GridCell::from(number(share, 1));
    // Effect on the energy of an input that is 1 % greater. Errors of an estimate have no such part.
    let slope = |input: &BudgetInput, sensitivity: f64| match input.key {
        Some(_) => significant(sensitivity * input.value * 1e9 * 0.01, 4),
        None => DASH.to_owned(),
    };
    let row = |input: &BudgetInput| {
        let shown = match input.unit {
            "J" => [0.0, input.u * 1e9].map(|joules| significant(joules, 3)),
            _ => [significant(input.value, 6), significant(input.u, 3)],
        };
        let [value, u] = shown.map(GridCell::from);
        let free = input
            .degrees_of_freedom
            .map_or("∞".to_owned(), |free| number(free, 0));
        vec![
            input.name.into(),
            value,
            u,
            input.unit.replace('J', "nJ").into(),
            input.evaluation.into(),
            input.distribution.into(),
            free.into(),
            slope(input, input.sensitivity_measured).into(),
            slope(input, input.sensitivity_predicted).into(),
            percent(input.share_measured_percent),
            percent(input.share_predicted_percent),
            percent(input.share_difference_percent),
        ]
    };
    let mut rows: Vec<Vec<GridCell>> = budget.inputs.iter().map(row).collect();
    rows.extend(budget.correlations.iter().map(|correlation| {
        let [one, other] = correlation.inputs.map(|place| budget.inputs[place].name);
        let name = format!("correlation of {one} and {other}");
        let mut cells = vec![GridCell::from(name), number(correlation.correlation, 2).into()];
        cells.resize(9, GridCell::from(""));
        cells.extend([
            percent(correlation.share_measured_percent),
            percent(correlation.share_predicted_percent),
            percent(correlation.share_difference_percent),
        ]);
        cells
    }));
    Grid::new(HEADINGS, rows)
}

fn result_table(budget: &StrikeBudget) -> Grid {
    let unit = EnergyUnit::of([budget.measured.value, budget.predicted.value]);
    let drawn = |of: fn(&MonteCarlo) -> Drawn| budget.monte_carlo.as_ref().map(of);
    let results = [
        ("A, measured", &budget.measured, drawn(|all| all.measured)),
        ("B, predicted", &budget.predicted, drawn(|all| all.predicted)),
        ("A − B", &budget.difference, drawn(|all| all.difference)),
    ];
    let rows = results.map(|(name, result, drawn)| {
        let of_drawn = |show: fn(&Drawn, EnergyUnit) -> String| {
            GridCell::from(drawn.as_ref().map_or(String::new(), |drawn| show(drawn, unit)))
        };
        vec![
            format!("{name} ({})", unit.symbol).into(),
            unit.number(result.value, 3).into(),
            unit.number(result.u, 3).into(),
            result
                .degrees_of_freedom
                .map_or("∞".to_owned(), |free| significant(free, 3))
                .into(),
            number(result.coverage_factor, 3).into(),
            unit.number(result.expanded, 3).into(),
            of_drawn(|drawn, unit| unit.number(drawn.u, 3)),
            of_drawn(|drawn, unit| {
                format!("{} to {}", unit.number(drawn.low, 3), unit.number(drawn.high, 3))
            }),
        ]
    });
    let headings = match budget.monte_carlo {
        Some(_) => "result | value | u | ν | k | U (95 %) | u, drawn | 95 % of the draws",
        None => "result | value | u | ν | k | U (95 %)",
    };
    let width = headings.split('|').count();
    Grid::new(
        headings,
        rows.map(|mut row| {
            row.truncate(width);
            row
        }),
    )
}

/// Lines about one budget: the unknown, the decision, and the draws.
fn lines(budget: &StrikeBudget) -> Vec<String> {
    let bead = budget.bead;
    let mut lines = Vec::new();
    if budget.unknown.is_empty() {
        let (are, difference) = (
            if budget.agrees() { "agree" } else { "differ" },
            &budget.difference,
        );
        lines.push(format!(
            "bead {bead}: A and B {are}: |A − B| against U(A − B), k = {:.2}, simple acceptance (JCGM 106, 8.2)",
            difference.coverage_factor
        ));
    } else {
        lines.push(format!(
            "bead {bead}: unknown uncertainties: {}; U lacks their part, so A and B are not judged",
            budget.unknown.join(", ")
        ));
    }
    if let Some(drawn) = &budget.monte_carlo {
        let each = [
            ("A", drawn.measured),
            ("B", drawn.predicted),
            ("A − B", drawn.difference),
        ];
        let each = each.map(|(name, drawn)| match drawn.agrees_to_digits {
            Some(2) => format!("{name} to two digits of u"),
            Some(_) => format!("{name} to one digit of u"),
            None => format!("{name} not even to one digit of u: use the drawn interval"),
        });
        lines.push(format!(
            "bead {bead}: by {} draws (JCGM 101, 8) the linear budget holds: {}",
            drawn.draws,
            each.join(", ")
        ));
    }
    lines
}

fn ratio_section(ratios: &[BeadRatio]) -> Chapter {
    let shown = |ratio: &Combined| format!("{:.5} ± {:.5}", ratio.value, ratio.expanded);
    let row = |ratio: &BeadRatio| {
        let [over, under] = ratio.beads;
        vec![
            format!("bead {over} over bead {under}").into(),
            shown(&ratio.measured).into(),
            shown(&ratio.predicted).into(),
            if ratio.shares_calibration {
                "cancel"
            } else {
                "do not"
            }
            .into(),
        ]
    };
    let rows: Vec<_> = ratios.iter().map(row).collect();
    let some_do_not = ratios.iter().any(|ratio| !ratio.shares_calibration);
    let line = some_do_not.then(|| {
        "Gain, flatness, supply and contacts cancel only between beads whose settings name the same calibration of the same day".to_owned()
    });
    Chapter::new("Ratios")
        .table(Grid::new("ratio | A | B | shared inputs", rows))
        .line(line)
}
