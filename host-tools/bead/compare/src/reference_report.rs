//! The report of a strike against the record of another instrument.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::reference::{Absorbed, AgainstReference, Aligned, Point, Sides};
use crate::report::{Cell, EnergyUnit, Fact, Report, Section, Table, number, percent, signed};

/// A strike against a reference, and what is known of both.
#[derive(Debug)]
pub struct ComparedReference<'a> {
    /// The recording's name.
    pub recording: &'a str,
    /// The reference's name.
    pub reference: &'a str,
    /// The strike, as its bead counts it.
    pub strike: u32,
    /// The comparison.
    pub against: &'a AgainstReference,
    /// The reason of the failure, if there is one.
    pub failure: Option<&'a str>,
    /// Command, versions and date of the report.
    pub made: &'a [Fact],
}

impl ComparedReference<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        Report {
            above: format!("{} · strike {}", self.recording, self.strike),
            title: format!("The bead against {}", self.reference),
            verdict: self
                .failure
                .map_or(Ok("Replay is identical"), |why| Err(why.to_owned())),
            tiles: self
                .quantities()
                .flat_map(|(name, _, aligned)| tiles(name, aligned))
                .collect(),
            sections: vec![
                self.pictures(),
                self.tables(),
                Section::facts("How it was made", self.made.iter().cloned()),
            ],
        }
    }

    fn quantities(&self) -> impl Iterator<Item = (&'static str, &'static str, &Aligned)> {
        let both = [
            ("force", "N", &self.against.force),
            ("acceleration", "m/s²", &self.against.acceleration),
        ];
        both.into_iter()
            .filter_map(|(name, unit, aligned)| Some((name, unit, aligned.as_ref()?)))
    }

    fn pictures(&self) -> Section {
        let text = "The reference is shifted by the delay and scaled by the gain that fit best. Below is what is left of the \
                    bead’s samples when it is subtracted.";
        let section = Section::new("One over the other").text(text);
        self.quantities().fold(section, |section, (name, unit, aligned)| {
            section.chart(chart(name, unit, &aligned.points))
        })
    }

    fn tables(&self) -> Section {
        let table = |name: &str, rows| Table::new(" | bead | reference | bead off by", rows).group(name);
        let section = Section::new("In numbers");
        let section = self.quantities().fold(section, |section, (name, unit, aligned)| {
            section.table(table(name, rows(aligned, unit)))
        });
        let estimates = [
            ("A, measured", &self.against.absorbed_measured),
            ("B, predicted", &self.against.absorbed_predicted),
        ];
        let unit = EnergyUnit::of(
            estimates
                .iter()
                .flat_map(|(_, absorbed)| [Some(absorbed.bead), absorbed.reference].into_iter().flatten()),
        );
        let rows = estimates.map(|(name, absorbed)| absorbed_row(name, absorbed, unit));
        let bits = if self.failure.is_none() {
            "identical"
        } else {
            "differ"
        };
        let bits = vec![vec!["bits of device and replay".into(), bits.into()]];
        let text = "The reference’s energies are those of the same estimators in floating point on the reference’s values, \
                    without the gain.";
        section
            .table(table("absorbed energy", rows.into()))
            .table(table("", bits))
            .text(text)
    }
}

fn tiles(name: &str, aligned: &Aligned) -> [(String, String); 3] {
    [
        (
            format!("{:.5}", aligned.correlation),
            format!("correlation of the {name}"),
        ),
        (format!("{:.4}", aligned.gain), format!("gain of the {name}")),
        (
            format!("{:.2} %", aligned.residual_part * 100.0),
            format!("residual of the {name}, rms, of its peak"),
        ),
    ]
}

/// The rows of one quantity, whose values have this unit.
fn rows(aligned: &Aligned, unit: &str) -> Vec<Vec<Cell>> {
    // Five digits.
    let shown = |value: f64| {
        let digits = (4.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
        number(value, digits)
    };
    let square = if unit == "N" {
        "energy ∫F² dt (N²·s)"
    } else {
        "energy ∫a² dt (m²/s³)"
    };
    let sides = |name: String, sides: &Sides| -> Vec<Cell> {
        [
            name,
            shown(sides.bead),
            shown(sides.reference),
            percent(sides.off()),
        ]
        .map(Cell::from)
        .into()
    };
    let one = |name: String, value: String, off: String| -> Vec<Cell> {
        [name, value, String::new(), off].map(Cell::from).into()
    };
    let arrival = [
        "arrival: since the trigger, in the file (ms)".to_owned(),
        number(aligned.arrival.bead * 1e3, 5),
        number(aligned.arrival.reference * 1e3, 5),
        format!("{} µs", signed(aligned.arrival_off * 1e6, 3)),
    ];
    vec![
        one(
            "correlation".to_owned(),
            format!("{:.6}", aligned.correlation),
            String::new(),
        ),
        one(
            "gain: bead = gain × reference".to_owned(),
            format!("{:.5}", aligned.gain),
            String::new(),
        ),
        arrival.map(Cell::from).into(),
        sides(format!("peak ({unit})"), &aligned.peak),
        sides(square.to_owned(), &aligned.energy),
        one(
            format!("residual, rms ({unit})"),
            format!("{:.5}", aligned.residual_rms),
            format!("{:.3} % of the peak", aligned.residual_part * 100.0),
        ),
    ]
}

fn absorbed_row(name: &str, absorbed: &Absorbed, unit: EnergyUnit) -> Vec<Cell> {
    let reference = absorbed.reference.filter(|joules| *joules > 0.0);
    vec![
        format!("{name} ({})", unit.symbol).into(),
        unit.number(absorbed.bead, 3).into(),
        Cell::known(reference.map(|joules| unit.number(joules, 3))),
        Cell::known(reference.map(|joules| percent(absorbed.bead / joules - 1.0))),
    ]
}

/// Both curves, and their difference below them.
fn chart(name: &str, unit: &str, points: &[Point]) -> Chart {
    let series = |name: &str, ink, mark, of: fn(&Point) -> f64| Series {
        name: name.to_owned(),
        ink,
        mark,
        points: points.iter().map(|point| (point.time * 1e3, of(point))).collect(),
    };
    let range = match (points.first(), points.last()) {
        (Some(first), Some(last)) => first.time * 1e3..last.time * 1e3,
        _ => 0.0..1.0,
    };
    let panels = vec![
        Panel::new(
            format!("{name} ({unit})"),
            vec![
                series("gain × reference", Ink::Chain, Mark::Broad, |point| {
                    point.reference
                }),
                series("bead", Ink::Sensed, Mark::Dots, |point| point.bead),
            ],
        )
        .height(230),
        Panel::new(
            format!("residual ({unit})"),
            vec![series(
                "bead − gain × reference",
                Ink::Sensed,
                Mark::Dots,
                |point| point.bead - point.reference,
            )],
        )
        .height(140),
    ];
    Chart {
        description: format!("The {name} by the bead and by the reference over time, and their difference"),
        width: WIDTH,
        ..Chart::new(Axis::new("time since the bead’s trigger (ms)", range), panels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::compare;
    use crate::testing::recorded_strike;
    use bead_instrument::{Trace, Waveform};
    use bead_recording::signal::Signal;

    #[test]
    fn a_reference_without_an_acceleration_is_compared_by_its_force() {
        let strike = recorded_strike();
        let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
        let waveform = Waveform {
            force: Some(Trace::even(signal.force, 1e5)),
            acceleration: None,
            start: 0.0,
            remarks: Vec::new(),
        };
        let against = compare(&strike, &waveform).unwrap();
        let compared = ComparedReference {
            recording: "r.mcap",
            reference: "scope.csv",
            strike: 3,
            against: &against,
            failure: None,
            made: &[("command", "bead compare".to_owned())],
        };
        let report = compared.report();
        let (page, terminal) = (report.page().unwrap(), report.terminal());
        for part in [
            "force (N)",
            "residual (N)",
            "time since the bead’s trigger (ms)",
            "A, measured (nJ)",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("acceleration (m/s²)"));
        let measured = terminal
            .lines()
            .find(|line| line.contains("A, measured"))
            .unwrap();
        assert!(measured.ends_with('–'), "{terminal}");
    }
}
