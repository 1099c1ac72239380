//! Curves, and how they are drawn.

use super::ink::Ink;

/// The style of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A broad line under the others.
    Broad,
    /// A thin line.
    Line,
    /// A thin dashed line.
    Dashed,
    /// A thin line whose dashes are those of this place in a family of curves, so that curves can be told
    /// apart without colours, and where one lies over another.
    Family(usize),
    /// A dot for each point.
    Dots,
    /// An open ring for each point, wide enough to show a disc inside it.
    Rings,
    /// A filled mark for each point: a disc, or what its place in a family has instead.
    Discs,
}

/// One curve.
#[derive(Debug, Clone)]
pub struct Series {
    /// Its name in the legend; empty for none.
    pub name: String,
    /// Its colour.
    pub ink: Ink,
    /// Its stroke.
    pub mark: Mark,
    /// Its points, in the units of the axes.
    pub points: Vec<(f64, f64)>,
}

/// The outline of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Glyph {
    Disc,
    Square,
    Up,
    Diamond,
    Down,
}

/// Dashes and gaps, pixels, by the place in a family; the first is solid.
const DASHES: [&str; 7] = [
    "",
    "9 4",
    "2.5 2.5",
    "10 3 2.5 3",
    "15 4",
    "10 3 2.5 3 2.5 3",
    "5 5",
];
const THIN: f64 = 2.0;
/// Broader than a dot that lies over it.
const BROAD: f64 = 7.0;
const DOT: f64 = 2.0;
const DISC: f64 = 3.4;
/// Wide enough to show a disc inside.
const RING: f64 = 6.0;

/// The strokes of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stroke {
    /// A line of this width, with these dashes.
    Line { width: f64, dashes: &'static str },
    /// A filled mark of this radius at each point.
    Filled { glyph: Glyph, radius: f64 },
    /// A ring of this radius at each point.
    Ring { radius: f64, width: f64 },
}

impl Series {
    /// A curve with these points; an empty name for none.
    pub fn new(
        name: impl Into<String>,
        ink: Ink,
        mark: Mark,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            ink,
            mark,
            points: points.into_iter().collect(),
        }
    }

    pub(super) fn stroke(&self) -> Stroke {
        let line = |width, dashes| Stroke::Line { width, dashes };
        let filled = |glyph, radius| Stroke::Filled { glyph, radius };
        match self.mark {
            Mark::Broad => line(BROAD, ""),
            Mark::Line => line(THIN, ""),
            Mark::Dashed => line(THIN, "6 4"),
            Mark::Family(place) => line(THIN, DASHES[place % DASHES.len()]),
            Mark::Dots => filled(Glyph::Disc, DOT),
            Mark::Discs => filled(self.glyph(), DISC),
            Mark::Rings => Stroke::Ring {
                radius: RING,
                width: THIN,
            },
        }
    }

    fn glyph(&self) -> Glyph {
        let glyphs = [Glyph::Disc, Glyph::Square, Glyph::Up, Glyph::Diamond, Glyph::Down];
        match self.ink {
            Ink::Curve(place) => glyphs[place % glyphs.len()],
            _ => Glyph::Disc,
        }
    }
}
