//! A result for people: tiles, and sections of text, tables and charts. A comparison is put into words once,
//! as a [`Report`]. [`Report::terminal`] shows it as aligned columns, [`Report::page`] as one HTML file that
//! needs nothing from outside; content for only one of them is marked.

mod content;
mod page;
mod quantity;
mod terminal;

pub use bead_tables::printable::count;
pub use content::{Chapter, DASH, Fact, Grid, GridCell, Medium, Passage, Report};
pub use quantity::{EnergyUnit, energy, number, percent, percent_within, signed};
pub use terminal::aligned;
