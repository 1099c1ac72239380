//! The sides of a chart: values, labels and cells along an axis of a sweep.

use std::collections::HashSet;

use hertz_charts::{Axis as ChartAxis, Scale};

use crate::axis::{Along, Values};
use crate::column::AxisColumn;
use bead_tables::Cell;
use bead_tables::printable::{beginning, one_line};
use bead_tables::unit::Unit;

/// Greatest number of letters of a text in a legend or a note, and at an axis.
const TEXT_LETTERS: usize = 40;
const AXIS_LETTERS: usize = 12;

/// A column as a chart shows it.
pub(super) struct ShownQuantity {
    pub(super) name: String,
    /// Symbol of the unit, with the prefix that makes numbers short; empty for none.
    pub(super) symbol: String,
    /// Divisor of values for that unit.
    pub(super) unit: f64,
}

impl ShownQuantity {
    pub(super) fn new(column: &str, values: impl Iterator<Item = f64>) -> Self {
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

    /// Name and unit at an axis.
    pub(super) fn label(&self) -> String {
        if self.symbol.is_empty() {
            return self.name.clone();
        }
        format!("{} ({})", self.name, self.symbol)
    }
}

/// The value at a place, for people. Where several keys change along the axis, other places may have the
/// same value, so the place is added.
pub(super) fn label(column: &AxisColumn<'_>, place: u64) -> String {
    let number = column.number(place);
    let quantity = ShownQuantity::new(&column.name(), [number].into_iter());
    let value = match column.of_texts() {
        Some(along) => text(along, place),
        None => short(&[number / quantity.unit]).concat(),
    };
    let axis = column.of.name.as_ref().filter(|_| column.along.is_some());
    let place = axis.map_or_else(String::new, |axis| format!(" ({axis} {place})"));
    let label = format!("{} = {value} {}", quantity.name, quantity.symbol);
    format!("{}{place}", label.trim_end())
}

/// A text of the table, short and printable.
fn text(along: &Along, place: u64) -> String {
    match along.cell(place) {
        Cell::Text(text) => beginning(&one_line(&text), TEXT_LETTERS).into_owned(),
        _ => String::new(),
    }
}

/// Writes numbers with four digits, or with as many as it takes to tell them apart.
fn short(values: &[f64]) -> Vec<String> {
    let with = |decimals: usize| -> Vec<String> {
        let rounded = |value: &f64| format!("{value:.decimals$e}").parse().unwrap_or(*value);
        values.iter().map(|value| rounded(value).to_string()).collect()
    };
    let differ = |names: &Vec<String>| names.iter().collect::<HashSet<_>>().len() == names.len();
    let found = [3, 6, 9].into_iter().map(with).find(differ);
    found.unwrap_or_else(|| with(16))
}

/// A column along one side of a chart.
pub(super) struct Side {
    pub(super) quantity: ShownQuantity,
    /// Values by place, in the quantity's unit.
    pub(super) values: Vec<f64>,
    pub(super) scale: Scale,
    /// Texts by place; empty for a column of numbers.
    pub(super) texts: Vec<String>,
    /// True if the values are drawn from a distribution: their points are not joined.
    pub(super) is_drawn: bool,
}

impl Side {
    pub(super) fn new(column: &AxisColumn<'_>) -> Self {
        let places = 0..column.of.count;
        let values: Vec<f64> = places.clone().map(|place| column.number(place)).collect();
        let texts = match column.of_texts() {
            Some(along) => places.map(|place| text(along, place)).collect(),
            None => Vec::new(),
        };
        let quantity = ShownQuantity::new(&column.name(), values.iter().copied());
        let spacing = column.along.map(|along| &along.values);
        let is_log = matches!(
            spacing,
            Some(Values::Space { log: true, .. } | Values::Drawn { log: true, .. })
        );
        Self {
            values: values.iter().map(|value| value / quantity.unit).collect(),
            quantity,
            scale: if is_log { Scale::Log } else { Scale::Linear },
            texts,
            is_drawn: matches!(spacing, Some(Values::Drawn { .. })),
        }
    }

    /// The label, and the texts at the axis. Long texts are replaced by their places.
    pub(super) fn names(&self) -> (String, Vec<String>) {
        let label = self.quantity.label();
        if self.texts.iter().all(|text| text.chars().count() <= AXIS_LETTERS) {
            return (label, self.texts.clone());
        }
        let places = (1..=self.texts.len()).map(|place| place.to_string());
        (format!("{label}, by its place in the list"), places.collect())
    }

    /// Names of curves, one for each place.
    pub(super) fn legend(&self) -> Vec<String> {
        if self.texts.is_empty() {
            return short(&self.values);
        }
        self.texts.clone()
    }

    /// The axis of a chart, over a range. A single value has room around it.
    pub(super) fn axis(&self, (low, high): (f64, f64)) -> ChartAxis {
        let is_single = self.scale.place(low) >= self.scale.place(high);
        let room = if is_single { 0.5 * low.abs().max(1e-9) } else { 0.0 };
        let (label, names) = self.names();
        ChartAxis {
            label,
            range: (low - room, high + room),
            scale: self.scale,
            names,
        }
    }
}

/// The cells of a map along one of its sides.
pub(super) struct Cells {
    pub(super) side: Side,
    pub(super) edges: Vec<f64>,
    /// Cells by place on the axis.
    pub(super) of_places: Vec<usize>,
}

impl Cells {
    /// Makes a cell for each place.
    ///
    /// # Errors
    /// Two values are too near for cells of their own.
    pub(super) fn new(column: &AxisColumn<'_>) -> Result<Self, String> {
        let side = Side::new(column);
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
        if cells.all(|edges| scale.place(edges[0]) < scale.place(edges[1])) {
            return Ok(Self {
                side,
                edges,
                of_places,
            });
        }
        // The places of an axis of several keys differ.
        let axis = column.of.name.as_ref();
        let instead = axis.map_or_else(String::new, |axis| format!("a map over {axis}, or "));
        Err(format!(
            "some values of {} cannot be told apart; draw {instead}a curve",
            column.name()
        ))
    }
}

/// Edges of cells half-way between sorted values.
fn edges(values: &[f64], scale: Scale) -> Vec<f64> {
    let back = |position: f64| match scale {
        Scale::Log => 10_f64.powf(position),
        _ => position,
    };
    let positions: Vec<f64> = values.iter().map(|value| scale.place(*value)).collect();
    let last = positions.len() - 1;
    let mut edges = vec![positions[0] - 0.5 * (positions[1] - positions[0])];
    edges.extend(positions.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
    edges.push(positions[last] + 0.5 * (positions[last] - positions[last - 1]));
    edges.into_iter().map(back).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_lie_half_way_between_values_on_their_scale() {
        assert_eq!(edges(&[1.0, 2.0, 4.0], Scale::Linear), [0.5, 1.5, 3.0, 5.0]);
        let edges = edges(&[1.0, 100.0], Scale::Log);
        let off = edges
            .iter()
            .zip([0.1, 10.0, 1000.0])
            .map(|(one, other)| (one / other - 1.0).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{edges:?}");
    }

    #[test]
    fn names_of_curves_have_as_many_digits_as_tell_them_apart() {
        assert_eq!(short(&[0.1, 0.25, 1.0 / 3.0]), ["0.1", "0.25", "0.3333"]);
        assert_eq!(short(&[100.01, 100.02]), ["100.01", "100.02"]);
        assert_eq!(short(&[1.0, 1.0 + 1e-12]), ["1", "1.000000000001"]);
    }
}
