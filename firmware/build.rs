//! Hands the linker its scripts and the image its git version.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// The sources of the image, from the workspace's root: a change in any of these makes a build "dirty".
const SOURCES: [&str; 6] = [
    "Cargo.lock",
    "Cargo.toml",
    "firmware",
    "memory.x",
    "rust-toolchain.toml",
    ".cargo",
];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the firmware lies inside the workspace");

    for source in SOURCES {
        println!("cargo::rerun-if-changed={}", root.join(source).display());
    }

    link(root, &out);
    println!("cargo::rustc-env=BEAD_GIT={}", git_version(root));
}

fn link(root: &Path, out: &Path) {
    fs::copy(root.join("memory.x"), out.join("memory.x")).expect("memory.x is at the workspace's root");
    println!("cargo::rustc-link-search={}", out.display());
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumb")) {
        for script in ["link.x", "defmt.x"] {
            println!("cargo::rustc-link-arg-bins=-T{script}");
        }
    }
}

/// The commit that the image is built from, with `-dirty` if any of its sources differs; "unknown" without
/// git.
fn git_version(root: &Path) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .arg("-C")
            .arg(root)
            // Otherwise `status` would rewrite the index, and so hold a lock that others need.
            .arg("--no-optional-locks")
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    // Every commit and checkout writes the log of HEAD. A path that does not exist would cause a rebuild each
    // time.
    for path in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", path]).map(|path| root.join(path));
        if let Some(path) = path.filter(|path| path.exists()) {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
    let Some(commit) = git(&["rev-parse", "--short=12", "HEAD"]) else {
        return "unknown".to_owned();
    };
    let mut status = vec!["status", "--porcelain", "--"];
    status.extend(SOURCES);
    match git(&status) {
        Some(changes) if changes.is_empty() => commit,
        _ => format!("{commit}-dirty"),
    }
}
