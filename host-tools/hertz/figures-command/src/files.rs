//! A figure as files: the picture (SVG, PNG) and its data (CSV, Parquet), all from one chart.
//!
//! Each row of the data is one point, in the units of the axes. `panel` and `curve` say where the point
//! belongs, `x_quantity` and `y_quantity` what it is.

use std::sync::Arc;

use bead::cli::place::Kind;
use hertz_charts::Chart;
use hertz_charts::Error;
use hertz_figures::plan::{Figure, Plan};
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use crate::pixels::{gif, png};

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

/// The files that a figure may have, by their endings.
pub(crate) const KINDS: [(&str, Kind); 5] = [
    ("svg", Kind::Drawing),
    ("png", Kind::Picture),
    ("csv", Kind::Table),
    ("parquet", Kind::Parquet),
    ("gif", Kind::Picture),
];

/// A file of a figure.
#[derive(Debug, Clone)]
pub(crate) struct File {
    /// Its name: `figure-NAME.svg`, `.png`, `.csv`, `.parquet` or, of an animation, `.gif`.
    pub(crate) name: String,
    /// Its kind.
    pub(crate) kind: Kind,
    /// Its content.
    pub(crate) bytes: Vec<u8>,
}

/// The files of a figure.
///
/// # Errors
/// The chart cannot be drawn, such as one with an axis without extent.
pub(crate) fn files(plan: &Plan, figure: &Figure) -> Result<Vec<File>, Error> {
    let chart = &figure.chart;
    let table = parquet(plan, chart).map_err(|error| Error::new(&chart.description, " as Parquet", error))?;
    let [svg, png_kind, csv_kind, parquet_kind, gif_kind] = KINDS;
    let mut files = vec![
        (svg, chart.standalone_svg()?.into_bytes()),
        (png_kind, png(chart)?),
        (csv_kind, csv(chart).into_bytes()),
        (parquet_kind, table),
    ];
    if !figure.frames.is_empty() {
        files.push((gif_kind, gif(&figure.frames)?));
    }
    let named = |((extension, kind), bytes)| File {
        name: format!("figure-{}.{extension}", plan.name),
        kind,
        bytes,
    };
    Ok(files.into_iter().map(named).collect())
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

fn parquet(plan: &Plan, chart: &Chart) -> Result<Vec<u8>, ParquetError> {
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

    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
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
    Ok(bytes)
}
