//! Tests of the bead on a fake device.

mod built_in;
