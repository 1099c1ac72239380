//! Cells coloured by a value, and the bar that says which colour is which.

use super::canvas::{Anchor, Canvas};
use super::ink::Ink;
use super::scale::{Scale, Ticks, ends};

/// Values over a grid of cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// The quantity and unit of the values. `^(…)` raises an exponent.
    pub label: String,
    /// Edges of the columns, one more than there are columns, in the units of the horizontal axis.
    pub x_edges: Vec<f64>,
    /// Edges of the rows, likewise.
    pub y_edges: Vec<f64>,
    /// Row by row. A value that is no number leaves its cell empty.
    pub values: Vec<f64>,
}

/// Perceptually uniform colours, also for colour-blind readers and in grey: matplotlib's *viridis* (N.
/// Smith and S. van der Walt, 2015, CC0), at nine places.
const COLOURS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [40.0, 174.0, 128.0],
    [94.0, 201.0, 98.0],
    [173.0, 220.0, 48.0],
    [253.0, 231.0, 37.0],
];
/// Number of distinct colours.
const LEVELS: usize = 128;

/// Size of the bar's numbers and of its title, height of the bar, and gap around it, pixels.
const NUMBERS: f64 = 14.0;
const BAR: f64 = 14.0;
const GAP: f64 = 5.0;

impl Map {
    /// The least and the greatest value.
    fn range(&self) -> (f64, f64) {
        let (low, high) = ends(self.values.iter().copied());
        if low < high {
            (low, high)
        } else if low.is_finite() && low == high {
            // One colour for all.
            let margin = 0.5 * low.abs().max(1e-12);
            (low - margin, low + margin)
        } else {
            (0.0, 1.0)
        }
    }

    /// The height of the bar with all around it, pixels.
    pub(super) fn bar_height(&self) -> f64 {
        NUMBERS + GAP + BAR + GAP + NUMBERS + 2.0 * GAP
    }

    /// Draws the bar below `top`.
    pub(super) fn draw_bar(&self, canvas: &mut Canvas, (left, right): (f64, f64), top: f64) {
        let (low, high) = self.range();
        let title = (left, top + 0.5 * NUMBERS);
        canvas.text(&self.label, title, NUMBERS, Ink::Text, Anchor::Start);
        let (top, step) = (top + NUMBERS + GAP, (right - left) / LEVELS as f64);
        for level in 0..LEVELS {
            let from = left + level as f64 * step;
            canvas.cell((from, top), (from + step, top + BAR), &colour(level));
        }
        for (place, label) in Ticks::new(Scale::Linear, (low, high), 6).major {
            let x = left + (place - low) / (high - low) * (right - left);
            canvas.line(&[(x, top + BAR), (x, top + BAR + 4.0)], Ink::Guide, 1.0, "");
            let at = (x, top + BAR + GAP + 0.5 * NUMBERS + 1.0);
            canvas.text(&label, at, NUMBERS, Ink::Guide, Anchor::Middle);
        }
    }

    /// Draws the cells. `x` and `y` return the pixels of values.
    pub(super) fn draw(&self, canvas: &mut Canvas, x: impl Fn(f64) -> f64, y: impl Fn(f64) -> f64) {
        let (low, high) = self.range();
        let level = |value: f64| {
            let part = (value - low) / (high - low);
            let level = ((part * LEVELS as f64) as usize).min(LEVELS - 1);
            value.is_finite().then_some(level)
        };
        let columns = self.x_edges.len().saturating_sub(1).max(1);
        for (row, edges) in self.values.chunks(columns).zip(self.y_edges.windows(2)) {
            let mut from = 0;
            // Neighbours of one colour are one cell.
            for run in row.chunk_by(|one, other| level(*one) == level(*other)) {
                let to = from + run.len();
                if let Some(level) = level(run[0]) {
                    let corners = (
                        (x(self.x_edges[from]), y(edges[0])),
                        (x(self.x_edges[to]), y(edges[1])),
                    );
                    canvas.cell(corners.0, corners.1, &colour(level));
                }
                from = to;
            }
        }
    }
}

fn colour(level: usize) -> String {
    let place = level as f64 / (LEVELS - 1) as f64 * (COLOURS.len() - 1) as f64;
    let below = (place as usize).min(COLOURS.len() - 2);
    let part = place - below as f64;
    let mix =
        |n: usize| (COLOURS[below][n] + part * (COLOURS[below + 1][n] - COLOURS[below][n])).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(columns: usize, values: Vec<f64>, x: impl Fn(f64) -> f64) -> Vec<String> {
        let edges = |cells: usize| (0..=cells).map(|edge| edge as f64).collect();
        let map = Map {
            label: String::new(),
            x_edges: edges(columns),
            y_edges: edges(values.len() / columns),
            values,
        };
        let mut canvas = Canvas::default();
        map.draw(&mut canvas, x, |y| 100.0 - 10.0 * y);
        canvas
            .into_svg()
            .split("<rect ")
            .skip(1)
            .map(str::to_owned)
            .collect()
    }

    #[test]
    fn each_cell_is_where_its_edges_are_in_the_colours_of_the_range_and_a_hole_stays_empty() {
        let cells = drawn(3, vec![0.0, 0.0, 1.0, f64::NAN, 1.0, 0.0], |x| 10.0 * x);
        assert_eq!(cells.len(), 4);
        for (cell, expected) in [
            (
                0,
                "x=\"0.00\" y=\"90.00\" width=\"20.00\" height=\"10.00\" fill=\"#440154\"",
            ),
            (
                2,
                "x=\"10.00\" y=\"80.00\" width=\"10.00\" height=\"10.00\" fill=\"#fde725\"",
            ),
        ] {
            assert!(cells[cell].starts_with(expected), "{cells:?}");
        }
    }

    #[test]
    fn cells_side_by_side_have_no_gap_between_them() {
        let cells = drawn(300, (0..300).map(f64::from).collect(), |x| 64.56 + 1.304 * x);
        let number = |cell: &str, key: &str| -> f64 {
            let value = cell.split(key).nth(1).unwrap().split('"').next();
            value.unwrap().parse().unwrap()
        };
        assert!(cells.len() > 100);
        for pair in cells.windows(2) {
            let end = number(&pair[0], "x=\"") + number(&pair[0], "width=\"");
            assert!((number(&pair[1], "x=\"") - end).abs() < 1e-9, "{pair:?}");
        }
    }
}
