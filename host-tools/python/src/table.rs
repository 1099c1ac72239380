//! Tables as columns: NumPy arrays of numbers, lists of texts.

use bead_tables::{Cell, CellKind, Column};
use numpy::{PyArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The rows of a table, column by column.
pub(crate) struct Columns {
    columns: Vec<Column>,
    cells: Vec<Vec<Cell>>,
}

impl Columns {
    pub(crate) fn new(columns: Vec<Column>) -> Self {
        let cells = columns.iter().map(|_| Vec::new()).collect();
        Self { columns, cells }
    }

    pub(crate) fn push(&mut self, row: Vec<Cell>) {
        for (column, cell) in self.cells.iter_mut().zip(row) {
            column.push(cell);
        }
    }

    /// A dictionary from the name of each column to its values. Whole numbers are `int64`, or `float64` with
    /// NaN where some are unknown; numbers are `float64`, NaN where unknown; texts are a list, None where
    /// there is none.
    pub(crate) fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        for (column, cells) in self.columns.into_iter().zip(self.cells) {
            let whole: Option<Vec<i64>> = cells
                .iter()
                .map(|cell| match cell {
                    Cell::Whole(number) => Some(*number),
                    _ => None,
                })
                .collect();
            match (column.kind, whole) {
                (CellKind::Whole, Some(whole)) => dict.set_item(column.name, whole.to_pyarray(py))?,
                (CellKind::Whole | CellKind::Number, _) => {
                    let numbers = cells.iter().map(|cell| cell.as_f64().unwrap_or(f64::NAN));
                    dict.set_item(column.name, PyArray1::from_vec(py, numbers.collect()))?;
                }
                _ => {
                    let texts = cells.iter().map(|cell| match cell {
                        Cell::Text(text) => Some(text.to_string()),
                        _ => None,
                    });
                    dict.set_item(column.name, PyList::new(py, texts.collect::<Vec<_>>())?)?;
                }
            }
        }
        Ok(dict)
    }
}
