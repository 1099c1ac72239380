//! Options, progress and the summary of every command that computes a sweep.

use indicatif::{DecimalBytes, HumanCount};

use bead_console::prelude::*;
use hertz_sweep::axis::SweepAxis;
use hertz_sweep::compute;
use hertz_sweep::folder::{Folder, Merged};
use hertz_sweep::plan::Plan;

/// Parses the path of a sweep's table. Refuses the ending `.csv`, since the table is a Parquet file.
pub(crate) fn table_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let ending = path.extension();
    if ending.is_some_and(|end| end.eq_ignore_ascii_case("csv")) {
        return Err("the table is a Parquet file; let its name end with .parquet".to_owned());
    }
    Ok(path)
}

/// `--threads`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Threads {
    /// Threads to compute on [default: one for each processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
}

impl Threads {
    pub(crate) fn pool(self) -> Result<rayon::ThreadPool, Failure> {
        let threads = self.threads.unwrap_or(0) as usize;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.context("cannot start threads").map_err(Failure::Device)
    }
}

/// `--yes` and `--limit`.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct Consent {
    /// Greatest number of points that are computed without --yes.
    #[arg(long, value_name = "POINTS", default_value_t = 100_000)]
    limit: u64,
    /// Compute any number of points.
    #[arg(long)]
    yes: bool,
}

impl Consent {
    /// Refuses a large sweep without --yes: it may be a slip.
    pub(crate) fn ask(self, plan: &Plan, seconds: f64) -> Result<(), Failure> {
        if self.yes || plan.points() <= self.limit {
            return Ok(());
        }
        let bytes = plan.points() as f64 * plan.columns().len() as f64 * 8.0;
        let (points, size) = (HumanCount(plan.points()), DecimalBytes(bytes as u64));
        let make = if plan.axes().len() == 1 { "makes" } else { "make" };
        bail!(
            Input,
            "{} {make} {points} points: about {} on {} threads here, and a table of {size}; to compute them, give --yes, or \
             a higher --limit",
            axes(plan),
            time(seconds * plan.points() as f64),
            rayon::current_num_threads(),
        )
    }
}

/// Measures the time of a point, s.
pub(crate) fn measured(plan: &Plan) -> f64 {
    let spinner = output::spinner("trying a few points");
    let seconds = compute::seconds_for_each(plan);
    spinner.finish_and_clear();
    seconds
}

/// Computes the missing chunks, and returns the number of their points.
pub(crate) fn compute_missing(folder: &Folder) -> Result<u64, Failure> {
    let (missing, all) = (folder.missing()?, folder.plan().points() as f64);
    let count = |chunk: &u64| {
        let points = folder.points(*chunk);
        points.end - points.start
    };
    let left: u64 = missing.iter().map(count).sum();
    let mut done = folder.plan().points() - left;
    let bar = output::part_done(format!("of {} points", HumanCount(folder.plan().points())));
    output::set_part(&bar, done as f64 / all);
    // Chunks of earlier runs say nothing about the pace of this one.
    bar.reset_eta();
    for chunk in missing {
        folder.run(chunk, &|points| {
            output::set_part(&bar, (done as f64 + points) / all)
        })?;
        done += count(&chunk);
    }
    bar.finish_and_clear();
    Ok(left)
}

pub(crate) fn merge(folder: &Folder, out: &Target) -> Result<Merged, Failure> {
    let bar = output::part_done("of the table written");
    let merged = folder.merge(out, &|chunk| {
        output::set_part(&bar, chunk as f64 / folder.chunks() as f64)
    })?;
    bar.finish_and_clear();
    Ok(merged)
}

/// The result of a sweep as JSON.
#[derive(Serialize, JsonSchema)]
pub struct SweepReport<'a> {
    plan: &'a str,
    points: u64,
    /// Points that this run computed; null of a merge.
    computed: Option<u64>,
    failed: u64,
    /// Time of the computation, s; null of a merge.
    seconds: Option<f64>,
    file: String,
    /// Columns that number the places of the axes.
    index: Vec<String>,
    /// Lines of Python that read the table as a cube.
    xarray: String,
}

/// Prints the summary of a sweep, and a line of Python that opens its table.
pub(crate) fn summary(
    plan: &Plan,
    merged: &Merged,
    out: &Path,
    computed: Option<(u64, f64)>,
    format: Format,
) -> Result<(), Failure> {
    if let Some(why) = &merged.first {
        note!(
            "{} of {} points could not be computed, and the column `error` says why; the first error: {why}",
            HumanCount(merged.failed),
            HumanCount(plan.points())
        );
    }
    let report = SweepReport {
        plan: plan.hash(),
        points: plan.points(),
        computed: computed.map(|(points, _)| points),
        failed: merged.failed,
        seconds: computed.map(|(_, seconds)| seconds),
        file: out.display().to_string(),
        index: plan.axes().iter().map(SweepAxis::index).collect(),
        xarray: plan.xarray(out),
    };
    output::print(format, &report, || {
        let computed = computed.map_or(String::new(), |(points, seconds)| {
            format!(", {} computed in {}", HumanCount(points), time(seconds))
        });
        let (file, points, xarray) = (&report.file, HumanCount(report.points), &report.xarray);
        format!("{file}: {points} points{computed}\nRead it in Python as a cube: {xarray}")
    })
}

/// Sizes of the axes as a product: `41 × 15`.
pub(crate) fn axes(plan: &Plan) -> String {
    let axes = plan.axes().iter();
    let counts: Vec<String> = axes.map(|axis| HumanCount(axis.count).to_string()).collect();
    match counts.as_slice() {
        [one] => format!("1 axis of {one}"),
        _ => format!("axes of {}", counts.join(" × ")),
    }
}

/// Writes a time in the unit that suits it.
pub(crate) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 0.1 => format!("{:.0} ms", s * 1e3),
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 2.0 * 3600.0 => format!("{:.0} min", s / 60.0),
        s if s < 2.0 * 86_400.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        assert_eq!(time(0.012), "12 ms");
        assert_eq!(time(4000.0), "67 min");
    }
}
