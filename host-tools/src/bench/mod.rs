//! The bead on the bench: what it senses, its front end, its image in QEMU, and faults.

pub mod bridge;
pub mod emulation;
pub mod error;
pub mod faults;
pub mod front_end;
pub mod image;
mod playback;
pub mod sensed;
pub mod several;
pub mod tables;
