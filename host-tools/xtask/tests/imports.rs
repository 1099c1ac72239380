//! Imports inside each crate point down: no circle between files, no file that uses what the file declaring
//! it defines, and no import of a higher room where the crate's `lib.rs` has a table of rooms, highest first.
//! Imports between crates are in their manifests.
//!
//! # Design
//! Paths are read from tokens, so that those in macros and function bodies count as well as those after
//! `use`. A path is an arrow to the file that *defines* its item: re-exports are followed, modules are passed
//! through. Code under `cfg(test)` is skipped.

#![allow(clippy::unwrap_used, reason = "a source that cannot be read fails the test")]

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

#[test]
fn imports_inside_each_crate_point_down() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let faults: Vec<String> = crates(root).iter().flat_map(|folder| faults(folder)).collect();
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// Folders with a `Cargo.toml` and a `src`.
fn crates(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    if folder.join("Cargo.toml").exists() && folder.join("src").exists() {
        found.push(folder.to_owned());
    }
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let hidden = path.file_name().unwrap().to_string_lossy().starts_with('.');
        if path.is_dir() && !hidden && !path.join("CACHEDIR.TAG").exists() {
            found.extend(crates(&path));
        }
    }
    found
}

/// A file and the module that it holds.
struct Module {
    file: PathBuf,
    parent: Option<usize>,
    children: HashMap<String, usize>,
    /// Names brought by `use`, with the paths that they stand for.
    names: HashMap<String, Vec<String>>,
    /// All paths of the file, with their lines.
    paths: Vec<(Vec<String>, usize)>,
}

/// The faults of one crate, one a line.
fn faults(folder: &Path) -> Vec<String> {
    let mut faults = Vec::new();
    for file in ["src/lib.rs", "src/main.rs"] {
        let file = folder.join(file);
        if file.exists() {
            let mut modules = Vec::new();
            read(file.clone(), &folder.join("src"), None, &mut modules);
            check(&rooms(&fs::read_to_string(file).unwrap()), &modules, &mut faults);
        }
    }
    faults
}

/// The rooms of a crate, from the rows "//! | [`room`] | … |" of its documentation.
fn rooms(lib: &str) -> Vec<String> {
    let row = |line: &str| {
        Some(
            line.strip_prefix("//! | [`")?
                .split('`')
                .next()?
                .replace("mod@", ""),
        )
    };
    lib.lines().filter_map(row).collect()
}

fn read(file: PathBuf, parts: &Path, parent: Option<usize>, modules: &mut Vec<Module>) -> usize {
    let at = modules.len();
    let tokens = fs::read_to_string(&file)
        .unwrap()
        .parse()
        .unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let (mut flat, mut names, mut paths) = (Vec::new(), HashMap::new(), Vec::new());
    flatten(tokens, &mut flat);
    modules.push(Module {
        file,
        parent,
        children: HashMap::new(),
        names: HashMap::new(),
        paths: Vec::new(),
    });
    let (mut next, mut depth, mut inline) = (0, 0, Vec::new());
    while next < flat.len() {
        let word = |ahead: usize| flat.get(next + ahead).map_or("", |(word, _)| word.as_str());
        match word(0) {
            "mod" if word(2) == "{" => inline.push(depth),
            "{" => depth += 1,
            "}" => {
                depth -= 1;
                inline.pop_if(|start| *start == depth);
            }
            _ => {}
        }
        if word(0) == "mod" && word(2) == ";" {
            let (name, below) = (word(1).to_owned(), parts.join(word(1)));
            let beside = parts.join(format!("{name}.rs"));
            let file = if beside.exists() {
                beside
            } else {
                below.join("mod.rs")
            };
            let child = read(file, &below, Some(at), modules);
            modules[at].children.insert(name, child);
        }
        let is_use = word(0) == "use";
        let starts = is_use
            || word(1) == "::" && is_name(word(0)) && (next == 0 || !".':".contains(&*flat[next - 1].0));
        if starts {
            let mut tree = Vec::new();
            let end = next + usize::from(is_use);
            next = use_tree(&flat, end, &[], &mut tree);
            for (name, mut path, line) in tree {
                // The first `super` of an inline module is this file.
                let supers = path.iter().take_while(|word| *word == "super").count();
                path[..supers.min(inline.len())].fill("self".into());
                if is_use {
                    names.insert(name, path.clone());
                }
                paths.push((path, line));
            }
        } else {
            next += 1;
        }
    }
    (modules[at].names, modules[at].paths) = (names, paths);
    at
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Tokens as words with their lines, `::` as one word, without what stands under `cfg(test)`.
fn flatten(tokens: TokenStream, flat: &mut Vec<(String, usize)>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        let line = tokens[at].span().start().line;
        match &tokens[at] {
            TokenTree::Punct(mark) if mark.as_char() == '#' && is_for_tests(tokens.get(at + 1)) => {
                let is_use = |token: &TokenTree| matches!(token, TokenTree::Ident(word) if word == "use");
                let item_is_use = tokens[at + 2..].iter().take(4).any(is_use);
                let ends = |token: &TokenTree| match token {
                    TokenTree::Group(group) => group.delimiter() == Delimiter::Brace && !item_is_use,
                    token => token.to_string() == ";",
                };
                at += tokens[at..]
                    .iter()
                    .position(ends)
                    .unwrap_or(tokens.len() - at - 1);
            }
            TokenTree::Punct(mark)
                if mark.as_char() == ':' && flat.last().is_some_and(|(word, _)| word == ":") =>
            {
                flat.last_mut().unwrap().0 = "::".into();
            }
            TokenTree::Group(group) => {
                let braces = group.delimiter() == Delimiter::Brace;
                flat.push((if braces { "{" } else { "(" }.into(), line));
                flatten(group.stream(), flat);
                flat.push((if braces { "}" } else { ")" }.into(), line));
            }
            token => flat.push((token.to_string().trim_start_matches("r#").to_owned(), line)),
        }
        at += 1;
    }
}

/// True for the brackets of `#[cfg(test)]` and of `#[cfg(all(test, …))]`.
fn is_for_tests(attribute: Option<&TokenTree>) -> bool {
    let text = attribute.map(ToString::to_string).unwrap_or_default();
    let words: Vec<&str> = text
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty())
        .collect();
    words.first() == Some(&"cfg") && words.contains(&"test") && !words.contains(&"not")
}

/// Reads `a::b::{c, d as e}` from word `at` on into (name, path, line); the position after it.
fn use_tree(
    flat: &[(String, usize)],
    mut at: usize,
    before: &[String],
    tree: &mut Vec<(String, Vec<String>, usize)>,
) -> usize {
    let mut path = before.to_vec();
    let line = flat.get(at).map_or(0, |(_, line)| *line);
    let word = |at: usize| flat.get(at).map_or("", |(word, _)| word.as_str());
    while is_name(word(at)) || word(at) == "::" || word(at) == "*" {
        if word(at) != "::" {
            path.push(word(at).to_owned());
            if word(at + 1) != "::" {
                at += 1;
                break;
            }
        }
        at += 1;
    }
    if word(at) == "{" && (path.is_empty() || word(at - 1) == "::") {
        at += 1;
        while at < flat.len() && word(at) != "}" {
            at = if word(at) == "," {
                at + 1
            } else {
                use_tree(flat, at, &path, tree).max(at + 1)
            };
        }
        return at + 1;
    }
    if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
        path.pop();
    }
    let mut name = path.last().cloned().unwrap_or_default();
    if word(at) == "as" {
        name = word(at + 1).to_owned();
        at += 2;
    }
    tree.push((name, path, line));
    at
}

/// The module that a path names (`Ok`) or that defines the named item (`Err`); `None` in other crates.
fn resolve(modules: &[Module], from: usize, path: &[String], depth: usize) -> Option<Result<usize, usize>> {
    let root = std::iter::successors(Some(from), |&module| modules[module].parent).last()?;
    let mut here = from;
    for (index, name) in path.iter().enumerate() {
        let module = &modules[here];
        match name.as_str() {
            "crate" => here = root,
            "self" => {}
            "super" => here = module.parent?,
            "*" => return Some(Err(here)),
            name => {
                if let Some(&child) = module.children.get(name) {
                    here = child;
                } else if let Some(named) = module
                    .names
                    .get(name)
                    .filter(|named| depth < 16 && *named != path)
                {
                    match resolve(modules, here, named, depth + 1)? {
                        Ok(module) => here = module,
                        item => return Some(item),
                    }
                } else if index > 0 {
                    return Some(Err(here));
                } else {
                    return None;
                }
            }
        }
    }
    Some(Ok(here))
}

fn check(rooms: &[String], modules: &[Module], faults: &mut Vec<String>) {
    let ancestors =
        |of: usize| std::iter::successors(Some(of), |&module| modules[module].parent).collect::<Vec<_>>();
    // Rooms are counted from the highest down.
    let room = |of: usize| {
        let top = *ancestors(of).iter().rev().nth(1)?;
        let name = modules[0].children.iter().find(|(_, child)| **child == top)?.0;
        rooms.iter().position(|room| room == name)
    };
    for name in modules[0]
        .children
        .keys()
        .filter(|name| !rooms.is_empty() && !rooms.contains(name))
    {
        faults.push(format!(
            "{}: {name} is not in the table of rooms",
            modules[0].file.display()
        ));
    }
    let mut arrows = Vec::new();
    let mut seen = BTreeSet::new();
    for (from, module) in modules.iter().enumerate() {
        for (path, line) in &module.paths {
            let Some(Err(to)) = resolve(modules, from, path, 0) else {
                continue;
            };
            if from == to || !seen.insert((from, to)) {
                continue;
            }
            let place = format!(
                "{}:{line}: {} is in {}",
                module.file.display(),
                path.join("::"),
                modules[to].file.display()
            );
            if ancestors(from).contains(&to) {
                faults.push(format!("{place}, which declares this module"));
            }
            if let (Some(own), Some(other)) = (room(from), room(to))
                && other < own
            {
                faults.push(format!("{place}: a higher room"));
            }
            arrows.push((from, to, place));
        }
    }
    // A file without imports, or that no file imports, is on no circle.
    loop {
        let (before, old) = (arrows.len(), arrows.clone());
        arrows.retain(|(from, to, _)| {
            old.iter().any(|(other, ..)| other == to) && old.iter().any(|(_, other, _)| other == from)
        });
        if arrows.len() == before {
            break;
        }
    }
    if !arrows.is_empty() {
        let places: Vec<&str> = arrows.iter().map(|(.., place)| place.as_str()).collect();
        faults.push(format!("a circle:\n    {}", places.join("\n    ")));
    }
}

/// Faults of a crate with these files in `src`, without their folder.
fn faults_of(files: &[(&str, &str)]) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join("src").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let faults = faults(folder.path()).into_iter();
    let prefix = format!("{}/src/", folder.path().display());
    faults.map(|fault| fault.replace(&prefix, "")).collect()
}

#[test]
fn circles_and_arrows_up_are_found_and_nothing_else() {
    const ROOMS: &str = "//! | [`attic`] | |\n//! | [`mod@cellar`] | |\npub mod attic; pub mod cellar;";
    type Files = &'static [(&'static str, &'static str)];
    let cases: [(Files, &[&str]); 6] = [
        // Modules are passed through, re-exports are followed, tests and comments are skipped.
        (
            &[
                (
                    "lib.rs",
                    "mod a; mod b; mod c; pub use {a::A, crate::b::B as Bee}; fn f() { c::d::run() }",
                ),
                (
                    "a.rs",
                    "//! crate::Bee\n#[cfg(test)]\nuse crate::{Bee};\n#[cfg(all(test, unix))] mod tests { use super::super::Bee; }",
                ),
                (
                    "b.rs",
                    "pub struct B; impl B { fn f(self) -> crate::A { std::mem::take(self.0) } }",
                ),
                ("c/mod.rs", "pub mod d;"),
                (
                    "c/d.rs",
                    "use crate::a; use super::super::b::{self, B}; fn run() { a::new(b::x()) }",
                ),
            ],
            &[],
        ),
        (
            &[
                ("lib.rs", "mod a; mod b; pub use {a::A, crate::b::B as Bee};"),
                ("a.rs", "use crate::{Bee};"),
                ("b.rs", "\nfn f() { println!(\"{}\", crate::A::new()) }"),
            ],
            &["a circle:\n    a.rs:1: crate::Bee is in b.rs\n    b.rs:2: crate::A::new is in a.rs"],
        ),
        (
            &[("main.rs", "mod a;\nstruct Top;"), ("a.rs", "\nuse super::Top;")],
            &["a.rs:2: super::Top is in main.rs, which declares this module"],
        ),
        (
            &[
                ("lib.rs", ROOMS),
                ("attic.rs", "use crate::cellar::Shelf;"),
                ("cellar.rs", ""),
            ],
            &[],
        ),
        (
            &[
                ("lib.rs", ROOMS),
                ("attic.rs", ""),
                ("cellar.rs", "mod shelf;"),
                ("cellar/shelf.rs", "use crate::attic::{Trunk};"),
            ],
            &["cellar/shelf.rs:1: crate::attic::Trunk is in attic.rs: a higher room"],
        ),
        (
            &[("lib.rs", "//! | [`attic`] | |\nmod hut;"), ("hut.rs", "")],
            &["lib.rs: hut is not in the table of rooms"],
        ),
    ];
    for (files, expected) in cases {
        assert_eq!(faults_of(files), expected);
    }
}
