//! Sweeps: many scenarios from one, over axes of parameters, into one table.
//!
//! # Design
//! A [`definition`] names a scenario, axes and outputs. Points are numbered, and the last axis turns fastest.
//! The scenario and the row of a point depend only on its number, so any number of threads and programs can
//! compute points in any chunks. A [`folder`] holds a plan and a part for each finished chunk. A part
//! appears whole or not at all, so the parts show where to resume, and their merged bytes do not depend on
//! the chunks. One machine and a cluster work alike; [`slurm`] only assigns chunks to jobs. [`time_series`]
//! is the table of a single run.

pub mod axis;
mod axis_table;
mod column;
pub mod compute;
pub mod definition;
pub mod draw;
pub mod folder;
pub mod key;
pub mod outputs;
pub mod picture;
pub mod plan;
mod side;
pub mod slurm;
#[cfg(test)]
mod testing;
pub mod time_series;
pub mod view;
