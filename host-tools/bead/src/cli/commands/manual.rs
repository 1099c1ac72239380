//! `bead completions` and `bead man`: what a shell and `man` know of the commands.

use clap::Command;
use clap_complete::Shell;

use crate::cli::commands::prelude::*;

const COMPLETIONS_HELP: &str = "\
Examples:
  bead completions bash > ~/.local/share/bash-completion/completions/bead
  bead completions zsh > ~/.zfunc/_bead
    (with fpath+=~/.zfunc before compinit in ~/.zshrc)
  bead completions fish > ~/.config/fish/completions/bead.fish";

#[derive(Debug, Args)]
#[command(after_help = COMPLETIONS_HELP)]
pub(crate) struct Completions {
    /// The shell that completes.
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn completions(arguments: &Completions, mut command: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "bead", &mut script);
    output::print_line(String::from_utf8_lossy(&script).trim_end())
}

const MAN_HELP: &str = "\
Examples:
  bead man ~/.local/share/man/man1
  man bead-emulate";

#[derive(Debug, Args)]
#[command(after_help = MAN_HELP)]
pub(crate) struct Manual {
    /// The directory for the pages; it is made if it is not there.
    #[arg(value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Writes a manual page for `command` and for each of its commands.
pub(crate) fn manual(arguments: &Manual, command: Command) -> Result<(), Failure> {
    let (pages, out) = (pages(command), arguments.out.as_path());
    let files = pages
        .iter()
        .map(|(name, _)| (format!("{name}.1"), FileKind::Text));
    let targets = place::targets(out, files, &[], arguments.overwrite)?;
    place::make_directory(out)?;
    for (target, (_, page)) in targets.iter().zip(&pages) {
        let mut text = Vec::new();
        page.render(&mut text)
            .with_context(|| format!("cannot write {}", target.path().display()))?;
        target.write_bytes(text)?;
    }
    note!("{} pages are in {}", targets.len(), out.display());
    Ok(())
}

/// The pages of a command and of those below it, each with its name: `bead`, `bead-settings`,
/// `bead-settings-make`. `help` has none, and no page refers to it.
fn pages(command: Command) -> Vec<(String, clap_mangen::Man)> {
    fn collect(command: &Command, above: &str, pages: &mut Vec<(String, clap_mangen::Man)>) {
        let name = format!("{above}{}", command.get_name());
        for inner in command.get_subcommands() {
            collect(inner, &format!("{name}-"), pages);
        }
        pages.push((name, clap_mangen::Man::new(command.clone())));
    }
    // Building adds the help commands.
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    collect(&command, "", &mut pages);
    pages
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn pages_refer_to_pages_that_are_there() {
        let pages = pages(Cli::command());
        for (name, page) in &pages {
            let mut text = Vec::new();
            page.render(&mut text).unwrap();
            let text = String::from_utf8(text).unwrap().replace("\\-", "-");
            let referred = text.lines().filter_map(|line| line.strip_suffix("(1)"));
            for other in referred {
                assert!(pages.iter().any(|(name, _)| name == other), "{name}: {other}");
            }
        }
        assert!(pages.iter().any(|(name, _)| name == "bead-settings-make"));
    }
}
