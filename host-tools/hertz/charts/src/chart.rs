//! A chart: panels over one horizontal axis, as SVG.

use super::canvas::{Canvas, escape};
use super::error::Error;
use super::frame::{ChartFrame, Columns, MARGIN};
use super::ink::{Ink, drawing_style};
use super::panel::{Axis, Panel};

/// Panels over one horizontal axis.
#[derive(Debug, Clone)]
pub struct Chart {
    /// The content in words, for readers that cannot see it.
    pub description: String,
    /// The horizontal axis that the panels share.
    pub x: Axis,
    /// The panels, top to bottom.
    pub panels: Vec<Panel>,
    /// Width in pixels: [`WIDTH`] for a page, [`COLUMN`] for a column of print.
    pub width: u32,
}

/// Width in pixels of a chart that fills a page; text sizes are chosen for it.
pub const WIDTH: u32 = 860;
/// Width in pixels of a chart that stays legible in a column of print (86 mm: text of 7 points).
pub const COLUMN: u32 = 480;

impl Chart {
    /// A chart for a column of print, without a description.
    pub fn new(x: Axis, panels: Vec<Panel>) -> Self {
        Self {
            description: String::new(),
            x,
            panels,
            width: COLUMN,
        }
    }

    /// The chart as an `<svg>` element that fills its column and takes its colours from
    /// [`style`](crate::style) in the page.
    ///
    /// # Errors
    /// An axis has no extent, or an end that is not finite.
    pub fn inline_svg(&self) -> Result<String, Error> {
        self.svg("", "")
    }

    /// The chart as a file of its own, with its style sheet.
    ///
    /// # Errors
    /// As [`Chart::inline_svg`].
    pub fn standalone_svg(&self) -> Result<String, Error> {
        let (width, height) = self.size();
        let size = format!(" width=\"{width}\" height=\"{height}\"");
        self.svg(&size, &format!("<style>{}</style>\n", drawing_style()))
    }

    fn svg(&self, size: &str, head: &str) -> Result<String, Error> {
        let (width, height) = self.size();
        Ok(format!(
            "<svg{size} class=\"chart\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {width} {height}\" \
             xmlns=\"http://www.w3.org/2000/svg\">\n{head}{}</svg>\n",
            escape(&self.description),
            self.draw()?
        ))
    }

    fn frames(&self) -> Vec<ChartFrame<'_>> {
        let last = self.panels.len().saturating_sub(1);
        let picture = f64::from(self.width);
        let panels = self.panels.iter().enumerate();
        let frames: Vec<_> = panels
            .map(|(place, panel)| {
                // A panel's own axis always has its numbers. The shared one has them below the last panel.
                let labelled = place == last || panel.x.is_some();
                let x = panel.x.as_ref().unwrap_or(&self.x);
                ChartFrame::new(panel, x, labelled, picture)
            })
            .collect();
        // All axes begin where those with the widest numbers do, and names stand above them.
        let left = frames.iter().map(|frame| frame.columns(picture).left);
        let left = left.fold(0.0, f64::max);
        let named = frames.into_iter().map(|frame| frame.named_from(left, picture));
        named.collect()
    }

    /// Width and height, pixels.
    pub(super) fn size(&self) -> (f64, f64) {
        let frames: f64 = self.frames().iter().map(ChartFrame::height).sum();
        (f64::from(self.width), (2.0 * MARGIN + frames).ceil())
    }

    /// The elements of the drawing, on a background of its size.
    pub(super) fn draw(&self) -> Result<String, Error> {
        let size = self.size();
        let frames = self.frames();
        if !frames.iter().all(ChartFrame::has_extent) {
            return Err(Error::new(&self.description, "", "an axis has no extent"));
        }
        let (left, right) = (0.0, size.0);
        let needed = frames.iter().map(|frame| frame.columns(size.0));
        let columns = needed.fold(Columns { left, right }, |one, other| Columns {
            left: one.left.max(other.left),
            right: one.right.min(other.right),
        });
        let mut canvas = Canvas::default();
        canvas.fill(size, Ink::Paper);
        let mut top = MARGIN;
        for frame in &frames {
            frame.draw(&mut canvas, top, columns);
            top += frame.height();
        }
        Ok(canvas.into_svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::width;
    use crate::ink::{FAMILY, style};
    use crate::legend::NAMES;
    use crate::series::{Mark, Series};

    fn chart() -> Chart {
        let points = (0..100).map(|i| (f64::from(i) * 0.1, (f64::from(i) * 0.2).sin()));
        let sensed = Series::new("sensed", Ink::Sensed, Mark::Line, points);
        let panel = Panel::new("force (N)", vec![sensed]).height(200);
        Chart {
            description: "a \"sine\" & more".to_owned(),
            width: WIDTH,
            ..Chart::new(Axis::new("time (ms)", 0.0..10.0), vec![panel])
        }
    }

    #[test]
    fn every_colour_of_a_chart_has_a_light_and_a_dark_value() {
        let mut chart = chart();
        let inks = [Ink::Chain, Ink::Measured, Ink::Predicted, Ink::Sensed, Ink::Guide];
        let inks = inks.into_iter().chain((0..FAMILY).map(Ink::Curve));
        for (place, ink) in inks.enumerate() {
            let marks = [
                Mark::Broad,
                Mark::Family(place),
                Mark::Dots,
                Mark::Rings,
                Mark::Discs,
            ];
            let points = &chart.panels[0].series[0].points;
            let marked = marks.map(|mark| Series::new("", ink, mark, points.clone()));
            chart.panels[0].series.extend(marked);
        }
        let (svg, sheet) = (chart.inline_svg().unwrap(), style());
        for attribute in ["fill=\"#", "stroke=\"#"] {
            for (at, _) in svg.match_indices(attribute) {
                let literal = svg[at..at + attribute.len() + 7].replace('"', "'");
                assert!(sheet.contains(&literal), "{literal} is not in the style sheet");
            }
        }
    }

    #[test]
    fn a_chart_needs_nothing_from_outside_and_escapes_its_text() {
        let svg = chart().standalone_svg().unwrap();
        assert!(svg.contains("a &quot;sine&quot; &amp; more"));
        assert!(svg.contains("time (ms)") && svg.contains("force (N)") && svg.contains("sensed"));
        assert_eq!(svg.matches("http").count(), 1, "only the name space");
    }

    #[test]
    fn an_empty_panel_is_still_drawn_and_an_axis_without_extent_is_refused() {
        let mut chart = chart();
        chart.panels[0].series.clear();
        assert!(chart.inline_svg().unwrap().contains("</svg>"));
        chart.x.range = (1.0, 1.0);
        assert!(chart.inline_svg().is_err());
    }

    /// The right ends of these texts of 14 pixels; a text stands in the middle of its place or begins there.
    fn ends(svg: &str, is_such: impl Fn(&str, &str) -> bool) -> Vec<f64> {
        let end = |text: &str| {
            let (attributes, text) = text.split_once('>')?;
            let x = attributes.split("x=\"").nth(1)?.split('"').next()?;
            let text = text.split('<').next().filter(|text| is_such(attributes, text))?;
            let part = if attributes.contains("\"middle\"") {
                0.5
            } else {
                1.0
            };
            Some(x.parse::<f64>().unwrap() + part * width(text, NAMES))
        };
        svg.split("<text").skip(1).filter_map(end).collect()
    }

    #[test]
    fn names_and_the_last_number_of_an_axis_stay_within_the_picture() {
        for letters in 1..60 {
            let mut chart = chart();
            let name = "n".repeat(letters);
            let one = Series::new(name.as_str(), Ink::Sensed, Mark::Line, [(0.0, 0.0)]);
            chart.panels[0] = Panel::new("energy (J)", vec![one; 4]).range(0.0, 2e-5);
            let ends = ends(&chart.inline_svg().unwrap(), |_, text| text == name);
            let inside = ends.iter().all(|end| *end <= f64::from(WIDTH));
            assert!(ends.len() == 4 && inside, "{letters}: {ends:?}");
        }
        for range in [0.0..10.0, 100.0..100.025, 1e6..1e6 + 0.02, -0.000_025..0.0] {
            let mut chart = chart();
            chart.x = Axis::new("time (ms)", range.clone());
            let ends = ends(&chart.inline_svg().unwrap(), |place, _| {
                place.contains("\"middle\"")
            });
            let inside = ends.iter().all(|end| *end <= f64::from(WIDTH));
            assert!(ends.len() > 4 && inside, "{range:?}: {ends:?}");
        }
    }

    #[test]
    fn all_axes_of_a_chart_stand_in_line() {
        let mut chart = chart();
        let mut wide = chart.panels[0].clone().range(0.0, 1e-5);
        wide.y_label = "energy (J)".to_owned();
        chart.panels.push(wide);
        let frames = chart.frames();
        let [one, other] = [0, 1].map(|panel| frames[panel].columns(860.0).left);
        assert!(one != other);
        let (svg, left) = (chart.inline_svg().unwrap(), one.max(other));
        assert!(svg.matches(&format!("points=\"{left:.2},")).count() >= 2, "{svg}");
    }
}
