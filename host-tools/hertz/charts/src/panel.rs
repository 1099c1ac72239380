//! Axes and panels.

use std::ops::{Range, RangeInclusive};

use super::map::Map;
use super::scale::{Scale, ends};
use super::series::Series;

/// A horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Its quantity and unit. `^(…)` raises an exponent.
    pub label: String,
    /// Its two ends.
    pub range: (f64, f64),
    /// Its scale.
    pub scale: Scale,
    /// Names in place of the numbers 0, 1, 2 and so on; empty for numbers.
    pub names: Vec<String>,
}

impl Axis {
    /// A linear axis.
    pub fn new(label: impl Into<String>, range: Range<f64>) -> Self {
        Self {
            label: label.into(),
            range: (range.start, range.end),
            scale: Scale::Linear,
            names: Vec::new(),
        }
    }

    /// An axis of counts, with a margin beyond both ends.
    pub fn count(label: impl Into<String>, range: RangeInclusive<usize>) -> Self {
        Self {
            scale: Scale::Count,
            ..Self::new(label, *range.start() as f64 - 0.3..*range.end() as f64 + 0.3)
        }
    }

    /// A logarithmic axis.
    pub fn log(label: impl Into<String>, range: Range<f64>) -> Self {
        Self {
            scale: Scale::Log,
            ..Self::new(label, range)
        }
    }

    /// Its ends, as places on its scale.
    pub(super) fn places(&self) -> (f64, f64) {
        (self.scale.place(self.range.0), self.scale.place(self.range.1))
    }
}

/// One panel: a pair of axes with curves. A curve ends where it leaves the panel.
#[derive(Debug, Clone)]
pub struct Panel {
    /// The quantity and unit of the vertical axis. `^(…)` raises an exponent.
    pub y_label: String,
    /// The scale of the vertical axis.
    pub y_scale: Scale,
    /// Names in place of the numbers 0, 1, 2 and so on; empty for numbers.
    pub y_names: Vec<String>,
    /// The vertical range; without one, the extent of the curves.
    pub y_range: Option<(f64, f64)>,
    /// The curves, drawn in order.
    pub series: Vec<Series>,
    /// Height in pixels at the chart's width.
    pub height: u32,
    /// A horizontal axis of its own, in place of the chart's.
    pub x: Option<Axis>,
    /// A note above the axes, in these lines; empty for none.
    pub note: String,
    /// True to write names at the ends of the curves, not in a legend above them.
    pub named_at_end: bool,
    /// Cells under the curves.
    pub map: Option<Map>,
}

impl Panel {
    /// A panel of 240 pixels with a linear vertical axis, over the chart's horizontal axis.
    pub fn new(y_label: impl Into<String>, series: Vec<Series>) -> Self {
        Self {
            y_label: y_label.into(),
            y_scale: Scale::Linear,
            y_names: Vec::new(),
            y_range: None,
            series,
            height: 240,
            x: None,
            note: String::new(),
            named_at_end: false,
            map: None,
        }
    }

    /// This panel with a logarithmic vertical axis.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.y_scale = Scale::Log;
        self
    }

    /// This panel with this vertical range.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.y_range = Some((low, high));
        self
    }

    /// This panel with this height, pixels.
    #[must_use]
    pub fn height(mut self, height: u32) -> Self {
        self.height = height;
        self
    }

    /// This panel over a horizontal axis of its own.
    #[must_use]
    pub fn over(mut self, x: Axis) -> Self {
        self.x = Some(x);
        self
    }

    /// This panel with a note above its axes.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// This panel with the names at the ends of the curves.
    #[must_use]
    pub fn named_at_end(mut self) -> Self {
        self.named_at_end = true;
        self
    }

    /// This panel over cells coloured by a value.
    #[must_use]
    pub fn map(mut self, map: Map) -> Self {
        self.map = Some(map);
        self
    }

    /// The vertical range, as places on its scale: the given range, or the extent of the curves inside the
    /// horizontal range with a margin. It is never empty.
    pub(super) fn y_places(&self, x_range: (f64, f64)) -> (f64, f64) {
        if let Some((low, high)) = self.y_range {
            return (self.y_scale.place(low), self.y_scale.place(high));
        }
        let points = self.series.iter().flat_map(|series| &series.points);
        let points = points.filter(|(x, _)| (x_range.0..=x_range.1).contains(x));
        let (low, high) = ends(points.map(|(_, y)| self.y_scale.place(*y)));
        if low > high {
            return (-1.0, 1.0);
        }
        let margin = 0.06 * (high - low);
        if margin > 0.0 {
            (low - margin, high + margin)
        } else {
            // A single value gets room around it, even where 1 is less than its last digit.
            let room = f64::max(1.0, 1e-3 * low.abs());
            (low - room, high + room)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ink, Mark};

    #[test]
    fn one_value_has_room_around_it() {
        for (value, range) in [
            (0.0, (-1.0, 1.0)),
            (5.0, (4.0, 6.0)),
            (1e30, (0.999e30, 1.001e30)),
        ] {
            let points = [(0.0, value), (1.0, value)];
            let series = Series::new("", Ink::Guide, Mark::Discs, points);
            let (low, high) = Panel::new(String::new(), vec![series]).y_places((0.0, 1.0));
            let close = |found: f64, expected: f64| (found - expected).abs() <= 1e-12 * value;
            assert!(close(low, range.0) && close(high, range.1), "{low} {high}");
        }
    }
}
