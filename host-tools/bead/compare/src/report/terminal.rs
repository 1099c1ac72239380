//! A report as aligned columns.

use comfy_table::{CellAlignment, presets};

use crate::report::content::{Grid, GridCell, GridColumn, Passage, Report};

/// A table that may still grow by others with its columns.
struct OpenGrid<'a> {
    columns: Vec<&'a GridColumn>,
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
    grouped: bool,
}

impl Report {
    /// The report's tables and lines as text, without a line end after the last.
    pub fn terminal(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        let mut open: Option<OpenGrid<'_>> = None;
        for content in self.sections.iter().flat_map(|section| &section.content) {
            match content {
                Passage::Grid(table) if table.medium.is_terminal() && !table.rows.is_empty() => {
                    let next = OpenGrid::of(table);
                    match &mut open {
                        Some(last) if last.grouped && last.columns == next.columns => {
                            last.rows.extend(next.rows);
                        }
                        _ => parts.extend(open.replace(next).map(OpenGrid::text)),
                    }
                }
                Passage::Line(line) => {
                    parts.extend(open.take().map(OpenGrid::text));
                    match parts.last_mut() {
                        Some(part) => *part += &format!("\n{line}"),
                        None => parts.push(line.clone()),
                    }
                }
                _ => {}
            }
        }
        parts.extend(open.map(OpenGrid::text));
        parts.join("\n\n")
    }
}

impl<'a> OpenGrid<'a> {
    fn of(table: &'a Grid) -> Self {
        let columns = table.columns.iter().filter(|column| column.medium.is_terminal());
        let columns: Vec<&GridColumn> = columns.collect();
        let mut heads: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        let named = table.group.as_ref().filter(|group| !group.is_empty());
        let mut rows: Vec<Vec<String>> = named.map(|group| vec![group.clone()]).into_iter().collect();
        for cells in &table.rows {
            let shown = cells.iter().zip(&table.columns);
            let shown = shown.filter(|(_, column)| column.medium.is_terminal());
            let mut texts: Vec<String> = shown.map(|(cell, _)| text(cell)).collect();
            // The rows of a group without a name have no heading to stand under.
            let is_below = table.group.is_some() && !rows.is_empty();
            if let Some(first) = texts.first_mut().filter(|_| is_below) {
                first.insert_str(0, "  ");
            }
            rows.push(texts);
        }
        if table.group.is_some() {
            heads[0].clear();
        }
        Self {
            columns,
            heads,
            rows,
            grouped: table.group.is_some(),
        }
    }

    fn text(self) -> String {
        aligned(&self.heads, self.rows)
    }
}

fn text(cell: &GridCell) -> String {
    match cell {
        GridCell::Text(text) | GridCell::Judged(text, _) => text.clone(),
        GridCell::Histogram(_) | GridCell::Bar(_) => String::new(),
    }
}

/// Rows in aligned columns without rules: names on the left, numbers on the right.
pub fn aligned<S: AsRef<str>, R: Into<comfy_table::Row>>(
    heads: &[S],
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut grid = comfy_table::Table::new();
    grid.load_style(presets::NOTHING)
        .set_header(heads.iter().map(AsRef::as_ref))
        .add_rows(rows);
    for (index, column) in grid.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if index > 0 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    // Padding leaves blanks at the ends of the lines.
    let lines: Vec<_> = grid.lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}
