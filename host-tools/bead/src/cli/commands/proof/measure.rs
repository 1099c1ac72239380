//! Measurements shared by all proofs: options, runs, errors of the estimates, and the page of a table.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use bead_wire::{Energy, StrikeFlags};
use clap::Args;
use hertz_chain::{Scenario, Solution};
use rayon::prelude::*;
use serde::Serialize;

use crate::cli::bench_options::BenchOptions;
use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use bead_bench::emulation::Emulation;
use bead_bench::error::BenchError;
use bead_compare::front_end::FrontEnd;
use bead_compare::sensed::Timing;
use bead_recording::frames::Frame;
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_tables::whole::Target;

/// Goals, as parts of the truth: of estimate A, and of B.
pub(super) const GOALS: [f64; 2] = [5e-3, 1e-2];
/// Shortest time from strike to strike, s.
pub(super) const INTERVAL: f64 = 0.05;
/// Quiet before the first strike, s.
pub(super) const LEAD_IN: f64 = 0.02;
/// Seed of the noise, unless another is given.
pub(super) const SEED: u64 = 1;

/// Options of every proof.
#[derive(Debug, Args)]
pub(super) struct Common {
    #[command(flatten)]
    pub(super) bench: BenchOptions,
    /// Seed of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = SEED)]
    pub(super) seed: u64,
    /// Write the table to this file too, as Markdown.
    #[arg(long, value_name = "F.md")]
    pub(super) table: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

impl Common {
    /// The place of the table; see [`place::target`].
    pub(super) fn target(&self, image: &Path) -> Result<Option<Target>, Failure> {
        let inputs = [&self.bench.scenario, image];
        place::optional(self.table.as_deref(), Kind::Text, &inputs, self.overwrite)
    }

    /// The command line of a proof: the scenario, the bead, the proof's own options, seed and table. With
    /// `--overwrite`, since who types it again replaces the table.
    pub(super) fn line(&self, proof: &str, options: &[String]) -> String {
        let table = self.table.as_ref();
        let table = table.map(|table| format!(" --overwrite --table {}", table.display()));
        format!(
            "bead proof {proof} {} --bead {}{}{}{}",
            self.bench.scenario.display(),
            self.bench.bead,
            options.concat(),
            typed("--seed", self.seed, SEED),
            table.unwrap_or_default()
        )
    }

    /// Runs the image on strikes of a simulated scenario.
    ///
    /// # Errors
    /// The bead has no intruder, the front end does not fit it, or the emulator fails.
    pub(super) fn measure(
        &self,
        scenario: &Scenario,
        solution: &Solution,
        front_end: &FrontEnd,
        strikes: u32,
        image: &Path,
    ) -> Result<Errors, BenchError> {
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes,
            interval: INTERVAL.max(1.1 * solution.end()),
        };
        let (bead, seed) = (self.bench.bead, Some(self.seed));
        let run = Emulation::prepare(scenario, solution, bead, front_end, seed, timing, image)?;
        let frames = run.run()?.whole()?.frames;
        Ok(Errors::of(&run, frames))
    }

    /// Highest force at the bead's incoming contact, N, and greatest magnitude of its intruder's
    /// acceleration, m/s².
    pub(super) fn peaks(&self, solution: &Solution) -> (f64, f64) {
        let (summary, bead) = (solution.summary(), self.bench.bead);
        let force = summary.peak_force.iter().find(|peak| peak.contact == bead);
        let intruder = summary.intruders.iter().find(|intruder| intruder.bead == bead);
        let acceleration = intruder.map(|intruder| intruder.acceleration_max.max(-intruder.acceleration_min));
        (force.map_or(0.0, |peak| peak.force), acceleration.unwrap_or(0.0))
    }

    /// Writes the page, `text` above the table, and prints the cells.
    pub(super) fn publish<C: Serialize, const N: usize>(
        &self,
        target: Option<&Target>,
        cells: &[C],
        text: &str,
        headings: [&str; N],
        row: impl Fn(&C) -> [String; N],
    ) -> Result<(), Failure> {
        if let Some(target) = target {
            let page = text.to_owned() + &markdown(headings, cells.iter().map(&row));
            target.write_bytes(page)?;
        }
        output::print(self.format, &cells, || {
            output::table(&headings.join(" | "), cells.iter().map(row))
        })
    }
}

/// The cells of all points, computed side by side.
pub(super) fn cells<P: Sync, C: Send>(
    points: &[P],
    cell: impl Fn(&P) -> Result<C, Failure> + Sync,
) -> Result<Vec<C>, Failure> {
    let progress = output::progress(points.len() as u64);
    let cells = points.par_iter().map(|point| {
        let cell = cell(point);
        progress.inc(1);
        cell
    });
    let cells = cells.collect();
    progress.finish_and_clear();
    cells
}

/// Every value of one axis with every value of another.
pub(super) fn grid<A: Copy, B: Copy>(rows: &[A], columns: &[B]) -> Vec<(A, B)> {
    let row = |&row: &A| columns.iter().map(move |&column| (row, column));
    rows.iter().flat_map(row).collect()
}

/// Refuses values of an option that are no positive length, or longer than any sphere of a chain.
///
/// # Errors
/// The message asks whether millimetres are meant.
pub(super) fn check_lengths(option: &str, metres: &[f64]) -> Result<(), Failure> {
    check_positive(option, metres, "m")?;
    let Some(long) = metres.iter().find(|length| **length > LONGEST) else {
        return Ok(());
    };
    Err(Failure::input(format!(
        "{option} {long}: {long} m is more than any sphere of a chain has; did you mean {long} mm? give {}",
        long * 1e-3
    )))
}

/// Refuses values of an option that are not finite and above 0.
///
/// # Errors
/// The message names the first of them and the unit.
pub(super) fn check_positive(option: &str, values: &[f64], unit: &str) -> Result<(), Failure> {
    let refused = values.iter().find(|value| !(value.is_finite() && **value > 0.0));
    refused.map_or(Ok(()), |value| {
        Err(Failure::input(format!(
            "{option} {value}: give more than 0, in {unit}"
        )))
    })
}

/// Greatest radius or diameter of a sphere, m.
const LONGEST: f64 = 1.0;

/// A table in Markdown.
pub(super) fn markdown<const N: usize>(
    headings: [&str; N],
    rows: impl Iterator<Item = [String; N]>,
) -> String {
    let heads = [headings.map(str::to_owned), headings.map(|_| "---".to_owned())];
    let line = |cells: [String; N]| format!("| {} |\n", cells.join(" | "));
    heads.into_iter().chain(rows).map(line).collect()
}

/// An option as it is typed, behind a blank; nothing if it has its default.
pub(super) fn typed(name: &str, value: impl Display, default: impl Display) -> String {
    let [value, default] = [value.to_string(), default.to_string()];
    if value == default {
        String::new()
    } else {
        format!(" {name} {value}")
    }
}

/// Values of an option as they are typed.
pub(super) fn list(values: impl IntoIterator<Item = impl Display>) -> String {
    let values: Vec<String> = values.into_iter().map(|value| value.to_string()).collect();
    values.join(",")
}

/// Errors of the estimates of one run.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(super) struct Errors {
    /// Strikes that were measured.
    pub(super) strikes: usize,
    /// Highest force of the truth, N.
    #[serde(skip)]
    pub(super) peak_force: f64,
    /// Root mean square over the strikes, A and B, as a part of the truth. NaN without a strike, as is the
    /// worst: null in JSON.
    #[schemars(with = "[Option<f64>; 2]")]
    pub(super) rms: [f64; 2],
    /// The greatest error, with its sign.
    #[schemars(with = "[Option<f64>; 2]")]
    pub(super) worst: [f64; 2],
    /// Every flag that was set.
    pub(super) flags: Vec<&'static str>,
}

impl Errors {
    /// True if every strike was measured within the sensors' range, and within the goals.
    pub(super) fn pass(&self, struck: u32) -> bool {
        self.strikes == struck as usize
            && self.flags.iter().all(|flag| !flag.ends_with("railed"))
            && self.rms.iter().zip(GOALS).all(|(rms, goal)| *rms <= goal)
    }

    /// The errors of the first window after each strike. Later windows are echoes.
    pub(super) fn of(run: &Emulation, frames: Vec<Frame>) -> Self {
        let strikes = assemble(frames, Some(run.settings));
        let mut begun = None;
        let mut is_first = |strike: &&RecordedStrike| {
            let before = std::mem::replace(&mut begun, run.truth.begun(strike.said.trigger_index));
            begun.is_some() && begun != before
        };
        let measured: Vec<_> = strikes.iter().filter(&mut is_first).collect();
        let absorbed = run.truth.truth.absorbed;
        let of = |energy: &dyn Fn(&bead_wire::Strike) -> Energy| -> (f64, f64) {
            let errors: Vec<f64> = measured
                .iter()
                .map(|strike| energy(&strike.said).joules() / absorbed - 1.0)
                .collect();
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            let worst = errors.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
            ((squares / errors.len() as f64).sqrt(), worst.unwrap_or(f64::NAN))
        };
        let a = of(&|said| said.absorbed_measured);
        let b = of(&|said| said.absorbed_predicted);
        let flags = measured.iter().map(|strike| strike.said.flags);
        let flags = flags.fold(StrikeFlags::NONE, StrikeFlags::with);
        Self {
            strikes: measured.len(),
            peak_force: run.truth.truth.peak_force,
            rms: [a.0, b.0],
            worst: [a.1, b.1],
            flags: flags.names().collect(),
        }
    }

    /// An error with its worst value, or the flag that makes it meaningless; `-` if the bead saw no strike.
    pub(super) fn shown(&self, estimate: usize) -> String {
        if self.strikes == 0 {
            return "-".to_owned();
        }
        let railed = ["acceleration_railed", "force_railed"][estimate];
        if self.flags.contains(&railed) {
            return "railed".to_owned();
        }
        let [rms, worst] = [self.rms, self.worst].map(|parts| 100.0 * parts[estimate]);
        format!("{rms:.2} ({worst:+.2})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_no_strike_are_no_numbers_and_no_pass() {
        let errors = Errors {
            strikes: 0,
            peak_force: 0.0,
            rms: [f64::NAN; 2],
            worst: [f64::NAN; 2],
            flags: Vec::new(),
        };
        assert_eq!([0, 1].map(|estimate| errors.shown(estimate)), ["-", "-"]);
        assert!(!errors.pass(2));
    }
}
