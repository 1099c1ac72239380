//! Set-up: finds the programs that the workspace needs, and installs those that are missing.
//!
//! # Design
//! xtask asks each program for itself (`rustc --print`, `qemu-system-arm --version`) and does not remember
//! what it installed. A second run finds everything in place, changes nothing and says so in one line. It
//! never removes a package: the plan of apt is simulated, shown, and carried out with `--no-remove`.

use std::path::PathBuf;

use crate::step::{CommandLine, Steps, Stop};

/// The target of the STM32F405's Cortex-M4F.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// The oldest QEMU whose plugin interface the emulator knows.
const QEMU_OLDEST: Version = Version(7, 2);

/// Needs of a command beyond the target and QEMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Need {
    /// To build and to run.
    Run,
    /// To check as well: rustfmt and clippy.
    Check,
}

/// Looks for what `need` asks for and installs what is missing.
///
/// # Errors
/// Status 3 with the one command to type, where this machine does not let xtask install it.
pub(crate) fn setup(steps: &Steps, need: Need) -> Result<(), Stop> {
    let rust = rust(steps, need)?;
    if find("cc").is_none() && find("clang").is_none() {
        return Err(Stop::missing(
            "no C compiler: Rust links with `cc`. Install gcc or clang (Debian, Ubuntu: apt-get install -y gcc libc6-dev)",
        ));
    }
    let qemu = qemu(steps)?;
    let found = format!("{rust} with {TARGET}, QEMU {qemu}, a C compiler");
    steps.announce(&format!("set-up: {found}: all in place"));
    Ok(())
}

/// The Rust toolchain that `rust-toolchain.toml` names, with the bead's target.
fn rust(steps: &Steps, need: Need) -> Result<String, Stop> {
    let version = output("rustc --version")
        .ok_or_else(|| Stop::missing("`rustc` does not run. Install Rust by rustup: https://rustup.rs"))?;
    if !target_installed() {
        steps.announce(&format!(
            "set-up: Rust's {TARGET} is missing: rustup installs it, some 20 MB"
        ));
        rustup(steps, &format!("rustup target add {TARGET}"))?;
        if !target_installed() {
            return Err(Stop::missing(format!(
                "rustup ran, but {version} still has no {TARGET}: is another rustc first in PATH?"
            )));
        }
    }
    if need == Need::Check {
        for (component, command) in [("rustfmt", "fmt"), ("clippy", "clippy")] {
            if output(&format!("cargo {command} --version")).is_none() {
                steps.announce(&format!("set-up: {component} is missing: rustup installs it"));
                rustup(steps, &format!("rustup component add {component}"))?;
            }
        }
    }
    Ok(version.split_whitespace().take(2).collect::<Vec<_>>().join(" "))
}

fn target_installed() -> bool {
    output(&format!("rustc --print target-libdir --target {TARGET}"))
        .is_some_and(|path| PathBuf::from(path).is_dir())
}

fn rustup(steps: &Steps, line: &str) -> Result<(), Stop> {
    if find("rustup").is_none() {
        return Err(Stop::missing(format!(
            "this Rust was not installed by rustup, so add what is missing by its package manager, \
             or install rustup from https://rustup.rs and run `{line}`"
        )));
    }
    steps
        .run("set-up: rustup", &CommandLine::new(line))
        .map_err(|stop| Stop::missing(stop.message))
}

/// The version of `qemu-system-arm`, installed if it was missing.
fn qemu(steps: &Steps) -> Result<Version, Stop> {
    if find("qemu-system-arm").is_none() {
        install_qemu(steps)?;
    }
    let said = output("qemu-system-arm --version").ok_or_else(|| {
        Stop::missing("`qemu-system-arm --version` fails: run it by hand to see why, or reinstall QEMU")
    })?;
    let unread = || format!("`qemu-system-arm --version` prints no version that xtask can read: {said}");
    let version = Version::parse(&said).ok_or_else(|| Stop::missing(unread()))?;
    if version < QEMU_OLDEST {
        return Err(Stop::missing(format!(
            "QEMU {version} is too old: {QEMU_OLDEST} or later is needed (Debian 12, Ubuntu 24.04, Fedora 38 or later have it)"
        )));
    }
    Ok(version)
}

fn install_qemu(steps: &Steps) -> Result<(), Stop> {
    let apt = find("apt-get").is_some();
    let root = output("id -u").is_some_and(|id| id == "0");
    let become_root = match (root, apt) {
        (true, true) => "",
        (false, true) if output("sudo -n true").is_some() => "sudo -n ",
        _ => {
            let what = format!("QEMU's qemu-system-arm is missing. {}", advice());
            return Err(Stop::missing(what));
        }
    };
    // An index that cannot be refreshed (one dead source among many) may still hold QEMU: the plan decides.
    let update = CommandLine::new(&format!("{become_root}apt-get update -q"));
    if let Err(stop) = steps.run("set-up: package index", &update) {
        eprintln!("{}", stop.message);
    }
    let (plan, release) = plan(steps)?;
    steps.announce(&format!(
        "set-up: QEMU's qemu-system-arm is missing: apt installs {}",
        plan.installed.join(", ")
    ));
    if !plan.upgraded.is_empty() {
        steps.announce(&format!(
            "set-up: apt upgrades {} for it",
            plan.upgraded.join(", ")
        ));
    }
    let install = format!(
        "{become_root}env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-remove {release}{PACKAGE}"
    );
    steps
        .run("set-up: QEMU", &CommandLine::new(&install))
        .map_err(|stop| Stop::missing(stop.message))?;
    let missing = || Stop::missing("apt installed QEMU, but there is still no qemu-system-arm in PATH");
    find("qemu-system-arm").map(drop).ok_or_else(missing)
}

/// QEMU as apt-get is asked for it.
const PACKAGE: &str = "--no-install-recommends qemu-system-arm";

/// Package names of a simulated installation, by what apt would do with them.
#[derive(Default)]
struct AptPlan {
    installed: Vec<String>,
    upgraded: Vec<String>,
    removed: Vec<String>,
}

impl AptPlan {
    /// Reads the output of `apt-get -s install`: `Inst name (version …)` for a new package, `Inst name [old]
    /// (version …)` for an upgraded one, `Remv name [old]` for a removed one.
    fn parse(simulation: &str) -> Self {
        let mut plan = AptPlan::default();
        for line in simulation.lines() {
            let mut words = line.split_whitespace();
            let (Some(action), Some(name)) = (words.next(), words.next()) else {
                continue;
            };
            let old = words.next().is_some_and(|word| word.starts_with('['));
            match action {
                "Inst" if old => plan.upgraded.push(name.to_owned()),
                "Inst" => plan.installed.push(name.to_owned()),
                "Remv" => plan.removed.push(name.to_owned()),
                _ => {}
            }
        }
        plan
    }
}

/// The first plan that removes nothing, and the option that asks apt for it: apt's own choice of a release,
/// or else one of the releases that offer QEMU. Installed packages may be of backports, where QEMU has to
/// come from too.
///
/// # Errors
/// Status 3: apt knows no such package, or would remove another one in every release.
fn plan(steps: &Steps) -> Result<(AptPlan, String), Stop> {
    let simulate = |option: &str| CommandLine::new(&format!("apt-get install -s {option}{PACKAGE}"));
    let first = steps
        .read("set-up: the packages that apt would install", &simulate(""))
        .map_err(|stop| Stop::missing(stop.message))?;
    let first = AptPlan::parse(&first);
    if first.removed.is_empty() {
        return Ok((first, String::new()));
    }
    let offers = output("apt-cache madison qemu-system-arm").unwrap_or_default();
    // " qemu-system-arm | 1:10.0.2 | http://deb.debian.org/debian bookworm-backports/main amd64 Packages"
    let release = |offer: &'_ str| {
        let place = offer.rsplit('|').next()?.split_whitespace().nth(1)?;
        Some(place.split('/').next()?.to_owned())
    };
    for release in offers.lines().filter_map(release) {
        let option = format!("-t {release} ");
        let simulation = output(&simulate(&option).to_string()).map(|said| AptPlan::parse(&said));
        if let Some(plan) = simulation.filter(|plan| plan.removed.is_empty()) {
            return Ok((plan, option));
        }
    }
    let removed = first.removed.join(", ");
    Err(Stop::missing(format!(
        "apt would remove {removed} to install QEMU's qemu-system-arm, so nothing was installed. \
         If you can do without {removed}, run: sudo apt-get install {PACKAGE}"
    )))
}

/// The one command that installs QEMU here.
fn advice() -> String {
    if cfg!(target_os = "macos") {
        return "Homebrew's build does not export the symbols that the peripheral overlay binds to: \
                run this in a Linux container or virtual machine (Debian 12 or Ubuntu 24.04 will do)"
            .into();
    }
    let managers = [
        (
            "apt-get",
            "sudo apt-get update && sudo apt-get install -y --no-remove --no-install-recommends qemu-system-arm",
        ),
        ("dnf", "sudo dnf install -y qemu-system-arm"),
        ("pacman", "sudo pacman -S --needed qemu-system-arm"),
        ("zypper", "sudo zypper install -y qemu-arm"),
        ("apk", "sudo apk add qemu-system-arm"),
    ];
    match managers.iter().find(|(program, _)| find(program).is_some()) {
        Some((_, command)) => format!("Install it, then run this again:\n    {command}"),
        None => format!(
            "Install QEMU {QEMU_OLDEST} or later from your distribution's packages (not a static build), then run this again"
        ),
    }
}

/// Path of `program`, found as a shell would find it.
pub(crate) fn find(program: &str) -> Option<PathBuf> {
    std::env::split_paths(&std::env::var_os("PATH")?)
        .map(|dir| dir.join(program))
        .find(|path| path.is_file())
}

/// Output of a command, trimmed; `None` if it fails.
pub(crate) fn output(line: &str) -> Option<String> {
    let out = CommandLine::new(line).command().output().ok()?;
    let said = String::from_utf8_lossy(&out.stdout);
    out.status.success().then(|| said.trim().to_owned())
}

/// Major and minor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Version(u32, u32);

impl Version {
    /// From "QEMU emulator version 7.2.22 (Debian …)".
    fn parse(said: &str) -> Option<Self> {
        let number = said.split_once("version ")?.1;
        let mut parts = number.split(|c: char| !c.is_ascii_digit());
        Some(Version(parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}", self.0, self.1)
    }
}
