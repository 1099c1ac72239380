//! What the flash image and the tools are made of.
//!
//! # Design
//! Cargo knows it all: `cargo tree` says which packages are linked into a program, feature by feature, and
//! `cargo metadata` says what each is. `deny.toml` says what is allowed, for cargo-deny and for this crate
//! alike, so that a clone without cargo-deny is checked too.

pub mod bill;
pub mod notices;
pub mod packages;
pub mod policy;

use std::path::Path;

/// The page that [`notices::page`] writes, from the workspace's root.
pub const PAGE: &str = "THIRD-PARTY.md";

/// The root of the workspace.
pub fn root() -> &'static Path {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.ancestors().nth(2).unwrap_or(manifest)
}
