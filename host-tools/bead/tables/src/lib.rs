//! Tables in files: columns with units, Parquet, CSV, and files that appear whole or not at all.
//!
//! # Design
//! A table has named columns of whole numbers, numbers or text ([`Column`]), and rows of [`Cell`]s. The name
//! of a column ends with its unit ([`mod@unit`]). [`Writer`] writes tables as Parquet or CSV, [`Reader`]
//! reads Parquet files of any origin, some rows at a time: memory does not grow with the table.

mod guarded;
pub mod printable;
mod read;
mod table;
pub mod unit;
pub mod whole;
mod write;

pub use read::{Batch, ReadError, Reader};
pub use table::{Cell, CellKind, Column};
pub use write::Writer;
