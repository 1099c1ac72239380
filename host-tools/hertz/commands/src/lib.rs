//! The simulator's commands: one file each, with its arguments, its run, its table and its JSON.

// For its macros: `failure!`, `bail!`, `note!`.
#[macro_use]
extern crate bead_console;

pub mod optimise;
pub mod optimise_front;
pub mod optimise_search;
pub mod periodic;
mod sensitivities;
pub mod simulate;
pub mod sweep;
pub mod sweep_cluster;
mod sweep_plot;
pub mod sweep_work;
