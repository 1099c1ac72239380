//! The report of a strike against the record of another instrument.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series};

use crate::pictures::{ends, wide};
use crate::reference::{Absorbed, AgainstReference, AlignedPoint, AlignedQuantity, BothSides};
use crate::report::{Chapter, EnergyUnit, Fact, Grid, GridCell, Report, number, percent, signed};

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
    /// The reason for the failure, if there is one.
    pub failure: Option<&'a str>,
    /// Command, versions and date of the report.
    pub made: &'a [Fact],
}

impl ComparedReference<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        let failure = self.failure.map(str::to_owned);
        let made = Chapter::facts("How it was made", self.made.iter().cloned());
        let tiles = self
            .quantities()
            .flat_map(|(name, _, aligned)| tiles(name, aligned));
        Report {
            above: format!("{} · strike {}", self.recording, self.strike),
            title: format!("The bead against {}", self.reference),
            verdict: failure.map_or(Ok("Replay is identical"), Err),
            tiles: tiles.collect(),
            sections: vec![self.pictures(), self.tables(), made],
        }
    }

    fn quantities(&self) -> impl Iterator<Item = (&'static str, &'static str, &AlignedQuantity)> {
        let both = [
            ("force", "N", &self.against.force),
            ("acceleration", "m/s²", &self.against.acceleration),
        ];
        both.into_iter()
            .filter_map(|(name, unit, aligned)| Some((name, unit, aligned.as_ref()?)))
    }

    fn pictures(&self) -> Chapter {
        let text = "The reference is shifted by the delay and scaled by the gain that fit best. Below is what is left of the \
                    bead’s samples when the reference is subtracted.";
        let section = Chapter::new("One over the other").text(text);
        self.quantities().fold(section, |section, (name, unit, aligned)| {
            section.chart(chart(name, unit, &aligned.points))
        })
    }

    fn tables(&self) -> Chapter {
        let table = |name: &str, rows| Grid::new(" | bead | reference | bead off by", rows).group(name);
        let section = Chapter::new("In numbers");
        let section = self.quantities().fold(section, |section, (name, unit, aligned)| {
            section.table(table(name, rows(aligned, unit)))
        });
        let estimates = [
            ("A, measured", &self.against.absorbed_measured),
            ("B, predicted", &self.against.absorbed_predicted),
        ];
        let energies = estimates
            .iter()
            .flat_map(|(_, absorbed)| [Some(absorbed.bead), absorbed.reference]);
        let unit = EnergyUnit::of(energies.flatten());
        let rows = estimates.map(|(name, absorbed)| absorbed_row(name, absorbed, unit));
        let bits = self.failure.map_or("identical", |_| "differ");
        let bits = vec![vec!["bits of device and replay".into(), bits.into()]];
        let text = "The reference’s energies are those of the same estimators in floating point on the reference’s values, \
                    without the gain.";
        let section = section.table(table("absorbed energy", rows.into()));
        section.table(table("", bits)).text(text)
    }
}

fn tiles(name: &str, aligned: &AlignedQuantity) -> [(String, String); 3] {
    let tile = |value: String, of: &str| (value, of.replace("{}", name));
    let part = format!("{:.2} %", aligned.residual_part * 100.0);
    [
        tile(format!("{:.5}", aligned.correlation), "correlation of the {}"),
        tile(format!("{:.4}", aligned.gain), "gain of the {}"),
        tile(part, "rms residual of the {}, of its peak"),
    ]
}

/// The rows of one quantity, whose values have this unit.
fn rows(aligned: &AlignedQuantity, unit: &str) -> Vec<Vec<GridCell>> {
    // Five digits.
    let shown = |value: f64| {
        let digits = (4.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
        number(value, digits)
    };
    let square = match unit {
        "N" => "energy ∫F² dt (N²·s)",
        _ => "energy ∫a² dt (m²/s³)",
    };
    let sides = |name: String, sides: &BothSides| {
        let [bead, reference] = [sides.bead, sides.reference].map(shown);
        [name, bead, reference, percent(sides.off())]
    };
    let one = |name: &str, value: String, off: &str| [name, &value, "", off].map(str::to_owned);
    let AlignedQuantity {
        arrival,
        gain,
        residual_rms,
        ..
    } = aligned;
    let part = format!("{:.3} % of the peak", aligned.residual_part * 100.0);
    let residual = format!("residual, rms ({unit})");
    let [in_bead, in_file] = [arrival.bead, arrival.reference].map(|time| number(time * 1e3, 5));
    let name = "arrival: since the trigger, in the file (ms)".to_owned();
    let late = format!("{} µs", signed(aligned.arrival_off * 1e6, 3));
    let rows = [
        one("correlation", format!("{:.6}", aligned.correlation), ""),
        one("gain: bead = gain × reference", format!("{gain:.5}"), ""),
        [name, in_bead, in_file, late],
        sides(format!("peak ({unit})"), &aligned.peak),
        sides(square.to_owned(), &aligned.energy),
        one(&residual, format!("{residual_rms:.5}"), &part),
    ];
    rows.map(|row| row.map(GridCell::from).into()).into()
}

fn absorbed_row(name: &str, absorbed: &Absorbed, unit: EnergyUnit) -> Vec<GridCell> {
    let reference = absorbed.reference.filter(|joules| *joules > 0.0);
    vec![
        format!("{name} ({})", unit.symbol).into(),
        unit.number(absorbed.bead, 3).into(),
        GridCell::known(reference.map(|joules| unit.number(joules, 3))),
        GridCell::known(reference.map(|joules| percent(absorbed.bead / joules - 1.0))),
    ]
}

/// Both curves, and their difference below them.
fn chart(name: &str, unit: &str, points: &[AlignedPoint]) -> Chart {
    let series = |name: &str, ink, mark, of: fn(&AlignedPoint) -> f64| {
        let points = points.iter().map(|point| (point.time * 1e3, of(point)));
        Series::new(name, ink, mark, points)
    };
    let both = vec![
        series("gain × reference", Ink::Chain, Mark::Broad, |at| at.reference),
        series("bead", Ink::Sensed, Mark::Dots, |at| at.bead),
    ];
    let residual = |at: &AlignedPoint| at.bead - at.reference;
    let residual = series("bead − gain × reference", Ink::Sensed, Mark::Dots, residual);
    let panels = vec![
        Panel::new(format!("{name} ({unit})"), both).height(230),
        Panel::new(format!("residual ({unit})"), vec![residual]).height(140),
    ];
    let [from, to] = ends(points, |point| point.time);
    let x = Axis::new("time since the bead’s trigger (ms)", from * 1e3..to * 1e3);
    let description = format!("The {name} by the bead and by the reference over time, and their difference");
    wide(&description, x, panels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::compare;
    use crate::testing::{recorded_strike, waveform};
    use bead_instrument::Trace;
    use bead_recording::signal::Signal;

    #[test]
    fn a_reference_without_an_acceleration_is_compared_by_its_force() {
        let strike = recorded_strike();
        let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
        let waveform = waveform(Some(Trace::even(signal.force, 1e5)), None);
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
        for part in ["force (N)", "residual (N)", "trigger (ms)", "A, measured (nJ)"] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("acceleration (m/s²)"));
        let measured = terminal.lines().find(|line| line.contains("A, measured"));
        assert!(measured.unwrap().ends_with('–'), "{terminal}");
    }
}
