//! One panel, drawn: its axes with ticks, its grid, and its curves.

use super::canvas::{Anchor, Canvas, width};
use super::ink::Ink;
use super::legend::{Legend, draw_at_end, room_at_end};
use super::map::Map;
use super::panel::{Axis, Panel};
use super::scale::Ticks;
use super::series::{Glyph, Series, Stroke};

/// Gap between the drawing and the edge of the picture, pixels.
pub(super) const MARGIN: f64 = 8.0;
/// Right of the axes: room for half of the last tick's number.
const RIGHT: f64 = 16.0;
const NUMBERS: f64 = 14.0;
const TITLES: f64 = 15.0;
const TICK: f64 = 5.0;
const FINE: f64 = 3.0;
/// Gap from the ticks to the numbers, and from the numbers to the title, pixels.
const GAP: f64 = 5.0;
/// Gap between panels, pixels.
const APART: f64 = 12.0;

/// A panel, with the values that drawing it needs.
#[derive(Debug)]
pub(super) struct ChartFrame<'a> {
    panel: &'a Panel,
    x: &'a Axis,
    x_places: (f64, f64),
    y_places: (f64, f64),
    x_ticks: Ticks,
    y_ticks: Ticks,
    legend: Legend<'a>,
    /// True if it shows the numbers and the title of its horizontal axis.
    labelled: bool,
}

/// The left and right ends of all horizontal axes, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Columns {
    pub(super) left: f64,
    pub(super) right: f64,
}

impl<'a> ChartFrame<'a> {
    pub(super) fn new(panel: &'a Panel, x: &'a Axis, labelled: bool, picture: f64) -> Self {
        let (x_places, y_places) = (x.places(), panel.y_places(x.range));
        let rows = (f64::from(panel.height) / 30.0).clamp(3.0, 9.0) as usize;
        // Names stand side by side, and the axis takes more than half of the picture.
        let widest = x.names.iter().map(|name| width(name, NUMBERS));
        let columns = if x.names.is_empty() {
            (picture / 70.0).clamp(4.0, 10.0) as usize
        } else {
            (0.55 * picture / (widest.fold(0.0, f64::max) + GAP)) as usize
        };
        let ticks = |names: &[String], scale, places, most| {
            if names.is_empty() {
                Ticks::new(scale, places, most)
            } else {
                Ticks::named(names, places, most)
            }
        };
        Self {
            panel,
            x,
            x_places,
            y_places,
            x_ticks: ticks(&x.names, x.scale, x_places, columns),
            y_ticks: ticks(&panel.y_names, panel.y_scale, y_places, rows),
            legend: Legend::new(panel, picture),
            labelled,
        }
    }

    /// This frame with a legend that has room from `left` to the edge of a picture of this width.
    pub(super) fn named_from(self, left: f64, picture: f64) -> Self {
        Self {
            legend: Legend::new(self.panel, picture - MARGIN - left),
            ..self
        }
    }

    /// True if both axes have an extent.
    pub(super) fn has_extent(&self) -> bool {
        let extent = |(low, high): (f64, f64)| low.is_finite() && high.is_finite() && low < high;
        extent(self.x_places) && extent(self.y_places)
    }

    /// The columns that the panel needs in a picture of this width.
    pub(super) fn columns(&self, picture: f64) -> Columns {
        let numbers = self.y_ticks.major.iter().map(|(_, label)| width(label, NUMBERS));
        let left = MARGIN + TITLES + 2.0 * GAP + numbers.fold(0.0, f64::max) + GAP + TICK;
        let right = picture - MARGIN - RIGHT.max(room_at_end(self.panel));
        let right = right.min(picture - 0.5 * MARGIN - self.overhang(right - left));
        Columns { left, right }
    }

    /// Length of the last number beyond the end of a horizontal axis of this length, pixels.
    fn overhang(&self, length: f64) -> f64 {
        let (low, high) = self.x_places;
        let ticks = self.x_ticks.major.iter().filter(|_| self.labelled);
        ticks
            .map(|(place, label)| 0.5 * width(label, NUMBERS) - (high - place) / (high - low) * length)
            .fold(0.0, f64::max)
    }

    /// Height of the panel with all around it, pixels.
    pub(super) fn height(&self) -> f64 {
        self.above() + f64::from(self.panel.height) + self.below()
    }

    /// The height of what stands above the axes.
    fn above(&self) -> f64 {
        let bar = self.panel.map.as_ref().map_or(0.0, Map::bar_height);
        self.legend.height() + self.note_height() + bar
    }

    fn note_height(&self) -> f64 {
        self.panel.note.lines().count() as f64 * (NUMBERS + GAP)
    }

    /// The height of what stands below the axes.
    fn below(&self) -> f64 {
        if self.labelled {
            TICK + GAP + NUMBERS + GAP + TITLES + APART
        } else {
            APART
        }
    }

    /// Draws the panel below `top`.
    pub(super) fn draw(&self, canvas: &mut Canvas, top: f64, columns: Columns) {
        let Columns { left, right } = columns;
        if let Some(map) = &self.panel.map {
            map.draw_bar(canvas, (left, right), top + self.legend.height());
        }
        self.legend.draw(canvas, (left, top));
        let top = top + self.above();
        let bottom = top + f64::from(self.panel.height);
        let x = |place: f64| {
            let (low, high) = self.x_places;
            left + (place - low) / (high - low) * (right - left)
        };
        let y = |place: f64| {
            let (low, high) = self.y_places;
            bottom - (place - low) / (high - low) * (bottom - top)
        };
        match &self.panel.map {
            // Grid lines would cut the cells.
            Some(map) => {
                let (across, up) = (self.x.scale, self.panel.y_scale);
                map.draw(canvas, |value| x(across.place(value)), |value| y(up.place(value)));
            }
            None => {
                for (place, _) in &self.x_ticks.major {
                    canvas.line(&[(x(*place), top), (x(*place), bottom)], Ink::Grid, 1.0, "");
                }
                for (place, _) in &self.y_ticks.major {
                    canvas.line(&[(left, y(*place)), (right, y(*place))], Ink::Grid, 1.0, "");
                }
            }
        }
        self.axes(canvas, (left, right), (top, bottom), x, y);
        let at_end = self.curves(canvas, x, y);
        if self.panel.named_at_end {
            draw_at_end(canvas, at_end, right, (top, bottom));
        }
        let mut line = top - self.note_height() + 0.5 * (NUMBERS + GAP);
        for note in self.panel.note.lines() {
            canvas.text(note, (left, line), NUMBERS, Ink::Text, Anchor::Start);
            line += NUMBERS + GAP;
        }
    }

    fn axes(
        &self,
        canvas: &mut Canvas,
        (left, right): (f64, f64),
        (top, bottom): (f64, f64),
        x: impl Fn(f64) -> f64,
        y: impl Fn(f64) -> f64,
    ) {
        canvas.line(
            &[(left, top), (left, bottom), (right, bottom)],
            Ink::Guide,
            1.0,
            "",
        );
        let mut across = |place: f64, length: f64| {
            let at = x(place);
            canvas.line(&[(at, bottom), (at, bottom + length)], Ink::Guide, 1.0, "");
        };
        self.x_ticks.major.iter().for_each(|tick| across(tick.0, TICK));
        self.x_ticks.minor.iter().for_each(|place| across(*place, FINE));
        let mut up = |place: f64, length: f64| {
            let at = y(place);
            canvas.line(&[(left - length, at), (left, at)], Ink::Guide, 1.0, "");
        };
        self.y_ticks.major.iter().for_each(|tick| up(tick.0, TICK));
        self.y_ticks.minor.iter().for_each(|place| up(*place, FINE));
        for (place, label) in &self.y_ticks.major {
            let at = (left - TICK - GAP, y(*place));
            canvas.text(label, at, NUMBERS, Ink::Guide, Anchor::End);
        }
        let title = (MARGIN + 0.5 * TITLES, 0.5 * (top + bottom));
        canvas.text(&self.panel.y_label, title, TITLES, Ink::Text, Anchor::Upwards);
        if self.labelled {
            let line = bottom + TICK + GAP + 0.5 * NUMBERS;
            for (place, label) in &self.x_ticks.major {
                canvas.text(label, (x(*place), line), NUMBERS, Ink::Guide, Anchor::Middle);
            }
            let title = (0.5 * (left + right), line + 0.5 * NUMBERS + GAP + 0.5 * TITLES);
            canvas.text(&self.x.label, title, TITLES, Ink::Text, Anchor::Middle);
        }
    }

    /// Draws the curves, and returns those with names, with the heights at which they end.
    fn curves(
        &self,
        canvas: &mut Canvas,
        x: impl Fn(f64) -> f64,
        y: impl Fn(f64) -> f64,
    ) -> Vec<(&'a Series, f64)> {
        let mut ends = Vec::new();
        let inside = |value: f64, (low, high): (f64, f64)| value >= low && value <= high;
        for series in &self.panel.series {
            let place = |&(at, value): &(f64, f64)| (self.x.scale.place(at), self.panel.y_scale.place(value));
            let points: Vec<(f64, f64)> = series.points.iter().map(place).collect();
            let pixels = |&(at, value): &(f64, f64)| (x(at), y(value));
            // A line has marks only at lone points, which no segment shows.
            let (marked, stroke): (Vec<_>, _) = match series.stroke() {
                Stroke::Line { width, dashes } => {
                    let pieces = visible(&points, self.x_places, self.y_places);
                    for piece in &pieces {
                        let piece: Vec<(f64, f64)> = piece.iter().map(pixels).collect();
                        canvas.line(&piece, series.ink, width, dashes);
                    }
                    let last = pieces.last().and_then(|piece| piece.last());
                    ends.extend(last.map(|point| (series, pixels(point).1)));
                    let (glyph, radius) = (Glyph::Disc, width);
                    (lone(&points).collect(), Stroke::Filled { glyph, radius })
                }
                stroke => (points.iter().collect(), stroke),
            };
            for point in marked {
                if inside(point.0, self.x_places) && inside(point.1, self.y_places) {
                    canvas.mark(pixels(point), series.ink, stroke);
                }
            }
        }
        ends.retain(|(series, _)| !series.name.is_empty());
        ends
    }
}

/// The parts of a line that lie in a rectangle. A point that is no number ends a part.
fn visible(points: &[(f64, f64)], x: (f64, f64), y: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let Some((enter, leave)) = inside(from, to, x, y) else {
            joined = false;
            continue;
        };
        let at = |part: f64| (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
        match pieces.last_mut() {
            Some(piece) if joined && enter == 0.0 => piece.push(at(leave)),
            _ => pieces.push(vec![at(enter), at(leave)]),
        }
        joined = leave == 1.0;
    }
    pieces
}

/// The part of a segment inside a rectangle, from 0 to 1 (Liang and Barsky, ACM Trans. Graphics 3, 1, 1984).
fn inside(from: (f64, f64), to: (f64, f64), x: (f64, f64), y: (f64, f64)) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, end, (low, high)) in [(from.0, to.0, x), (from.1, to.1, y)] {
        let run = end - start;
        if !run.is_finite() {
            return None;
        }
        if run == 0.0 {
            if start < low || start > high {
                return None;
            }
            continue;
        }
        let (one, other) = ((low - start) / run, (high - start) / run);
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    (enter < leave).then_some((enter, leave))
}

/// The points of a line without a neighbour: no segment shows them.
fn lone(points: &[(f64, f64)]) -> impl Iterator<Item = &(f64, f64)> {
    let known = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
    let beside =
        move |place: Option<usize>| place.and_then(|place| points.get(place)).filter(known).is_some();
    let alone = move |place: usize| !beside(place.checked_sub(1)) && !beside(Some(place + 1));
    let places = points.iter().enumerate().filter(move |(place, _)| alone(*place));
    places.map(|(_, point)| point).filter(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_ends_where_it_leaves_the_panel_and_at_a_point_that_is_no_number() {
        let (inside, [one, other]) = ((0.0, 0.0), [(1.0, 0.5), (4.0, 0.5)]);
        for (points, expected) in [
            (vec![inside, one, other], vec![vec![inside, one, other]]),
            (
                vec![inside, (1.0, 2.0), (2.0, 0.0)],
                vec![vec![inside, (0.5, 1.0)], vec![(1.5, 1.0), (2.0, 0.0)]],
            ),
            (
                vec![inside, one, (2.0, f64::NAN), (3.0, 0.5), other],
                vec![vec![inside, one], vec![(3.0, 0.5), other]],
            ),
        ] {
            assert_eq!(visible(&points, (0.0, 4.0), (0.0, 1.0)), expected);
        }
    }

    #[test]
    fn a_point_between_two_that_are_missing_is_alone() {
        let (none, points) = (f64::NAN, [0.1, f64::NAN, 0.3, f64::NAN, 0.5, 0.6]);
        let of = |values: &[f64]| -> Vec<f64> {
            let points: Vec<_> = values.iter().map(|value| (0.0, *value)).collect();
            lone(&points).map(|point| point.1).collect()
        };
        assert_eq!(of(&points), [0.1, 0.3]);
        assert_eq!(of(&[0.7]), [0.7]);
        assert_eq!(of(&[none, 0.2]), [0.2]);
        assert!(of(&[none, 0.2, 0.3]).is_empty() && of(&[none]).is_empty());
    }
}
