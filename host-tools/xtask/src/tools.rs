//! Programs that cargo compiles into target/tools when a command first needs them.

use std::path::PathBuf;

use crate::step::{CommandLine, Steps, Stop};

/// Path of a program of crates.io, installed first if it is missing or of another version. `options` are
/// those of its `cargo install`.
///
/// # Errors
/// It does not compile, or there is no network.
pub(crate) fn installed(steps: &Steps, package: &str, version: &str, options: &str) -> Result<PathBuf, Stop> {
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
