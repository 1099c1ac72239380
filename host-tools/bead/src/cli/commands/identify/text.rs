//! The result of `bead identify` for people.

use bead_compare::report::{DASH, count};
use bead_console::output;
use bead_identify::report::{BeadResult, IdentifyReport, QuantityResult};

/// The tables of all beads, each below its heading.
pub(super) fn text(report: &IdentifyReport) -> String {
    let all: Vec<_> = report
        .beads
        .iter()
        .map(|bead| of_bead(report.method(), bead))
        .collect();
    all.join("\n\n")
}

/// A number with `digits` significant digits.
fn number(value: f64, digits: i32) -> String {
    output::significant(value, digits, -3..7)
}

fn percent(part: Option<f64>) -> String {
    part.map_or_else(|| DASH.to_owned(), |part| number(100.0 * part, 2))
}

fn of_bead(method: &str, bead: &BeadResult) -> String {
    let heading = format!(
        "bead {}, {} of {}",
        bead.address,
        method,
        count(bead.strikes.len() as u64, "strike")
    );
    let mut parts = vec![heading, quantities(&bead.quantities)];
    parts.extend(correlations(bead));
    parts.extend(recordings(bead));
    parts.push(lines(bead));
    parts.join("\n\n")
}

fn quantities(quantities: &[QuantityResult]) -> String {
    let row = |one: &QuantityResult| {
        let error = one.standard_error.map(|error| error / one.value);
        let ends = one
            .interval
            .map(|[low, high]| format!("{} to {}", number(low, 6), number(high, 6)));
        [
            format!("{} {}", one.symbol, one.unit).trim().to_owned(),
            number(one.start, 6),
            number(one.value, 6),
            percent(error),
            ends.unwrap_or_else(|| output::either(one.held_because.is_some(), "held: see below", "held")),
            percent(one.relative_uncertainty),
        ]
    };
    output::table(
        "quantity | start | value | error % | interval 95 % | u %",
        quantities.iter().map(row),
    )
}

fn fitted(bead: &BeadResult) -> Vec<&QuantityResult> {
    bead.quantities.iter().filter(|one| one.fitted).collect()
}

fn correlations(bead: &BeadResult) -> Option<String> {
    let fitted = fitted(bead);
    if fitted.len() < 2 {
        return None;
    }
    let names: Vec<&str> = fitted.iter().map(|one| one.symbol).collect();
    let rows = names
        .iter()
        .zip(&bead.correlations)
        .enumerate()
        .map(|(at, (name, row))| {
            let cells = row
                .iter()
                .take(at + 1)
                .map(|part| format!("{part:+.3}").replace('-', "−"));
            let empty = names.len() - at - 1;
            let cells = std::iter::once((*name).to_owned()).chain(cells);
            cells
                .chain(std::iter::repeat_n(String::new(), empty))
                .collect::<Vec<_>>()
        });
    Some(output::table(
        &format!("correlation | {}", names.join(" | ")),
        rows,
    ))
}

fn recordings(bead: &BeadResult) -> Option<String> {
    if bead.recordings.is_empty() {
        return None;
    }
    let names: Vec<String> = fitted(bead)
        .iter()
        .map(|one| format!("{} {} | ± %", one.symbol, one.unit))
        .collect();
    let rows = bead.recordings.iter().map(|one| {
        let mut row = vec![one.recording.clone(), one.strikes.to_string()];
        for (value, error) in one.values.iter().zip(&one.relative_errors) {
            row.extend([number(*value, 6), number(100.0 * error, 2)]);
        }
        row
    });
    let header = format!("by itself | strikes | {}", names.join(" | "));
    Some(output::table(&header, rows))
}

/// Goodness, noise, what was held and why, and doubts, in lines.
fn lines(bead: &BeadResult) -> String {
    let goodness = &bead.goodness;
    let mut lines = vec![format!(
        "χ²/ν = {:.3} with ν = {:.0}, p = {:.3}; errors by the scatter of the samples{}",
        goodness.chi_squared / goodness.degrees_of_freedom,
        goodness.degrees_of_freedom,
        goodness.probability,
        if goodness.error_scale > 1.0 {
            format!(", enlarged by {:.2}", goodness.error_scale)
        } else {
            String::new()
        }
    )];
    let noise = bead.noise.iter().map(|one| {
        let unit = if one.channel.ends_with("force") {
            "N"
        } else {
            "m/s²"
        };
        let colour = match one.order {
            0 => "white".to_owned(),
            order => format!("{order} lags"),
        };
        format!(
            "{} {} {unit} ({colour})",
            one.channel.replace('_', " "),
            number(one.deviation, 3)
        )
    });
    lines.push(format!("noise: {}", noise.collect::<Vec<_>>().join(", ")));
    lines.extend(bead.quantities.iter().filter_map(|one| {
        let why = one.held_because.as_ref()?;
        let value = number(one.value, 6);
        Some(format!("{} is held at {value} {}: {why}", one.symbol, one.unit))
    }));
    let lacking: Vec<&str> = fitted(bead)
        .iter()
        .filter(|one| one.relative_uncertainty.is_none())
        .map(|one| one.symbol)
        .collect();
    if !lacking.is_empty() {
        lines.push(format!(
            "u of {} is unknown: [uncertainty] of the settings does not state that of the held quantities; add it, or give --uncertainty",
            lacking.join(", ")
        ));
    }
    lines.extend(bead.doubts.iter().map(|doubt| format!("doubt: {}", doubt.text)));
    lines.join("\n")
}
