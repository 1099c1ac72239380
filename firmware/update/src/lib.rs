//! Updates of a bead over its line, with a way back.
//!
//! # Design
//! ```text
//! announced: signed manifest, judged   ─> room erased ─> pieces ─> hash compared ─> marked ─> reset loader:
//! swap, page by page        ─> the new image, on trial ─> confirmed, or swapped back at the next reset
//! ```
//!
//! | file | is |
//! |---|---|
//! | [`layout`] | places of the images in flash |
//! | [`manifest`] | statement about an image, and its signature |
//! | [`reception`] | an image that comes in pieces |
//! | [`swap`] | the state, the swap and the way back, by `embassy-boot` |
//! | `internal` | the driver of the part's flash; only for the part |
//! | `file` | the ELF file of an image and its signature; with the feature `file`, for programs of the host |
#![no_std]
#![deny(unsafe_code)]

#[cfg(any(test, feature = "file"))]
extern crate std;

#[cfg(feature = "file")]
pub mod file;

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "flash is memory that no Rust object stands for")]
pub mod internal;
pub mod layout;
pub mod manifest;
mod partition;
pub mod reception;
pub mod swap;

/// The traits of the flash.
pub use embedded_storage::nor_flash;
