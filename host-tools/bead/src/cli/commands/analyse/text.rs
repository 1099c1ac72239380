//! The result of `bead analyse` as a table for people.

use crate::cli::commands::analyse::report::AnalyseReport;
use bead_compare::report::{DASH, count};
use bead_console::output;
use bead_spectra::bead::{BeadSpectrum, Points, SpectrumPoint, TransferPoint};

/// The tables of all beads, each below its heading.
pub(super) fn text(report: &AnalyseReport) -> String {
    let of_bead = |bead: &BeadSpectrum| {
        let heading = format!(
            "bead {}, {}: {}{}, in {}",
            bead.address,
            count(bead.strikes.len() as u64, "strike"),
            report.name(),
            report.conditions(),
            bead.unit
        );
        let table = match &bead.points {
            Points::Spectrum(points) => spectrum(points),
            Points::Transfer(points) => transfer(points),
        };
        format!("{heading}\n\n{table}\n\n{}", limits(report, bead))
    };
    let all: Vec<_> = report.beads.iter().map(of_bead).collect();
    all.join("\n\n")
}

/// A number with four digits.
fn number(value: f64) -> String {
    output::significant(value, 4, -4..6)
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| DASH.to_owned(), number)
}

fn hertz(frequency: f64) -> String {
    format!("{frequency:.1}")
}

fn spectrum(points: &[SpectrumPoint]) -> String {
    let several = points.iter().any(|point| point.standard_deviation.is_some());
    let is_shock = points.iter().any(|point| point.peaks.is_some());
    let has_phase = points.iter().any(|point| point.phase_rad.is_some());
    let mut header = String::from("Hz");
    header += match (several, is_shock) {
        (true, _) => " | mean | u | deviation | envelope | P95/50",
        (false, true) => " | maximax | u",
        (false, false) => " | value | u",
    };
    if is_shock {
        header += " | primary | residual | positive | negative";
    }
    if has_phase {
        header += " | phase °";
    }
    let row = |point: &SpectrumPoint| {
        let mut row = vec![hertz(point.frequency_hz), number(point.mean), or_dash(point.u)];
        if several {
            row.extend([
                or_dash(point.standard_deviation),
                number(point.envelope),
                or_dash(point.upper_95_50),
            ]);
        }
        if let Some(peaks) = &point.peaks {
            row.extend([peaks.primary, peaks.residual, peaks.positive, peaks.negative].map(number));
        }
        if has_phase {
            let phase = point.phase_rad.map(|phase| format!("{:.1}", phase.to_degrees()));
            row.push(phase.map_or_else(|| DASH.to_owned(), |phase| phase.replace('-', "−")));
        }
        row
    };
    output::table(&header, points.iter().map(row))
}

fn transfer(points: &[TransferPoint]) -> String {
    let row = |point: &TransferPoint| {
        let phase = point
            .phase_rad
            .map(|phase| format!("{:.1}", phase.to_degrees()).replace('-', "−"));
        let coherence = point.coherence.map(|part| format!("{part:.4}"));
        [
            hertz(point.frequency_hz),
            or_dash(point.magnitude),
            or_dash(point.u),
            phase.unwrap_or_else(|| DASH.to_owned()),
            coherence.unwrap_or_else(|| DASH.to_owned()),
        ]
    };
    output::table("Hz | magnitude | u | phase ° | coherence", points.iter().map(row))
}

/// Limits of the numbers, in lines.
fn limits(report: &AnalyseReport, bead: &BeadSpectrum) -> String {
    let mut lines = vec![format!(
        "from {:.1} Hz, one period in the window, to {:.0} Hz at {:.0} samples a second",
        bead.lowest_hz, bead.highest_hz, bead.sample_rate_hz
    )];
    lines.push(match bead.gain_uncertainty {
        Some(part) => format!("u of the scale: {:.2} %, up to 5 kHz", 100.0 * part),
        None => "u: unknown, as the settings do not state it or a flag casts doubt on the scale".to_owned(),
    });
    if !report.is_of_force() {
        let zero = number(bead.zero_uncertainty_mps2);
        lines.push(format!("zero of the acceleration: ± {zero} m/s² (u)"));
    }
    if let (Points::Transfer(_), 1) = (&bead.points, bead.strikes.len()) {
        lines.push("coherence needs at least two strikes".to_owned());
    }
    lines.join("\n")
}
