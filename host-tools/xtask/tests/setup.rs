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
struct FakeMachine {
    bin: tempfile::TempDir,
}

const RUSTC: &str =
    r#"case "$1" in --version) echo "rustc 1.95.0 (0123 2026-04-01)" ;; *) echo "$HERE/thumb" ;; esac"#;
const LOG: &str = r#"echo "${0##*/} $*" >> "$HERE/log""#;

impl FakeMachine {
    /// One that has all but QEMU.
    fn new() -> Self {
        let machine = FakeMachine {
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

    /// An apt whose `install` brings QEMU 7.2, and whose simulation prints what `simulation` prints besides.
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

    /// Runs `xtask setup`, which must end with this status after these commands of the package manager and of
    /// rustup; returns what it said.
    fn setup(&self, status: i32, commands: &[&str]) -> String {
        let mut xtask = Command::new(env!("CARGO_BIN_EXE_xtask"));
        let xtask = xtask.arg("setup").env("PATH", self.bin.path()).output().unwrap();
        let said = String::from_utf8(xtask.stderr).unwrap();
        let log = fs::read_to_string(self.path("log")).unwrap_or_default();
        let _ = fs::remove_file(self.path("log"));
        assert_eq!(xtask.status.code(), Some(status), "{said}");
        assert_eq!(log.lines().collect::<Vec<_>>(), commands, "{said}");
        said
    }
}

const UPDATE: &str = "apt-get update -q";
const SIMULATE: &str = "apt-get install -s --no-install-recommends qemu-system-arm";
const INSTALL: &str = "apt-get install -q -y --no-remove --no-install-recommends qemu-system-arm";

#[test]
fn root_with_apt_gets_qemu_once_and_the_second_run_changes_nothing() {
    let machine = FakeMachine::new();
    machine.apt_with(r#"echo "Inst libc6 [2.36-9] (2.36-9+deb12u10 Debian:12.15/oldstable [amd64])""#);
    machine.user("0");
    let said = machine.setup(0, &[UPDATE, SIMULATE, INSTALL]);
    let (plan, install) = (
        said.find("apt installs qemu-system-arm\n"),
        said.find("apt-get install -q"),
    );
    assert!(plan.is_some() && plan < install, "{said}");
    assert!(said.contains("apt upgrades libc6 for it"), "{said}");
    assert_eq!(machine.setup(0, &[]).lines().count(), 1);
}

#[test]
fn a_user_with_sudo_that_asks_nothing_gets_qemu() {
    let machine = FakeMachine::new();
    machine.apt_with("");
    machine.program("sudo", "shift; exec \"$@\"");
    machine.program("true", "");
    let said = machine.setup(0, &[UPDATE, SIMULATE, INSTALL]);
    assert!(
        said.contains("$ sudo -n env DEBIAN_FRONTEND=noninteractive apt-get install"),
        "{said}"
    );
}

#[test]
fn a_user_who_may_not_install_reads_the_command_of_this_system() {
    for (manager, command) in [
        ("apt-get", "sudo apt-get install -y"),
        ("dnf", "sudo dnf install"),
        ("pacman", "sudo pacman -S"),
    ] {
        let machine = FakeMachine::new();
        machine.program(manager, LOG);
        machine.program("sudo", "exit 1");
        let said = machine.setup(3, &[]);
        // The apt advice refreshes the index first, so the command need not begin the line.
        assert!(said.contains(command), "{manager}: {said}");
    }
}

/// QEMU comes from the release whose plan removes no package; if each would remove one, nothing is installed.
#[test]
fn no_package_is_removed_for_qemu() {
    const BACKPORTS: &str = "-t bookworm-backports --no-install-recommends qemu-system-arm";
    let simulate = SIMULATE.replace("--no-install", "-t bookworm --no-install");
    for (removes_none, status) in [("bookworm-backports", 0), ("no such release", 3)] {
        let machine = FakeMachine::new();
        machine.apt_with(&format!(
            r#"case "$*" in *"-t {removes_none} "*) ;; *) echo "Remv qemu-utils [1:10.0.2]" ;; esac"#
        ));
        machine.program(
            "apt-cache",
            r#"echo "qemu-system-arm | 1:7.2 | http://deb.debian.org/debian bookworm/main amd64 Packages"
echo "qemu-system-arm | 1:10.0.2 | http://deb.debian.org/debian bookworm-backports/main amd64 Packages""#,
        );
        machine.user("0");
        let (last, install) = (
            format!("apt-get install -s {BACKPORTS}"),
            format!("apt-get install -q -y --no-remove {BACKPORTS}"),
        );
        let mut commands = vec![UPDATE, SIMULATE, &simulate, &last];
        commands.extend((status == 0).then_some(install.as_str()));
        let said = machine.setup(status, &commands);
        let refusal = "sudo apt-get install --no-install-recommends qemu-system-arm";
        let refused = said
            .lines()
            .any(|line| line.contains("would remove qemu-utils") && line.ends_with(refusal));
        assert_eq!(refused, status == 3, "{said}");
    }
}

#[test]
fn an_install_that_fails_names_the_command_to_repeat() {
    for (failing, commands) in [
        ("-s", &[UPDATE, SIMULATE][..]),
        ("-q", &[UPDATE, SIMULATE, INSTALL]),
    ] {
        let machine = FakeMachine::new();
        machine.user("0");
        machine.program(
            "apt-get",
            &format!("{LOG}\ncase \"$1 $2\" in \"install {failing}\") exit 100 ;; esac"),
        );
        let said = machine.setup(3, commands);
        assert!(said.contains("To repeat only this step"), "{said}");
    }
}

#[test]
fn a_missing_rust_target_is_added_by_rustup_or_named() {
    const ADD: &str = "rustup target add thumbv7em-none-eabihf";
    let machine = FakeMachine::new();
    machine.qemu("10.0.2");
    fs::remove_dir(machine.path("thumb")).unwrap();
    assert!(machine.setup(3, &[]).contains(ADD));
    machine.program("rustup", &format!("{LOG}\n/bin/mkdir \"$HERE/thumb\""));
    machine.setup(0, &[ADD]);
}

#[test]
fn a_qemu_older_than_the_plugin_interface_is_refused() {
    let machine = FakeMachine::new();
    machine.qemu("6.2.0");
    let said = machine.setup(3, &[]);
    assert!(said.contains("QEMU 6.2 is too old: 7.2 or later"), "{said}");
}
