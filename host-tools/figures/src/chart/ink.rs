//! Colours, on light and on dark pages.

use std::fmt::Write;

/// What a curve stands for. The hue says which estimate it is, the mark says what computed it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// The full f64 chain: the truth.
    Chain,
    /// Estimate A, from the acceleration.
    Measured,
    /// Estimate B, from the force.
    Predicted,
    /// What the sensors delivered.
    Sensed,
    /// One of a family of curves, by its place in the family; after [`FAMILY`] curves the hues repeat.
    Curve(usize),
    /// Guides: levels, expected places.
    Guide,
    /// Titles.
    Text,
    /// Lines that help to read values off.
    Grid,
    /// What everything lies on.
    Paper,
}

/// How many curves of a family differ in colour.
pub const FAMILY: usize = 7;

/// Name of the CSS variable, the light value and the dark one. The light values are what a picture without a
/// style sheet shows. Those of a family differ in lightness too, and keep apart for colour-blind readers
/// (after M. Okabe and K. Ito, "Color universal design", 2008).
const COLOURS: [(&str, &str, &str); 8 + FAMILY] = [
    ("chain", "#8c97a1", "#8d99a4"),
    ("measured", "#006db0", "#5cb8f2"),
    ("predicted", "#c25000", "#ff9a52"),
    ("sensed", "#107a5e", "#4fd0a8"),
    ("faint", "#5a6773", "#9aa7b2"),
    ("text", "#1c252e", "#e6ebef"),
    ("grid", "#e3e8ec", "#2b343c"),
    ("paper", "#fffffe", "#14191e"),
    ("c1", "#0b4f8a", "#6fb1ef"),
    ("c2", "#d55e01", "#ff8c42"),
    ("c3", "#009e73", "#4fd6a9"),
    ("c4", "#882e72", "#d58fc4"),
    ("c5", "#c99400", "#f0c54d"),
    ("c6", "#4aa5da", "#9fdcff"),
    ("c7", "#333b42", "#c3ccd4"),
];

impl Ink {
    fn row(self) -> usize {
        match self {
            Self::Chain => 0,
            Self::Measured => 1,
            Self::Predicted => 2,
            Self::Sensed => 3,
            Self::Guide => 4,
            Self::Text => 5,
            Self::Grid => 6,
            Self::Paper => 7,
            Self::Curve(index) => 8 + index % FAMILY,
        }
    }

    /// The light value, which [`style`] maps to a variable.
    pub(super) fn literal(self) -> &'static str {
        COLOURS[self.row()].1
    }
}

/// The style sheet of every chart. Each colour is a literal attribute in the drawing, so that programs
/// without style sheets show it; the sheet maps it to a variable that has a light and a dark value.
pub fn style() -> String {
    let mut sheet = String::from(":root{color-scheme:light dark");
    // Writing to a String cannot fail.
    let mut push = |text: std::fmt::Arguments<'_>| sheet.write_fmt(text).unwrap_or_default();
    for (name, light, _) in COLOURS {
        push(format_args!(";--{name}:{light}"));
    }
    push(format_args!("}}@media (prefers-color-scheme:dark){{:root{{"));
    for (name, _, dark) in COLOURS {
        push(format_args!("--{name}:{dark};"));
    }
    push(format_args!(
        "}}}}svg.chart text{{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}}"
    ));
    for (name, light, _) in COLOURS {
        push(format_args!(
            "svg.chart [fill='{light}']{{fill:var(--{name})}}svg.chart [stroke='{light}']{{stroke:var(--{name})}}"
        ));
    }
    sheet
}
