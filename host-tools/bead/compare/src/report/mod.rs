//! A result for people: tiles, and sections of text, tables and charts.
//!
//! # Design
//! A comparison is put into words once, as a [`Report`]. Two renderers show it: [`Report::terminal`] as
//! aligned columns, [`Report::page`] as one HTML file that needs nothing from outside. What only one of them
//! shows is marked, as pictures need a page and long tables need a narrow one.

mod content;
mod page;
mod quantity;
mod terminal;

pub use content::{Block, Cell, DASH, Fact, Medium, Report, Section, Table};
pub use quantity::{EnergyUnit, count, energy, number, percent, percent_within, signed};
pub use terminal::aligned;
