//! A result for people: tiles, and sections of text, tables and charts. A comparison is put into words once,
//! as a [`Report`]. [`Report::terminal`] shows it as aligned columns, [`Report::page`] as one HTML file that
//! needs nothing from outside; content for one of them alone is marked.

mod content;
mod page;
mod quantity;
mod terminal;

pub(crate) use content::{Chapter, Grid, GridCell, Medium, Passage};
pub use content::{DASH, Fact, Report};
pub use quantity::{EnergyUnit, count, energy, number, percent, percent_within, signed};
pub use terminal::aligned;
