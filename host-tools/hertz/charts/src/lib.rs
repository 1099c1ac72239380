//! Line charts as SVG, with colours for light and for dark pages.
//!
//! # Design
//! A [`Chart`] is data: panels with curves over axes. Drawing has three layers: `frame` places a panel's
//! axes, ticks and curves, `legend` the names, `map` colours cells, and `canvas` writes lines, marks and text
//! as SVG. All axes of a chart begin and end in the same columns. A chart inside a page and a chart in its
//! own file share the sheet [`style`]. A [`Plate`] puts charts side by side, with letters.

mod canvas;
mod chart;
mod error;
mod frame;
mod ink;
mod legend;
mod map;
mod panel;
mod plate;
mod scale;
mod series;

pub use canvas::{escape, raised};
pub use chart::{COLUMN, Chart, WIDTH};
pub use error::Error;
pub use ink::{FAMILY, Ink, style};
pub use map::Map;
pub use panel::{Axis, Panel};
pub use plate::Plate;
pub use scale::{Scale, ends};
pub use series::{Mark, Series};
