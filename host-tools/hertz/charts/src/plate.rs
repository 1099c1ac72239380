//! Charts side by side on one sheet, with the letters of a paper's figure.

use super::canvas::{Anchor, Canvas, escape};
use super::chart::Chart;
use super::error::Error;
use super::ink::{Ink, drawing_style};

/// Size of the letters, pixels.
const LETTERS: f64 = 16.0;
/// Height of the strip above a chart that holds its letter, pixels.
const STRIP: f64 = 20.0;
/// Gap between charts, pixels.
const APART: f64 = 16.0;
/// Columns that differ by less than this, such as by a row of a legend, count as equally long: letters that
/// follow one another then stand side by side. Pixels.
const LEVEL: f64 = 60.0;

/// Charts in columns, each with a letter above its upper left corner.
#[derive(Debug, Clone)]
pub struct Plate {
    /// The content in words, for readers that cannot see it.
    pub description: String,
    /// The letter of each chart, such as `a`, and the chart. Each comes below the column that is shortest so
    /// far, or the first of those about as short.
    pub charts: Vec<(String, Chart)>,
    /// Number of columns, at least 1.
    pub columns: usize,
}

impl Plate {
    /// The plate as a file of its own, with its style sheet.
    ///
    /// # Errors
    /// A chart cannot be drawn ([`Chart::inline_svg`]), or there is none.
    pub fn standalone_svg(&self) -> Result<String, Error> {
        self.svg(&format!("<style>{}</style>\n", drawing_style()))
    }

    /// The plate in its light colours, for programs without style sheets.
    ///
    /// # Errors
    /// As [`Plate::standalone_svg`].
    pub fn plain_svg(&self) -> Result<String, Error> {
        self.svg("")
    }

    fn svg(&self, head: &str) -> Result<String, Error> {
        if self.charts.is_empty() || self.columns == 0 {
            return Err(Error::new(&self.description, "", "a plate has no chart"));
        }
        let mut drawings = String::new();
        let sizes = self.charts.iter().map(|(_, chart)| chart.size());
        let across = APART + sizes.map(|(wide, _)| wide).fold(0.0, f64::max);
        let mut columns: Vec<(f64, f64)> = (0..self.columns.min(self.charts.len()))
            .map(|column| (column as f64 * across, 0.0))
            .collect();
        for (letter, chart) in &self.charts {
            let shortest = columns.iter().map(|(_, top)| *top).fold(f64::INFINITY, f64::min);
            let next = columns.iter_mut().find(|(_, top)| *top < shortest + LEVEL);
            let Some((left, top)) = next else { continue };
            let mut lettered = Canvas::default();
            let place = (*left + 0.5 * LETTERS, *top + 0.5 * STRIP);
            lettered.text(&format!("({letter})"), place, LETTERS, Ink::Text, Anchor::Start);
            drawings += &format!(
                "{}<g transform=\"translate({left} {})\">\n{}</g>\n",
                lettered.into_svg(),
                *top + STRIP,
                chart.draw()?,
            );
            *top += STRIP + chart.size().1 + APART;
        }
        let width = columns.len() as f64 * across - APART;
        let height = columns.iter().map(|(_, below)| *below).fold(0.0, f64::max) - APART;
        let mut sheet = Canvas::default();
        sheet.fill((width, height), Ink::Paper);
        Ok(format!(
            "<svg width=\"{width}\" height=\"{height}\" class=\"chart\" role=\"img\" aria-label=\"{}\" \
             viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n{head}{}{drawings}</svg>\n",
            escape(&self.description),
            sheet.into_svg()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Mark, Panel, Series};

    fn chart(height: u32) -> Chart {
        let series = Series::new("", Ink::Curve(0), Mark::Line, [(0.0, 0.0), (1.0, 1.0)]);
        let panel = Panel::new("y", vec![series]).height(height);
        Chart::new(Axis::new("x", 0.0..1.0), vec![panel])
    }

    #[test]
    fn a_chart_comes_below_the_first_of_the_short_columns() {
        let [low, legend, tall] = [100, 130, 200].map(chart);
        let (wide, high) = low.size();
        let below = STRIP + legend.size().1 + APART;
        let charts = [("a", legend), ("b", low.clone()), ("c", tall), ("d", low)];
        let mut plate = Plate {
            description: "four".to_owned(),
            charts: charts.map(|(letter, chart)| (letter.to_owned(), chart)).into(),
            columns: 2,
        };
        let svg = plate.plain_svg().unwrap();
        let right = wide + APART;
        let places = [
            (0.0, 0.0),
            (right, 0.0),
            (0.0, below),
            (right, STRIP + high + APART),
        ];
        for ((left, top), letter) in places.into_iter().zip(["(a)", "(b)", "(c)", "(d)"]) {
            let (_, after) = svg.split_once(letter).unwrap();
            let chart = format!("</text>\n<g transform=\"translate({left} {})\">", top + STRIP);
            assert!(after.starts_with(&chart), "{letter}: {chart}");
        }
        assert!(svg.starts_with(&format!("<svg width=\"{}\"", 2.0 * wide + APART)));
        plate.charts.clear();
        assert!(plate.standalone_svg().is_err());
    }
}
