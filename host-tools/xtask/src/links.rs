//! Check that every link of the documentation leads somewhere.
//!
//! # Design
//! Links inside the repository are checked, files and headings alike; the web is not, since a check that
//! needs the web fails for reasons that are not the project's.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::files::texts;
use crate::step::Stop;

/// Checks all Markdown files under `root`, and returns the number of links that it followed.
///
/// # Errors
/// The links that lead nowhere, one a line, with file and line number.
pub(crate) fn check(root: &Path) -> Result<usize, Stop> {
    let pages: HashMap<PathBuf, String> = texts(root, ".md")?.into_iter().collect();
    let mut followed = 0;
    let mut broken = Vec::new();
    for (page, text) in &pages {
        for (line, link) in links(text) {
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            followed += 1;
            if let Err(why) = follow(page, &link, &pages) {
                let page = page.strip_prefix(root).unwrap_or(page);
                broken.push(format!("{}:{line}: {link}: {why}", page.display()));
            }
        }
    }
    broken.extend(unlisted(&root.join("docs"), &pages));
    broken.sort();
    if broken.is_empty() {
        return Ok(followed);
    }
    let broken = broken.join("\n");
    Err(Stop::failed(format!("links that lead nowhere:\n{broken}")))
}

/// The pages of the book that its summary does not list, and so nobody finds.
fn unlisted(docs: &Path, pages: &HashMap<PathBuf, String>) -> Vec<String> {
    let Some(summary) = pages.get(&docs.join("SUMMARY.md")) else {
        return Vec::new();
    };
    let listed: Vec<PathBuf> = links(summary).map(|(_, link)| docs.join(link)).collect();
    pages
        .keys()
        .filter(|page| page.starts_with(docs) && !page.ends_with("SUMMARY.md") && !listed.contains(page))
        .map(|page| format!("{}: not in docs/SUMMARY.md", page.display()))
        .collect()
}

fn follow(page: &Path, link: &str, pages: &HashMap<PathBuf, String>) -> Result<(), &'static str> {
    let (file, heading) = match link.split_once('#') {
        Some((file, heading)) => (file, Some(heading)),
        None => (link, None),
    };
    let beside = page.parent().unwrap_or(page).join(file);
    let target = match file {
        "" => page.to_owned(),
        _ => beside.canonicalize().map_err(|_| "no such file")?,
    };
    match (heading, pages.get(&target)) {
        (Some(heading), Some(text)) if !slugs(text).any(|slug| slug == heading) => Err("no such heading"),
        _ => Ok(()),
    }
}

/// The prose of a page, with line numbers: what is not in a fenced block.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut fenced = false;
    text.lines().enumerate().filter_map(move |(index, line)| {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            return None;
        }
        (!fenced).then_some((index + 1, line))
    })
}

/// The targets of `[text](target)` and `![text](target)`, with line numbers.
fn links(text: &str) -> impl Iterator<Item = (usize, String)> {
    prose(text).flat_map(|(number, line)| {
        // In code spans `](` is code: every second piece between backticks.
        let spoken: String = line.split('`').step_by(2).collect::<Vec<_>>().join("`");
        let targets = spoken.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
        let first = |(target, _): (&str, &str)| target.split_whitespace().next().unwrap_or("").to_owned();
        targets.map(|target| (number, first(target))).collect::<Vec<_>>()
    })
}

/// The anchors that GitHub gives to the headings of a page.
fn slugs(text: &str) -> impl Iterator<Item = String> {
    prose(text)
        .filter(|(_, line)| line.starts_with('#'))
        .map(|(_, line)| {
            let heading = line.trim_start_matches('#').trim().chars();
            let kept = heading.filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.map(|c| if c == ' ' { '-' } else { c })
                .flat_map(char::to_lowercase)
                .collect()
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write;

    /// The number of links that are followed in these pages, or the complaint.
    fn checked(pages: &[(&str, &str)]) -> Result<usize, String> {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap();
        for (name, text) in pages {
            write(&root.join(name), text).unwrap();
        }
        let complaint = |stop: Stop| stop.message.replace(&format!("{}/", root.display()), "");
        check(&root).map_err(complaint)
    }

    #[test]
    fn links_that_hold_are_counted_and_those_that_lead_nowhere_are_named_with_their_line() {
        let readme = "[a](docs/a.md#the-heading-no-2) and [b](docs/) and ![p](docs/p.svg \"title\") [w](https://x.y)\n";
        let page = "# The heading, no. 2\n[up](../README.md) [here](#the-heading-no-2)\n";
        let pages = [("README.md", readme), ("docs/a.md", page), ("docs/p.svg", "")];
        assert_eq!(checked(&pages), Ok(5));
        // Code and build directories are left alone.
        let code = ("a.md", "`v[0](gone.md)`\n```\n[x](gone.md)\n```\n");
        let built = [("target/CACHEDIR.TAG", ""), ("target/other.md", "[x](gone.md)\n")];
        assert_eq!(checked(&[code, built[0], built[1]]), Ok(0));
        let lost = "links that lead nowhere:\na.md:3: #gone: no such heading\na.md:3: gone.md: no such file";
        assert_eq!(
            checked(&[("a.md", "# A\n\n[x](gone.md) [y](#gone)\n")]),
            Err(lost.to_owned())
        );
        let summary = ("docs/SUMMARY.md", "- [A](a.md)\n");
        let unlisted = "links that lead nowhere:\ndocs/b.md: not in docs/SUMMARY.md";
        let pages = [summary, ("docs/a.md", ""), ("docs/b.md", ""), ("README.md", "")];
        assert_eq!(checked(&pages), Err(unlisted.to_owned()));
    }

    #[test]
    fn the_programs_of_the_page_on_libraries_are_those_that_are_compiled() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
        let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
        let page = read("docs/library.md");
        for folder in [
            "host-tools/hertz/chain",
            "host-tools/stm32f405-qemu",
            "firmware/wire",
        ] {
            let program = read(&format!("{folder}/examples/library.rs"));
            let (_, code) = program
                .split_once("//! The example of docs/library.md.\n\n")
                .unwrap();
            assert!(page.contains(&format!("```rust\n{code}```")), "{folder}");
        }
    }
}
