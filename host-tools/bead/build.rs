//! Passes on where the emulator's overlay and the flash image are built, so that `bead` can carry both.
//!
//! # Design
//! `cargo install --path host-tools/bead` must install a program that can emulate anywhere. A missing image
//! is therefore built here, by a second cargo in the same target directory: for another target and another
//! profile, cargo takes another lock. If `cargo xtask` builds the image at the same time, the later one
//! waits and finds all in place. An existing image is used as it is, so that a change of the firmware does
//! not recompile the host tools: `cargo xtask build` rebuilds the image, and `bead` is linked with it.

use std::env;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::UNIX_EPOCH;

const TARGET: &str = "thumbv7em-none-eabihf";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let built = env::var("DEP_STM32F405_QEMU_BUILT").expect("the emulator's build script says it");
    println!("cargo::rustc-env=STM32F405_QEMU_BUILT={built}");

    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let root = root
        .ancestors()
        .nth(2)
        .expect("the host tools lie inside the workspace");
    let image = target_directory().join(TARGET).join("firmware/bead-firmware");
    if !is_there(&image) {
        build(root, &image);
    }
    if !is_there(&image) {
        println!(
            "cargo::warning=the flash image is not built, so that `bead` carries none: `cargo xtask build` says why"
        );
        // Run again once there is an image. Until then an empty file takes its place, since `bead` includes
        // it. The file is dated 1970, since cargo reruns this script for every file newer than its last
        // run.
        println!("cargo::rerun-if-changed={}", image.display());
        let folder = image.parent().expect("it lies in a directory");
        fs::create_dir_all(folder)
            .and_then(|()| File::create(&image)?.set_modified(UNIX_EPOCH))
            .expect("the target directory can be written to");
    }
    println!("cargo::rustc-env=BEAD_IMAGE={}", image.display());
    // An installed program needs no symbols.
    println!("cargo::rustc-link-arg-bins=-s");
}

fn is_there(image: &Path) -> bool {
    image.metadata().is_ok_and(|found| found.len() > 0)
}

/// The target directory: OUT_DIR is TARGET/release/build/bead-HASH/out, with a triple before `release` if one
/// was asked for.
fn target_directory() -> PathBuf {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let triple = env::var("TARGET").expect("cargo sets it");
    let mut above = out.ancestors().skip(4);
    let folder = above.next().expect("OUT_DIR lies in the target directory");
    let is_triple = folder.file_name().is_some_and(|name| *name == *triple);
    let folder = if is_triple { above.next() } else { Some(folder) };
    folder.expect("a triple lies in the target directory").to_owned()
}

/// Prefixes of variables of the host tools' build, which must not reach the image's build.
const OF_THIS_BUILD: [&str; 8] = [
    "CARGO_FEATURE_",
    "CARGO_CFG_",
    "CARGO_PKG_",
    "CARGO_MANIFEST_",
    "DEP_",
    "RUSTC_WORKSPACE_WRAPPER",
    "CLIPPY_ARGS",
    "CARGO_ENCODED_RUSTFLAGS",
];

/// Builds the image. If that fails, as without the target, `bead` is still built.
fn build(root: &Path, image: &Path) {
    let folder = image
        .ancestors()
        .nth(3)
        .expect("TARGET/thumb…/firmware/bead-firmware");
    let mut cargo = Command::new(env::var_os("CARGO").expect("cargo sets it"));
    cargo.current_dir(root).stdin(Stdio::null());
    cargo.args([
        "build",
        "--profile",
        "firmware",
        "--target",
        TARGET,
        "-p",
        "bead-firmware",
    ]);
    cargo.arg("--target-dir").arg(folder);
    for (name, _) in env::vars_os() {
        if OF_THIS_BUILD
            .iter()
            .any(|start| name.to_string_lossy().starts_with(start))
        {
            cargo.env_remove(&name);
        }
    }
    let why = match cargo.output() {
        Ok(output) if output.status.success() => return,
        Ok(output) => {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            let error = said.lines().find(|line| line.starts_with("error"));
            error.unwrap_or("it does not say why").to_owned()
        }
        Err(error) => error.to_string(),
    };
    println!("cargo::warning=building the flash image: {why}");
}
