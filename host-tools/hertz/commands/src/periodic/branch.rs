//! A branch of motions that repeat: its run, its table, its picture and its JSON.

use std::fs::File;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

use hertz_chain::{
    Bifurcation, Branch, BranchEnd, BranchOptions, BranchPoint, DriveParameter, PeriodicState,
};
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, ends};

use super::motion::{Motion, unit_of_amplitude};
use bead_console::prelude::*;
use bead_tables::printable::count;
use bead_tables::{Cell, CellKind, Column, Writer};

/// Motions along a parameter.
#[derive(Serialize, JsonSchema)]
pub(super) struct BranchReport {
    /// `amplitude` or `frequency`.
    parameter: &'static str,
    /// Its unit: m, N or Hz.
    unit: &'static str,
    /// Why it ends: `range`, `points` (there were as many as allowed), `lost` (none was found in steps
    /// however short) or `stopped`.
    end: &'static str,
    /// In order along the branch.
    points: Vec<BranchMotion>,
}

/// A motion on a branch.
#[derive(Serialize, JsonSchema)]
struct BranchMotion {
    #[serde(flatten)]
    motion: Motion,
    /// `fold` at this point, or `period-doubling`, `torus` or `crossing` between the point before and this.
    bifurcation: Option<&'static str>,
}

/// Follows the branch, with a progress bar. Ctrl-C ends it with the points so far.
pub(super) fn follow(
    state: PeriodicState,
    parameter: DriveParameter,
    to: f64,
    options: &BranchOptions,
) -> Result<BranchReport, Failure> {
    let bar = output::progress(options.points as u64);
    let stop = interrupt::orderly("the branch did not end in time and nothing was written".to_owned());
    let (name, unit) = match parameter {
        DriveParameter::Frequency => (parameter.name(), "Hz"),
        _ => (parameter.name(), unit_of_amplitude(state.scenario())),
    };
    let branch = Branch::follow(state, parameter, to, options, |point| {
        bar.inc(1);
        bar.set_message(format!("{name} {:.6e} {unit}", point.value));
        if stop.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    })?;
    bar.finish_and_clear();
    let motion = |point: &BranchPoint| {
        Ok(BranchMotion {
            motion: Motion::of(&point.state)?,
            bifurcation: point.bifurcation.map(Bifurcation::name),
        })
    };
    match branch.end {
        BranchEnd::Points => note!(
            "the branch has {} and goes on; give more --points",
            count(options.points as u64, "point")
        ),
        BranchEnd::Lost => note!("the branch is lost: no motion was found even with the shortest steps"),
        _ => {}
    }
    Ok(BranchReport {
        parameter: name,
        unit,
        end: branch.end.name(),
        points: branch.points.iter().map(motion).collect::<Result<_, Failure>>()?,
    })
}

impl BranchMotion {
    /// The columns of a table of the branch, with this motion's cells. `name` names the parameter's column.
    fn row(&self, name: &str, parameter: DriveParameter) -> Vec<(Column, Cell)> {
        let motion = &self.motion;
        let number = |name: String, value: f64| (Column::new(name, CellKind::Number), Cell::Number(value));
        let text = |name: &str, value| (Column::new(name, CellKind::Text), Cell::text(value));
        let mut row = vec![
            number(name.to_owned(), motion.value(parameter)),
            text("stable", Some(yes_or_no(motion.stable))),
            number("multiplier_re".to_owned(), motion.multiplier.re),
            number("multiplier_im".to_owned(), motion.multiplier.im),
            text("bifurcation", self.bifurcation),
        ];
        for (contact, (least, greatest)) in (1..).zip(motion.force_min_n.iter().zip(&motion.force_max_n)) {
            row.push(number(format!("force_min_{contact}_n"), *least));
            row.push(number(format!("force_max_{contact}_n"), *greatest));
        }
        for (bead, speed) in (1..).zip(&motion.speed_max_mps) {
            row.push(number(format!("speed_max_{bead}_mps"), *speed));
        }
        for (intruder, stroke) in (1..).zip(&motion.stroke_max_m) {
            row.push(number(format!("stroke_max_{intruder}_m"), *stroke));
        }
        row
    }
}

fn yes_or_no(is_so: bool) -> &'static str {
    if is_so { "yes" } else { "no" }
}

impl BranchReport {
    fn parameter(&self) -> DriveParameter {
        match self.parameter {
            "frequency" => DriveParameter::Frequency,
            _ => DriveParameter::Amplitude,
        }
    }

    fn label(&self) -> String {
        format!("{} ({})", self.parameter, self.unit)
    }

    /// The table of the ends and the bifurcations.
    pub(super) fn table(&self) -> String {
        let last = self.points.len() - 1;
        let shown = self.points.iter().enumerate();
        let shown = shown.filter(|(n, point)| [0, last].contains(n) || point.bifurcation.is_some());
        let rows = shown.map(|(n, point)| {
            let motion = &point.motion;
            let here = match point.bifurcation {
                Some(bifurcation) => bifurcation,
                None if n == 0 => "start",
                None => "end",
            };
            [
                format!("{:.8e}", motion.value(self.parameter())),
                here.to_owned(),
                yes_or_no(motion.stable).to_owned(),
                format!("{:.6}", motion.multiplier.magnitude()),
                format!("{:.4}", motion.greatest_force()),
            ]
        });
        let header = format!(
            "{} | point | stable | greatest multiplier | greatest force (N)",
            self.label()
        );
        let table = output::table(&header, rows);
        format!("{table}\n\n{}.", count(self.points.len() as u64, "point"))
    }

    /// Writes a row for each point.
    pub(super) fn write(&self, file: &mut File) -> anyhow::Result<()> {
        let name = format!("{}_{}", self.parameter, self.unit.to_lowercase());
        let rows = self.points.iter().map(|point| point.row(&name, self.parameter()));
        let mut rows = rows.map(|row| -> (Vec<Column>, Vec<Cell>) { row.into_iter().unzip() });
        let Some((columns, first)) = rows.next() else {
            return Ok(());
        };
        let mut writer = Writer::csv(file, &columns)?;
        writer.push(first)?;
        for (_, row) in rows {
            writer.push(row)?;
        }
        writer.finish()
    }

    /// The greatest force against the parameter: stable motions as lines, others dashed.
    pub(super) fn chart(&self, parameter: DriveParameter, title: &str) -> Chart {
        let mut curves: Vec<Series> = Vec::new();
        let place = |point: &BranchMotion| (point.motion.value(parameter), point.motion.greatest_force());
        for pair in self.points.windows(2) {
            let (curve, name, mark) = if pair[1].motion.stable {
                (0, "stable", Mark::Line)
            } else {
                (1, "unstable", Mark::Dashed)
            };
            let goes_on = curves.last().is_some_and(|curve| curve.mark == mark);
            if !goes_on {
                let is_first = curves.iter().all(|curve| curve.mark != mark);
                let name = if is_first { name } else { "" };
                curves.push(Series::new(name, Ink::Curve(curve), mark, [place(&pair[0])]));
            }
            if let Some(curve) = curves.last_mut() {
                curve.points.push(place(&pair[1]));
            }
        }
        let is_fold = |point: &&BranchMotion| point.bifurcation == Some("fold");
        let folds = self.points.iter().filter(is_fold).map(place);
        let folds = Series::new("fold", Ink::Curve(2), Mark::Discs, folds);
        if !folds.points.is_empty() {
            curves.push(folds);
        }
        let values = self.points.iter().map(|point| point.motion.value(parameter));
        let (low, high) = ends(values);
        let axis = Axis::new(self.label(), low..high);
        let mut chart = Chart::new(axis, vec![Panel::new("greatest force (N)", curves).height(280)]);
        chart.description = format!("Motions that repeat: {title}");
        chart
    }
}
