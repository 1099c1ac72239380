//! The paper's figures. Each one runs: simulation, picture, data and checks.
//!
//! # Design
//! A [`FigurePlan`](plan::FigurePlan) names a figure and says how to draw it. Drawing returns a
//! [`Figure`](plan::Figure): a chart and a list of [`FigureCheck`](check::FigureCheck)s. Files are made
//! from the chart alone, so what is written is what is drawn. Figures of one plate share their runs through
//! the [`Lab`](lab::Lab), and [`plate`] puts them on one sheet. The lab also records how well energy and
//! momentum held in every run that a figure used.

pub mod catalogue;
pub mod chapter;
pub mod check;
mod curve;
pub mod error;
pub mod lab;
mod observe;
pub mod plan;
pub mod plate;
mod plates;
mod setting;
