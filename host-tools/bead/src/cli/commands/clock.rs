//! `bead clock`: how a bead's clock runs against the host's, and beads against one another.

use chrono::{DateTime, SecondsFormat};

use crate::cli::commands::prelude::*;
use bead_recording::clock::{ClockComparison, RecordedBoot, compare};

const AFTER_HELP: &str = "\
Drift is the rate at which a bead's clock gains; below zero it loses. Drift against the host comes from the \
receive times of the recording: a minute gives it to a few ppm, ten minutes to a tenth of a ppm, as far as delays \
allow. With several recordings, beads whose sync inputs saw the same edges are put on the time of the first \
bead, to tens of ns. Their strikes are put on that time too.

Examples:
  bead clock strikes.mcap
  bead clock bead-5.mcap bead-8.mcap --format json \\
      | jq '.strikes[] | [.recording, .arrival_s]'";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recordings. The bead of the first gives the time for all.
    #[arg(required = true, value_name = "F.mcap")]
    recordings: Vec<PathBuf>,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let report = compare(&arguments.recordings)?;
    for what in &report.left_out {
        note!("left out: {what}");
    }
    for clock in report.clocks.iter().filter(|clock| !clock.in_real_time) {
        let times = times_as_fast(clock.drift_ppm.unwrap_or(0.0));
        note!("{}: {times}", named(&clock.place));
    }
    output::print(arguments.format, &report, || table(&report))
}

/// Text in place of the drift of a clock without one.
pub(crate) fn times_as_fast(ppm: f64) -> String {
    format!(
        "the bead's time passed {:.2} times as fast as the host's, so this says nothing about its crystal (an emulated \
         bead keeps time with pace = 1.0 under [clock])",
        1.0 + ppm * 1e-6
    )
}

/// Host time in ns since 1970, as people and programs read it.
pub(crate) fn rfc3339(unix_ns: i64) -> String {
    DateTime::from_timestamp_nanos(unix_ns).to_rfc3339_opts(SecondsFormat::Nanos, true)
}

/// A drift with its uncertainty. Without an uncertainty nothing is known of the drift.
pub(crate) fn drift(ppm: f64, uncertainty: Option<f64>) -> [String; 2] {
    match uncertainty {
        Some(within) => [figures(ppm, within), figures(within, within)],
        None => ["-".to_owned(), "-".to_owned()],
    }
}

/// A number with as many decimals as its uncertainty supports: two digits of the uncertainty.
fn figures(value: f64, within: f64) -> String {
    let decimals = (1.0 - within.abs().max(1e-6).log10()).ceil().clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

fn named(place: &RecordedBoot) -> String {
    let mut name = place.recording.display().to_string();
    for (what, number) in [("address", place.address.into()), ("boot", place.boot)] {
        if number != 0 {
            name += &format!(", {what} {number}");
        }
    }
    name
}

const CLOCKS: &str = "against this host | index 0 was at | for s | frames | drift ppm | ± | residual µs | delay µs \
                      | edges | missed";

fn table(report: &ClockComparison) -> String {
    let [micro, nano] = [1e6, 1e9].map(|unit| move |seconds: f64| format!("{:.1}", seconds * unit));
    let clocks = report.clocks.iter().map(|clock| {
        let [ppm, within] = drift(clock.drift_ppm.unwrap_or(0.0), clock.drift_uncertainty_ppm);
        [
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
        ]
    });
    let mut parts = vec![output::table(CLOCKS, clocks)];
    let Some(reference) = &report.reference else {
        return parts.concat();
    };
    let alignments = report.alignments.iter().map(|alignment| {
        let of = &alignment.alignment;
        let [ppm, within] = match of.drift_uncertainty_ppm {
            None => [format!("{:.4}", of.drift_ppm), "-".to_owned()],
            uncertainty => drift(of.drift_ppm, uncertainty),
        };
        [
            named(&alignment.place),
            alignment.edges_in_common.to_string(),
            format!("{:.9}", alignment.offset_s),
            ppm,
            within,
            nano(of.residual_rms_s),
            nano(of.residual_max_s),
        ]
    });
    let header = format!(
        "against {} | edges in common | index 0 was at s | drift ppm | ± | residual ns | largest ns",
        named(reference)
    );
    parts.push(output::table(&header, alignments));
    if !report.strikes.is_empty() {
        let strikes = report.strikes.iter().map(|strike| {
            let arrival = format!("{:.9}", strike.arrival_s);
            let rise = strike.rise_s.map_or("-".to_owned(), |rise| format!("{rise:.9}"));
            [named(&strike.place), strike.strike.to_string(), rise, arrival]
        });
        let header = "strike at | number | half force at s | peak at s";
        parts.push(output::table(header, strikes));
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
}
