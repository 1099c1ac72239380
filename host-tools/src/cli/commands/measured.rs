//! How far the estimates of a run are from the truth: shared by `bead accuracy` and `bead spheres`.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use bead_wire::{Energy, StrikeFlags};
use clap::Args;
use hertz_chain::Solution;
use serde::Serialize;

use crate::bench::emulation::Emulation;
use crate::bench::sensed::Timing;
use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::recording::frames::Frame;
use crate::recording::strikes::{RecordedStrike, assemble};
use crate::tables::whole::Target;

/// Goals, as parts of the truth: of estimate A, and of B.
const GOALS: [f64; 2] = [5e-3, 1e-2];
/// Shortest time from strike to strike, s.
const INTERVAL: f64 = 0.05;
/// Quiet before the first strike, s.
const LEAD_IN: f64 = 0.02;
/// Seed of the noise, unless another is given.
const SEED: u64 = 1;

/// How a table of errors is made and where it goes.
#[derive(Debug, Args)]
pub(super) struct TableOptions {
    /// Seed of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = SEED)]
    pub(super) seed: u64,
    /// Write the table to this file too, as Markdown.
    #[arg(long, value_name = "F.md")]
    table: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// How to print the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

impl TableOptions {
    /// Where the table goes; see [`place::target`].
    pub(super) fn target(&self, inputs: &[&Path]) -> Result<Option<Target>, Failure> {
        place::optional(self.table.as_deref(), Kind::Text, inputs, self.overwrite)
    }

    /// These options as they are typed; `--overwrite`, since who types them again replaces the table.
    pub(super) fn typed(&self) -> String {
        let seed = typed("--seed", self.seed, SEED);
        let table = self
            .table
            .iter()
            .map(|table| format!(" --overwrite --table {}", table.display()));
        seed + &table.collect::<String>()
    }

    /// Writes and prints the cells.
    pub(super) fn tell(
        &self,
        target: Option<&Target>,
        cells: &impl Serialize,
        markdown: impl FnOnce() -> String,
        table: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        if let Some(target) = target {
            target.write_bytes(markdown())?;
        }
        output::print(self.format, cells, table)
    }
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
pub(super) fn rows<const N: usize>(headings: [&str; N], rows: impl Iterator<Item = [String; N]>) -> String {
    let heads = [headings.map(str::to_owned), headings.map(|_| "---".to_owned())];
    let line = |cells: [String; N]| format!("| {} |\n", cells.join(" | "));
    heads.into_iter().chain(rows).map(line).collect()
}

/// An option as it is typed, behind a blank; nothing if it has its default.
pub(super) fn typed(name: &str, value: impl Display, default: impl Display) -> String {
    let [value, default] = [value.to_string(), default.to_string()];
    match value == default {
        true => String::new(),
        false => format!(" {name} {value}"),
    }
}

/// Values of an option as they are typed.
pub(super) fn list(values: impl IntoIterator<Item = impl Display>) -> String {
    let values: Vec<String> = values.into_iter().map(|value| value.to_string()).collect();
    values.join(",")
}

/// A row of `strikes` strikes of a simulation.
pub(super) fn timing(strikes: u32, solution: &Solution) -> Timing {
    Timing {
        lead_in: LEAD_IN,
        strikes,
        interval: INTERVAL.max(1.1 * solution.end()),
    }
}

/// Errors of the estimates of one run.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(super) struct Errors {
    /// Strikes that were measured.
    pub(super) strikes: usize,
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
    /// Whether every strike was measured within the sensors' range, and well enough.
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
            rms: [f64::NAN; 2],
            worst: [f64::NAN; 2],
            flags: Vec::new(),
        };
        assert_eq!([0, 1].map(|estimate| errors.shown(estimate)), ["-", "-"]);
        assert!(!errors.pass(2));
    }
}
