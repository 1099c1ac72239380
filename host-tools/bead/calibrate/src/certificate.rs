//! The certificate of a calibration, after ISO/IEC 17025:2017, 7.8.2 to 7.8.6: for the terminal, and as a
//! page.

use bead_compare::budget::significant;
use bead_compare::report::{Chapter, DASH, Fact, Grid, GridCell, Medium, Passage, Report, number, signed};

use crate::about::About;
use crate::calibration::Calibration;
use crate::conformity::Conformity;
use crate::model::{BudgetRow, CalibrationResult};

/// A calibration with the other contents of its certificate.
#[derive(Debug)]
pub struct Certificate<'a> {
    /// The calibration.
    pub calibration: &'a Calibration,
    /// Texts that are not measured.
    pub about: &'a About,
    /// Day of the calibration.
    pub calibrated: String,
    /// Day on which the page is made.
    pub issued: String,
    /// Statement of conformity, if one was asked for.
    pub conformity: Option<&'a Conformity>,
    /// Doubts that were overruled, a sentence each.
    pub doubts: &'a [String],
    /// True for a bead that was simulated or emulated.
    pub is_simulated: bool,
    /// Facts about the page.
    pub made: &'a [Fact],
}

impl Certificate<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        let calibration = self.calibration;
        let doubt = calibration.doubt();
        let failed = self.conformity.is_some_and(|conformity| !conformity.passes());
        let verdict = match (doubt, failed) {
            (Some(doubt), _) => Err(doubt),
            (None, true) => Err("does not conform".to_owned()),
            (None, false) => Ok("calibrated"),
        };
        let tiles = calibration.results.iter().map(tile).collect();
        let mut sections = vec![self.identification(), results(calibration)];
        // A result that is itself an input has no budget.
        let derived = calibration
            .results
            .iter()
            .filter(|result| result.inputs.len() > 1);
        sections.extend(derived.map(budget));
        sections.push(self.checks());
        sections.push(observations(calibration));
        sections.push(self.method());
        sections.push(self.traceability());
        sections.push(self.authorisation());
        if !self.made.is_empty() {
            sections.push(Chapter::facts("How this was made", self.made.iter().cloned()));
        }
        Report {
            above: "Calibration certificate".to_owned(),
            title: calibration.title.to_owned(),
            verdict,
            tiles,
            sections,
        }
    }

    fn identification(&self) -> Chapter {
        let about = self.about;
        let bead = self.calibration.bead.as_ref().map(|bead| match &bead.uid {
            Some(uid) => format!("address {}, device id {uid}", bead.address),
            None => format!("address {}", bead.address),
        });
        let item = match (about.item.as_str(), self.is_simulated) {
            (item, false) => stated(item),
            ("", true) => "simulated bead: no hardware was calibrated".to_owned(),
            (item, true) => format!("{item} (simulated bead: no hardware was calibrated)"),
        };
        let supply = self.calibration.supply_v.map(|volts| format!("{volts:.3} V"));
        let conditions = [
            ("temperature", about.temperature.as_str()),
            ("humidity", about.humidity.as_str()),
            ("", about.remarks.as_str()),
        ];
        let conditions = conditions.into_iter().filter(|(_, text)| !text.is_empty());
        let conditions = conditions.map(|(name, text)| format!("{name} {text}").trim().to_owned());
        let mut conditions: Vec<_> = conditions.collect();
        conditions
            .extend(supply.map(|volts| format!("supply of the converter {volts}, as the bead measured it")));
        let is_elsewhere = !about.place.is_empty();
        let place = if is_elsewhere {
            &about.place
        } else {
            &about.laboratory
        };
        let facts = [
            ("certificate", stated(&about.number)),
            ("laboratory", stated(&about.laboratory)),
            ("place", stated(place)),
            ("owner", stated(&about.owner)),
            ("item", item),
            ("bead", bead.unwrap_or_else(|| NOT_STATED.to_owned())),
            ("date of calibration", self.calibrated.clone()),
            ("date of issue", self.issued.clone()),
            ("conditions", stated(&conditions.join("; "))),
        ];
        Chapter::facts("Identification", facts)
    }

    fn checks(&self) -> Chapter {
        let calibration = self.calibration;
        let checks = calibration.checks.iter().map(|check| {
            vec![
                check.what.clone().into(),
                signed(check.deviation_percent, 3).into(),
                format!("{:.3}", check.allowed_percent).into(),
                GridCell::judged(if check.holds { "holds" } else { "fails" }, Some(check.holds)),
            ]
        });
        let checks = Grid::new("check | deviation (%) | allowed (%) | verdict", checks);
        let failed = calibration.doubt().map(Passage::Failure);
        let conformity = self.conformity.map(Conformity::sentence);
        let doubts = self
            .doubts
            .iter()
            .map(|doubt| Some(format!("Made despite a doubt: {doubt}")));
        let left_out = calibration.left_out.iter();
        // The command names them on standard error, too.
        let left_out = left_out.map(|out| Passage::Text(format!("Left out: {}: {}.", out.subject, out.why)));
        let chapter = Chapter::new("Checks and conformity").table(checks).with(failed);
        let lines = std::iter::once(conformity).chain(doubts);
        lines.fold(chapter, Chapter::line).with(left_out)
    }

    fn method(&self) -> Chapter {
        let method = self.calibration.method.iter();
        method.fold(Chapter::new("Method"), |chapter, text| {
            chapter.text(text.as_str())
        })
    }

    fn traceability(&self) -> Chapter {
        let row = |reference: &crate::about::Reference| {
            let until = reference.valid_until.map(|day| day.to_string());
            vec![
                GridCell::from(stated(&reference.name)),
                stated(&reference.gives).into(),
                stated(&reference.certificate).into(),
                until.unwrap_or_else(|| DASH.to_owned()).into(),
            ]
        };
        let rows: Vec<_> = self.about.references.iter().map(row).collect();
        let line = if rows.is_empty() {
            "No reference is stated, so these results are traceable only to what the operator typed."
        } else {
            "The results are traceable to these references through the inputs that they give, in the budgets above."
        };
        let table = Grid::new("reference | gives | certificate | valid until", rows);
        Chapter::new("Traceability")
            .table(table.on(Medium::Page))
            .text(line)
    }

    fn authorisation(&self) -> Chapter {
        let missing = self.about.missing();
        let facts = [("authorised by", stated(&self.about.authorised_by))];
        let chapter = Chapter::facts("Authorisation", facts)
            .text("The results hold for the item that is named, at the time and under the conditions of the calibration.");
        if missing.is_empty() {
            return chapter;
        }
        chapter.text(format!(
            "ISO/IEC 17025, 7.8, also asks for: {}. State them in the file of --about.",
            missing.join(", ")
        ))
    }
}

const NOT_STATED: &str = "not stated";

fn stated(text: &str) -> String {
    (if text.is_empty() { NOT_STATED } else { text }).to_owned()
}

/// The value of a result, and its name with its uncertainty. Both numbers are rounded to two digits of the
/// uncertainty.
fn tile(result: &CalibrationResult) -> (String, String) {
    let combined = &result.combined;
    let (unit, size) = prefixed(result);
    let [value, expanded] = [combined.value / size, combined.expanded / size];
    let digits = decimals(expanded);
    (
        format!("{value:.digits$} {unit}").trim_end().replace('-', "−"),
        format!("{}, U = {expanded:.digits$}", result.name),
    )
}

/// Decimals that show two digits of an uncertainty.
fn decimals(expanded: f64) -> usize {
    if expanded > 0.0 {
        (1.0 - expanded.log10().floor()).clamp(0.0, 12.0) as usize
    } else {
        6
    }
}

/// The unit of a result with a prefix, and its size in the SI unit.
fn prefixed(result: &CalibrationResult) -> (String, f64) {
    let value = result.combined.value.abs();
    let thousandth = (1e-6..0.1).contains(&value);
    match result.unit {
        "N" if thousandth => ("mN".to_owned(), 1e-3),
        "kg" if thousandth => ("g".to_owned(), 1e-3),
        unit => (unit.to_owned(), 1.0),
    }
}

/// Degrees of freedom in words; a number beyond 10 000 is meaningless.
fn freedom(free: Option<f64>) -> String {
    match free {
        Some(free) if free < 1e4 => format!("{free:.0}"),
        _ => "∞".to_owned(),
    }
}

/// The name of a result with its unit, if it has one.
fn with_unit(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} ({unit})"),
    }
}

fn results(calibration: &Calibration) -> Chapter {
    let row = |result: &CalibrationResult| {
        let combined = &result.combined;
        let (unit, size) = prefixed(result);
        let digits = decimals(combined.u / size);
        let number = |value: f64| GridCell::from(number(value / size, digits));
        let free = combined.degrees_of_freedom;
        let before = result.before.filter(|before| *before != 0.0);
        let change = before.map(|before| signed(100.0 * (combined.value / before - 1.0), 2));
        vec![
            with_unit(result.name, &unit).into(),
            number(combined.value),
            number(combined.u),
            freedom(free).into(),
            format!("{:.2}", combined.coverage_factor).into(),
            number(combined.expanded),
            format!("{:.3}", 100.0 * combined.expanded / combined.value.abs()).into(),
            change.unwrap_or_else(|| DASH.to_owned()).into(),
        ]
    };
    let rows = calibration.results.iter().map(row);
    let table = Grid::new(
        "result | value | u | ~ν | k | U (95 %) | ~U (%) | ~change (%)",
        rows,
    );
    let correlations = calibration.correlations.iter().map(|one| {
        let [a, b] = one.results;
        vec![format!("{a} and {b}").into(), signed(one.correlation, 3).into()]
    });
    let correlations = Grid::new("correlation of | r", correlations);
    Chapter::new("Results").table(table).table(correlations).text(
        "u is the combined standard uncertainty, U = k u the expanded one, for a coverage of 95 % (JCGM 100; k by \
         Student's t with ν degrees of freedom).",
    )
}

fn budget(result: &CalibrationResult) -> Chapter {
    let row = |BudgetRow {
                   input,
                   sensitivity,
                   share_percent,
               }: &BudgetRow| {
        vec![
            GridCell::from(input.name.as_str()),
            significant(input.value, 6).into(),
            significant(input.u, 2).into(),
            input.unit.into(),
            input.evaluation.into(),
            input.distribution.into(),
            freedom(input.degrees_of_freedom).into(),
            significant(*sensitivity, 3).into(),
            format!("{share_percent:.1}").into(),
        ]
    };
    let rows = result.inputs.iter().map(row);
    let headings = "input | value | u | ~unit | type | ~distribution | ~ν | ~sensitivity | % of u²";
    let table = Grid::new(headings, rows);
    Chapter::new(format!("Uncertainty budget: {}", result.name)).table(table.group(result.name))
}

fn observations(calibration: &Calibration) -> Chapter {
    let Some(first) = calibration.observations.first() else {
        return Chapter::new("Observations");
    };
    // A narrow page has room only for the first value and the last, the result of the observation.
    let last = first.values.len().saturating_sub(1);
    let headings = first.values.iter().enumerate().map(|(place, value)| {
        let mark = if (1..last).contains(&place) { "~" } else { "" };
        format!("{mark}{}", with_unit(value.name, value.unit))
    });
    let headings: Vec<_> = std::iter::once("observation".to_owned())
        .chain(headings)
        .collect();
    let rows = calibration.observations.iter().map(|observation| {
        let values = observation.values.iter();
        let values = values.map(|value| GridCell::from(significant(value.value, 5)));
        std::iter::once(observation.subject.as_str().into())
            .chain(values)
            .collect()
    });
    Chapter::new("Observations").table(Grid::new(&headings.join("|"), rows))
}
