//! The view of a sweep's chart: its axes, and the points that it takes.

use hertz_charts::FAMILY;

use crate::axis::SweepAxis;
use crate::column::AxisColumn;
use crate::plan::Plan;
use crate::side::{Cells, label};
use bead_tables::Cell;
use bead_tables::printable::first_of;

/// The options of a chart; those that are left out follow from the sweep.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct View {
    /// Column of the horizontal axis.
    pub x: Option<String>,
    /// Column of the vertical axis.
    pub y: Option<String>,
    /// Column of a map's colours; empty for the first result.
    pub map: Option<String>,
    /// Column whose values have a curve each.
    pub by: Option<String>,
    /// `COLUMN=VALUE`: only points with this value.
    pub at: Vec<String>,
}

/// The layout of a chart.
pub(super) struct ChartLayout<'a> {
    pub(super) x: AxisColumn<'a>,
    pub(super) form: ChartForm<'a>,
    pub(super) at: Vec<ChosenPlace>,
}

/// Curves of a result, or a map of a result.
pub(super) enum ChartForm<'a> {
    Curves { y: String, by: Option<AxisColumn<'a>> },
    Map { y: AxisColumn<'a>, value: String },
}

/// A place on an axis, chosen by --at.
pub(super) struct ChosenPlace {
    pub(super) axis: usize,
    pub(super) place: u64,
    /// Its value, for people.
    pub(super) label: String,
}

/// Curves at most: more cannot be told apart.
const MOST_CURVES: u64 = 4 * FAMILY as u64;
/// Cells of a map at most.
const MOST_CELLS: u64 = 250_000;
/// Points of curves at most.
pub(super) const MOST_POINTS: usize = 1_000_000;
/// Places of an axis at most.
const MOST_PLACES: u64 = 10_000_000;
/// Names of a list in a message at most.
const NAMES: usize = 20;

const NO_MAP: &str = "a map needs two axes of the sweep with at least two values each; draw a curve";

impl View {
    /// Checks that the view fits a sweep.
    ///
    /// # Errors
    /// A column is unknown or missing, or the chart would be too large.
    pub fn check(&self, plan: &Plan) -> Result<(), String> {
        self.layout(plan).map(drop)
    }

    /// The layout of a sweep's chart.
    pub(super) fn layout<'a>(&self, plan: &'a Plan) -> Result<ChartLayout<'a>, String> {
        let mut axes = OpenAxes::new(self, plan)?;
        let is_map = self.is_map(plan, &axes);
        axes.needs_two = is_map;
        let x = axes.take(self.x.as_deref(), "--x", is_map)?;
        let form = if is_map {
            self.map_form(&mut axes, &x)?
        } else {
            self.curves_form(&mut axes, &x)?
        };
        axes.check_none_left()?;
        let layout = ChartLayout { x, form, at: axes.at };
        layout.check_size()?;
        Ok(layout)
    }

    fn is_map(&self, plan: &Plan, axes: &OpenAxes<'_>) -> bool {
        match (&self.map, &self.y) {
            (Some(_), _) => true,
            (None, Some(y)) => AxisColumn::find(plan, y).is_some(),
            (None, None) => self.by.is_none() && self.x.is_none() && axes.open.len() == 2,
        }
    }

    fn map_form<'a>(&self, axes: &mut OpenAxes<'a>, x: &AxisColumn<'_>) -> Result<ChartForm<'a>, String> {
        let y = axes.take(self.y.as_deref(), "--y", false)?;
        if y.axis == x.axis {
            return Err("a map needs two axes of the sweep, but --x and --y name the same one; choose another axis for one of them".to_owned());
        }
        let value = result(axes.plan, self.map.as_deref().filter(|name| !name.is_empty()))?;
        Ok(ChartForm::Map { y, value })
    }

    fn curves_form<'a>(&self, axes: &mut OpenAxes<'a>, x: &AxisColumn<'_>) -> Result<ChartForm<'a>, String> {
        let by = self.by.as_deref().map(|by| axes.take(Some(by), "--by", false));
        let by = by.transpose()?;
        if by.as_ref().is_some_and(|by| by.axis == x.axis) {
            return Err("--x and --by name the same axis; choose another axis for one of them".to_owned());
        }
        let y = result(axes.plan, self.y.as_deref())?;
        Ok(ChartForm::Curves { y, by })
    }
}

/// The result of this name, or the first.
fn result(plan: &Plan, name: Option<&str>) -> Result<String, String> {
    let results = plan.definition().outputs.columns();
    let mut results = results.iter().map(|column| column.name.clone());
    let Some(name) = name else {
        return results
            .next()
            .ok_or_else(|| "the sweep keeps no result".to_owned());
    };
    if results.clone().any(|result| result == name) {
        return Ok(name.to_owned());
    }
    Err(format!(
        "{name} is not a result of this sweep; its results are {}",
        first_of(results, NAMES)
    ))
}

/// The axes with several places that no option has used yet.
struct OpenAxes<'a> {
    plan: &'a Plan,
    open: Vec<usize>,
    /// Number of axes with several places.
    several: usize,
    at: Vec<ChosenPlace>,
    /// True for a map.
    needs_two: bool,
}

impl<'a> OpenAxes<'a> {
    fn new(view: &View, plan: &'a Plan) -> Result<Self, String> {
        if let Some(long) = plan.axes().iter().find(|axis| axis.count > MOST_PLACES) {
            let (name, count) = (long.index(), long.count);
            return Err(format!(
                "axis {name} has {count} places, more than the {MOST_PLACES} that a picture can show"
            ));
        }
        let mut at: Vec<ChosenPlace> = Vec::new();
        for text in &view.at {
            let place = ChosenPlace::parse(plan, text)?;
            if at.iter().any(|other| other.axis == place.axis) {
                return Err(format!(
                    "--at {text}: another --at already chooses a place on that axis; leave out one of them"
                ));
            }
            at.push(place);
        }
        let mut open: Vec<usize> = (0..plan.axes().len())
            .filter(|axis| plan.axes()[*axis].count > 1)
            .collect();
        let several = open.len();
        open.retain(|axis| at.iter().all(|place| place.axis != *axis));
        Ok(Self {
            plan,
            open,
            several,
            at,
            needs_two: false,
        })
    }

    /// Takes the column of an option; without a name, the first or last axis that is left.
    fn take(&mut self, name: Option<&str>, option: &str, last: bool) -> Result<AxisColumn<'a>, String> {
        let column = match name {
            Some(name) => AxisColumn::find(self.plan, name).ok_or_else(|| {
                let known = first_of(self.plan.axes().iter().map(SweepAxis::index), NAMES);
                format!("{name} is not a column of an axis of this sweep; its axes are {known}")
            })?,
            None => {
                let axis = if last { self.open.last() } else { self.open.first() };
                AxisColumn::index(self.plan, *axis.ok_or_else(|| self.nothing_left(option))?)
            }
        };
        if self.at.iter().any(|place| place.axis == column.axis) {
            return Err(format!(
                "{option} names an axis that --at fixes at one place; leave out one of the two options"
            ));
        }
        self.open.retain(|axis| *axis != column.axis);
        Ok(column)
    }

    fn nothing_left(&self, option: &str) -> String {
        match self.several {
            0 | 1 if self.needs_two => NO_MAP.to_owned(),
            0 => "each axis of this sweep has one value; name the column of one with --x".to_owned(),
            _ => format!("there is no axis left for {option}; leave out an --at"),
        }
    }

    fn check_none_left(&self) -> Result<(), String> {
        let Some(first) = self.open.first() else {
            return Ok(());
        };
        let axis = |axis: &usize| &self.plan.axes()[*axis];
        let left = self.open.iter().map(axis);
        let left = left.map(|axis| format!("{} ({} values)", axis.index(), axis.count));
        let first = axis(first).index();
        Err(format!(
            "the sweep has more axes: {}; choose a place on each with --at {first}=VALUE, or draw a curve for each value with --by {first}",
            first_of(left, NAMES)
        ))
    }
}

impl ChartLayout<'_> {
    /// Checks that the chart can be seen.
    fn check_size(&self) -> Result<(), String> {
        let across = self.x.of.count;
        match &self.form {
            ChartForm::Curves { by, .. } => {
                let curves = by.map_or(1, |by| by.of.count);
                if curves > MOST_CURVES {
                    return Err(format!(
                        "{curves} curves cannot be told apart; choose {MOST_CURVES} at most, or draw a map"
                    ));
                }
                if across * curves > MOST_POINTS as u64 {
                    return Err(format!(
                        "{} points are too many for curves, which show at most {MOST_POINTS}; choose places with \
                         --at, or sweep fewer values",
                        across * curves
                    ));
                }
            }
            ChartForm::Map { y, .. } => {
                let up = y.of.count;
                if across < 2 || up < 2 {
                    return Err(NO_MAP.to_owned());
                }
                if across.saturating_mul(up) > MOST_CELLS {
                    return Err(format!(
                        "a map of {across} × {up} cells is too large; at most {MOST_CELLS} cells can be drawn"
                    ));
                }
                Cells::new(&self.x).and(Cells::new(y))?;
            }
        }
        Ok(())
    }
}

impl ChosenPlace {
    /// The place nearest to the value in `COLUMN=VALUE`.
    fn parse(plan: &Plan, text: &str) -> Result<Self, String> {
        let wrong = || format!("--at {text}: write COLUMN=VALUE with a column of an axis");
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        let column = AxisColumn::find(plan, name.trim()).ok_or_else(wrong)?;
        let (value, mut places) = (value.trim(), 0..column.of.count);
        let place = match column.of_texts() {
            Some(along) => places
                .find(|place| along.cell(*place) == Cell::Text(value.into()))
                .ok_or_else(|| format!("--at {text}: no point has that value"))?,
            None => {
                let number = value.parse().ok().filter(|number: &f64| number.is_finite());
                let number =
                    number.ok_or_else(|| format!("--at {text}: the value must be a finite number"))?;
                let distances = places.map(|place| (place, (column.number(place) - number).abs()));
                let nearest = distances.min_by(|one, other| one.1.total_cmp(&other.1));
                nearest.ok_or_else(wrong)?.0
            }
        };
        Ok(Self {
            axis: column.axis,
            place,
            label: label(&column, place),
        })
    }
}
