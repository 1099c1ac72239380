//! Colours, on light and on dark pages.

/// The meaning of a colour. The hue shows the estimate, the mark its source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// The full f64 chain: the truth.
    Chain,
    /// Estimate A, from the acceleration.
    Measured,
    /// Estimate B, from the force.
    Predicted,
    /// Values of the sensors.
    Sensed,
    /// One of a family of curves, by its place in the family; after [`FAMILY`] curves the hues repeat.
    Curve(usize),
    /// Guides: levels, expected places.
    Guide,
    /// Titles.
    Text,
    /// Lines that help to read values off.
    Grid,
    /// The background.
    Paper,
}

/// Number of curves of a family that differ in colour.
pub const FAMILY: usize = 7;

/// Name of the CSS variable, light value, dark value. A program without style sheets shows the light values.
/// The colours of a family differ in lightness too, so that colour-blind readers can tell them apart (after
/// M. Okabe and K. Ito, "Color universal design", 2008).
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

    /// The light value, which [`drawing_style`] replaces on a dark page.
    pub(super) fn literal(self) -> &'static str {
        COLOURS[self.row()].1
    }
}

/// The style sheet of a drawing by itself. Its attributes carry the light colours; on a dark page these rules
/// replace them. They name colours, not variables: programs that know neither media queries nor `var()`,
/// such as resvg and CairoSVG, keep the light colours.
pub(super) fn drawing_style() -> String {
    let rule = |(_, light, dark): &(&str, &str, &str)| {
        format!("svg.chart [fill='{light}']{{fill:{dark}}}svg.chart [stroke='{light}']{{stroke:{dark}}}")
    };
    let dark: String = COLOURS.iter().map(rule).collect();
    format!(
        ":root{{color-scheme:light dark}}\
         svg.chart text{{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}}\
         @media (prefers-color-scheme:dark){{{dark}}}"
    )
}

/// The style sheet of a page with charts: that of its charts, and the colours as CSS variables for the rest
/// of the page.
pub fn style() -> String {
    let light: String = COLOURS
        .map(|(name, light, _)| format!("--{name}:{light};"))
        .concat();
    let dark: String = COLOURS
        .map(|(name, _, dark)| format!("--{name}:{dark};"))
        .concat();
    let drawings = drawing_style();
    format!(":root{{{light}}}@media (prefers-color-scheme:dark){{:root{{{dark}}}}}{drawings}")
}
