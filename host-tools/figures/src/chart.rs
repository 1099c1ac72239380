//! Line charts as SVG: drawn by plotters, with colours for light and for dark pages.
//!
//! # Design
//! Plotters writes every colour as a literal attribute. Each colour of [`Ink`] is therefore a distinct
//! literal, and [`STYLE`] maps it to a CSS variable that has a light and a dark value. A chart inside a page
//! and a chart in its own file share that sheet.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{RGBColor, ShapeStyle};

use crate::error::Error;

/// Why plotters does not draw.
type Refused = Box<dyn std::error::Error + Send + Sync>;

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
}

/// How many curves of a family differ in colour.
pub const FAMILY: usize = 7;
const FAMILY_INKS: [RGBColor; FAMILY] = [
    RGBColor(0x1f, 0x4e, 0x9e),
    RGBColor(0xc4, 0x3c, 0x2e),
    RGBColor(0x1b, 0x86, 0x4f),
    RGBColor(0x8a, 0x4f, 0xb0),
    RGBColor(0xb0, 0x73, 0x00),
    RGBColor(0x0f, 0x8b, 0x9d),
    RGBColor(0xc2, 0x4f, 0x8c),
];

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
            Self::Curve(index) => FAMILY_INKS[index % FAMILY],
            Self::Guide => FAINT,
        }
    }
}

/// The style sheet of every chart: it maps literal colours to variables, light and dark.
pub const STYLE: &str = "\
:root{color-scheme:light dark;--paper:#fffffe;--text:#1c252e;--faint:#5a6773;--grid:#e3e8ec;\
--chain:#8c97a1;--measured:#006db0;--predicted:#c25000;--sensed:#107a5e;\
--c1:#1f4e9e;--c2:#c43c2e;--c3:#1b864f;--c4:#8a4fb0;--c5:#b07300;--c6:#0f8b9d;--c7:#c24f8c}\
@media (prefers-color-scheme:dark){:root{--paper:#14191e;--text:#e6ebef;--faint:#9aa7b2;--grid:#2b343c;\
--chain:#8d99a4;--measured:#5cb8f2;--predicted:#ff9a52;--sensed:#4fd0a8;\
--c1:#7fa8f0;--c2:#ff8a7a;--c3:#5fd096;--c4:#cc9bf0;--c5:#e8b04a;--c6:#5ccbdb;--c7:#f59ac8}}\
svg.chart text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}\
svg.chart [fill='#FFFFFE']{fill:var(--paper)}\
svg.chart [fill='#1C252E']{fill:var(--text)}svg.chart [stroke='#1C252E']{stroke:var(--text)}\
svg.chart [fill='#5A6773']{fill:var(--faint)}svg.chart [stroke='#5A6773']{stroke:var(--faint)}\
svg.chart [stroke='#E3E8EC']{stroke:var(--grid)}\
svg.chart [fill='#8C97A1']{fill:var(--chain)}svg.chart [stroke='#8C97A1']{stroke:var(--chain)}\
svg.chart [fill='#006DB0']{fill:var(--measured)}svg.chart [stroke='#006DB0']{stroke:var(--measured)}\
svg.chart [fill='#C25000']{fill:var(--predicted)}svg.chart [stroke='#C25000']{stroke:var(--predicted)}\
svg.chart [fill='#107A5E']{fill:var(--sensed)}svg.chart [stroke='#107A5E']{stroke:var(--sensed)}\
svg.chart [fill='#1F4E9E']{fill:var(--c1)}svg.chart [stroke='#1F4E9E']{stroke:var(--c1)}\
svg.chart [fill='#C43C2E']{fill:var(--c2)}svg.chart [stroke='#C43C2E']{stroke:var(--c2)}\
svg.chart [fill='#1B864F']{fill:var(--c3)}svg.chart [stroke='#1B864F']{stroke:var(--c3)}\
svg.chart [fill='#8A4FB0']{fill:var(--c4)}svg.chart [stroke='#8A4FB0']{stroke:var(--c4)}\
svg.chart [fill='#B07300']{fill:var(--c5)}svg.chart [stroke='#B07300']{stroke:var(--c5)}\
svg.chart [fill='#0F8B9D']{fill:var(--c6)}svg.chart [stroke='#0F8B9D']{stroke:var(--c6)}\
svg.chart [fill='#C24F8C']{fill:var(--c7)}svg.chart [stroke='#C24F8C']{stroke:var(--c7)}";

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A broad line that lies under the others.
    Broad,
    /// A thin line.
    Line,
    /// A thin dashed line.
    Dashed,
    /// A dot for each point.
    Dots,
    /// An open ring for each point, wide enough to show a disc inside it.
    Rings,
    /// A disc for each point.
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

/// The scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Equal steps have equal lengths.
    #[default]
    Linear,
    /// Equal factors have equal lengths; points that are not positive are left out.
    Log,
}

impl Scale {
    /// The place of a value on the axis.
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log => value.log10(),
        }
    }
}

/// A horizontal axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Its quantity and unit.
    pub label: String,
    /// Its two ends.
    pub range: (f64, f64),
    /// Its scale.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    pub fn new(label: impl Into<String>, range: Range<f64>) -> Self {
        Self {
            label: label.into(),
            range: (range.start, range.end),
            scale: Scale::Linear,
        }
    }

    /// A logarithmic axis.
    pub fn log(label: impl Into<String>, range: Range<f64>) -> Self {
        Self {
            scale: Scale::Log,
            ..Self::new(label, range)
        }
    }
}

/// One panel: a pair of axes with curves.
#[derive(Debug, Clone)]
pub struct Panel {
    /// The quantity and unit of the vertical axis.
    pub y_label: String,
    /// The scale of the vertical axis.
    pub y_scale: Scale,
    /// The vertical range; without one, the extent of the curves.
    pub y_range: Option<(f64, f64)>,
    /// The curves, drawn in order.
    pub series: Vec<Series>,
    /// Height in pixels at the chart's width.
    pub height: u32,
    /// A horizontal axis of its own, in place of the chart's.
    pub x: Option<Axis>,
}

/// Panels over one horizontal axis.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What the chart shows, for readers that cannot see it.
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
/// Plotters rounds to whole pixels: a chart is drawn larger by this and scaled back, so that curves are
/// smooth.
pub const FINE: u32 = 4;
const LEGEND_HEIGHT: u32 = 30;
const LEGEND_ROW: u32 = 20;
const X_LABELS_HEIGHT: u32 = 50;
const Y_LABELS_WIDTH: u32 = 70;
const MARGIN: u32 = 12;
/// Room for half of the last tick's number.
const RIGHT: u32 = 24;
const TICKS: u32 = 14;
const TITLES: u32 = 15;
const THIN: u32 = 2;
/// Broader than a dot that lies over it.
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

impl Panel {
    /// A panel of 240 pixels with a linear vertical axis, over the chart's horizontal axis.
    pub fn new(y_label: impl Into<String>, series: Vec<Series>) -> Self {
        Self {
            y_label: y_label.into(),
            y_scale: Scale::Linear,
            y_range: None,
            series,
            height: 240,
            x: None,
        }
    }

    /// The same with a logarithmic vertical axis.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.y_scale = Scale::Log;
        self
    }

    /// The same with this vertical range.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.y_range = Some((low, high));
        self
    }

    /// The same with this height, pixels.
    #[must_use]
    pub fn height(mut self, height: u32) -> Self {
        self.height = height;
        self
    }

    /// The same over a horizontal axis of its own.
    #[must_use]
    pub fn over(mut self, x: Axis) -> Self {
        self.x = Some(x);
        self
    }
}

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

    /// The chart as an `<svg>` element that fills its column and takes its colours from [`STYLE`] in the
    /// page.
    ///
    /// # Errors
    /// Plotters refuses the data, such as an axis without extent.
    pub fn inline_svg(&self) -> Result<String, Error> {
        let svg = self
            .draw()
            .map_err(|reason| Error::drawing(&self.description, "", reason))?;
        let open = svg.find('>').map_or(0, |end| end + 1);
        let (width, height) = self.size();
        Ok(format!(
            "<svg class=\"chart\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\" \
             xmlns=\"http://www.w3.org/2000/svg\">{}",
            escape(&self.description),
            px(width),
            px(height),
            svg[open..].trim_start()
        ))
    }

    /// The chart as a file of its own, with its style sheet.
    ///
    /// # Errors
    /// As [`Chart::inline_svg`].
    pub fn standalone_svg(&self) -> Result<String, Error> {
        let svg = self.inline_svg()?;
        let (width, height) = self.size();
        let size = format!("<svg width=\"{width}\" height=\"{height}\" ");
        let svg = svg.replacen("<svg ", &size, 1);
        let open = svg.find('>').map_or(0, |end| end + 1);
        Ok(format!(
            "{}\n<style>{STYLE}</style>\n{}",
            &svg[..open],
            &svg[open..]
        ))
    }

    fn size(&self) -> (u32, u32) {
        let panels = 0..self.panels.len();
        (self.width, panels.map(|index| self.panel_height(index)).sum())
    }

    fn panel_height(&self, index: usize) -> u32 {
        let panel = &self.panels[index];
        let labels = if self.labelled(index) { X_LABELS_HEIGHT } else { 0 };
        panel.height + self.legend(panel).height() + labels
    }

    /// Whether a panel shows a horizontal axis: its own, or the shared one below the last panel.
    fn labelled(&self, index: usize) -> bool {
        self.panels[index].x.is_some() || index + 1 == self.panels.len()
    }

    fn legend<'a>(&self, panel: &'a Panel) -> Legend<'a> {
        Legend::new(panel, self.width)
    }

    fn draw(&self) -> Result<String, Refused> {
        let mut svg = String::new();
        let (width, height) = self.size();
        {
            let root = SVGBackend::with_string(&mut svg, (px(width), px(height))).into_drawing_area();
            root.fill(&PAPER)?;
            let mut rest = root.clone();
            for (index, panel) in self.panels.iter().enumerate() {
                let (area, below) = rest.split_vertically(px(self.panel_height(index)));
                self.draw_panel(panel, &area, self.labelled(index))?;
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
        labelled: bool,
    ) -> Result<(), Refused>
    where
        DB::ErrorType: 'static,
    {
        let legend = self.legend(panel);
        let (above, plot) = area.split_vertically(px(legend.height()));
        legend.draw(&above)?;
        let x = panel.x.as_ref().unwrap_or(&self.x);
        let x_range = (x.scale.place(x.range.0), x.scale.place(x.range.1));
        let y_range = panel.y_extent(x.range);
        let inner = self.width - Y_LABELS_WIDTH - MARGIN - RIGHT;
        let rows = (panel.height / 32).clamp(3, 8) as usize;
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(px(6))
            .margin_right(px(RIGHT))
            .margin_left(px(MARGIN))
            .margin_bottom(if labelled { 0 } else { px(6) })
            .x_label_area_size(if labelled { px(X_LABELS_HEIGHT) } else { 0 })
            .y_label_area_size(px(Y_LABELS_WIDTH))
            .build_cartesian_2d(
                Ticked::new(x.scale, x_range, (inner / 75).max(3) as usize),
                Ticked::new(panel.y_scale, y_range, rows),
            )?;
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
            .x_desc(if labelled { x.label.as_str() } else { "" })
            .y_desc(panel.y_label.as_str())
            .x_labels(10)
            .y_labels(rows)
            .x_label_formatter(&|v| x.scale.label(*v))
            .y_label_formatter(&|v| panel.y_scale.label(*v))
            .draw()?;
        for series in &panel.series {
            let style = series.style();
            let circle = |radius| move |point| Circle::new(point, px(radius), style);
            let points = series
                .points
                .iter()
                .copied()
                .filter(|(at, _)| (x.range.0..=x.range.1).contains(at))
                .map(|(at, value)| (x.scale.place(at), panel.y_scale.place(value)))
                .filter(|(_, value)| value.is_finite());
            match series.mark {
                Mark::Broad | Mark::Line => chart.draw_series(LineSeries::new(points, style)),
                Mark::Dashed => chart.draw_series(DashedLineSeries::new(points, px(6), px(4), style)),
                Mark::Dots => chart.draw_series(points.map(circle(DOT))),
                Mark::Rings => chart.draw_series(points.map(circle(RING))),
                Mark::Discs => chart.draw_series(points.map(circle(DISC))),
            }?;
        }
        Ok(())
    }
}

impl Series {
    fn style(&self) -> ShapeStyle {
        let colour = self.ink.colour();
        match self.mark {
            Mark::Broad => colour.stroke_width(px(BROAD)),
            Mark::Line | Mark::Dashed | Mark::Rings => colour.stroke_width(px(THIN)),
            Mark::Dots | Mark::Discs => colour.filled(),
        }
    }
}

/// The legend above the axes, where it hides no data. It takes as many rows as it needs.
struct Legend<'a> {
    /// Each curve that has a name, with the place of the name: pixels from the left, and row.
    entries: Vec<(&'a Series, u32, u32)>,
    rows: u32,
}

impl<'a> Legend<'a> {
    fn new(panel: &'a Panel, width: u32) -> Self {
        let left = MARGIN + Y_LABELS_WIDTH;
        let (mut x, mut rows) = (left, 0);
        let mut entries = Vec::new();
        for series in panel.series.iter().filter(|series| !series.name.is_empty()) {
            // Plotters cannot measure text without a font. A character of sans-serif is on average a little
            // wider than half its size.
            let advance = 30 + series.name.chars().count() as u32 * TICKS * 11 / 20 + 8;
            if rows == 0 {
                rows = 1;
            } else if x + advance > width {
                rows += 1;
                x = left;
            }
            entries.push((series, x, rows - 1));
            x += advance;
        }
        Self { entries, rows }
    }

    fn height(&self) -> u32 {
        match self.rows {
            0 => 0,
            rows => LEGEND_HEIGHT + (rows - 1) * LEGEND_ROW,
        }
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, plotters::coord::Shift>) -> Result<(), Refused>
    where
        DB::ErrorType: 'static,
    {
        let at = |pixels: u32| px(pixels) as i32;
        let text = TextStyle::from((FONT, px(TICKS)).into_font())
            .color(&TEXT)
            .pos(Pos::new(HPos::Left, VPos::Center));
        for &(series, x, row) in &self.entries {
            let (x, middle) = (at(x), at(LEGEND_HEIGHT / 2 + 3 + row * LEGEND_ROW));
            let place = |pixels: u32| (x + at(pixels), middle);
            let line = |from: u32, to: u32| PathElement::new([place(from), place(to)], series.style());
            let circle = |radius: u32| Circle::new(place(12), px(radius), series.style());
            match series.mark {
                Mark::Broad | Mark::Line => area.draw(&line(0, 24))?,
                Mark::Dashed => [0, 9, 18]
                    .iter()
                    .try_for_each(|&start| area.draw(&line(start, start + 6)))?,
                Mark::Dots | Mark::Discs => area.draw(&circle(DISC))?,
                Mark::Rings => area.draw(&circle(RING))?,
            }
            area.draw(&Text::new(series.name.as_str(), place(30), text.clone()))?;
        }
        Ok(())
    }
}

impl Panel {
    /// The vertical range, as places on its scale: the given range, or the extent of the curves inside the
    /// horizontal range with a margin. It is never empty.
    fn y_extent(&self, x_range: (f64, f64)) -> (f64, f64) {
        if let Some((low, high)) = self.y_range {
            return (self.y_scale.place(low), self.y_scale.place(high));
        }
        let values = self
            .series
            .iter()
            .flat_map(|series| &series.points)
            .filter(|(x, _)| (x_range.0..=x_range.1).contains(x))
            .map(|(_, y)| self.y_scale.place(*y))
            .filter(|y| y.is_finite());
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

/// A coordinate with given ticks.
struct Ticked {
    range: (f64, f64),
    ticks: Vec<f64>,
}

impl Ticked {
    fn new(scale: Scale, range: (f64, f64), most: usize) -> Self {
        let ticks = ticks(scale, range, most);
        Self { range, ticks }
    }
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (start, end): (i32, i32)) -> i32 {
        let part = (value - self.range.0) / (self.range.1 - self.range.0);
        start + (part * f64::from(end - start)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.0..self.range.1
    }
}

/// The places of the ticks on the scale, at most about `most` of them. A linear axis has steps of 1, 2 or 5.
/// A logarithmic axis has a tick for each decade; with few decades also for 2 and 5, with many decades only
/// for some.
fn ticks(scale: Scale, (low, high): (f64, f64), most: usize) -> Vec<f64> {
    let inside = |place: &f64| *place >= low - 1e-9 * (high - low) && *place <= high + 1e-9 * (high - low);
    let decades = (low.floor() as i32)..=(high.ceil() as i32);
    if scale == Scale::Log && high - low < 2.5 {
        let all =
            decades.flat_map(|decade| [1.0_f64, 2.0, 5.0].map(|digit| f64::from(decade) + digit.log10()));
        return all.filter(inside).collect();
    }
    if scale == Scale::Log {
        let apart = (decades.clone().count() - 1).div_ceil(most).max(1) as i32;
        let kept = decades.filter(|decade| decade % apart == 0).map(f64::from);
        return kept.filter(inside).collect();
    }
    let rough = (high - low) / most as f64;
    let decade = 10_f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * decade);
    let step = steps.into_iter().find(|step| *step >= rough).unwrap_or(rough);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    (first..=last).map(|n| n as f64 * step).collect()
}

impl Scale {
    /// The number at a place on the axis.
    fn label(self, place: f64) -> String {
        let digit = 10_f64.powf(place - place.floor());
        match self {
            Self::Linear => label(place),
            Self::Log if (-2.01..3.99).contains(&place) => label(10_f64.powf(place)),
            Self::Log if digit > 1.5 && digit < 9.5 => {
                format!("{}·10{}", digit.round(), superscript(place.floor()))
            }
            Self::Log => format!("10{}", superscript(place.round())),
        }
    }
}

fn superscript(exponent: f64) -> String {
    let small = |character: char| match character {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32(0x2070 + character as u32 - '0' as u32).unwrap_or(character),
        other => other,
    };
    format!("{exponent:.0}").chars().map(small).collect()
}

/// The number at a tick: as many decimals as it needs, a true minus, no negative zero.
fn label(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 {
        return "0".to_owned();
    }
    format!("{rounded}").replace('-', "−")
}

/// Text escaped for HTML and SVG, for content and for attributes.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let points = (0..100)
            .map(|i| (f64::from(i) * 0.1, (f64::from(i) * 0.2).sin()))
            .collect();
        let sensed = Series {
            name: "sensed".to_owned(),
            ink: Ink::Sensed,
            mark: Mark::Line,
            points,
        };
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
        let series = chart.panels[0].series[0].clone();
        for (ink, mark) in [
            (Ink::Chain, Mark::Broad),
            (Ink::Measured, Mark::Dashed),
            (Ink::Predicted, Mark::Rings),
            (Ink::Sensed, Mark::Dots),
            (Ink::Sensed, Mark::Discs),
            (Ink::Guide, Mark::Dashed),
        ]
        .into_iter()
        .chain((0..FAMILY).map(|index| (Ink::Curve(index), Mark::Line)))
        {
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
