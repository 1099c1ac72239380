//! `cargo xtask setup` on machines that lack something, played by scripts in a PATH of their own.
#![cfg(unix)]
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot prepare its machine has failed"
)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::Command;

/// A machine whose PATH holds only what a test puts there.
struct Machine {
    bin: tempfile::TempDir,
}

/// Outcome of a run of `xtask setup`.
struct Outcome {
    status: Option<i32>,
    said: String,
    /// The package manager's and rustup's command lines, in order.
    ran: Vec<String>,
}

const RUSTC: &str =
    r#"case "$1" in --version) echo "rustc 1.95.0 (0123 2026-04-01)" ;; *) echo "$HERE/thumb" ;; esac"#;
const LOG: &str = r#"echo "${0##*/} $*" >> "$HERE/log""#;

impl Machine {
    /// One that has all but QEMU.
    fn new() -> Self {
        let machine = Machine {
            bin: tempfile::tempdir().unwrap(),
        };
        fs::create_dir(machine.path("thumb")).unwrap();
        machine.program("rustc", RUSTC);
        machine.program("cargo", "echo 1.95.0");
        machine.program("cc", "true");
        machine.user("1000");
        machine.program("env", "shift; exec \"$@\"");
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.bin.path().join(name)
    }

    fn program(&self, name: &str, script: &str) {
        let path = self.path(name);
        fs::write(
            &path,
            format!("#!/bin/sh\nHERE={}\n{script}\n", self.bin.path().display()),
        )
        .unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn user(&self, id: &str) {
        self.program("id", &format!("echo {id}"));
    }

    fn qemu(&self, version: &str) {
        self.program(
            "qemu-system-arm",
            &format!("echo QEMU emulator version {version}"),
        );
    }

    /// An apt whose `install` brings QEMU 7.2.
    fn apt(&self) {
        self.apt_with("");
    }

    /// An apt whose simulation also prints `Remv qemu-utils`, unless it is asked for this release.
    fn apt_that_removes_unless(&self, release: &str) {
        self.apt_with(&format!(
            r#"case "$*" in *"-t {release} "*) ;; *) echo "Remv qemu-utils [1:10.0.2]" ;; esac"#
        ));
    }

    fn apt_with(&self, simulation: &str) {
        self.qemu("7.2.22");
        fs::rename(self.path("qemu-system-arm"), self.path("package")).unwrap();
        self.program(
            "apt-get",
            &format!(
                r#"{LOG}
case "$*" in
    "install -s "*) {simulation}
        echo "Inst qemu-system-arm (1:7.2 Debian:12/oldstable [amd64])" ;;
    install*) /bin/mv "$HERE/package" "$HERE/qemu-system-arm" ;;
esac"#
            ),
        );
    }

    fn setup(&self) -> Outcome {
        let xtask = Command::new(env!("CARGO_BIN_EXE_xtask"))
            .arg("setup")
            .env("PATH", self.bin.path())
            .output()
            .unwrap();
        let log = fs::read_to_string(self.path("log")).unwrap_or_default();
        let _ = fs::remove_file(self.path("log"));
        Outcome {
            status: xtask.status.code(),
            said: String::from_utf8(xtask.stderr).unwrap(),
            ran: log.lines().map(str::to_owned).collect(),
        }
    }
}

const UPDATE: &str = "apt-get update -q";
const SIMULATE: &str = "apt-get install -s --no-install-recommends qemu-system-arm";
const INSTALL: &str = "apt-get install -q -y --no-remove --no-install-recommends qemu-system-arm";

#[test]
fn root_with_apt_gets_qemu_once_and_the_second_run_changes_nothing() {
    let machine = Machine::new();
    machine.apt();
    machine.user("0");
    let first = machine.setup();
    assert_eq!(
        (first.status, first.ran),
        (Some(0), vec![UPDATE.into(), SIMULATE.into(), INSTALL.into()]),
        "{}",
        first.said
    );
    assert!(
        first.said.find("apt installs qemu-system-arm").unwrap()
            < first.said.find("apt-get install -q").unwrap()
    );
    let second = machine.setup();
    assert_eq!(
        (second.status, second.ran.len(), second.said.lines().count()),
        (Some(0), 0, 1),
        "{}",
        second.said
    );
}

#[test]
fn a_user_with_sudo_that_asks_nothing_gets_qemu() {
    let machine = Machine::new();
    machine.apt();
    machine.program("sudo", "shift; exec \"$@\"");
    machine.program("true", "");
    let run = machine.setup();
    assert_eq!(
        (run.status, run.ran),
        (Some(0), vec![UPDATE.into(), SIMULATE.into(), INSTALL.into()]),
        "{}",
        run.said
    );
    assert!(
        run.said
            .contains("$ sudo -n env DEBIAN_FRONTEND=noninteractive apt-get install"),
        "{}",
        run.said
    );
}

#[test]
fn a_user_who_may_not_install_is_told_the_command_of_this_system() {
    let commands = [
        ("apt-get", "sudo apt-get install -y"),
        ("dnf", "sudo dnf install"),
        ("pacman", "sudo pacman -S"),
    ];
    for (manager, command) in commands {
        let machine = Machine::new();
        machine.program(manager, LOG);
        machine.program("sudo", "exit 1");
        let run = machine.setup();
        assert_eq!(
            (run.status, run.ran.len()),
            (Some(3), 0),
            "{manager}: {}",
            run.said
        );
        // The apt advice refreshes the index first, so the command need not begin the line.
        assert!(run.said.contains(command), "{manager}: {}", run.said);
    }
}

/// An `apt-cache` that offers QEMU in two releases.
const OFFERS: &str = r#"echo "qemu-system-arm | 1:7.2 | http://deb.debian.org/debian bookworm/main amd64 Packages"
echo "qemu-system-arm | 1:10.0.2 | http://deb.debian.org/debian bookworm-backports/main amd64 Packages""#;

#[test]
fn where_apt_would_remove_a_package_qemu_comes_from_the_release_that_removes_none() {
    let machine = Machine::new();
    machine.apt_that_removes_unless("bookworm-backports");
    machine.program("apt-cache", OFFERS);
    machine.user("0");
    let run = machine.setup();
    let install =
        "apt-get install -q -y --no-remove -t bookworm-backports --no-install-recommends qemu-system-arm";
    assert_eq!(run.status, Some(0), "{}", run.said);
    assert_eq!(run.ran.last().map(String::as_str), Some(install), "{}", run.said);
}

#[test]
fn a_package_that_every_release_would_remove_is_named_and_nothing_is_installed() {
    let machine = Machine::new();
    machine.apt_that_removes_unless("no such release");
    machine.program("apt-cache", OFFERS);
    machine.user("0");
    let run = machine.setup();
    assert_eq!(run.status, Some(3), "{}", run.said);
    let only_simulated = |line: &String| line == UPDATE || line.starts_with("apt-get install -s ");
    assert!(run.ran.iter().all(only_simulated), "{:?}", run.ran);
    assert!(
        run.said
            .lines()
            .any(|line| line.contains("would remove qemu-utils")
                && line.ends_with("sudo apt-get install --no-install-recommends qemu-system-arm")),
        "{}",
        run.said
    );
}

#[test]
fn an_install_that_fails_names_the_command_to_repeat() {
    for (failing, ran) in [
        ("-s", vec![UPDATE, SIMULATE]),
        ("-q", vec![UPDATE, SIMULATE, INSTALL]),
    ] {
        let machine = Machine::new();
        machine.user("0");
        machine.program(
            "apt-get",
            &format!("{LOG}\ncase \"$1 $2\" in \"install {failing}\") exit 100 ;; esac"),
        );
        let run = machine.setup();
        assert_eq!(
            (run.status, run.ran),
            (Some(3), ran.into_iter().map(str::to_owned).collect()),
            "{}",
            run.said
        );
        assert!(run.said.contains("To repeat this step alone"), "{}", run.said);
    }
}

#[test]
fn a_missing_rust_target_is_added_by_rustup() {
    let machine = Machine::new();
    machine.qemu("10.0.2");
    fs::remove_dir(machine.path("thumb")).unwrap();
    machine.program("rustup", &format!("{LOG}\n/bin/mkdir \"$HERE/thumb\""));
    let run = machine.setup();
    assert_eq!(
        (run.status, run.ran),
        (Some(0), vec!["rustup target add thumbv7em-none-eabihf".into()]),
        "{}",
        run.said
    );
}

#[test]
fn a_rust_without_rustup_is_told_what_it_lacks() {
    let machine = Machine::new();
    machine.qemu("10.0.2");
    fs::remove_dir(machine.path("thumb")).unwrap();
    let run = machine.setup();
    assert_eq!(run.status, Some(3));
    assert!(
        run.said.contains("rustup target add thumbv7em-none-eabihf"),
        "{}",
        run.said
    );
}

#[test]
fn a_qemu_older_than_the_plugin_interface_is_refused() {
    let machine = Machine::new();
    machine.qemu("6.2.0");
    let run = machine.setup();
    assert_eq!(run.status, Some(3));
    assert!(
        run.said.contains("QEMU 6.2 is too old: 7.2 or later"),
        "{}",
        run.said
    );
}
