//! Tables of `bead emulate`: of one bead, and of several.

use crate::cli::commands::prelude::*;
use bead_bench::run::{MeasuredStrike, RunReport};
use bead_compare::energy_uncertainties::EnergyUncertainties;
use bead_compare::report::{DASH, EnergyUnit, percent, signed};

pub(super) fn table(report: &RunReport) -> String {
    let mut parts = vec![strikes(report) + &legend(report.measured()), counts(report)];
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

/// A line that explains ± beside these strikes; empty if no strike has one.
fn legend<'a>(strikes: impl Iterator<Item = &'a MeasuredStrike>) -> String {
    let legend = EnergyUncertainties::legend(strikes.filter_map(|strike| strike.uncertainty.as_ref()));
    legend.map_or_else(String::new, |legend| format!("\n± is {legend}"))
}

/// The headings of the strikes. Each estimate has its own reference value if a waveform was played.
fn headings(unit: EnergyUnit, played: bool) -> String {
    let unit = unit.symbol;
    if played {
        format!(
            "strike at sample | peak force (N) | given | A measured ({unit}) | of the given | B predicted ({unit}) | of the given \
             | A off | B off | supply | replay | flags"
        )
    } else {
        format!(
            "strike at sample | peak force (N) | truth | A measured ({unit}) | B predicted ({unit}) | truth | A off | B off \
             | supply | replay | flags"
        )
    }
}

/// The one unit of all energies of these strikes.
fn energy_unit<'a>(strikes: impl IntoIterator<Item = &'a MeasuredStrike>) -> EnergyUnit {
    EnergyUnit::of(strikes.into_iter().flat_map(|strike| {
        let truth = strike.truth.map_or(0.0, |truth| truth.absorbed);
        [
            strike.device.absorbed_measured,
            strike.device.absorbed_predicted,
            truth,
        ]
    }))
}

fn strikes(report: &RunReport) -> String {
    let unit = energy_unit(report.measured());
    let row = |strike| row(strike, unit, report.played);
    output::table(&headings(unit, report.played), report.measured().map(row))
}

/// A strike: its values beside the truth, or beside f64 estimates of the waveform that was played.
fn row(strike: &MeasuredStrike, unit: EnergyUnit, played: bool) -> Vec<String> {
    let (truth, given) = (strike.truth, strike.given);
    let of_truth = truth.map(|truth| truth.peak_force);
    let peak = if played {
        given.and_then(|given| given.peak_force)
    } else {
        of_truth
    };
    let known = |value: Option<String>| value.unwrap_or(output::either(played, DASH, "echo"));
    let energy = |joules: f64| unit.number(joules, 2);
    let off = |joules: f64, truth: Option<f64>| {
        let truth = truth.filter(|truth| *truth > 0.0);
        truth.map_or(DASH.to_owned(), |truth| percent(joules / truth - 1.0))
    };
    let (a, b) = (strike.device.absorbed_measured, strike.device.absorbed_predicted);
    // The expanded uncertainty, k = 2.
    let within = |joules: f64, u: Option<f64>| match u {
        Some(u) => format!("{} ± {}", energy(joules), energy(2.0 * u)),
        None => energy(joules),
    };
    let [u_a, u_b] = strike.uncertainty.map_or([None; 2], |known| known.each());
    let [shown_a, shown_b] = [within(a, u_a), within(b, u_b)];
    let mut row = vec![
        strike.sample_index.to_string(),
        format!("{:.4}", strike.device.peak_force),
    ];
    row.push(known(peak.map(|peak| format!("{peak:.4}"))));
    if played {
        let of_a = given.and_then(|given| given.absorbed_measured);
        let of_b = given.and_then(|given| given.absorbed_predicted);
        row.extend([shown_a, known(of_a.map(energy)), shown_b, known(of_b.map(energy))]);
        row.extend([off(a, of_a), off(b, of_b)]);
    } else {
        let truth = truth.map(|truth| truth.absorbed);
        row.extend([
            shown_a,
            shown_b,
            known(truth.map(energy)),
            off(a, truth),
            off(b, truth),
        ]);
    }
    let conditions = strike.conditions.map(|conditions| conditions.to_string());
    row.push(conditions.unwrap_or(DASH.to_owned()));
    let flags = strike.flags.join(", ");
    row.push(strike.replay.name().to_owned());
    row.push(output::either(flags.is_empty(), DASH, &flags));
    row
}

/// A bead among several, as in the JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct EmulatedBead {
    pub(super) bead: usize,
    pub(super) clock_ppm: f64,
    pub(super) began_s: f64,
    #[serde(flatten)]
    pub(super) report: RunReport,
}

pub(super) fn table_of_several(beads: &[EmulatedBead]) -> String {
    let unit = energy_unit(beads.iter().flat_map(|of| of.report.measured()));
    let strikes = beads.iter().flat_map(|of| {
        let row = |strike| [vec![of.bead.to_string()], row(strike, unit, of.report.played)].concat();
        of.report.measured().map(row)
    });
    let header = format!("bead | {}", headings(unit, false));
    let rows = beads.iter().map(|of| {
        let (report, frames) = (&of.report, &of.report.frames);
        let busiest = report.instructions_per_sample.worst_block;
        [
            of.bead.to_string(),
            signed(of.clock_ppm, 3),
            format!("{:.6}", of.began_s),
            frames.received.to_string(),
            frames.lost.to_string(),
            frames.corrupt.to_string(),
            report.overruns.to_string(),
            report.resets.to_string(),
            busiest.map_or(DASH.to_owned(), |count| format!("{count:.1}")),
        ]
    });
    let counts = "bead | crystal ppm | first scan at s | frames received | lost | corrupt | overruns | resets \
                  | instructions a sample in the busiest block";
    let legend = legend(beads.iter().flat_map(|of| of.report.measured()));
    let mut parts = vec![
        output::table(&header, strikes) + &legend,
        output::table(counts, rows),
    ];
    let recording = beads.iter().find_map(|of| of.report.recording.as_ref());
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
            "not required: another fault hid it, it was too short, or the run ended".to_owned()
        } else {
            output::either(provoked.reported, "yes", "no")
        };
        [
            provoked.fault.kind.name().to_owned(),
            provoked.fault.at.to_string(),
            provoked.cause.map_or(DASH.to_owned(), |cause| cause.to_string()),
            provoked.cause.map_or(DASH.to_owned(), |_| reported),
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
            None => [DASH, DASH].map(str::to_owned),
        };
        [name.to_owned(), count, part]
    });
    output::table("instructions a sample | | of those that fit", rows)
}
