//! The tests of the command line, of recordings and of the host's side of a line: one program, linked once.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod analyse;
mod answering;
mod browser;
mod budget;
mod calibrate;
mod channels;
mod command_line;
mod export;
mod failing_image;
mod first_flash;
mod first_strike;
mod flash;
mod full_disk;
mod hostile;
mod identify;
mod inputs;
mod interrupted;
mod kept;
mod limits;
mod logbook;
mod monitor;
mod monitor_rate;
mod pane;
mod program;
mod record;
mod recover;
mod requests;
mod rom;
mod row;
mod rows;
mod schema;
mod schemas;
mod settings;
mod shared_line;
mod signed_result;
mod slurm;
mod sweep;
mod waveforms;
mod yesterday;
