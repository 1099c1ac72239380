//! A drawing as SVG: lines, marks and text, in pixels of the chart.

use std::fmt::Write;

use super::ink::Ink;
use super::series::{Glyph, Stroke};

/// Text escaped for HTML and SVG, for content and for attributes. Characters that XML 1.0 cannot write are
/// replaced by U+FFFD.
pub fn escape(text: &str) -> String {
    // Without surrogates, which no text holds.
    let is_none =
        |c: char| matches!(c, '\0'..'\t' | '\u{b}' | '\u{c}' | '\u{e}'..' ' | '\u{fffe}' | '\u{ffff}');
    text.replace(is_none, "\u{fffd}")
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

/// A text as pieces that stand on the line and pieces that are raised, in turn: `F^(1/6)` has a raised `1/6`.
pub(super) fn pieces(text: &str) -> Vec<(&str, bool)> {
    let mut pieces = Vec::new();
    let mut rest = text;
    while let Some((plain, after)) = rest.split_once("^(") {
        let Some((raised, after)) = after.split_once(')') else {
            break;
        };
        pieces.extend([(plain, false), (raised, true)]);
        rest = after;
    }
    pieces.push((rest, false));
    pieces.retain(|(piece, _)| !piece.is_empty());
    pieces
}

/// Text for HTML and Markdown, with `<sup>` around raised pieces. `plain` makes each piece safe.
pub fn raised(text: &str, plain: impl Fn(&str) -> String) -> String {
    let piece = |(piece, raised): (&str, bool)| {
        if raised {
            format!("<sup>{}</sup>", plain(piece))
        } else {
            plain(piece)
        }
    };
    pieces(text).into_iter().map(piece).collect()
}

/// Size of raised text, as a part of that on the line.
const RAISED: f64 = 0.72;

/// The approximate width of a text of this size, pixels. No font is at hand, so a rather wide one is assumed.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let of = |character: char| match character {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '|' | '\'' => 0.30,
        ' ' | 't' | 'f' | 'r' | '(' | ')' | '/' => 0.38,
        'm' | 'w' | 'M' | 'W' | '%' => 0.92,
        '=' | '+' | '−' | '<' | '>' | '≤' => 0.80,
        _ => 0.62,
    };
    let piece = |(piece, raised): (&str, bool)| {
        let size = if raised { RAISED * size } else { size };
        size * piece.chars().map(of).sum::<f64>()
    };
    pieces(text).into_iter().map(piece).sum()
}

/// The point of a text that its position refers to.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// The middle of a text that runs upwards.
    Upwards,
}

/// A drawing to which elements are added.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    svg: String,
}

impl Canvas {
    /// The elements of the drawing.
    pub(super) fn into_svg(self) -> String {
        self.svg
    }

    fn push(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        self.svg.write_fmt(text).unwrap_or_default();
        self.svg.push('\n');
    }

    /// A filled rectangle from the origin.
    pub(super) fn fill(&mut self, (width, height): (f64, f64), ink: Ink) {
        self.push(format_args!(
            "<rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
            ink.literal()
        ));
    }

    /// A rectangle between two corners. Its colour shows a value, so it is the same on every page.
    pub(super) fn cell(&mut self, one: (f64, f64), other: (f64, f64), colour: &str) {
        // Rounded as it is written, so that neighbouring cells have no gap between them.
        let [one, other] =
            [one, other].map(|(x, y)| ((100.0 * x).round() / 100.0, (100.0 * y).round() / 100.0));
        let (x, y) = (one.0.min(other.0), one.1.min(other.1));
        let (width, height) = ((one.0 - other.0).abs(), (one.1 - other.1).abs());
        self.push(format_args!(
            "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\" fill=\"{colour}\" \
             shape-rendering=\"crispEdges\"/>"
        ));
    }

    /// A line through these points.
    pub(super) fn line(&mut self, points: &[(f64, f64)], ink: Ink, width: f64, dashes: &str) {
        let points = points.iter().map(|(x, y)| format!("{x:.2},{y:.2}"));
        let mut points: Vec<String> = points.collect();
        points.dedup();
        let path = points.join(" ");
        let dashes = match dashes {
            "" => String::new(),
            dashes => format!(" stroke-dasharray=\"{dashes}\""),
        };
        self.push(format_args!(
            "<polyline points=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\"{dashes}/>",
            ink.literal()
        ));
    }

    /// Draws the mark of a stroke at one point; nothing for a line.
    pub(super) fn mark(&mut self, (x, y): (f64, f64), ink: Ink, stroke: Stroke) {
        let colour = ink.literal();
        match stroke {
            Stroke::Line { .. } => {}
            Stroke::Ring { radius, width } => self.push(format_args!(
                "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"none\" stroke=\"{colour}\" \
                 stroke-width=\"{width}\"/>"
            )),
            Stroke::Filled {
                glyph: Glyph::Disc,
                radius,
            } => self.push(format_args!(
                "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{colour}\"/>"
            )),
            Stroke::Filled { glyph, radius } => {
                // Corners in units of the radius; the areas are about that of the disc.
                let corners: &[(f64, f64)] = match glyph {
                    Glyph::Square => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
                    Glyph::Up => &[(0.0, -1.35), (1.2, 0.8), (-1.2, 0.8)],
                    Glyph::Down => &[(0.0, 1.35), (1.2, -0.8), (-1.2, -0.8)],
                    _ => &[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
                };
                let corner = |(dx, dy): &(f64, f64)| format!("{:.2},{:.2}", x + radius * dx, y + radius * dy);
                let corners: Vec<String> = corners.iter().map(corner).collect();
                let corners = corners.join(" ");
                self.push(format_args!("<polygon points=\"{corners}\" fill=\"{colour}\"/>"));
            }
        }
    }

    /// A text of this size whose middle, seen across the line, is at `y`.
    pub(super) fn text(&mut self, text: &str, (x, y): (f64, f64), size: f64, ink: Ink, anchor: Anchor) {
        let (name, turn) = match anchor {
            Anchor::Start => ("start", String::new()),
            Anchor::Middle => ("middle", String::new()),
            Anchor::End => ("end", String::new()),
            Anchor::Upwards => ("middle", format!(" transform=\"rotate(-90 {x:.2} {y:.2})\"")),
        };
        // A third of the size: half the height of a figure.
        let down = 0.35 * size;
        let (up, small) = (0.38 * size, RAISED * size);
        let (mut spans, mut lifted) = (String::new(), false);
        for (piece, raised) in pieces(text) {
            let piece = escape(piece);
            spans += &match (lifted, raised) {
                (false, true) => {
                    format!(
                        "<tspan dy=\"{:.2}\" font-size=\"{small:.1}\">{piece}</tspan>",
                        -up
                    )
                }
                (true, false) => format!("<tspan dy=\"{up:.2}\">{piece}</tspan>"),
                _ => piece,
            };
            lifted = raised;
        }
        self.push(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" dy=\"{down:.2}\" font-size=\"{size}\" font-family=\"sans-serif\" \
             text-anchor=\"{name}\" fill=\"{}\"{turn}>{spans}</text>",
            ink.literal()
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_behind_a_caret_is_raised() {
        let expected = [("F / V", false), ("6/5", true), (" (N)", false)];
        assert_eq!(pieces("F / V^(6/5) (N)"), expected);
        assert_eq!(pieces("10^(−3)"), [("10", false), ("−3", true)]);
        assert_eq!(pieces("a^(b"), [("a^(b", false)]);
    }

    #[test]
    fn what_xml_cannot_write_is_replaced() {
        let kept = "\t\n\r ~\u{7f}\u{d7ff}\u{e000}\u{fffd}\u{10000}\u{10ffff}";
        assert_eq!(escape(kept), kept);
        let all = "\0\u{8}a\u{b}\u{c}\u{e}\u{1f}<\u{fffe}\u{ffff}";
        assert_eq!(escape(all).replace('\u{fffd}', "_"), "__a____&lt;__");
    }

    #[test]
    fn a_raised_piece_needs_less_room() {
        assert!(width("10^(12)", 14.0) < width("1012", 14.0));
    }
}
