//! A figure as files: the picture (SVG, PNG, PDF) and its data (CSV, Parquet), all from one chart. A plate as
//! files: its picture.
//!
//! Each row of the data is one point, in the units of the axes. `panel` and `curve` say where the point
//! belongs, `x_quantity` and `y_quantity` what it is.

use bead_console::failure::Failure;
use bead_console::place::FileKind;
use bead_tables::whole::Target;
use bead_tables::{Cell, Column, Writer};
use hertz_charts::{Chart, Plate};
use hertz_figures::plan::{Figure, FigurePlan};

use crate::drawing::Drawing;
use crate::pdf::pdf;
use crate::pixels::{gif, png};

/// The files that a figure may have, by their endings.
pub(crate) const KINDS: [(&str, FileKind); 6] = [
    ("svg", FileKind::Drawing),
    ("png", FileKind::Picture),
    ("pdf", FileKind::Picture),
    ("csv", FileKind::Table),
    ("parquet", FileKind::Parquet),
    ("gif", FileKind::Picture),
];

/// The files of a plate: the first of [`KINDS`].
pub(crate) const PLATE_KINDS: usize = 3;

/// Writes the pictures of a plate, `plate-NUMBER.svg`, `.png` and `.pdf`, and returns their paths.
pub(crate) fn write_plate(
    number: &str,
    plate: &Plate,
    target: impl Fn(&str, FileKind) -> Result<Target, Failure>,
) -> Result<Vec<String>, Failure> {
    let drawing = Drawing::of_plate(plate)?;
    let mut paths = Vec::new();
    for (extension, kind) in &KINDS[..PLATE_KINDS] {
        let target = target(&format!("plate-{number}.{extension}"), *kind)?;
        match *extension {
            "svg" => target.write_bytes(plate.standalone_svg()?)?,
            "png" => target.write_bytes(png(&drawing)?)?,
            _ => target.write_bytes(pdf(&drawing)?)?,
        }
        paths.push(target.path().display().to_string());
    }
    Ok(paths)
}

/// Writes the files of a figure, each to the target of its name, and returns their paths: `figure-NAME.svg`,
/// `.png`, `.pdf`, `.csv`, `.parquet` and, of an animation, `.gif`.
///
/// # Errors
/// The chart cannot be drawn, such as one with an axis without extent, or a file cannot be written.
pub(crate) fn write(
    plan: &FigurePlan,
    figure: &Figure,
    target: impl Fn(&str, FileKind) -> Result<Target, Failure>,
) -> Result<Vec<String>, Failure> {
    let chart = &figure.chart;
    let drawing = Drawing::of(chart)?;
    let mut paths = Vec::new();
    for (extension, kind) in KINDS {
        if extension == "gif" && figure.frames.is_empty() {
            continue;
        }
        let target = target(&format!("figure-{}.{extension}", plan.name), kind)?;
        match extension {
            "svg" => target.write_bytes(chart.standalone_svg()?)?,
            "png" => target.write_bytes(png(&drawing)?)?,
            "pdf" => target.write_bytes(pdf(&drawing)?)?,
            "gif" => target.write_bytes(gif(&figure.frames)?)?,
            "csv" => target.write(|file| write_points(chart, Writer::csv(file, &columns())?))?,
            _ => target.write(|file| {
                let notes = [
                    ("figure", plan.name),
                    ("title", plan.title),
                    ("setting", plan.setting),
                ];
                write_points(chart, Writer::parquet(file, "figure", &columns(), &notes)?)
            })?,
        }
        paths.push(target.path().display().to_string());
    }
    Ok(paths)
}

fn columns() -> [Column; 6] {
    use bead_tables::CellKind::{Number, Text, Whole};
    [
        ("panel", Whole),
        ("curve", Text),
        ("x_quantity", Text),
        ("x", Number),
        ("y_quantity", Text),
        ("y", Number),
    ]
    .map(|(name, kind)| Column::new(name, kind))
}

fn write_points(chart: &Chart, mut table: Writer<'_>) -> anyhow::Result<()> {
    let text = |text: &str| Cell::Text(text.into());
    for (panel, number) in chart.panels.iter().zip(1..) {
        let x_quantity = &panel.x.as_ref().unwrap_or(&chart.x).label;
        for series in &panel.series {
            for (x, y) in &series.points {
                table.push(vec![
                    Cell::Whole(number),
                    text(&series.name),
                    text(x_quantity),
                    Cell::Number(*x),
                    text(&panel.y_label),
                    Cell::Number(*y),
                ])?;
            }
        }
    }
    table.finish()
}
