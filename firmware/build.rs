//! Hands the linker its scripts, and the image its loader, its git version and the pins of its board.
//!
//! # Design
//! A probe flashes one file, and CI runs the same one: the image contains the loader, as bytes in a section.
//! The loader is a separate program, which a second cargo builds here in another target directory, since the
//! outer one is locked.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

use bead_update::manifest::DEVELOPMENT_KEY;
use object::{Object as _, ObjectSegment as _};

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
    load(root, &out);
    take_key(&out);
    let board = wire(root, &out);
    let git = git_version(root);
    println!("cargo::rustc-env=BEAD_GIT={git}");
    // For src/image_name.rs. `bead flash` knows mark and end.
    let version = env::var("CARGO_PKG_VERSION").expect("cargo sets it");
    println!("cargo::rustc-env=BEAD_IMAGE_NAME=bead-image:{version} {git} {board};");
}

fn link(root: &Path, out: &Path) {
    fs::copy(root.join("memory.x"), out.join("memory.x")).expect("it lies in the workspace's root");
    println!("cargo::rustc-link-search={}", out.display());
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumb")) {
        for script in ["link.x", "defmt.x"] {
            println!("cargo::rustc-link-arg-bins=-T{script}");
        }
    }
}

/// Variables of this build that must not reach the loader's.
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

/// Builds the loader, and writes its flash contents as `loader.bin`; an empty file on a host, where no image
/// is linked.
fn load(root: &Path, out: &Path) {
    let binary = out.join("loader.bin");
    let target = env::var("TARGET").expect("cargo sets it");
    if !target.starts_with("thumb") {
        fs::write(binary, []).expect("cargo made OUT_DIR");
        return;
    }
    let mut cargo = Command::new(env::var_os("CARGO").expect("cargo sets it"));
    cargo.current_dir(root).stdin(Stdio::null());
    let folder = out.join("loader");
    cargo.args("build -p bead-loader --profile firmware --target".split(' '));
    cargo.args([target.as_ref(), OsStr::new("--target-dir"), folder.as_ref()]);
    for (name, _) in env::vars_os() {
        let name = name.to_string_lossy().into_owned();
        if OF_THIS_BUILD.iter().any(|start| name.starts_with(start)) {
            cargo.env_remove(name);
        }
    }
    let built = cargo.output().expect("cargo runs");
    let said = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "the loader does not build:\n{said}");

    let elf = fs::read(folder.join(&target).join("firmware/bead-loader")).expect("it was built");
    let elf = object::File::parse(&*elf).expect("the linker made an ELF file");
    // Vectors, code and constants, one after another. The loader has no initialised variables.
    let mut bytes = Vec::new();
    let start = elf.segments().map(|segment| segment.address()).min();
    assert_eq!(start, Some(0x0800_0000), "the part starts there");
    for segment in elf.segments() {
        let data = segment.data().expect("the file is whole");
        if !data.is_empty() {
            bytes.resize((segment.address() - start.expect("it has one")) as usize, 0xFF);
            bytes.extend(data);
        }
    }
    assert!(bytes.len() <= 32 * 1024, "the loader has two sectors");
    fs::write(binary, bytes).expect("cargo made OUT_DIR");
}

/// Writes the row of the board that the image is built for, as code that `src/wiring.rs` includes; returns
/// the board's name.
fn wire(root: &Path, out: &Path) -> String {
    println!("cargo::rerun-if-env-changed=BEAD_BOARD");
    let table = fs::read_to_string(root.join("firmware/boards.txt")).expect("it lies beside this file");
    let rows = table
        .lines()
        .filter(|line| line.contains('|') && !line.starts_with('#'));
    let mut rows = rows.map(|line| line.split('|').map(str::trim).collect::<Vec<_>>());
    let row = match env::var("BEAD_BOARD") {
        Ok(name) => rows.find(|row| row[0] == name),
        Err(_) => rows.next(),
    };
    let Some(&[name, _, port, sync, line, light, ..]) = row.as_deref() else {
        panic!(
            "BEAD_BOARD names no board of firmware/boards.txt that works; `cargo xtask build NAME` says why"
        );
    };
    let pins = |cell: &str| {
        let pins: Vec<_> = cell.split(' ').map(|pin| format!("$p.{pin}")).collect();
        pins.join(", ")
    };
    let (light, lit) = light.split_once(' ').expect("the light has a level");
    let is_high = lit == "high";
    let code = format!(
        "/// Name of the board.\npub(crate) const NAME: &str = {name:?};\n\
         /// The light is lit when its pin is high.\npub(crate) const LIT_HIGH: bool = {is_high};\n\
         /// Port, sync input, trigger line, light.\n\
         macro_rules! pins {{ ($p:ident) => {{ (({}), {}, ({}), {}) }} }}\npub(crate) use pins;\n",
        pins(port),
        pins(sync),
        pins(line),
        pins(light)
    );
    fs::write(out.join("wiring.rs"), code).expect("cargo made OUT_DIR");
    name.to_owned()
}

/// Writes the public key of those who may sign an update: 64 hexadecimal digits in `BEAD_UPDATE_KEY`, or the
/// development key's.
fn take_key(out: &Path) {
    println!("cargo::rerun-if-env-changed=BEAD_UPDATE_KEY");
    let digit = |at: usize, text: &str| u8::from_str_radix(text.get(2 * at..2 * at + 2)?, 16).ok();
    let key = env::var("BEAD_UPDATE_KEY").map_or_else(
        |_| DEVELOPMENT_KEY,
        |text| {
            std::array::from_fn(|at| digit(at, &text).filter(|_| text.len() == 64))
                .map(|byte| byte.expect("BEAD_UPDATE_KEY has the 64 hexadecimal digits of a public key"))
        },
    );
    let code = format!(
        "/// Public key of those who may sign an update.\npub(crate) const KEY: [u8; 32] = {key:?};\n"
    );
    fs::write(out.join("update_key.rs"), code).expect("cargo made OUT_DIR");
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
