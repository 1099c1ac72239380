//! Curves and maps of a sweep's table.

use std::collections::HashSet;
use std::path::Path;

use anyhow::Context;
use hertz_figures::chart::{Axis as ChartAxis, COLUMN, Chart, FAMILY, Ink, Map, Mark, Panel, Scale, Series};

use crate::export::read::Reading;
use crate::export::{Cell, Kind};
use crate::recording::printable::first_of;
use crate::sweep::axis::{Along, Values};
use crate::sweep::definition::Definition;
use crate::sweep::plan::Plan;

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
    at: Vec<(usize, u64)>,
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

/// More curves than this cannot be told apart.
const MOST_CURVES: u64 = 4 * FAMILY as u64;
/// Names of a list that are told.
const NAMES_TOLD: usize = 20;
/// Cells of a map.
const MOST_CELLS: u64 = 250_000;
/// Points of curves, and places of an axis.
const MOST_DRAWN: usize = 1_000_000;
const MOST_PLACES: u64 = 10_000_000;
/// Beyond this a value is none: two may differ by more than an `f64` can be.
const MOST_VALUE: f64 = 1e300;

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
    let reading = Reading::open(table)?;
    let sweep = reading.said("sweep").context("it is no table of bead sweep")?;
    let plan = Plan::new(Definition::from_toml(sweep, "its sweep")?)?;
    let (has, points) = (reading.rows(), plan.points());
    anyhow::ensure!(has == points, "it has {has} rows, and its sweep {points} points");
    let decided = decide(view, &plan).map_err(anyhow::Error::msg)?;
    let value = match &decided.drawn {
        Drawn::Curves { y, .. } => y,
        Drawn::Map { value, .. } => value,
    };
    let mut rows: Vec<(u64, f64)> = Vec::new();
    for group in reading.groups_of(&["point", value])? {
        for row in group?.into_rows() {
            let number_of_point = match &row[0] {
                Cell::Whole(point) => u64::try_from(*point).ok(),
                _ => None,
            };
            let point = number_of_point.filter(|point| *point < points);
            let point = point.context("a row is of no point of its sweep")?;
            let mut chosen = decided.at.iter();
            if chosen.all(|(axis, place)| plan.place(point, *axis) == *place) {
                let few = rows.len() < MOST_DRAWN;
                anyhow::ensure!(
                    few,
                    "it has more than {MOST_DRAWN} points to draw; choose some with --at"
                );
                let value = Some(number(&row[1])).filter(|value| value.abs() <= MOST_VALUE);
                rows.push((point, value.unwrap_or(f64::NAN)));
            }
        }
    }
    rows.sort_by_key(|row| row.0);
    if let Some(twice) = rows.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        anyhow::bail!("it has point {} twice, and so others are missing", twice[0].0);
    }
    let quantity = Quantity::new(value, rows.iter().map(|row| row.1));
    match &decided.drawn {
        Drawn::Curves { by, .. } => Ok(curves(&plan, &decided.x, by.as_ref(), &quantity, rows)),
        Drawn::Map { y, .. } => map(&plan, &decided.x, y, &quantity, &rows),
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
    let mut at = Vec::new();
    for text in &view.at {
        at.push(chosen(plan, text)?);
    }
    // Axes that no --at has chosen from, and that have anything to choose.
    let mut open: Vec<usize> = (0..plan.axes().len())
        .filter(|axis| plan.axes()[*axis].count > 1)
        .collect();
    open.retain(|axis| !at.iter().any(|(chosen, _)| chosen == axis));
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
                column(*axis.ok_or_else(|| format!("there is no axis left for {what}; leave out an --at"))?)
            }
        };
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
        Drawn::Map { y, .. } if count(&x) < 2 || count(y) < 2 => {
            Err("a map needs two values of each axis at least; draw a curve".to_owned())
        }
        Drawn::Map { y, .. } if count(&x).saturating_mul(count(y)) > MOST_CELLS => Err(format!(
            "a map of {} × {} cells is more than can be seen; {MOST_CELLS} are the most",
            count(&x),
            count(y)
        )),
        _ => Ok(Decided { x, drawn, at }),
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
fn chosen(plan: &Plan, text: &str) -> Result<(usize, u64), String> {
    let wrong = || format!("--at {text}: write COLUMN=VALUE with a column of an axis");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let column = find(plan, name.trim()).ok_or_else(wrong)?;
    let (axis, value) = (&plan.axes()[column.axis], value.trim());
    let along = column.along.map(|along| &axis.along[along]);
    if let Some(along) = along.filter(|along| along.kind() == Kind::Text) {
        let same = |place: &u64| along.cell(*place) == Cell::Text(value.into());
        let place = (0..axis.count).find(same);
        return Ok((
            column.axis,
            place.ok_or_else(|| format!("--at {text}: no point has that value"))?,
        ));
    }
    let value: f64 = value.parse().map_err(|_| wrong())?;
    let distances = (0..axis.count).map(|place| (place, (coordinate(along, place) - value).abs()));
    let nearest = distances.min_by(|one, other| one.1.total_cmp(&other.1));
    Ok((column.axis, nearest.ok_or_else(wrong)?.0))
}

/// The number at a place of an axis; a text is told by its place.
fn coordinate(along: Option<&Along>, place: u64) -> f64 {
    match along.map(|along| along.cell(place)) {
        Some(cell @ (Cell::Number(_) | Cell::Whole(_))) => number(&cell),
        _ => place as f64,
    }
}

fn number(cell: &Cell) -> f64 {
    match cell {
        Cell::Number(number) => *number,
        Cell::Whole(number) => *number as f64,
        _ => f64::NAN,
    }
}

/// How a column is written on an axis: its name, its unit with a prefix that makes numbers short, and what it
/// is divided by for that.
struct Quantity {
    label: String,
    unit: f64,
}

/// Endings of columns, the longest first, with their units. A kilogram is a thousand of what takes a prefix.
const UNITS: [(&str, &str, f64); 10] = [
    ("_N_s_per_m", "N·s/m", 1.0),
    ("_kg_per_m3", "", 0.0),
    ("_N_per_m", "N/m", 1.0),
    ("_m_per_s", "m/s", 1.0),
    ("_Pa", "Pa", 1.0),
    ("_kg", "g", 1e-3),
    ("_J", "J", 1.0),
    ("_N", "N", 1.0),
    ("_s", "s", 1.0),
    ("_m", "m", 1.0),
];
const PREFIXES: [(&str, f64); 8] = [
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("", 1.0),
    ("m", 1e-3),
    ("µ", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
];

impl Quantity {
    fn new(column: &str, values: impl Iterator<Item = f64>) -> Self {
        let greatest = values
            .filter(|value| value.is_finite())
            .map(f64::abs)
            .fold(0.0, f64::max);
        let known = UNITS.iter().find(|(end, ..)| column.ends_with(end));
        match known {
            Some((end, unit, size)) if *size > 0.0 => {
                let name = column[..column.len() - end.len()].replace('_', " ");
                let fits = |(_, prefix): &&(&str, f64)| greatest >= prefix * size;
                let (letter, prefix) = PREFIXES.iter().find(fits).unwrap_or(&("", 1.0));
                Self {
                    label: format!("{name} ({letter}{unit})"),
                    unit: prefix * size,
                }
            }
            Some((end, ..)) => Self {
                label: format!("{} (kg/m³)", column[..column.len() - end.len()].replace('_', " ")),
                unit: 1.0,
            },
            None => Self {
                label: column.replace('_', " "),
                unit: 1.0,
            },
        }
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

    fn all(&self, plan: &Plan) -> Vec<f64> {
        let along = self.along(plan);
        (0..plan.axes()[self.axis].count)
            .map(|place| coordinate(along, place))
            .collect()
    }

    /// The column's values, in its unit, with its scale.
    fn quantity(&self, plan: &Plan) -> (Quantity, Vec<f64>, Scale) {
        let values = self.all(plan);
        let quantity = Quantity::new(&self.name(plan), values.iter().copied());
        let log = matches!(
            self.along(plan).map(|along| &along.values),
            Some(Values::Log { .. } | Values::Drawn { log: true, .. })
        );
        let values = values.iter().map(|value| value / quantity.unit).collect();
        (quantity, values, if log { Scale::Log } else { Scale::Linear })
    }

    fn drawn(&self, plan: &Plan) -> bool {
        self.along(plan)
            .is_some_and(|along| matches!(along.values, Values::Drawn { .. }))
    }
}

fn axis(label: String, (low, high): (f64, f64), scale: Scale) -> ChartAxis {
    // One value has room around it.
    let room = match place(low, scale) < place(high, scale) {
        true => 0.0,
        false => 0.5 * low.abs().max(1e-9),
    };
    ChartAxis {
        label,
        range: (low - room, high + room),
        scale,
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

fn described(plan: &Plan, what: &str) -> String {
    match plan.definition().title.as_str() {
        "" => what.to_owned(),
        title => format!("{title}: {what}"),
    }
}

fn curves(plan: &Plan, x: &Column, by: Option<&Column>, y: &Quantity, rows: Vec<(u64, f64)>) -> Chart {
    let (across, values, scale) = x.quantity(plan);
    let families = by.map_or(1, |by| plan.axes()[by.axis].count);
    let named = by.map(|by| by.quantity(plan));
    let mut points: Vec<Vec<(f64, f64)>> = vec![Vec::new(); families as usize];
    for (point, value) in rows {
        let family = by.map_or(0, |by| plan.place(point, by.axis) as usize);
        points[family].push((values[plan.place(point, x.axis) as usize], value / y.unit));
    }
    let names = named
        .as_ref()
        .map_or_else(Vec::new, |(_, values, _)| short(values));
    let series = points.into_iter().enumerate().map(|(family, mut points)| {
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        let text = by.and_then(|by| match by.along(plan)?.cell(family as u64) {
            Cell::Text(text) => Some(text.to_string()),
            _ => None,
        });
        let name = text.or_else(|| names.get(family).cloned()).unwrap_or_default();
        Series {
            name,
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
    let mut panel = Panel::new(y.label.clone(), series.collect());
    if let Some((quantity, ..)) = &named {
        panel = panel.note(format!("by {}", quantity.label));
    }
    let axis = axis(across.label, ends(&values), scale);
    let description = described(plan, &format!("{} over {}", y.label, axis.label));
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

fn map(plan: &Plan, x: &Column, y: &Column, value: &Quantity, rows: &[(u64, f64)]) -> anyhow::Result<Chart> {
    let [across, up] = [x, y].map(|column| {
        let (quantity, values, scale) = column.quantity(plan);
        // Drawn or listed values need not be in order.
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
        let mut rank = vec![0; order.len()];
        order
            .iter()
            .enumerate()
            .for_each(|(place, from)| rank[*from] = place);
        let sorted: Vec<f64> = order.iter().map(|from| values[*from]).collect();
        (quantity, edges(&sorted, scale), scale, rank)
    });
    let columns = across.3.len();
    let mut values = vec![f64::NAN; columns * up.3.len()];
    for (point, found) in rows {
        let place = |of: &Column| plan.place(*point, of.axis) as usize;
        let (column, row) = (across.3[place(x)], up.3[place(y)]);
        values[row * columns + column] = found / value.unit;
    }
    let (x_range, y_range) = (ends(&across.1), ends(&up.1));
    for ((low, high), scale, label) in [(x_range, across.2, &across.0.label), (y_range, up.2, &up.0.label)] {
        anyhow::ensure!(
            place(low, scale) < place(high, scale),
            "a map needs two values of each axis at least, and those of {label} cannot be told apart; draw a curve"
        );
    }
    let panel = Panel {
        y_scale: up.2,
        ..Panel::new(up.0.label, Vec::new())
    };
    let cells = Map {
        label: value.label.clone(),
        x_edges: across.1,
        y_edges: up.1,
        values,
    };
    let panel = panel.range(y_range.0, y_range.1).height(360).map(cells);
    let axis = axis(across.0.label, x_range, across.2);
    let description = described(
        plan,
        &format!("{} over {} and {}", value.label, axis.label, panel.y_label),
    );
    Ok(Chart {
        description,
        width: COLUMN,
        ..Chart::new(axis, vec![panel])
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
    use crate::export::table::{Parquet, Table};

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

    /// A table of these points, which tells of a sweep over these axes, drawn.
    fn drawn_over(points: &[i64], axes: &str) -> Result<Chart, String> {
        let mut sweep: toml::Table = toml::from_str(axes).unwrap();
        let paper = hertz_chain::Scenario::paper().to_toml();
        let scenario: toml::Table = toml::from_str(&paper).unwrap();
        sweep.insert("scenario".to_owned(), scenario.into());
        let plan = Plan::new(Definition::from_toml(&sweep.to_string(), "a.toml").unwrap()).unwrap();
        let path = tempfile::NamedTempFile::new().unwrap();
        let mut file = path.reopen().unwrap();
        let said = [("sweep", sweep.to_string())];
        let said = said.each_ref().map(|(key, value)| (*key, value.as_str()));
        let mut table = Parquet::signed(&mut file, "sweep", &plan.columns(), &said).unwrap();
        for point in points {
            let mut row = plan.row(0, &Err("it was not run".to_owned()));
            row[0] = Cell::Whole(*point);
            table.push(row).unwrap();
        }
        Box::new(table).finish().unwrap();
        chart(path.path(), &View::default()).map_err(|error| error.to_string())
    }

    fn drawn(points: &[i64], speeds: u64) -> Result<Chart, String> {
        let axis = format!("[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, {speeds}.0]");
        drawn_over(points, &axis)
    }

    #[test]
    fn values_that_cannot_be_told_apart_have_no_map_and_have_a_curve() {
        let speeds = "[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, 2]\n";
        // Their logarithms are equal.
        let near = "[[axis]]\nkey = \"chain.young\"\nlogspace = [5e9, 5000000000.000001, 2]\n";
        for axes in [[speeds, near], [near, speeds]] {
            let why = drawn_over(&[0, 1, 2, 3], &axes.concat()).err().unwrap();
            assert!(why.contains("cannot be told apart; draw a curve"), "{why}");
        }
        let chart = drawn_over(&[0, 1], near).unwrap();
        assert!(chart.standalone_svg().is_ok());
    }

    #[test]
    fn a_table_has_the_points_of_its_sweep() {
        assert!(drawn(&[0, 1, 2], 3).is_ok());
        for (points, speeds, why) in [
            (&[0, 1][..], 3, "it has 2 rows, and its sweep 3 points"),
            (
                &[0, 1],
                1_000_000_000_000,
                "it has 2 rows, and its sweep 1000000000000 points",
            ),
            (&[0, 1, 3], 3, "a row is of no point of its sweep"),
            (&[0, 1, -1], 3, "a row is of no point of its sweep"),
            (&[1, 0, 1], 3, "it has point 1 twice, and so others are missing"),
        ] {
            assert_eq!(drawn(points, speeds).err().as_deref(), Some(why));
        }
        let all: Vec<i64> = (0..=MOST_DRAWN as i64).collect();
        let why = drawn(&all, all.len() as u64).err();
        assert!(why.is_some_and(|why| why.starts_with("it has more than 1000000 points")));
    }

    #[test]
    fn names_of_curves_have_as_many_digits_as_tell_them_apart() {
        assert_eq!(short(&[0.1, 0.25, 1.0 / 3.0]), ["0.1", "0.25", "0.3333"]);
        assert_eq!(short(&[100.01, 100.02]), ["100.01", "100.02"]);
        assert_eq!(short(&[1.0, 1.0 + 1e-12]), ["1", "1.000000000001"]);
    }

    #[test]
    fn units_take_the_prefix_that_makes_numbers_short() {
        let of = |column: &str, value: f64| {
            let quantity = Quantity::new(column, [value].into_iter());
            (quantity.label, value / quantity.unit)
        };
        assert_eq!(of("absorbed_J", 12e-6).0, "absorbed (µJ)");
        assert_eq!(of("intruder_0_mass_kg", 3.7e-3).0, "intruder 0 mass (g)");
        assert_eq!(of("chain_young_Pa", 4.5e9), ("chain young (GPa)".to_owned(), 4.5));
        assert_eq!(
            of("absorbed_of_injected", 0.2),
            ("absorbed of injected".to_owned(), 0.2)
        );
    }
}
