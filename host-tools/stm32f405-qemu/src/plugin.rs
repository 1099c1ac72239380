//! The plugin: what runs inside QEMU.
//!
//! # Design
//!
//! `callbacks` is what QEMU calls, and `qemu` is what the plugin calls in QEMU. Only these two have `unsafe`
//! in them. The callbacks drive an `Overlay`. The overlay drives a machine, records what comes out of it, and
//! ends the run.
//!
//! The processor's thread also passes the time in which the processor waits, while the main thread rests: see
//! `idle`.
//!
//! QEMU's big lock is held in every callback that reaches the overlay, so one call ends before the next
//! begins.

mod blocks;
mod callbacks;
mod count;
mod coverage;
mod cycles;
mod failures;
mod fences;
mod handlers;
mod idle;
mod overlay;
mod pace;
mod priorities;
mod qemu;
mod recorder;
mod rtt;
mod self_test;
mod stops;
mod waiting;
