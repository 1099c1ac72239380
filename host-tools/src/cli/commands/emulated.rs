//! Tables of `bead emulate`: of one bead, and of several.

use crate::bench::emulation::RunTruth;
use crate::bench::sensed::Truth;
use crate::cli::output;
use crate::comparison::given::Given;
use crate::comparison::run::{MeasuredStrike, RunReport};

/// Of one bead.
pub(super) fn table(report: &RunReport) -> String {
    let mut parts = vec![strikes(report), counts(report)];
    if !report.provoked.is_empty() {
        parts.push(provoked(report));
    }
    if !report.faults.is_empty() {
        parts.push(reported(report));
    }
    parts.push(instructions(report));
    if !report.unknown_registers.is_empty() {
        let registers = report.unknown_registers.join(", ");
        parts.push(format!("registers without a model: {registers}"));
    }
    if let Some(recording) = &report.recording {
        parts.push(format!("recording: {}", recording.display()));
    }
    parts.join("\n\n")
}

const STRIKES: &str = "strike at sample | peak force (N) | truth | A measured (nJ) | B predicted (nJ) | truth \
                       | A off | B off | replay | flags";

fn strikes(report: &RunReport) -> String {
    if report.played {
        return output::table(PLAYED, report.measured().map(played_row));
    }
    output::table(STRIKES, report.measured().map(strike_row))
}

const PLAYED: &str = "strike at sample | peak force (N) | given | A measured (nJ) | of the given | B predicted (nJ) \
                      | of the given | A off | B off | replay | flags";

/// A strike of a waveform that was played: each estimate beside what f64 makes of the waveform.
fn played_row(strike: &MeasuredStrike) -> [String; 11] {
    let given = |of: fn(&Given) -> Option<f64>| strike.given.as_ref().and_then(of);
    let (peak, a, b) = (
        given(|given| given.peak_force),
        given(|given| given.absorbed_measured),
        given(|given| given.absorbed_predicted),
    );
    let shown = |value: Option<f64>, scale: f64, digits: usize| {
        value.map_or("-".to_owned(), |value| format!("{:.digits$}", value * scale))
    };
    let off = |joule: f64, given: Option<f64>| match given {
        Some(given) if given > 0.0 => format!("{:+.3} %", (joule / given - 1.0) * 100.0),
        _ => "-".to_owned(),
    };
    let flags = strike.flags.join(", ");
    [
        strike.sample_index.to_string(),
        format!("{:.4}", strike.peak_force),
        shown(peak, 1.0, 4),
        format!("{:.2}", strike.absorbed_measured * 1e9),
        shown(a, 1e9, 2),
        format!("{:.2}", strike.absorbed_predicted * 1e9),
        shown(b, 1e9, 2),
        off(strike.absorbed_measured, a),
        off(strike.absorbed_predicted, b),
        output::either(strike.replay_identical, "identical", "differs"),
        output::either(flags.is_empty(), "-", &flags),
    ]
}

fn strike_row(strike: &MeasuredStrike) -> [String; 10] {
    let truth = |of: fn(&Truth) -> String| strike.truth.as_ref().map_or("echo".to_owned(), of);
    let off = |joule: f64| match strike.truth {
        Some(truth) => format!("{:+.3} %", (joule / truth.absorbed - 1.0) * 100.0),
        None => "-".to_owned(),
    };
    let flags = strike.flags.join(", ");
    [
        strike.sample_index.to_string(),
        format!("{:.4}", strike.peak_force),
        truth(|truth| format!("{:.4}", truth.peak_force)),
        format!("{:.2}", strike.absorbed_measured * 1e9),
        format!("{:.2}", strike.absorbed_predicted * 1e9),
        truth(|truth| format!("{:.2}", truth.absorbed * 1e9)),
        off(strike.absorbed_measured),
        off(strike.absorbed_predicted),
        output::either(strike.replay_identical, "identical", "differs"),
        output::either(flags.is_empty(), "-", &flags),
    ]
}

/// Of several beads: each with its truth and its report.
pub(super) fn table_of_several(beads: &[(RunTruth, RunReport)]) -> String {
    let strikes = beads.iter().flat_map(|(truth, report)| {
        let bead = truth.bead.to_string();
        report.measured().map(move |strike| {
            let mut row = vec![bead.clone()];
            row.extend(strike_row(strike));
            row
        })
    });
    let header = format!("bead | {STRIKES}");
    let rows = beads.iter().map(|(truth, report)| {
        let frames = &report.frames;
        let busiest = report.instructions_per_sample.worst_block;
        [
            truth.bead.to_string(),
            format!("{:+.3}", truth.clock_ppm),
            format!("{:.6}", truth.began),
            frames.received.to_string(),
            frames.lost.to_string(),
            frames.corrupt.to_string(),
            report.overruns.to_string(),
            report.resets.to_string(),
            busiest.map_or("-".to_owned(), |count| format!("{count:.1}")),
        ]
    });
    let counts = "bead | crystal ppm | first scan at s | frames received | lost | corrupt | overruns | resets \
                  | instructions a sample in the busiest block";
    let mut parts = vec![output::table(&header, strikes), output::table(counts, rows)];
    let recording = beads.iter().find_map(|(_, report)| report.recording.as_ref());
    parts.extend(recording.map(|path| format!("recording: {}", path.display())));
    parts.join("\n\n")
}

fn counts(report: &RunReport) -> String {
    let frames = &report.frames;
    let row = |name: &str, count: u64| [name.to_owned(), count.to_string()];
    let mut rows = vec![
        row("received", frames.received),
        row("lost", frames.lost),
        row("corrupt", frames.corrupt),
    ];
    for (cause, count) in &frames.dropped_by_cause {
        let cause = cause.replace('_', " ");
        rows.push(row(&format!("dropped by the bead, {cause}"), *count));
    }
    rows.extend([
        row("strikes passed over", report.strikes_passed_over),
        row("gaps in the samples", report.gaps.len() as u64),
        row("overruns", report.overruns),
        row("resets", report.resets as u64),
    ]);
    output::table("frames |", rows)
}

fn provoked(report: &RunReport) -> String {
    let rows = report.provoked.iter().map(|provoked| {
        let reported = if provoked.excused {
            "another fault hid it".to_owned()
        } else {
            output::either(provoked.reported, "yes", "no")
        };
        [
            provoked.fault.kind.name().to_owned(),
            provoked.fault.at.to_string(),
            provoked.cause.map_or("-".to_owned(), |cause| cause.to_string()),
            provoked.cause.map_or("-".to_owned(), |_| reported),
        ]
    });
    output::table("provoked | at (s) | to be reported as | reported", rows)
}

fn reported(report: &RunReport) -> String {
    let rows = report.faults.iter().map(|fault| {
        [
            fault.cause.to_string(),
            fault.sample_index.to_string(),
            fault.boot.to_string(),
            fault.detail.clone(),
        ]
    });
    output::table("the bead reported | at sample | of boot | detail", rows)
}

fn instructions(report: &RunReport) -> String {
    let rows = report.instructions_per_sample.rows().map(|(name, count)| {
        let part = |count: f64| format!("{:.1} %", count / report.instructions_available * 100.0);
        let [count, part] = match count {
            Some(count) => [format!("{count:.1}"), part(count)],
            None => ["-", "-"].map(str::to_owned),
        };
        [name.to_owned(), count, part]
    });
    output::table("instructions a sample | | of those that fit", rows)
}
