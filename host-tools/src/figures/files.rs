//! A figure as files: the picture (SVG, PNG) and its data (CSV, Parquet), all from the one chart.
//!
//! The data stand one point a row, in the units of the axes: `panel` and `curve` say where the point belongs, `x_quantity`
//! and `y_quantity` what it is.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use rayon::prelude::*;

use super::{Figure, Plan};
use crate::failure::{Blame, Failure};
use crate::figure::{Chart, SCREEN};
use crate::output;

struct Row<'a> {
    panel: i32,
    curve: &'a str,
    x_quantity: &'a str,
    x: f64,
    y_quantity: &'a str,
    y: f64,
}

fn rows(chart: &Chart) -> impl Iterator<Item = Row<'_>> {
    chart.panels.iter().zip(1..).flat_map(|(panel, number)| {
        let x_quantity = &panel.x.as_ref().unwrap_or(&chart.x).label;
        panel.series.iter().flat_map(move |series| {
            series.points.iter().map(move |&(x, y)| Row {
                panel: number,
                curve: &series.name,
                x_quantity,
                x,
                y_quantity: &panel.y_label,
                y,
            })
        })
    })
}

/// Writes `figure-NAME.svg`, `.png`, `.csv`, `.parquet` and, of an animation, `.gif` into a directory that is there, and
/// gives their paths.
///
/// # Errors
/// A file that cannot be written.
pub fn write(plan: &Plan, figure: &Figure, directory: &Path) -> Result<Vec<String>, Failure> {
    let path = |extension: &str| directory.join(format!("figure-{}.{extension}", plan.name));
    let chart = &figure.chart;
    let svg = chart.standalone_svg()?;
    output::write_whole(&path("svg"), |file| Ok(file.write_all(svg.as_bytes())?))?;
    let png = chart.png()?;
    output::write_whole(&path("png"), |file| Ok(file.write_all(&png)?))?;
    output::write_whole(&path("csv"), |file| Ok(file.write_all(csv(chart).as_bytes())?))?;
    output::write_whole(&path("parquet"), |file| parquet(plan, chart, file))?;
    let mut extensions = vec!["svg", "png", "csv", "parquet"];
    if !figure.frames.is_empty() {
        output::write_whole(&path("gif"), |file| animation(&figure.frames, file))?;
        extensions.push("gif");
    }
    let written = extensions
        .iter()
        .map(|extension| path(extension).display().to_string());
    Ok(written.collect())
}

/// Hundredths of a second that a frame stays.
const FRAME: u16 = 12;

fn animation(frames: &[Chart], file: &mut std::fs::File) -> anyhow::Result<()> {
    let images = frames
        .par_iter()
        .map(|chart| {
            let pixels = chart.pixels(SCREEN)?;
            let size = |pixels: u32| u16::try_from(pixels).or_input(|| "a picture is too large for GIF");
            let (width, height) = (size(pixels.width())?, size(pixels.height())?);
            let mut image = gif::Frame::from_rgba_speed(width, height, &mut pixels.take(), 10);
            image.delay = FRAME;
            Ok(image)
        })
        .collect::<Result<Vec<_>, Failure>>()?;
    let first = &images[0];
    let mut encoder = gif::Encoder::new(std::io::BufWriter::new(file), first.width, first.height, &[])?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    for image in &images {
        encoder.write_frame(image)?;
    }
    Ok(())
}

fn csv(chart: &Chart) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let mut text = String::from("panel,curve,x_quantity,x,y_quantity,y\n");
    for row in rows(chart) {
        let [curve, x, y] = [row.curve, row.x_quantity, row.y_quantity].map(quoted);
        text.push_str(&format!("{},{curve},{x},{},{y},{}\n", row.panel, row.x, row.y));
    }
    text
}

fn parquet(plan: &Plan, chart: &Chart, file: &mut std::fs::File) -> anyhow::Result<()> {
    let schema = parse_message_type(
        "message figure { REQUIRED INT32 panel; REQUIRED BINARY curve (UTF8); REQUIRED BINARY x_quantity (UTF8); \
         REQUIRED DOUBLE x; REQUIRED BINARY y_quantity (UTF8); REQUIRED DOUBLE y; }",
    )?;
    let metadata = [
        ("figure", plan.name),
        ("title", plan.title),
        ("setting", plan.setting),
    ]
    .map(|(key, value)| KeyValue::new(key.to_owned(), value.to_owned()));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(metadata.to_vec()))
        .build();
    let rows: Vec<Row<'_>> = rows(chart).collect();
    let text = |of: fn(&Row<'_>) -> String| -> Vec<ByteArray> {
        rows.iter()
            .map(|row| ByteArray::from(of(row).into_bytes()))
            .collect()
    };
    let numbers: Vec<i32> = rows.iter().map(|row| row.panel).collect();
    let [xs, ys]: [Vec<f64>; 2] = [|row: &Row<'_>| row.x, |row: &Row<'_>| row.y]
        .map(|of: fn(&Row<'_>) -> f64| rows.iter().map(of).collect());

    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    let mut column = 0;
    while let Some(mut out) = group.next_column()? {
        match column {
            0 => out.typed::<Int32Type>().write_batch(&numbers, None, None)?,
            1 => out
                .typed::<ByteArrayType>()
                .write_batch(&text(|row| row.curve.to_owned()), None, None)?,
            2 => out.typed::<ByteArrayType>().write_batch(
                &text(|row| row.x_quantity.to_owned()),
                None,
                None,
            )?,
            3 => out.typed::<DoubleType>().write_batch(&xs, None, None)?,
            4 => out.typed::<ByteArrayType>().write_batch(
                &text(|row| row.y_quantity.to_owned()),
                None,
                None,
            )?,
            _ => out.typed::<DoubleType>().write_batch(&ys, None, None)?,
        };
        out.close()?;
        column += 1;
    }
    group.close()?;
    writer.close()?;
    Ok(())
}
