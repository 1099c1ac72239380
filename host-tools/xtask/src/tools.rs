//! Programs that cargo compiles into target/tools when a command first needs them.

use std::path::PathBuf;

use crate::step::{CommandLine, Steps, Stop};

/// A program of crates.io: its package, the version, and its options for `cargo install`.
pub(crate) struct Tool {
    pub(crate) package: &'static str,
    pub(crate) version: &'static str,
    pub(crate) options: &'static str,
}

/// Path of a tool, installed first if it is missing or of another version.
///
/// # Errors
/// It does not compile, or there is no network.
pub(crate) fn installed(steps: &Steps, tool: &Tool) -> Result<PathBuf, Stop> {
    let Tool {
        package,
        version,
        options,
    } = tool;
    let root = steps.built("tools").join(format!("{package}-{version}"));
    let program = root.join("bin").join(package);
    if !steps.root.join(&program).exists() {
        steps.announce(&format!(
            "{package} is missing: cargo compiles it into {}, which takes some minutes",
            root.display()
        ));
        let install = CommandLine::new(&format!(
            "cargo install {package} --version {version} --locked {options} --root"
        ));
        steps.run(package, &install.arg(&root))?;
    }
    Ok(program)
}
