//! Follows docs/firmware-in-ci.md word for word, and tests the action for GitHub that it uses.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_yaml_ng::Value;

use super::said;

const RUNNER: &str = env!("CARGO_BIN_EXE_stm32-emu");
const TARGET: &str = "thumbv7em-none-eabihf";

fn root() -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.canonicalize().unwrap()
}

fn page() -> String {
    fs::read_to_string(root().join("docs/firmware-in-ci.md")).unwrap()
}

/// The files of the page, each with its path, and its commands.
fn contents(page: &str) -> (Vec<(&str, String)>, Vec<&str>) {
    let (mut files, mut commands) = (Vec::new(), Vec::new());
    let mut path = None;
    let mut file: Option<String> = None;
    for line in page.lines() {
        match &mut file {
            Some(_) if line == "```" => files.push((path.take().unwrap(), file.take().unwrap())),
            Some(text) => *text += &format!("{line}\n"),
            None if line.starts_with("```") => file = Some(String::new()),
            None => {
                let named = line.strip_prefix('`').and_then(|rest| rest.strip_suffix("`:"));
                path = named.or(path);
                commands.extend(line.strip_prefix("    "));
            }
        }
    }
    (files, commands)
}

fn put(folder: &Path, path: &str, text: &str) {
    let path = folder.join(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

/// A folder with the page's files, and with the runner in `bin`. Packages have the workspace's versions.
fn project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let page = page();
    for (path, text) in contents(&page).0 {
        put(folder.path(), path, &text);
    }
    fs::copy(root().join("Cargo.lock"), folder.path().join("Cargo.lock")).unwrap();
    fs::create_dir(folder.path().join("bin")).unwrap();
    symlink(RUNNER, folder.path().join("bin/stm32-emu")).unwrap();
    folder
}

/// Runs a script as GitHub does, with `bin` first in PATH.
fn bash(folder: &Path, script: &str, variables: &[(String, String)]) -> Output {
    let path = format!("{}/bin:{}", folder.display(), std::env::var("PATH").unwrap());
    let mut bash = Command::new("bash");
    bash.args(["--noprofile", "--norc", "-e", "-o", "pipefail", "-c", script])
        .current_dir(folder)
        .env("PATH", path)
        .env_remove("CARGO_TARGET_DIR")
        .envs(variables.iter().cloned());
    bash.output().unwrap()
}

#[test]
fn a_stranger_gets_from_an_empty_folder_to_an_image_that_is_checked_by_the_page() {
    let page = page();
    let folder = project();
    // The packages are compiled once for all runs of this test.
    let built = root().join("target/firmware-in-ci");
    fs::create_dir_all(&built).unwrap();
    symlink(built, folder.path().join("target")).unwrap();
    let (_, commands) = contents(&page);
    let (install, typed): (Vec<&str>, _) = commands
        .into_iter()
        .partition(|line| line.contains("install") || line.starts_with("rustup"));
    assert_eq!(install.len(), 3);
    assert!(install[2].ends_with(env!("CARGO_PKG_NAME")), "{}", install[2]);
    let outputs: Vec<String> = typed
        .iter()
        .map(|line| {
            let output = bash(folder.path(), line, &[]);
            assert!(output.status.success(), "{line}: {}", said(&output));
            said(&output)
        })
        .collect();
    let expected = [
        "button pressed: false",
        "2 passed; 0 failed",
        "1 passed; 0 failed; 0 ignored; 0 measured; 1 filtered out",
        "button pressed: true",
    ];
    assert_eq!(outputs.len(), expected.len());
    for (output, words) in outputs.iter().zip(expected) {
        assert!(output.contains(words), "{output}");
    }
    let report = fs::read_to_string(folder.path().join("run.xml")).unwrap();
    assert!(report.contains("failures=\"0\""), "{report}");
}

fn action() -> Value {
    let path = root().join(".github/actions/stm32-emu/action.yml");
    serde_yaml_ng::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn keys(mapping: &Value) -> BTreeSet<&str> {
    let keys = mapping.as_mapping().unwrap().keys();
    keys.map(|key| key.as_str().unwrap()).collect()
}

/// Runs the steps of the action in order with these inputs, until one fails.
fn act(folder: &Path, inputs: &[(&str, &str)]) -> Output {
    let action = action();
    let input = |name: &str| {
        let given = inputs.iter().find(|(input, _)| *input == name);
        let default = || action["inputs"][name]["default"].as_str().unwrap();
        given.map_or_else(default, |(_, value)| value).to_owned()
    };
    let mut last = None;
    for step in action["runs"]["steps"].as_sequence().unwrap() {
        assert_eq!(step["shell"], "bash");
        let script = step["run"].as_str().unwrap();
        // Inputs come in variables only: the shell would execute an input in the script itself.
        assert!(!script.contains("${{"), "{script}");
        let mut variables = Vec::new();
        for (name, value) in step["env"].as_mapping().into_iter().flatten() {
            let value = value.as_str().unwrap();
            let of = value
                .strip_prefix("${{ inputs.")
                .and_then(|rest| rest.strip_suffix(" }}"));
            variables.push((name.as_str().unwrap().to_owned(), input(of.unwrap())));
        }
        let within = step["working-directory"].as_str().map(|within| {
            let path = root().join(".github/actions/stm32-emu");
            within.replace("${{ github.action_path }}", path.to_str().unwrap())
        });
        let script = within.map_or_else(|| script.into(), |within| format!("cd {within}\n{script}"));
        let output = bash(folder, &script, &variables);
        let failed = !output.status.success();
        last = Some(output);
        if failed {
            break;
        }
    }
    last.unwrap()
}

#[test]
fn the_action_runs_an_image_as_its_inputs_say_and_fails_as_it_does() {
    let folder = project();
    let image = super::images::image("buttons");
    let image = image.to_str().unwrap();
    let presses = "[[button]]\npin = \"PC13\"\npressed = [\"5ms\", \"7ms\"]\nfor = \"1ms\"\n";
    put(folder.path(), "a button.toml", presses);
    let inputs = [
        ("image", image),
        ("scenario", "a button.toml"),
        ("until", "pressed (true|false)"),
        ("for", "100ms"),
        ("junit", "run.xml"),
        ("strict", "true"),
    ];
    let output = act(folder.path(), &inputs);
    assert!(output.status.success(), "{}", said(&output));
    assert!(folder.path().join("run.xml").is_file());

    let status = |inputs: &[(&str, &str)]| act(folder.path(), inputs).status.code();
    assert_eq!(
        status(&[("image", image), ("until", "never"), ("for", "10ms")]),
        Some(7)
    );
    assert_eq!(status(&[("image", image), ("chip", "STM32F411CE")]), Some(3));
    let polls = super::images::image("polls");
    let polls = polls.to_str().unwrap();
    assert_eq!(status(&[("image", polls), ("until", "waiting")]), Some(0));
    let strict = [("image", polls), ("until", "waiting"), ("strict", "true")];
    assert_eq!(status(&strict), Some(6));
}

#[test]
fn the_action_installs_what_is_missing_from_its_own_repository() {
    let folder = tempfile::tempdir().unwrap();
    let bin = folder.path().join("bin");
    fs::create_dir(&bin).unwrap();
    // Programs that record their arguments, in a PATH that has neither QEMU nor the runner.
    for name in ["sudo", "cargo"] {
        let program = bin.join(name);
        let note = format!(
            "#!/bin/bash\necho {name} \"$@\" in \"$PWD\" >> '{}/asked'\n",
            folder.path().display()
        );
        fs::write(&program, note).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let action = action();
    for step in action["runs"]["steps"].as_sequence().unwrap().iter().take(2) {
        let script = format!("PATH='{}'\n{}", bin.display(), step["run"].as_str().unwrap());
        let output = bash(&root(), &script, &[]);
        assert!(output.status.success(), "{}", said(&output));
    }
    let asked = fs::read_to_string(folder.path().join("asked")).unwrap();
    let lines: Vec<_> = asked
        .lines()
        .map(|line| line.split(" in ").next().unwrap())
        .collect();
    let package = "host-tools/stm32f405-qemu";
    let expected = [
        "sudo apt-get update",
        "sudo apt-get install --yes --no-install-recommends qemu-system-arm",
        &format!("cargo install --locked --path {package}"),
    ];
    assert_eq!(lines, expected);
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).canonicalize().unwrap();
    assert_eq!(root().join(package), own);
}

#[test]
fn the_workflow_of_the_page_gives_the_action_inputs_that_it_has() {
    let page = page();
    let (files, _) = contents(&page);
    let (_, workflow) = files.iter().find(|(path, _)| path.ends_with(".yml")).unwrap();
    let workflow: Value = serde_yaml_ng::from_str(workflow).unwrap();
    let steps = workflow["jobs"]["run"]["steps"].as_sequence().unwrap();
    let of_us = |step: &&Value| {
        step["uses"]
            .as_str()
            .is_some_and(|what| what.contains("stm32-emu"))
    };
    let step = steps.iter().find(of_us).unwrap();
    let uses = step["uses"].as_str().unwrap();
    let place = uses.strip_prefix("absorber-bead/absorber-bead/").unwrap();
    let (place, _) = place.split_once('@').unwrap();
    assert!(root().join(place).join("action.yml").is_file());
    let action = action();
    let inputs = keys(&action["inputs"]);
    assert!(keys(&step["with"]).is_subset(&inputs), "{inputs:?}");
    let image = step["with"]["image"].as_str().unwrap();
    assert_eq!(image, format!("target/{TARGET}/release/firmware"));
    // Each is in the sentence below it.
    let (_, sentence) = page.split_once("Its inputs are ").unwrap();
    assert!(
        inputs
            .iter()
            .all(|input| sentence.contains(&format!("`{input}`")))
    );
}
