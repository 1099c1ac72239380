//! The pins of the board that the image is built for: a row of `boards.txt`, which the build script reads.

include!(concat!(env!("OUT_DIR"), "/wiring.rs"));
