//! A report as aligned columns.

use comfy_table::{CellAlignment, Table as Grid, presets};

use crate::report::content::{Block, Cell, Column, Report, Table};

/// A table that may still grow by others with its columns.
struct Open<'a> {
    columns: Vec<&'a Column>,
    heads: Vec<String>,
    rows: Vec<Vec<String>>,
    grouped: bool,
}

impl Report {
    /// The report's tables and lines as text, without a line end after the last.
    pub fn terminal(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        let mut open: Option<Open<'_>> = None;
        let blocks = self.sections.iter().flat_map(|section| &section.blocks);
        for block in blocks {
            match block {
                Block::Table(table) if table.medium.is_terminal() && !table.rows.is_empty() => {
                    let next = Open::of(table);
                    match &mut open {
                        Some(last) if last.grouped && last.columns == next.columns => {
                            last.rows.extend(next.rows);
                        }
                        _ => parts.extend(open.replace(next).map(Open::text)),
                    }
                }
                Block::Line(line) => {
                    parts.extend(open.take().map(Open::text));
                    match parts.last_mut() {
                        Some(part) => *part += &format!("\n{line}"),
                        None => parts.push(line.clone()),
                    }
                }
                _ => {}
            }
        }
        parts.extend(open.map(Open::text));
        parts.join("\n\n")
    }
}

impl<'a> Open<'a> {
    fn of(table: &'a Table) -> Self {
        let shown = |column: &&Column| column.medium.is_terminal();
        let columns: Vec<&Column> = table.columns.iter().filter(shown).collect();
        let mut heads: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        let mut rows = Vec::new();
        if let Some(group) = table.group.as_ref().filter(|group| !group.is_empty()) {
            rows.push(vec![group.clone()]);
        }
        for cells in &table.rows {
            let shown = cells
                .iter()
                .zip(&table.columns)
                .filter(|(_, column)| column.medium.is_terminal());
            let mut texts: Vec<String> = shown.map(|(cell, _)| text(cell)).collect();
            if !rows.is_empty()
                && let Some(first) = texts.first_mut().filter(|_| table.group.is_some())
            {
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

fn text(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) | Cell::Judged(text, _) => text.clone(),
        Cell::Histogram(_) | Cell::Bar(_) => String::new(),
    }
}

/// Rows in aligned columns without rules: names on the left, numbers on the right.
pub fn aligned<S: AsRef<str>, R: Into<comfy_table::Row>>(
    heads: &[S],
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut grid = Grid::new();
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
