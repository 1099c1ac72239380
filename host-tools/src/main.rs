//! `bead`, the command line.

fn main() {}
