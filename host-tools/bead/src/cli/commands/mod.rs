//! One file a command: its arguments, its run, its table and its JSON.

pub(crate) mod clock;
pub(crate) mod command;
pub(crate) mod compare;
mod compare_arguments;
pub(crate) mod compare_reference;
pub(crate) mod compare_row;
mod compared;
pub(crate) mod decode;
pub(crate) mod emulate;
mod emulated;
pub(crate) mod export;
pub(crate) mod fetch;
pub(crate) mod figures;
pub(crate) mod manual;
pub(crate) mod optimise;
mod prelude;
pub(crate) mod proof;
pub(crate) mod record;
pub(crate) mod recover;
pub(crate) mod replay;
pub(crate) mod settings;
mod settings_file;
pub(crate) mod simulate;
pub(crate) mod sweep;
pub(crate) mod sweep_cluster;
mod sweep_plot;
pub(crate) mod sweep_work;
