//! `bead clock`: how a bead's clock runs against the host's, and beads against one another.

use std::path::PathBuf;

use chrono::{DateTime, SecondsFormat};
use clap::Args;

use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::recording::clock::{Place, Report, compare};

const AFTER_HELP: &str = "\
Drift is how fast a bead's clock is; below zero it is slow. Against the host it comes from the receive times of the
recording: a minute tells it to some ppm, ten minutes to a tenth of one, as far as delays allow. With several recordings, beads whose
sync inputs saw the same edges are put on the time of the first, to tens of ns, and their strikes with them.

Examples:
  bead clock strikes.mcap
  bead clock bead-5.mcap bead-8.mcap --format json | jq '.strikes[] | [.recording, .arrival_s]'";

/// Arguments of `bead clock`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recordings; the first one's bead gives the time of all.
    #[arg(required = true, value_name = "F.mcap")]
    recordings: Vec<PathBuf>,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let report = compare(&arguments.recordings)?;
    match arguments.format {
        Format::Json => output::print_json(&report),
        Format::Table => output::print_line(&table(&report)),
    }
}

/// Host time in ns since 1970, as people and programs read it.
pub(crate) fn rfc3339(unix_ns: i64) -> String {
    DateTime::from_timestamp_nanos(unix_ns).to_rfc3339_opts(SecondsFormat::Nanos, true)
}

/// A drift with its uncertainty; with none, nothing is known of it.
pub(crate) fn drift(ppm: f64, uncertainty: Option<f64>) -> [String; 2] {
    match uncertainty {
        Some(within) => [figures(ppm, within), figures(within, within)],
        None => ["-".to_owned(), "-".to_owned()],
    }
}

/// As many decimals as the uncertainty leaves: its first figure but one.
fn figures(value: f64, within: f64) -> String {
    let decimals = (1.0 - within.abs().max(1e-6).log10()).ceil().clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

fn named(place: &Place) -> String {
    match place.boot {
        0 => place.recording.display().to_string(),
        boot => format!("{}, boot {boot}", place.recording.display()),
    }
}

fn table(report: &Report) -> String {
    let micro = |seconds: f64| format!("{:.1}", seconds * 1e6);
    let mut clocks = output::table([
        "against this host",
        "index 0 was at",
        "for s",
        "frames",
        "drift ppm",
        "±",
        "residual µs",
        "delay µs",
        "edges",
        "missed",
    ]);
    for clock in &report.clocks {
        let [ppm, within] = drift(clock.drift_ppm.unwrap_or(0.0), clock.drift_uncertainty_ppm);
        clocks.add_row([
            named(&clock.place),
            rfc3339(clock.started_unix_ns),
            format!("{:.1}", clock.span_s),
            clock.frames.to_string(),
            ppm,
            within,
            micro(clock.residual_s),
            micro(clock.delay_s),
            clock.edges.to_string(),
            clock.edges_missed.to_string(),
        ]);
    }
    let mut parts = vec![output::table_text(&clocks)];
    let Some(reference) = &report.reference else {
        return parts.concat();
    };
    let nano = |seconds: f64| format!("{:.1}", seconds * 1e9);
    let mut alignments = output::table([
        format!("against {}", named(reference)),
        "edges in common".to_owned(),
        "index 0 was at s".to_owned(),
        "drift ppm".to_owned(),
        "±".to_owned(),
        "residual ns".to_owned(),
        "largest ns".to_owned(),
    ]);
    for alignment in &report.alignments {
        let [ppm, within] = match alignment.drift_uncertainty_ppm {
            None => [format!("{:.4}", alignment.drift_ppm), "-".to_owned()],
            uncertainty => drift(alignment.drift_ppm, uncertainty),
        };
        alignments.add_row([
            named(&alignment.place),
            alignment.edges_in_common.to_string(),
            format!("{:.9}", alignment.offset_s),
            ppm,
            within,
            nano(alignment.residual_rms_s),
            nano(alignment.residual_max_s),
        ]);
    }
    parts.push(output::table_text(&alignments));
    if !report.strikes.is_empty() {
        let mut strikes = output::table(["strike at", "number", "arrived at s"]);
        for strike in &report.strikes {
            strikes.add_row([
                named(&strike.place),
                strike.strike.to_string(),
                format!("{:.9}", strike.arrival_s),
            ]);
        }
        parts.push(output::table_text(&strikes));
    }
    parts.join("\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_has_no_more_figures_than_its_uncertainty_has() {
        assert_eq!(drift(12.345_678, Some(0.0234)), ["12.346", "0.023"]);
        assert_eq!(drift(-7.6, Some(15.2)), ["-8", "15"]);
        assert_eq!(drift(3.0, None), ["-", "-"]);
    }

    #[test]
    fn host_time_is_written_to_the_nanosecond() {
        assert_eq!(
            rfc3339(1_700_000_000_123_456_789),
            "2023-11-14T22:13:20.123456789Z"
        );
    }
}
