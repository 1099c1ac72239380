//! Curves and maps of a sweep's table.

use std::collections::HashSet;
use std::path::Path;

use anyhow::Context;
use hertz_charts::{Axis as ChartAxis, COLUMN, Chart, FAMILY, Ink, Map, Mark, Panel, Scale, Series};

use crate::sweep::axis::{Along, Values};
use crate::sweep::definition::Definition;
use crate::sweep::plan::Plan;
use crate::tables::printable::{beginning, first_of, one_line};
use crate::tables::unit::Unit;
use crate::tables::{Cell, Kind, Reader};

/// What is to be drawn; what is left open follows from the sweep.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct View {
    /// The column of the horizontal axis.
    pub x: Option<String>,
    /// The column of the vertical axis.
    pub y: Option<String>,
    /// Draw a map of this column; empty for the first result.
    pub map: Option<String>,
    /// A curve for each value of this column.
    pub by: Option<String>,
    /// `COLUMN=VALUE`: only points there.
    pub at: Vec<String>,
}

/// A view of which everything is decided. Columns of axes are the axis and the key along it; none is the
/// place.
struct Decided {
    x: Column,
    drawn: Drawn,
    at: Vec<Chosen>,
}

enum Drawn {
    Curves { y: String, by: Option<Column> },
    Map { y: Column, value: String },
}

#[derive(Debug, Clone, PartialEq)]
struct Column {
    axis: usize,
    along: Option<usize>,
}

/// A place that --at took.
struct Chosen {
    axis: usize,
    place: u64,
    /// Its value, for people.
    told: String,
}

/// More curves than this cannot be told apart.
const MOST_CURVES: u64 = 4 * FAMILY as u64;
/// Names of a list that are told.
const NAMES_TOLD: usize = 20;
/// Letters of a text of the table in a legend or a note, and of one that stands at an axis.
const LONGEST_TEXT: usize = 40;
const LONGEST_NAME: usize = 12;
/// Cells of a map.
const MOST_CELLS: u64 = 250_000;
/// Points of curves, and places of an axis.
const MOST_DRAWN: usize = 1_000_000;
const MOST_PLACES: u64 = 10_000_000;
/// Beyond this a value is none: two may differ by more than an `f64` can be.
const MOST_VALUE: f64 = 1e300;

const NO_MAP: &str = "a map needs two axes of the sweep with two values each; draw a curve";

/// Whether this can be drawn of a sweep.
///
/// # Errors
/// Why not, and what would do.
pub fn check(view: &View, plan: &Plan) -> Result<(), String> {
    decide(view, plan).map(drop)
}

/// Draws a table of a sweep.
///
/// # Errors
/// It is no such table, or the view does not fit it.
pub fn chart(table: &Path, view: &View) -> anyhow::Result<Chart> {
    let reader = Reader::open(table)?;
    let sweep = reader.note("sweep").context("is no table of bead sweep")?;
    let plan = Plan::new(Definition::from_toml(sweep, "its sweep")?)?;
    let (has, points) = (reader.rows(), plan.points());
    anyhow::ensure!(has == points, "has {has} rows, and its sweep {points} points");
    let decided = decide(view, &plan).map_err(anyhow::Error::msg)?;
    let value = match &decided.drawn {
        Drawn::Curves { y, .. } => y,
        Drawn::Map { value, .. } => value,
    };
    let place = |name: &str| {
        let place = reader.columns().iter().position(|column| column.name == name);
        place.with_context(|| format!("has no column {name}"))
    };
    let mut rows: Vec<(u64, f64)> = Vec::new();
    for batch in reader.batches(vec![place("point")?, place(value)?]) {
        for row in batch?.into_rows() {
            let number_of_point = match &row[0] {
                Cell::Whole(point) => u64::try_from(*point).ok(),
                _ => None,
            };
            let point = number_of_point.filter(|point| *point < points);
            let point = point.context("has a row of no point of its sweep")?;
            let mut chosen = decided.at.iter();
            if chosen.all(|chosen| plan.place(point, chosen.axis) == chosen.place) {
                let few = rows.len() < MOST_DRAWN;
                anyhow::ensure!(few, "has points twice, and so others are missing");
                let value = row[1].as_f64().filter(|value| value.abs() <= MOST_VALUE);
                rows.push((point, value.unwrap_or(f64::NAN)));
            }
        }
    }
    rows.sort_by_key(|row| row.0);
    if let Some(twice) = rows.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        anyhow::bail!("has point {} twice, and so others are missing", twice[0].0);
    }
    anyhow::ensure!(
        rows.iter().any(|row| row.1.is_finite()),
        "has no point with a value of {value}; draw another result, or see why in the column `error`"
    );
    let quantity = Quantity::new(value, rows.iter().map(|row| row.1));
    match &decided.drawn {
        Drawn::Curves { by, .. } => Ok(curves(&plan, &decided, by.as_ref(), &quantity, rows)),
        Drawn::Map { y, .. } => map(&plan, &decided, y, &quantity, &rows),
    }
}

fn decide(view: &View, plan: &Plan) -> Result<Decided, String> {
    if let Some(long) = plan.axes().iter().find(|axis| axis.count > MOST_PLACES) {
        let (name, count) = (long.index(), long.count);
        return Err(format!(
            "axis {name} has {count} places, and {MOST_PLACES} are the most that a picture is made of"
        ));
    }
    let find = |name: &str| find(plan, name);
    let results: Vec<String> = plan
        .definition()
        .outputs
        .columns()
        .into_iter()
        .map(|column| column.name)
        .collect();
    let result = |name: &str| match results.iter().any(|result| result == name) {
        true => Ok(name.to_owned()),
        false => Err(format!(
            "{name} is no result of this sweep; there are {}",
            first_of(&results, NAMES_TOLD)
        )),
    };
    let first = || results[0].clone();
    let mut at: Vec<Chosen> = Vec::new();
    for text in &view.at {
        let chosen = chosen(plan, text)?;
        if at.iter().any(|other| other.axis == chosen.axis) {
            return Err(format!(
                "--at {text}: another --at has chosen a place of that axis; leave out one of them"
            ));
        }
        at.push(chosen);
    }
    // Axes that no --at has chosen from, and that have anything to choose.
    let mut open: Vec<usize> = (0..plan.axes().len())
        .filter(|axis| plan.axes()[*axis].count > 1)
        .collect();
    let several = open.len();
    open.retain(|axis| !at.iter().any(|chosen| chosen.axis == *axis));
    let column = |axis: usize| Column {
        axis,
        along: plan.axes()[axis].name.is_none().then_some(0),
    };
    let is_map = match (&view.map, &view.y, &view.by) {
        (Some(_), ..) => true,
        (None, Some(y), _) => find(y).is_some(),
        (None, None, by) => by.is_none() && view.x.is_none() && open.len() == 2,
    };
    let mut take = |name: Option<&String>, what: &str, last: bool| -> Result<Column, String> {
        let found = match name {
            Some(name) => find(name).ok_or_else(|| {
                let known: Vec<String> = plan.axes().iter().map(super::axis::Axis::index).collect();
                format!(
                    "{name} is no column of an axis of this sweep; there are {}",
                    first_of(&known, NAMES_TOLD)
                )
            })?,
            None => {
                let axis = if last { open.last() } else { open.first() };
                column(*axis.ok_or_else(|| match several {
                    0 | 1 if is_map => NO_MAP.to_owned(),
                    0 => "each axis of this sweep has one value; name the column of one with --x".to_owned(),
                    _ => format!("there is no axis left for {what}; leave out an --at"),
                })?)
            }
        };
        if at.iter().any(|chosen| chosen.axis == found.axis) {
            return Err(format!(
                "{what} is of an axis of which --at leaves one place; leave out one of them"
            ));
        }
        open.retain(|axis| *axis != found.axis);
        Ok(found)
    };
    let x = take(view.x.as_ref(), "--x", is_map)?;
    let drawn = if is_map {
        let y = take(view.y.as_ref(), "--y", false)?;
        if y.axis == x.axis {
            return Err("a map needs two axes of the sweep, and --x and --y are of one".to_owned());
        }
        let value = match view.map.as_deref() {
            None | Some("") => first(),
            Some(name) => result(name)?,
        };
        Drawn::Map { y, value }
    } else {
        let by = view
            .by
            .as_ref()
            .map(|by| take(Some(by), "--by", false))
            .transpose()?;
        if by.as_ref().is_some_and(|by| by.axis == x.axis) {
            return Err("--x and --by are of one axis; give two".to_owned());
        }
        let y = view.y.as_deref().map_or_else(|| Ok(first()), result)?;
        Drawn::Curves { y, by }
    };
    if let Some(first) = open.first() {
        let axis = |axis: &usize| {
            format!(
                "{} ({} values)",
                plan.axes()[*axis].index(),
                plan.axes()[*axis].count
            )
        };
        let left: Vec<String> = open.iter().map(axis).collect();
        let first = plan.axes()[*first].index();
        return Err(format!(
            "the sweep has more axes: {}; choose a place of each with --at {first}=VALUE, or a curve for each with --by {first}",
            first_of(&left, NAMES_TOLD)
        ));
    }
    let count = |column: &Column| plan.axes()[column.axis].count;
    match &drawn {
        Drawn::Curves { by: Some(by), .. } if count(by) > MOST_CURVES => Err(format!(
            "{} curves cannot be told apart; choose {MOST_CURVES} at most, or draw a map",
            count(by)
        )),
        Drawn::Curves { by, .. } if count(&x) * by.as_ref().map_or(1, count) > MOST_DRAWN as u64 => {
            Err(format!(
                "curves of {} points are more than can be seen, and {MOST_DRAWN} are the most; choose places with \
                 --at, or sweep fewer values",
                count(&x) * by.as_ref().map_or(1, count)
            ))
        }
        Drawn::Map { y, .. } if count(&x) < 2 || count(y) < 2 => Err(NO_MAP.to_owned()),
        Drawn::Map { y, .. } if count(&x).saturating_mul(count(y)) > MOST_CELLS => Err(format!(
            "a map of {} × {} cells is more than can be seen; {MOST_CELLS} are the most",
            count(&x),
            count(y)
        )),
        Drawn::Map { y, .. } => {
            // Whether each value has a cell.
            Cells::new(plan, &x).and(Cells::new(plan, y))?;
            Ok(Decided { x, drawn, at })
        }
        Drawn::Curves { .. } => Ok(Decided { x, drawn, at }),
    }
}

/// The axis that a column belongs to.
fn find(plan: &Plan, name: &str) -> Option<Column> {
    plan.axes().iter().enumerate().find_map(|(axis, of)| {
        if of.name.as_deref() == Some(name) {
            return Some(Column { axis, along: None });
        }
        let along = of.along.iter().position(|along| along.key.column() == name);
        along.map(|along| Column {
            axis,
            along: Some(along),
        })
    })
}

/// The place that `COLUMN=VALUE` names: the nearest.
fn chosen(plan: &Plan, text: &str) -> Result<Chosen, String> {
    let wrong = || format!("--at {text}: write COLUMN=VALUE with a column of an axis");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let column = find(plan, name.trim()).ok_or_else(wrong)?;
    let (along, value) = (column.along(plan), value.trim());
    let mut places = 0..plan.axes()[column.axis].count;
    let place = match along.filter(is_text) {
        Some(along) => places
            .find(|place| along.cell(*place) == Cell::Text(value.into()))
            .ok_or_else(|| format!("--at {text}: no point has that value"))?,
        None => {
            let number: Option<f64> = value.parse().ok();
            let number = number.filter(|number| number.is_finite());
            let number = number.ok_or_else(|| format!("--at {text}: the value must be a finite number"))?;
            let distances = places.map(|place| (place, (coordinate(along, place) - number).abs()));
            let nearest = distances.min_by(|one, other| one.1.total_cmp(&other.1));
            nearest.ok_or_else(wrong)?.0
        }
    };
    Ok(Chosen {
        axis: column.axis,
        place,
        told: column.told(plan, place),
    })
}

fn is_text(along: &&Along) -> bool {
    along.kind() == Kind::Text
}

/// A text of the table, short and without what could steer a reader.
fn text(along: &Along, place: u64) -> String {
    match along.cell(place) {
        Cell::Text(text) => beginning(&one_line(&text), LONGEST_TEXT).into_owned(),
        _ => String::new(),
    }
}

/// The number at a place of an axis; a text is told by its place.
fn coordinate(along: Option<&Along>, place: u64) -> f64 {
    match along.filter(|along| !is_text(along)) {
        Some(along) => along.cell(place).as_f64().unwrap_or(f64::NAN),
        None => place as f64,
    }
}

/// How a column is written on an axis.
struct Quantity {
    name: String,
    /// Its unit with a prefix that makes numbers short; empty for none.
    symbol: String,
    /// What a value is divided by for that.
    unit: f64,
}

impl Quantity {
    fn new(column: &str, values: impl Iterator<Item = f64>) -> Self {
        let finite = values.filter(|value| value.is_finite());
        let greatest = finite.map(f64::abs).fold(0.0, f64::max);
        let (stem, unit) = Unit::of_column(column).unzip();
        let (symbol, size) = unit.map_or((String::new(), 1.0), |unit| unit.prefixed(greatest));
        Self {
            name: stem.unwrap_or(column).replace('_', " "),
            symbol,
            unit: size,
        }
    }

    fn label(&self) -> String {
        match self.symbol.as_str() {
            "" => self.name.clone(),
            symbol => format!("{} ({symbol})", self.name),
        }
    }
}

/// A column along one side of a picture.
struct Side {
    quantity: Quantity,
    /// By the place on the axis, in the quantity's unit.
    values: Vec<f64>,
    scale: Scale,
    /// Of a column of texts, by the place on the axis.
    texts: Vec<String>,
}

impl Side {
    /// The label, and what stands at the axis in place of numbers. Where the texts are too long for that,
    /// their places stand there.
    fn named(&self) -> (String, Vec<String>) {
        let label = self.quantity.label();
        if self.texts.iter().all(|text| text.chars().count() <= LONGEST_NAME) {
            return (label, self.texts.clone());
        }
        let places = (1..=self.texts.len()).map(|place| place.to_string());
        (format!("{label}, by its place in the list"), places.collect())
    }
}

impl Column {
    fn along<'a>(&self, plan: &'a Plan) -> Option<&'a Along> {
        self.along.map(|along| &plan.axes()[self.axis].along[along])
    }

    fn name(&self, plan: &Plan) -> String {
        let axis = &plan.axes()[self.axis];
        self.along(plan)
            .map_or_else(|| axis.index(), |along| along.key.column())
    }

    fn side(&self, plan: &Plan) -> Side {
        let (along, places) = (self.along(plan), 0..plan.axes()[self.axis].count);
        let values: Vec<f64> = places.clone().map(|place| coordinate(along, place)).collect();
        let texts = along.filter(is_text).into_iter();
        let texts = texts.flat_map(|along| places.clone().map(|place| text(along, place)));
        let quantity = Quantity::new(&self.name(plan), values.iter().copied());
        let log = matches!(
            along.map(|along| &along.values),
            Some(Values::Log { .. } | Values::Drawn { log: true, .. })
        );
        Side {
            values: values.iter().map(|value| value / quantity.unit).collect(),
            quantity,
            scale: if log { Scale::Log } else { Scale::Linear },
            texts: texts.collect(),
        }
    }

    /// The value at a place, for people. Where several keys change along the axis, more of its places may
    /// have that value, and the place is told too.
    fn told(&self, plan: &Plan, place: u64) -> String {
        let along = self.along(plan);
        let number = coordinate(along, place);
        let quantity = Quantity::new(&self.name(plan), [number].into_iter());
        let value = match along.filter(is_text) {
            Some(along) => text(along, place),
            None => short(&[number / quantity.unit]).concat(),
        };
        let axis = plan.axes()[self.axis].name.as_ref().filter(|_| along.is_some());
        let place = axis.map_or_else(String::new, |axis| format!(" ({axis} {place})"));
        let told = format!("{} = {value} {}", quantity.name, quantity.symbol);
        format!("{}{place}", told.trim_end())
    }

    fn drawn(&self, plan: &Plan) -> bool {
        self.along(plan)
            .is_some_and(|along| matches!(along.values, Values::Drawn { .. }))
    }
}

fn axis(side: &Side, (low, high): (f64, f64)) -> ChartAxis {
    // One value has room around it.
    let room = match place(low, side.scale) < place(high, side.scale) {
        true => 0.0,
        false => 0.5 * low.abs().max(1e-9),
    };
    let (label, names) = side.named();
    ChartAxis {
        label,
        range: (low - room, high + room),
        scale: side.scale,
        names,
    }
}

/// Where a value lies on an axis, in a length of its own.
fn place(value: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Log => value.log10(),
        _ => value,
    }
}

fn ends(values: &[f64]) -> (f64, f64) {
    let of = |fold: fn(f64, f64) -> f64, start| values.iter().copied().fold(start, fold);
    (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
}

/// What the picture shows, and which places --at took: the nearest, and so not always what was asked for.
fn described(plan: &Plan, at: &[Chosen], what: &str) -> String {
    let title = match plan.definition().title.as_str() {
        "" => String::new(),
        title => format!("{title}: "),
    };
    let at: String = at.iter().map(|chosen| format!(", at {}", chosen.told)).collect();
    format!("{title}{what}{at}")
}

/// What a reader must know beside the axes, in lines.
fn note(by: Option<&Side>, at: &[Chosen]) -> String {
    let by = by.map(|by| format!("by {}", by.quantity.label()));
    let at = at.iter().map(|chosen| format!("at {}", chosen.told));
    by.into_iter().chain(at).collect::<Vec<_>>().join("\n")
}

fn curves(plan: &Plan, decided: &Decided, by: Option<&Column>, y: &Quantity, rows: Vec<(u64, f64)>) -> Chart {
    let x = &decided.x;
    let across = x.side(plan);
    let families = by.map_or(1, |by| plan.axes()[by.axis].count);
    let named = by.map(|by| by.side(plan));
    let mut points: Vec<Vec<(f64, f64)>> = vec![Vec::new(); families as usize];
    for (point, value) in rows {
        let family = by.map_or(0, |by| plan.place(point, by.axis) as usize);
        let at = across.values[plan.place(point, x.axis) as usize];
        points[family].push((at, value / y.unit));
    }
    let names = named
        .as_ref()
        .map_or_else(Vec::new, |by| match by.texts.is_empty() {
            true => short(&by.values),
            false => by.texts.clone(),
        });
    let series = points.into_iter().enumerate().map(|(family, mut points)| {
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        Series {
            name: names.get(family).cloned().unwrap_or_default(),
            ink: Ink::Curve(family),
            // Drawn points follow no line.
            mark: if x.drawn(plan) {
                Mark::Discs
            } else {
                Mark::Family(family)
            },
            points,
        }
    });
    let panel = Panel::new(y.label(), series.collect()).note(note(named.as_ref(), &decided.at));
    let (low, high) = ends(&across.values);
    // A name has room on both sides.
    let room = if across.texts.is_empty() { 0.0 } else { 0.5 };
    let axis = axis(&across, (low - room, high + room));
    let description = described(plan, &decided.at, &format!("{} over {}", y.label(), axis.label));
    Chart {
        description,
        ..Chart::new(axis, vec![panel.height(300)])
    }
}

/// Numbers with four digits, and with more where four are not enough to tell them apart.
fn short(values: &[f64]) -> Vec<String> {
    let with = |decimals: usize| -> Vec<String> {
        let rounded = |value: &f64| format!("{value:.decimals$e}").parse().unwrap_or(*value);
        values.iter().map(|value| rounded(value).to_string()).collect()
    };
    let told = |names: &Vec<String>| names.iter().collect::<HashSet<_>>().len() == names.len();
    let found = [3, 6, 9].into_iter().map(with).find(told);
    found.unwrap_or_else(|| with(16))
}

/// The cells of a map along one of its sides.
struct Cells {
    side: Side,
    edges: Vec<f64>,
    /// Which cell each place of the axis has.
    of_places: Vec<usize>,
}

impl Cells {
    fn new(plan: &Plan, column: &Column) -> Result<Self, String> {
        let side = column.side(plan);
        let (values, scale) = (&side.values, side.scale);
        // Drawn or listed values need not be in order.
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
        let mut of_places = vec![0; values.len()];
        for (cell, place) in order.iter().enumerate() {
            of_places[*place] = cell;
        }
        let sorted: Vec<f64> = order.iter().map(|place| values[*place]).collect();
        let edges = edges(&sorted, scale);
        let mut cells = edges.windows(2);
        if cells.all(|edges| place(edges[0], scale) < place(edges[1], scale)) {
            return Ok(Self {
                side,
                edges,
                of_places,
            });
        }
        // An axis of several keys has a place for each point.
        let axis = plan.axes()[column.axis].name.as_ref();
        let instead = axis.map_or_else(String::new, |axis| format!("a map over {axis}, or "));
        Err(format!(
            "some values of {} cannot be told apart; draw {instead}a curve",
            column.name(plan)
        ))
    }
}

fn map(
    plan: &Plan,
    decided: &Decided,
    y: &Column,
    value: &Quantity,
    rows: &[(u64, f64)],
) -> anyhow::Result<Chart> {
    let x = &decided.x;
    let across = Cells::new(plan, x).map_err(anyhow::Error::msg)?;
    let up = Cells::new(plan, y).map_err(anyhow::Error::msg)?;
    let (x_range, y_range) = (ends(&across.edges), ends(&up.edges));
    let columns = across.edges.len() - 1;
    let mut values = vec![f64::NAN; columns * (up.edges.len() - 1)];
    for (point, found) in rows {
        let cell = |cells: &Cells, of: &Column| cells.of_places[plan.place(*point, of.axis) as usize];
        let (column, row) = (cell(&across, x), cell(&up, y));
        values[row * columns + column] = found / value.unit;
    }
    let (y_label, y_names) = up.side.named();
    let panel = Panel {
        y_scale: up.side.scale,
        y_names,
        ..Panel::new(y_label, Vec::new())
    };
    let cells = Map {
        label: value.label(),
        x_edges: across.edges,
        y_edges: up.edges,
        values,
    };
    let panel = panel.range(y_range.0, y_range.1).height(360).map(cells);
    let axis = axis(&across.side, x_range);
    let what = format!("{} over {} and {}", value.label(), axis.label, panel.y_label);
    Ok(Chart {
        description: described(plan, &decided.at, &what),
        width: COLUMN,
        ..Chart::new(axis, vec![panel.note(note(None, &decided.at))])
    })
}

/// Edges of cells around values in order: half-way between them.
fn edges(values: &[f64], scale: Scale) -> Vec<f64> {
    let back = |place: f64| match scale {
        Scale::Log => 10_f64.powf(place),
        _ => place,
    };
    let places: Vec<f64> = values.iter().map(|value| place(*value, scale)).collect();
    let last = places.len() - 1;
    let mut edges = vec![places[0] - 0.5 * (places[1] - places[0])];
    edges.extend(places.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
    edges.push(places[last] + 0.5 * (places[last] - places[last - 1]));
    edges.into_iter().map(back).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::Writer;

    #[test]
    fn edges_lie_half_way_between_values_on_their_scale() {
        assert_eq!(edges(&[1.0, 2.0, 4.0], Scale::Linear), [0.5, 1.5, 3.0, 5.0]);
        let edges = edges(&[1.0, 100.0], Scale::Log);
        assert!(
            edges
                .iter()
                .zip([0.1, 10.0, 1000.0])
                .all(|(one, other)| (one / other - 1.0).abs() < 1e-12)
        );
    }

    const BEADS: &str = "[[axis]]\nkey = \"intruder.0.beads\"\nvalues = [8, 12, [3, 4], 5]\n";
    const MASSES: &str = "[[axis]]\nzip = [\
        { key = \"intruder.0.mass\", values = [1e-3, 1e-3, 2e-3] },\
        { key = \"intruder.0.stiffness\", values = [1e5, 4e5, 4e5] }]\n";
    fn speeds(count: u64) -> String {
        format!("[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, {count}]\n")
    }

    fn plan(axes: &str) -> Plan {
        let mut sweep: toml::Table = toml::from_str(axes).unwrap();
        let paper = hertz_chain::Scenario::paper().to_toml();
        let scenario: toml::Table = toml::from_str(&paper).unwrap();
        sweep.insert("scenario".to_owned(), scenario.into());
        Plan::new(Definition::from_toml(&sweep.to_string(), "a.toml").unwrap()).unwrap()
    }

    /// A view from words such as `x=COLUMN`.
    fn view(words: &str) -> View {
        let mut view = View::default();
        for word in words.split_whitespace() {
            let (option, value) = word.split_once('=').unwrap();
            let value = value.to_owned();
            match option {
                "x" => view.x = Some(value),
                "y" => view.y = Some(value),
                "map" => view.map = Some(value),
                "by" => view.by = Some(value),
                _ => view.at.push(value),
            }
        }
        view
    }

    fn checked(axes: &str, words: &str) -> Result<(), String> {
        check(&view(words), &plan(axes))
    }

    /// A table of these points with these results, which tells of a sweep over these axes, drawn.
    fn drawn_over(
        points: impl IntoIterator<Item = i64>,
        result: &Cell,
        axes: &str,
        words: &str,
    ) -> Result<Chart, String> {
        let plan = plan(axes);
        let path = tempfile::NamedTempFile::new().unwrap();
        let mut file = path.reopen().unwrap();
        let sweep = plan.definition().to_toml();
        let mut table = Writer::parquet(&mut file, "sweep", &plan.columns(), &[("sweep", &sweep)]).unwrap();
        let first = plan.columns().len() - 1 - plan.definition().outputs.columns().len();
        for point in points {
            let mut row = plan.row(0, &Err("it was not run".to_owned()));
            row[0] = Cell::Whole(point);
            row[first] = result.clone();
            table.push(row).unwrap();
        }
        table.finish().unwrap();
        chart(path.path(), &view(words)).map_err(|error| error.to_string())
    }

    fn drawn(points: &[i64], speeds_of: u64) -> Result<Chart, String> {
        drawn_over(
            points.iter().copied(),
            &Cell::Number(1e-6),
            &speeds(speeds_of),
            "",
        )
    }

    /// A whole sweep with a result at each point, as a picture.
    fn svg(axes: &str, words: &str) -> String {
        let points = 0..plan(axes).points() as i64;
        let chart = drawn_over(points, &Cell::Number(1e-6), axes, words);
        chart.unwrap().standalone_svg().unwrap()
    }

    #[test]
    fn values_that_cannot_be_told_apart_have_no_map_and_have_a_curve() {
        // Their logarithms are equal.
        let near = "[[axis]]\nkey = \"chain.young\"\nlogspace = [5e9, 5000000000.000001, 2]\n";
        for axes in [[&speeds(2), near], [near, &speeds(2)]] {
            let why = checked(&axes.concat(), "").unwrap_err();
            assert!(why.contains("cannot be told apart; draw a curve"), "{why}");
        }
        svg(near, "");
        let axes = [MASSES, &speeds(2)].concat();
        let why = checked(&axes, "map=absorbed_j y=intruder_0_mass_kg").unwrap_err();
        let expected =
            "some values of intruder_0_mass_kg cannot be told apart; draw a map over zip, or a curve";
        assert_eq!(why, expected);
        // Each of 3 × 2 points has a cell, of one colour along a row.
        let map = svg(&axes, "map=absorbed_j y=zip");
        assert_eq!(map.matches("crispEdges").count(), 128 + 3);
    }

    #[test]
    fn texts_stand_at_their_places_and_have_no_numbers() {
        let axes = [BEADS, &speeds(2)].concat();
        for words in ["x=intruder_0_beads by=striker_velocity_mps", "y=intruder_0_beads"] {
            let svg = svg(&axes, words);
            for name in [">8<", ">12<", ">3 4<", ">5<", ">intruder 0 beads<"] {
                assert!(svg.contains(name), "{name}: {svg}");
            }
            assert!(!svg.contains(">3<"), "{svg}");
        }
        let long = "[[axis]]\nkey = \"intruder.0.beads\"\nvalues = [8, [1, 2, 3, 4, 5, 6, 7]]\n";
        let svg = svg(long, "");
        let label = ">intruder 0 beads, by its place in the list<";
        assert!(
            svg.contains(label) && svg.contains(">1<") && svg.contains(">2<"),
            "{svg}"
        );
    }

    #[test]
    fn the_place_that_at_took_is_told() {
        let axes = [&speeds(3), MASSES].concat();
        let curve = svg(&axes, "x=zip at=striker_velocity_mps=5");
        assert_eq!(
            curve.matches("at striker velocity = 1.2 m/s").count(),
            2,
            "note and description"
        );
        let curve = svg(&axes, "by=striker_velocity_mps x=intruder_0_stiffness_n_per_m");
        assert!(!curve.contains("at striker"));
        let curve = svg(&axes, "x=striker_velocity_mps at=intruder_0_mass_kg=0");
        assert!(curve.contains(">at intruder 0 mass = 1 g (zip 0)<"), "{curve}");
        let curve = svg(
            &[BEADS, MASSES, &speeds(2)].concat(),
            "at=intruder_0_beads=12 at=zip=2",
        );
        assert!(
            curve.contains(">at intruder 0 beads = 12<") && curve.contains(">at zip = 2<"),
            "{curve}"
        );
    }

    #[test]
    fn what_does_not_fit_the_axes_is_refused_before_the_work() {
        let two = [&speeds(3), MASSES].concat();
        let one = "[[axis]]\nkey = \"duration\"\nvalues = [1e-3]\n";
        let young = |count: u64| format!("[[axis]]\nkey = \"chain.young\"\nlinspace = [1e9, 2e9, {count}]\n");
        for (axes, words, why) in [
            (
                &two[..],
                "at=zip=1 at=intruder_0_mass_kg=1",
                "another --at has chosen",
            ),
            (
                &two,
                "x=zip at=intruder_0_mass_kg=1",
                "--x is of an axis of which --at leaves one place",
            ),
            (
                &two,
                "y=zip at=zip=1",
                "--y is of an axis of which --at leaves one place",
            ),
            (
                &two,
                "by=zip at=zip=1",
                "--by is of an axis of which --at leaves one place",
            ),
            (&two, "at=zip=nan", "the value must be a finite number"),
            (&two, "at=zip=-inf", "the value must be a finite number"),
            (
                &two,
                "at=zip=1 at=striker_velocity_mps=1",
                "there is no axis left for --x; leave out an --at",
            ),
            (&speeds(3), "map=absorbed_j", "a map needs two axes of the sweep"),
            (
                one,
                "",
                "each axis of this sweep has one value; name the column of one with --x",
            ),
            (&speeds(1_000_001), "", "curves of 1000001 points are more"),
            (
                &[speeds(500_001), young(2)].concat(),
                "x=striker_velocity_mps by=chain_young_pa",
                "curves of 1000002 points are more",
            ),
        ] {
            let found = checked(axes, words).unwrap_err();
            assert!(found.contains(why), "{words}: {found}");
        }
        assert_eq!(checked(&speeds(1_000_000), ""), Ok(()));
        assert_eq!(checked(one, "x=duration_s"), Ok(()));
    }

    #[test]
    fn a_table_has_the_points_of_its_sweep() {
        assert!(drawn(&[0, 1, 2], 3).is_ok());
        for (points, speeds, why) in [
            (&[0, 1][..], 3, "has 2 rows, and its sweep 3 points"),
            (
                &[0, 1],
                1_000_000_000_000,
                "has 2 rows, and its sweep 1000000000000 points",
            ),
            (&[0, 1, 3], 3, "has a row of no point of its sweep"),
            (&[0, 1, -1], 3, "has a row of no point of its sweep"),
            (&[1, 0, 1], 3, "has point 1 twice, and so others are missing"),
        ] {
            assert_eq!(drawn(points, speeds).err().as_deref(), Some(why));
        }
        let again = std::iter::repeat_n(0, MOST_DRAWN + 2);
        let axes = [
            &speeds(2),
            &speeds(MOST_DRAWN as u64 / 2 + 1).replace("striker.velocity", "duration")[..],
        ];
        let why = drawn_over(
            again,
            &Cell::Number(1e-6),
            &axes.concat(),
            "at=striker_velocity_mps=0",
        );
        assert_eq!(
            why.err().as_deref(),
            Some("has points twice, and so others are missing")
        );
    }

    #[test]
    fn a_picture_of_no_values_is_refused() {
        let why = drawn_over(0..3, &Cell::Null, &speeds(3), "").err().unwrap();
        assert!(
            why.starts_with("has no point with a value of absorbed_j; "),
            "{why}"
        );
    }

    #[test]
    fn names_of_curves_have_as_many_digits_as_tell_them_apart() {
        assert_eq!(short(&[0.1, 0.25, 1.0 / 3.0]), ["0.1", "0.25", "0.3333"]);
        assert_eq!(short(&[100.01, 100.02]), ["100.01", "100.02"]);
        assert_eq!(short(&[1.0, 1.0 + 1e-12]), ["1", "1.000000000001"]);
    }
}
