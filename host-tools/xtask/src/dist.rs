//! The archive that a release carries: `bead` with all that it needs inside, completions, manual pages,
//! scenarios, and the images for all boards.

use std::fs;
use std::path::Path;

use crate::files::{self, below, cannot, write};
use crate::setup::find;
use crate::step::{CommandLine, Steps, Stop};
use crate::{board_table, boards, supply};

/// Files beside the program and the pages.
const BESIDE: [&str; 4] = ["LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.md", "CHANGELOG.md"];

const README: &str = "\
# bead

The host tools of the sensing absorber bead. [docs/first-strike.md](docs/first-strike.md) leads from here to your
own strike in pandas in ten minutes. All that you need is QEMU (`qemu-system-arm`).

| | |
|---|---|
| `bead` | the program; put it into a folder of your PATH |
| `bead-figures` | what `bead figures` runs; put it next to `bead` |
| `docs/` | the book, and scenarios to start from |
| `completions/` | for bash, zsh (`_bead`) and fish |
| `man/` | manual pages: `man -M man bead` |
| `firmware/` | the image for each board, which `bead flash --board NAME` finds there, and their SHA-256: docs/how-to.md |
| `THIRD-PARTY.md`, `notices/` | third-party packages in the programs and the image: licences, their texts, bills of materials (CycloneDX) |
";

/// The programs, and where each is built from.
const PROGRAMS: [(&str, &str); 2] = [
    ("bead", "host-tools/bead"),
    ("bead-figures", "host-tools/hertz/figures-command"),
];

/// Greatest size of a program, bytes.
const MOST: u64 = 40 << 20;

/// Installs `bead` as its users do, packs it, and tries the archive where there is no Rust. The images are
/// built.
///
/// # Errors
/// It cannot be built or packed, is too large, or does not work from an empty folder.
pub(crate) fn make(steps: &Steps, image: &Path) -> Result<(), Stop> {
    let host = steps.read("this computer", &CommandLine::new("rustc --print host-tuple"))?;
    let name = format!("bead-{}-{}", env!("CARGO_PKG_VERSION"), host.trim());
    let root = steps.target.join("dist");
    let (installed, packed) = (root.join("install"), root.join(&name));
    let _ = fs::remove_dir_all(&root);
    for (program, path) in PROGRAMS {
        let install = CommandLine::new("cargo install --locked --force --path");
        let install = install
            .arg(path)
            .words("--bin")
            .arg(program)
            .words("--root")
            .arg(&installed);
        steps.run(&format!("{program}, as its users install it"), &install)?;
    }

    let program = packed.join("bead");
    let copy = |from: &Path, to: &str| files::copy(from, &packed.join(to));
    for (program, _) in PROGRAMS {
        copy(&installed.join("bin").join(program), program)?;
        // A quarter of the program is names of functions.
        let strip = CommandLine::new("strip").arg(packed.join(program));
        steps.run(&format!("{program} without symbols"), &strip)?;
        let size = fs::metadata(packed.join(program)).map_or(0, |file| file.len());
        if size > MOST {
            return Err(Stop::failed(format!(
                "{program} has {size} bytes, but at most {MOST} are allowed"
            )));
        }
    }
    let mut boards = board_table::names(steps)?;
    copy(
        &steps.root.join(image),
        &format!("firmware/{}.elf", boards.remove(0)),
    )?;
    for board in &boards {
        copy(&boards::path(steps, board), &format!("firmware/{board}.elf"))?;
    }
    let sums = CommandLine::new("sh -c")
        .arg("sha256sum *.elf")
        .within(packed.join("firmware"));
    let sums = steps.read("the SHA-256 of each image", &sums)?;
    write(&packed.join("firmware/SHA256SUMS"), sums)?;
    let docs = steps.root.join("docs");
    let pages = below(&docs, &|_| true)?;
    let beside = BESIDE.iter().map(|name| steps.root.join(name));
    for from in beside.chain(pages) {
        let to = from.strip_prefix(&steps.root).unwrap_or(&from);
        copy(&from, &to.display().to_string())?;
    }
    write(&packed.join("README.md"), README)?;
    for (shell, file) in [("bash", "bead"), ("zsh", "_bead"), ("fish", "bead.fish")] {
        let script = CommandLine::program(&program).words("completions").arg(shell);
        let script = steps.read(&format!("completions for {shell}"), &script)?;
        write(&packed.join("completions").join(file), script)?;
    }
    steps.run(
        "manual pages",
        &CommandLine::program(&program)
            .words("man")
            .arg(packed.join("man/man1")),
    )?;
    supply::release(steps, &packed.join("notices"))?;
    let file = format!("{name}.tar.gz");
    let archive = root.join(&file);
    let pack = CommandLine::new("tar --sort=name --owner=0 --group=0 --numeric-owner -czf")
        .arg(&archive)
        .arg("-C");
    steps.run("the archive", &pack.arg(&root).arg(&name))?;
    // As `sha256sum --check` reads it, beside the archive.
    let sum = CommandLine::new("sha256sum").arg(&file).within(&root);
    let sum = steps.read("the SHA-256 of the archive", &sum)?;
    write(&root.join(format!("{file}.sha256")), sum)?;

    try_out(steps, &archive, &name)?;
    let bytes = |path: &Path| fs::metadata(path).map_or(0.0, |found| found.len() as f64 / 1e6);
    steps.announce(&format!(
        "done. {} has {:.1} MB; bead has {:.1} MB",
        archive.display(),
        bytes(&archive),
        bytes(&program)
    ));
    Ok(())
}

/// Unpacks the archive into an empty folder and follows its page, with nothing in PATH but QEMU.
fn try_out(steps: &Steps, archive: &Path, name: &str) -> Result<(), Stop> {
    let folder = std::env::temp_dir().join(format!("bead-dist-{}", std::process::id()));
    let tried = unpack(steps, archive, &folder).and_then(|()| {
        // Written as a user types it, in the folder of the archive.
        let home = folder.join(name);
        for words in [
            "emulate docs/scenarios/paper-strike.toml --bead 8 --out run",
            "replay run/bead-8.mcap",
            "compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml --report report.html",
            "export run/bead-8.mcap --out tables",
            "figures 2a --check",
            "flash --probe --dry-run --board pyboard-1.1",
        ] {
            let line = CommandLine::new("env -i -C")
                .arg(&home)
                .arg(format!("PATH={}", folder.join("path").display()))
                .arg("./bead")
                .words(words);
            steps.read("from an empty folder, without Rust", &line)?;
        }
        if home.join("tables/samples.parquet").is_file() {
            return Ok(());
        }
        Err(Stop::failed("bead wrote no table"))
    });
    let _ = fs::remove_dir_all(&folder);
    tried
}

/// The archive, and a folder `path` with QEMU alone.
fn unpack(steps: &Steps, archive: &Path, folder: &Path) -> Result<(), Stop> {
    let path = folder.join("path");
    files::make(&path)?;
    let qemu = find("qemu-system-arm").ok_or_else(|| Stop::missing("no qemu-system-arm in PATH"))?;
    std::os::unix::fs::symlink(qemu, path.join("qemu-system-arm")).map_err(cannot("make", &path))?;
    let unpack = CommandLine::new("tar -xzf").arg(archive).arg("-C").arg(folder);
    steps.run("unpacked", &unpack)
}
