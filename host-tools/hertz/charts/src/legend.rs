//! The names of curves: in rows above the axes, or at the ends of the curves.

use super::canvas::{Anchor, Canvas, width};
use super::ink::Ink;
use super::panel::Panel;
use super::series::{Series, Stroke};

/// Size of the names, pixels.
pub(super) const NAMES: f64 = 14.0;
const ROW: f64 = 20.0;
/// Gap between the last row and the axes, pixels.
const BELOW: f64 = 8.0;
/// Length of the piece of the curve before its name.
const SAMPLE: f64 = 28.0;
const GAP: f64 = 7.0;
const BETWEEN: f64 = 18.0;

/// The legend above the axes, where it hides no data. Its entries stand in columns, in as few rows as they
/// fit into.
#[derive(Debug)]
pub(super) struct Legend<'a> {
    entries: Vec<&'a Series>,
    /// The left of each column.
    columns: Vec<f64>,
}

impl<'a> Legend<'a> {
    /// The legend of a panel with this much room for it, pixels.
    pub(super) fn new(panel: &'a Panel, room: f64) -> Self {
        let named = |series: &&Series| !series.name.is_empty() && !panel.named_at_end;
        let entries: Vec<&Series> = panel.series.iter().filter(named).collect();
        let rows = (1..=entries.len()).find(|rows| lefts(&entries, *rows).1 <= room);
        let columns = lefts(&entries, rows.unwrap_or(1)).0;
        Self { entries, columns }
    }

    /// Its height, pixels.
    pub(super) fn height(&self) -> f64 {
        match self.entries.len().div_ceil(self.columns.len().max(1)) {
            0 => 0.0,
            rows => rows as f64 * ROW + BELOW,
        }
    }

    /// Draws the legend with this upper left corner.
    pub(super) fn draw(&self, canvas: &mut Canvas, (left, top): (f64, f64)) {
        for (place, series) in self.entries.iter().enumerate() {
            let x = left + self.columns[place % self.columns.len()];
            let y = top + ROW * ((place / self.columns.len()) as f64 + 0.5);
            sample(canvas, series, (x, y));
            let name = (x + SAMPLE + GAP, y);
            canvas.text(&series.name, name, NAMES, Ink::Text, Anchor::Start);
        }
    }
}

/// The left ends of the columns for this number of rows, and the right end of the last one.
fn lefts(entries: &[&Series], rows: usize) -> (Vec<f64>, f64) {
    let count = entries.len().div_ceil(rows);
    let mut lefts = Vec::new();
    let mut left = 0.0;
    for column in 0..count {
        lefts.push(left);
        let names = entries.iter().skip(column).step_by(count);
        let widest = names.map(|series| width(&series.name, NAMES)).fold(0.0, f64::max);
        left += SAMPLE + GAP + widest + BETWEEN;
    }
    (lefts, left - BETWEEN)
}

/// A piece of a curve.
fn sample(canvas: &mut Canvas, series: &Series, (x, y): (f64, f64)) {
    match series.stroke() {
        Stroke::Line { width, dashes } => {
            canvas.line(&[(x, y), (x + SAMPLE, y)], series.ink, width, dashes);
        }
        stroke => canvas.mark((x + 0.5 * SAMPLE, y), series.ink, stroke),
    }
}

/// The room that names at the ends of the curves take on the right, pixels.
pub(super) fn room_at_end(panel: &Panel) -> f64 {
    let names = panel.series.iter().filter(|_| panel.named_at_end);
    let widest = names.map(|series| width(&series.name, NAMES)).fold(0.0, f64::max);
    if widest > 0.0 { widest + 2.0 * GAP } else { 0.0 }
}

/// Writes each name beside the end of its curve. `ends` has the names' curves with the heights of their ends.
/// Names that would cover one another move apart, inside the span from `top` to `bottom`.
pub(super) fn draw_at_end(
    canvas: &mut Canvas,
    mut ends: Vec<(&Series, f64)>,
    right: f64,
    (top, bottom): (f64, f64),
) {
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut places: Vec<f64> = ends.iter().map(|end| end.1).collect();
    for place in 1..places.len() {
        places[place] = places[place].max(places[place - 1] + NAMES + 1.0);
    }
    let mut limit = bottom;
    for place in places.iter_mut().rev() {
        *place = place.min(limit).max(top);
        limit = *place - NAMES - 1.0;
    }
    for ((series, _), y) in ends.into_iter().zip(places) {
        canvas.text(&series.name, (right + GAP, y), NAMES, series.ink, Anchor::Start);
    }
}
