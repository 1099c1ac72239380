//! Shared by all proofs: options, runs, errors of the estimates, and the page of a table.

use hertz_chain::Solution;
use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::cli::commands::prelude::*;
use crate::cli::provenance::command;
use bead_bench::accuracy::EstimateErrors;
use bead_bench::emulation::{Emulation, Placed};
use bead_bench::error::BenchError;
use bead_bench::image::find_image;
use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Timing, Truth, load_scenario};
use bead_console::beads::one_bead;

/// Shortest time from strike to strike, s.
const INTERVAL: f64 = 0.05;
/// Quiet before the first strike, s.
const LEAD_IN: f64 = 0.02;
/// Greatest radius or diameter of a sphere, m.
const LONGEST: f64 = 1.0;

/// Options of every proof.
#[derive(Debug, Args)]
pub(super) struct ProofOptions {
    /// The scenario, a TOML file in SI units.
    scenario: PathBuf,
    /// The bead that senses: one with an intruder.
    #[arg(long, value_name = "N", value_parser = one_bead)]
    pub(super) bead: usize,
    /// The flash image [default: as `cargo xtask build` leaves it, else the one inside this program].
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
    /// Seed of the noise: the same seed gives the same table.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Write the table to this file too, as Markdown.
    #[arg(long, value_name = "F.md")]
    table: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(super) fn metres(text: &str) -> Result<f64, String> {
    let metres = positive(text).map_err(|_| "give more than 0, in m".to_owned())?;
    if metres <= LONGEST {
        return Ok(metres);
    }
    let length = metres * 1e-3;
    Err(format!(
        "{metres} m is too large for a sphere of a chain; did you mean {metres} mm? give {length}"
    ))
}

pub(super) struct Prepared<'a> {
    pub(super) common: &'a ProofOptions,
    pub(super) scenario: Scenario,
    image: PathBuf,
    page: Option<Target>,
}

impl ProofOptions {
    /// Finds the image, reads the scenario, and checks that the table can be written.
    pub(super) fn prepare(&self) -> Result<Prepared<'_>, Failure> {
        let image = find_image(self.firmware.as_deref())?;
        let inputs: [&Path; 2] = [&self.scenario, &image];
        Ok(Prepared {
            page: self
                .overwrite
                .optional(self.table.as_deref(), FileKind::Text, &inputs)?,
            scenario: load_scenario(&self.scenario)?.0,
            common: self,
            image,
        })
    }
}

impl Prepared<'_> {
    /// Runs the image on strikes of a simulated scenario.
    pub(super) fn measure(
        &self,
        scenario: &Scenario,
        solution: &Solution,
        front_end: &AnalogFrontEnd,
        strikes: u32,
    ) -> Result<EstimateErrors, BenchError> {
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes,
            interval: INTERVAL.max(1.1 * solution.end()),
        };
        let placed = Placed::alone(self.common.bead, Some(self.common.seed));
        let run = Emulation::place(scenario, solution, placed, front_end, timing, &self.image)?;
        let frames = run.run()?.whole()?.frames;
        Ok(EstimateErrors::of(&run, frames))
    }

    /// Computes the cells of all points side by side, writes the page, `text` above the table, and prints the
    /// cells.
    pub(super) fn tabulate<P: Sync, C: Serialize + Send, const N: usize>(
        &self,
        points: &[P],
        cell: impl Fn(&P) -> Result<C, Failure> + Sync,
        [title, text]: [&str; 2],
        headings: [&str; N],
        row: impl Fn(&C) -> [String; N],
    ) -> Result<Vec<C>, Failure> {
        let progress = output::progress(points.len() as u64);
        let cells = on_all_cores(&progress, points, &cell)?;
        progress.finish_and_clear();
        if let Some(page) = &self.page {
            let heads = [headings.map(str::to_owned), headings.map(|_| "---".to_owned())];
            let lines = heads.into_iter().chain(cells.iter().map(&row));
            let table: String = lines.map(|line| format!("| {} |\n", line.join(" | "))).collect();
            page.write_bytes(format!(
                "# {title}\n\nWritten by\n\n    {}\n\n{text}\n{table}",
                command()
            ))?;
        }
        output::print(self.common.format, &cells, || {
            output::table(&headings.join(" | "), cells.iter().map(row))
        })?;
        Ok(cells)
    }
}

/// Computes something of each item on all cores, and moves the bar by a step for each.
pub(super) fn on_all_cores<T, R: Send, E: Send>(
    progress: &ProgressBar,
    items: impl IntoParallelIterator<Item = T>,
    compute: impl Fn(T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    let computed = items.into_par_iter().map(|item| {
        let computed = compute(item);
        progress.inc(1);
        computed
    });
    computed.collect()
}

/// Peaks of a strike at the bead.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct StrikePeaks {
    /// Highest force at the bead's incoming contact.
    pub(super) peak_force_n: f64,
    /// Greatest magnitude of the intruder's acceleration.
    pub(super) peak_acceleration_mps2: f64,
}

impl StrikePeaks {
    /// The peaks of a simulated strike at `bead`.
    pub(super) fn of(scenario: &Scenario, solution: &Solution, bead: usize) -> Result<Self, Failure> {
        let intruders = solution.summary().intruders;
        let intruder = intruders.iter().find(|intruder| intruder.bead == bead);
        let acceleration = intruder.map(|intruder| intruder.acceleration_max.max(-intruder.acceleration_min));
        Ok(Self {
            peak_force_n: Truth::of(scenario, solution, bead)?.peak_force,
            peak_acceleration_mps2: acceleration.unwrap_or(0.0),
        })
    }
}

/// Every value of one axis with every value of another.
pub(super) fn grid<A: Copy, B: Copy>(rows: &[A], columns: &[B]) -> Vec<(A, B)> {
    let row = |&row: &A| columns.iter().map(move |&column| (row, column));
    rows.iter().flat_map(row).collect()
}

/// An error with its worst value, or the flag that makes it meaningless; `-` if the bead saw no strike.
pub(super) fn shown(errors: &EstimateErrors, estimate: usize) -> String {
    if errors.strikes == 0 {
        return "-".to_owned();
    }
    let railed = ["acceleration_railed", "force_railed"][estimate];
    if errors.flags.contains(&railed) {
        return "railed".to_owned();
    }
    let [rms, worst] = [errors.rms, errors.worst].map(|parts| 100.0 * parts[estimate]);
    format!("{rms:.2} ({worst:+.2})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_no_strike_are_no_numbers_and_no_pass() {
        let errors = EstimateErrors {
            strikes: 0,
            rms: [f64::NAN; 2],
            worst: [f64::NAN; 2],
            flags: Vec::new(),
        };
        assert_eq!([0, 1].map(|estimate| shown(&errors, estimate)), ["-", "-"]);
        assert!(!errors.pass(2));
    }
}
