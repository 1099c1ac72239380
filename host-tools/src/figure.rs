//! Line charts as SVG: drawn by plotters, coloured by role so that light and dark readers both get theirs.
//!
//! # Design
//! Plotters writes every colour as a literal attribute. Each colour of [`Ink`] is therefore a distinct literal, and
//! [`STYLE`] maps it to a CSS variable that has a light and a dark value. A chart inside a page and one in a file of
//! its own share that sheet.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{RGBColor, ShapeStyle};

use crate::failure::{Blame, Failure};

/// Who drew a curve. Hue tells the estimate, the mark tells who computed it.
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
}

const TEXT: RGBColor = RGBColor(0x1c, 0x25, 0x2e);
const FAINT: RGBColor = RGBColor(0x5a, 0x67, 0x73);
const GRID: RGBColor = RGBColor(0xe3, 0xe8, 0xec);
const PAPER: RGBColor = RGBColor(0xff, 0xff, 0xfe);

impl Ink {
    fn colour(self) -> RGBColor {
        match self {
            Self::Chain => RGBColor(0x8c, 0x97, 0xa1),
            Self::Measured => RGBColor(0x00, 0x6d, 0xb0),
            Self::Predicted => RGBColor(0xc2, 0x50, 0x00),
            Self::Sensed => RGBColor(0x10, 0x7a, 0x5e),
        }
    }
}

/// The style sheet of every chart: literal colours to variables, light and dark.
pub const STYLE: &str = "\
:root{color-scheme:light dark;--paper:#fffffe;--text:#1c252e;--faint:#5a6773;--grid:#e3e8ec;\
--chain:#8c97a1;--measured:#006db0;--predicted:#c25000;--sensed:#107a5e}\
@media (prefers-color-scheme:dark){:root{--paper:#14191e;--text:#e6ebef;--faint:#9aa7b2;--grid:#2b343c;\
--chain:#8d99a4;--measured:#5cb8f2;--predicted:#ff9a52;--sensed:#4fd0a8}}\
svg.chart text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}\
svg.chart [fill='#FFFFFE']{fill:var(--paper)}\
svg.chart [fill='#1C252E']{fill:var(--text)}svg.chart [stroke='#1C252E']{stroke:var(--text)}\
svg.chart [fill='#5A6773']{fill:var(--faint)}svg.chart [stroke='#5A6773']{stroke:var(--faint)}\
svg.chart [stroke='#E3E8EC']{stroke:var(--grid)}\
svg.chart [fill='#8C97A1']{fill:var(--chain)}svg.chart [stroke='#8C97A1']{stroke:var(--chain)}\
svg.chart [fill='#006DB0']{fill:var(--measured)}svg.chart [stroke='#006DB0']{stroke:var(--measured)}\
svg.chart [fill='#C25000']{fill:var(--predicted)}svg.chart [stroke='#C25000']{stroke:var(--predicted)}\
svg.chart [fill='#107A5E']{fill:var(--sensed)}svg.chart [stroke='#107A5E']{stroke:var(--sensed)}";

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A broad line, to lie under the others.
    Broad,
    /// A thin line.
    Line,
    /// A thin dashed line.
    Dashed,
    /// A dot a point.
    Dots,
    /// An open ring a point, wide enough to show a disc inside it.
    Rings,
    /// A disc a point.
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

/// One panel: a pair of axes with curves.
#[derive(Debug, Clone)]
pub struct Panel {
    /// The quantity and unit of the vertical axis.
    pub y_label: String,
    /// The curves, drawn in order.
    pub series: Vec<Series>,
    /// Height in pixels at the width of [`WIDTH`].
    pub height: u32,
}

/// Panels over one horizontal axis.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What the chart shows, for readers that cannot see it.
    pub description: String,
    /// The quantity and unit of the horizontal axis.
    pub x_label: String,
    /// The horizontal range.
    pub x_range: (f64, f64),
    /// The panels, top to bottom.
    pub panels: Vec<Panel>,
}

/// Width of every chart in pixels; text sizes are chosen for it.
pub const WIDTH: u32 = 860;
/// Plotters rounds to whole pixels: a chart is drawn larger by this and scaled back, so that curves are smooth.
const FINE: u32 = 4;
const LEGEND_HEIGHT: u32 = 30;
const X_LABELS_HEIGHT: u32 = 50;
const Y_LABELS_WIDTH: u32 = 70;
const MARGIN: u32 = 12;
const TICKS: u32 = 14;
const TITLES: u32 = 15;
const THIN: u32 = 2;
/// More than a dot laid over it.
const BROAD: u32 = 7;
const DOT: u32 = 2;
const DISC: u32 = 3;
/// Wide enough to show a disc inside.
const RING: u32 = 6;

/// Pixels of a chart in pixels of the drawing.
const fn px(pixels: u32) -> u32 {
    pixels * FINE
}
const FONT: &str = "sans-serif";

impl Chart {
    /// The chart as an `<svg>` element that fills its column and takes its colours from [`STYLE`] in the page.
    ///
    /// # Errors
    /// Plotters refuses the data, such as an axis without extent.
    pub fn inline_svg(&self) -> Result<String, Failure> {
        let svg = self
            .draw()
            .or_input(|| format!("cannot draw \"{}\"", self.description))?;
        let open = svg.find('>').map_or(0, |end| end + 1);
        let (_, height) = self.size();
        Ok(format!(
            "<svg class=\"chart\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\" \
             xmlns=\"http://www.w3.org/2000/svg\">{}",
            escape(&self.description),
            px(WIDTH),
            px(height),
            svg[open..].trim_start()
        ))
    }

    /// The chart as a file of its own, with its style sheet.
    ///
    /// # Errors
    /// As [`Chart::inline_svg`].
    pub fn standalone_svg(&self) -> Result<String, Failure> {
        let svg = self.inline_svg()?;
        let (_, height) = self.size();
        let size = format!("<svg width=\"{WIDTH}\" height=\"{height}\" ");
        let svg = svg.replacen("<svg ", &size, 1);
        let open = svg.find('>').map_or(0, |end| end + 1);
        Ok(format!(
            "{}\n<style>{STYLE}</style>\n{}",
            &svg[..open],
            &svg[open..]
        ))
    }

    fn size(&self) -> (u32, u32) {
        let panels: u32 = self
            .panels
            .iter()
            .map(|panel| panel.height + legend_height(panel))
            .sum();
        (WIDTH, panels + X_LABELS_HEIGHT)
    }

    fn draw(&self) -> anyhow::Result<String> {
        let mut svg = String::new();
        let (width, height) = self.size();
        {
            let root = SVGBackend::with_string(&mut svg, (px(width), px(height))).into_drawing_area();
            root.fill(&PAPER)?;
            let mut rest = root.clone();
            for (index, panel) in self.panels.iter().enumerate() {
                let last = index + 1 == self.panels.len();
                let labels = if last { X_LABELS_HEIGHT } else { 0 };
                let (area, below) = rest.split_vertically(px(panel.height + legend_height(panel) + labels));
                self.draw_panel(panel, &area, last)?;
                rest = below;
            }
            root.present()?;
        }
        Ok(svg)
    }

    fn draw_panel<DB: DrawingBackend>(
        &self,
        panel: &Panel,
        area: &DrawingArea<DB, plotters::coord::Shift>,
        last: bool,
    ) -> anyhow::Result<()>
    where
        DB::ErrorType: 'static,
    {
        let (legend, plot) = area.split_vertically(px(legend_height(panel)));
        draw_legend(panel, &legend)?;
        let (low, high) = panel.y_range(self.x_range);
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(px(6))
            .margin_right(px(MARGIN))
            .margin_left(px(MARGIN))
            .margin_bottom(if last { 0 } else { px(6) })
            .x_label_area_size(if last { px(X_LABELS_HEIGHT) } else { 0 })
            .y_label_area_size(px(Y_LABELS_WIDTH))
            .build_cartesian_2d(self.x_range.0..self.x_range.1, low..high)?;
        let ticks = (FONT, px(TICKS)).into_font().color(&FAINT);
        let title = (FONT, px(TITLES)).into_font().color(&TEXT);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(px(1)))
            .axis_style(FAINT.stroke_width(px(1)))
            .set_all_tick_mark_size(px(5))
            .label_style(ticks)
            .axis_desc_style(title)
            .x_desc(if last { self.x_label.as_str() } else { "" })
            .y_desc(panel.y_label.as_str())
            .x_labels(10)
            .y_labels((panel.height / 32).clamp(3, 8) as usize)
            .x_label_formatter(&|v| label(*v))
            .y_label_formatter(&|v| label(*v))
            .draw()?;
        for series in &panel.series {
            let colour = series.ink.colour();
            let points = series
                .points
                .iter()
                .copied()
                .filter(|(x, _)| (self.x_range.0..=self.x_range.1).contains(x));
            match series.mark {
                Mark::Broad => {
                    chart.draw_series(LineSeries::new(points, colour.stroke_width(px(BROAD))))?;
                }
                Mark::Line => {
                    chart.draw_series(LineSeries::new(points, colour.stroke_width(px(THIN))))?;
                }
                Mark::Dashed => {
                    chart.draw_series(DashedLineSeries::new(
                        points,
                        px(6),
                        px(4),
                        colour.stroke_width(px(THIN)),
                    ))?;
                }
                Mark::Dots => {
                    chart.draw_series(points.map(|point| Circle::new(point, px(DOT), colour.filled())))?;
                }
                Mark::Rings => {
                    chart.draw_series(points.map(|point| Circle::new(point, px(RING), ring(colour))))?;
                }
                Mark::Discs => {
                    chart.draw_series(points.map(|point| Circle::new(point, px(DISC), colour.filled())))?;
                }
            }
        }
        Ok(())
    }
}

fn ring(colour: RGBColor) -> ShapeStyle {
    colour.stroke_width(px(THIN))
}

fn legend_height(panel: &Panel) -> u32 {
    if panel.series.iter().any(|series| !series.name.is_empty()) {
        LEGEND_HEIGHT
    } else {
        0
    }
}

/// The legend stands above the axes, where it hides no data.
fn draw_legend<DB: DrawingBackend>(
    panel: &Panel,
    area: &DrawingArea<DB, plotters::coord::Shift>,
) -> anyhow::Result<()>
where
    DB::ErrorType: 'static,
{
    let at = |pixels: u32| px(pixels) as i32;
    let middle = at(LEGEND_HEIGHT / 2 + 3);
    let mut x = at(MARGIN + Y_LABELS_WIDTH);
    let style = TextStyle::from((FONT, px(TICKS)).into_font())
        .color(&TEXT)
        .pos(Pos::new(HPos::Left, VPos::Center));
    for series in panel.series.iter().filter(|series| !series.name.is_empty()) {
        let colour = series.ink.colour();
        let line = [(x, middle), (x + at(24), middle)];
        match series.mark {
            Mark::Broad => area.draw(&PathElement::new(line, colour.stroke_width(px(BROAD))))?,
            Mark::Line => area.draw(&PathElement::new(line, colour.stroke_width(px(THIN))))?,
            Mark::Dashed => {
                for start in [x, x + at(9), x + at(18)] {
                    let dash = [(start, middle), (start + at(6), middle)];
                    area.draw(&PathElement::new(dash, colour.stroke_width(px(THIN))))?;
                }
            }
            Mark::Dots => area.draw(&Circle::new((x + at(12), middle), px(DISC), colour.filled()))?,
            Mark::Rings => area.draw(&Circle::new((x + at(12), middle), px(RING), ring(colour)))?,
            Mark::Discs => area.draw(&Circle::new((x + at(12), middle), px(DISC), colour.filled()))?,
        }
        area.draw(&Text::new(
            series.name.as_str(),
            (x + at(30), middle),
            style.clone(),
        ))?;
        // Plotters cannot measure text without a font: half the size is the mean advance of sans-serif.
        x += at(30 + series.name.chars().count() as u32 * TICKS / 2 + 22);
    }
    Ok(())
}

impl Panel {
    /// The extent of the curves inside the horizontal range, with a margin, and never empty.
    fn y_range(&self, x_range: (f64, f64)) -> (f64, f64) {
        let values = self
            .series
            .iter()
            .flat_map(|series| &series.points)
            .filter(|(x, y)| (x_range.0..=x_range.1).contains(x) && y.is_finite())
            .map(|(_, y)| *y);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| {
            (l.min(y), h.max(y))
        });
        if low > high {
            return (-1.0, 1.0);
        }
        let margin = 0.06 * (high - low);
        if margin > 0.0 {
            (low - margin, high + margin)
        } else {
            (low - 1.0, high + 1.0)
        }
    }
}

/// A tick's figure: as many decimals as it needs, a true minus, no negative zero.
fn label(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 {
        return "0".to_owned();
    }
    format!("{rounded}").replace('-', "−")
}

/// Text as it may stand in HTML and SVG, in content and in attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let points = (0..100)
            .map(|i| (f64::from(i) * 0.1, (f64::from(i) * 0.2).sin()))
            .collect();
        Chart {
            description: "a \"sine\" & more".to_owned(),
            x_label: "time (ms)".to_owned(),
            x_range: (0.0, 10.0),
            panels: vec![Panel {
                y_label: "force (N)".to_owned(),
                height: 200,
                series: vec![Series {
                    name: "sensed".to_owned(),
                    ink: Ink::Sensed,
                    mark: Mark::Line,
                    points,
                }],
            }],
        }
    }

    #[test]
    fn every_colour_of_a_chart_has_a_light_and_a_dark_value() {
        let mut chart = chart();
        let series = chart.panels[0].series[0].clone();
        for (ink, mark) in [
            (Ink::Chain, Mark::Broad),
            (Ink::Measured, Mark::Dashed),
            (Ink::Predicted, Mark::Rings),
            (Ink::Sensed, Mark::Dots),
            (Ink::Sensed, Mark::Discs),
        ] {
            chart.panels[0].series.push(Series {
                ink,
                mark,
                ..series.clone()
            });
        }
        let svg = chart.inline_svg().unwrap();
        for attribute in ["fill=\"#", "stroke=\"#"] {
            for (at, _) in svg.match_indices(attribute) {
                let literal = &svg[at..at + attribute.len() + 7].replace('"', "'");
                assert!(
                    STYLE.contains(literal.as_str()),
                    "{literal} is not in the style sheet"
                );
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
    fn an_empty_panel_is_still_drawn() {
        let mut chart = chart();
        chart.panels[0].series.clear();
        assert!(chart.inline_svg().unwrap().contains("</svg>"));
    }
}
