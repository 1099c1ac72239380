//! One file a command: its arguments, its run, its table and its JSON.

pub(crate) mod simulate;
