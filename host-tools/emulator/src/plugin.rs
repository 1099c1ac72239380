//! The plugin: what runs inside QEMU.
//!
//! # Design
//!
//! [`qemu`] is the only file with `unsafe` in it: it finds QEMU's functions, lays the regions over the machine and turns
//! QEMU's callbacks into calls of [`Overlay`]. The overlay drives a [`Machine`], records what comes out, and ends the run.
//!
//! QEMU's big lock is held in every callback that reaches the overlay, so one call ends before the next begins.

mod blocks;
mod callbacks;
mod count;
mod overlay;
mod qemu;
mod recorder;
mod rtt;
mod self_test;
