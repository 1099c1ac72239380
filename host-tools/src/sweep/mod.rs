//! Sweeps: many scenarios from one, over axes of parameters, into one table.
//!
//! # Design
//! A [`definition`] names a scenario, axes and outputs. Its points are numbered: the last axis turns fastest.
//! A point's scenario and row depend on its number alone, so points can be computed in any chunks, by any
//! number of threads and programs. A [`folder`] holds a plan and a part for each finished chunk. A part
//! appears whole or not at all, so the parts that are there tell where to go on. Merged, they give the same
//! bytes whatever the chunks were. One machine and a cluster work in the same way; [`slurm`] only says who
//! computes which chunk.

pub mod axis;
pub mod compute;
pub mod definition;
pub mod draw;
pub mod folder;
pub mod key;
pub mod outputs;
pub mod picture;
pub mod plan;
pub mod slurm;
pub mod time_series;
