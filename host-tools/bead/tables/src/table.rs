//! Cells and columns.

use std::sync::Arc;

/// A value of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Unknown.
    Null,
    /// A count, an index, bits.
    Whole(i64),
    /// A quantity.
    Number(f64),
    /// A name.
    Text(Arc<str>),
}

impl Cell {
    /// A whole number; one above 2^63 - 1 becomes that.
    pub fn whole(number: impl TryInto<i64>) -> Self {
        Self::Whole(number.try_into().unwrap_or(i64::MAX))
    }

    /// A number, or null.
    pub fn number(number: Option<f64>) -> Self {
        number.map_or(Self::Null, Self::Number)
    }

    /// A text, or null.
    pub fn text(text: Option<&str>) -> Self {
        text.map_or(Self::Null, |text| Self::Text(text.into()))
    }

    /// The number in the cell, whole or not; `None` for text and null.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Whole(number) => Some(*number as f64),
            Self::Number(number) => Some(*number),
            Self::Null | Self::Text(_) => None,
        }
    }
}

/// The kind of value that a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// [`Cell::Whole`].
    Whole,
    /// [`Cell::Number`].
    Number,
    /// [`Cell::Text`].
    Text,
    /// Values of other programs that are not read: lists, decimals in bytes, floats of 16 bits.
    Other,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name, with the unit at its end ([`crate::unit`]).
    pub name: String,
    /// Its kind of value.
    pub kind: CellKind,
}

impl Column {
    /// A column.
    pub fn new(name: impl Into<String>, kind: CellKind) -> Self {
        let name = name.into();
        Self { name, kind }
    }
}
