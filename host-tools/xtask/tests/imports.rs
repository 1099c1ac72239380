//! Imports of the workspace point down: no circle between files, no arrow from a lower room to a higher one.
//!
//! # Design
//! Paths are read from the source as tokens, so that those in macros and function bodies count as well as
//! those after `use`. A path counts as an arrow to the file that *defines* its item: re-exports are followed,
//! modules are only passed through. What stands under `cfg(test)` is not read, and neither are tests and
//! examples.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};

/// A crate of the workspace: what it may import, and its rooms from the lowest up, if it has any.
struct Package {
    name: &'static str,
    knows: &'static [&'static str],
    rooms: &'static [&'static str],
}

const fn package(name: &'static str, knows: &'static [&'static str]) -> Package {
    Package {
        name,
        knows,
        rooms: &[],
    }
}

/// Which crate knows which. A new crate gets its row here.
const WORKSPACE: &[Package] = &[
    package("bead-crc", &[]),
    package("bead-model", &["bead-crc"]),
    package("bead-wire", &["bead-crc"]),
    package("bead-store", &["bead-crc", "bead-testing"]),
    package("hertz-chain", &[]),
    package("hertz-charts", &[]),
    package("stm32f405-qemu", &[]),
    package("stm32f405-qemu-images", &[]),
    package("xtask", &[]),
    package("bead-telemetry", &["bead-model", "bead-wire"]),
    package("bead-testing", &["bead-model", "bead-wire"]),
    package(
        "bead-firmware",
        &[
            "bead-crc",
            "bead-model",
            "bead-wire",
            "bead-store",
            "bead-telemetry",
        ],
    ),
    package("hertz-figures", &["hertz-chain", "hertz-charts"]),
    package(
        "hertz-benchmarks",
        &["hertz-chain", "hertz-charts", "hertz-figures"],
    ),
    Package {
        name: "absorber-bead",
        knows: HOST,
        rooms: &[
            "recording",
            "line",
            "waveform",
            "bench",
            "comparison",
            "export",
            "sweep",
            "cli",
        ],
    },
    package("bead-figures", HOST),
    package("bead-fuzz", HOST),
    package("bead-inventory", &[]),
    package("bead-tests", HOST),
];
/// All that the host's programs may use.
const HOST: &[&str] = &[
    "bead-crc",
    "bead-model",
    "bead-wire",
    "bead-store",
    "hertz-chain",
    "stm32f405-qemu",
    "bead-telemetry",
    "bead-testing",
    "hertz-charts",
    "hertz-figures",
    "absorber-bead",
];

#[test]
fn imports_of_the_workspace_point_down() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    match check(root, WORKSPACE) {
        Ok(found) => println!("{found}"),
        Err(faults) => panic!("{faults}"),
    }
}

/// Checks the workspace in `root`; says how many files and arrows there are.
///
/// # Errors
/// The circles and the arrows up, with the lines that draw them; a crate or a room without its place in the
/// table.
fn check(root: &Path, packages: &[Package]) -> Result<String, String> {
    let source = Source::read(root, packages)?;
    let arrows = source.arrows();
    let mut faults: Vec<String> = arrows
        .iter()
        .filter_map(|arrow| Some(format!("{}: {}", source.told(arrow), source.up(packages, arrow)?)))
        .collect();
    let up = faults.len();
    let circles = circles(source.files.len(), &arrows);
    for circle in &circles {
        let told: Vec<String> = circle.iter().map(|arrow| source.told(arrow)).collect();
        faults.push(format!("a circle:\n    {}", told.join("\n    ")));
    }
    let count = |count: usize, one: &str| format!("{count} {one}{}", if count == 1 { "" } else { "s" });
    let found = format!("{}, {} up", count(circles.len(), "circle"), count(up, "arrow"));
    if faults.is_empty() {
        return Ok(format!(
            "imports: {found}, in {} files with {} arrows",
            source.files.len(),
            arrows.len()
        ));
    }
    Err(format!("imports: {found}\n{}", faults.join("\n")))
}

/// An import of something that `to` defines.
struct Arrow<'a> {
    from: usize,
    to: usize,
    module: usize,
    path: &'a Import,
}

/// A path as it stands in the source.
struct Import {
    segments: Vec<String>,
    /// `use a::*`.
    glob: bool,
    line: usize,
}

struct Module {
    file: usize,
    parent: Option<usize>,
    /// The name of the top module that it lies in; of the crate's root, nothing.
    room: String,
    children: HashMap<String, usize>,
    /// The items defined here.
    items: HashSet<String>,
    /// The names that `use` brings here, with the paths that they stand for.
    names: HashMap<String, Vec<String>>,
    imports: Vec<Import>,
}

enum Found {
    Module(usize),
    /// An item of this file.
    Item(usize),
    Elsewhere,
}

struct File {
    path: PathBuf,
    package: usize,
}

#[derive(Default)]
struct Source {
    root: PathBuf,
    files: Vec<File>,
    modules: Vec<Module>,
    /// The libraries' root modules, by the name that code gives them.
    crates: HashMap<String, usize>,
}

impl Source {
    fn read(root: &Path, packages: &[Package]) -> Result<Self, String> {
        let mut source = Source {
            root: root.to_owned(),
            ..Source::default()
        };
        let mut folders = Vec::new();
        manifests(root, &mut folders).map_err(|error| format!("{}: {error}", root.display()))?;
        folders.sort();
        for (folder, name) in folders {
            let package = packages.iter().position(|package| package.name == name);
            let package =
                package.ok_or_else(|| format!("the crate {name} has no row in the table of imports.rs"))?;
            for (file, name) in [("src/lib.rs", library(&name)), ("src/main.rs", String::new())] {
                let path = folder.join(file);
                if path.exists() {
                    let parts = path.parent().unwrap_or(&folder).to_owned();
                    let module = source.file(path, package, None, "", &parts)?;
                    source.crates.insert(name, module);
                }
            }
        }
        source.crates.remove("");
        Ok(source)
    }

    /// Reads a file as a module whose children lie in `parts`.
    fn file(
        &mut self,
        path: PathBuf,
        package: usize,
        parent: Option<usize>,
        room: &str,
        parts: &Path,
    ) -> Result<usize, String> {
        let failed = |why: String| format!("{}: {why}", path.display());
        let text = std::fs::read_to_string(&path).map_err(|error| failed(error.to_string()))?;
        let tokens: TokenStream = text
            .parse()
            .map_err(|error: proc_macro2::LexError| failed(error.to_string()))?;
        self.files.push(File { path, package });
        let module = self.module(self.files.len() - 1, parent, room);
        self.walk(tokens, module, parts, true)?;
        Ok(module)
    }

    fn module(&mut self, file: usize, parent: Option<usize>, room: &str) -> usize {
        self.modules.push(Module {
            file,
            parent,
            room: room.to_owned(),
            children: HashMap::new(),
            items: HashSet::new(),
            names: HashMap::new(),
            imports: Vec::new(),
        });
        self.modules.len() - 1
    }

    /// Reads what a module holds; `top` outside of every bracket in it.
    fn walk(&mut self, tokens: TokenStream, module: usize, parts: &Path, top: bool) -> Result<(), String> {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            let next = tokens.get(at + 1);
            match (&tokens[at], next) {
                (TokenTree::Punct(mark), Some(TokenTree::Group(group)))
                    if mark.as_char() == '#' && only_for_tests(group.stream()) =>
                {
                    at = after_item(&tokens, at + 2);
                    continue;
                }
                (TokenTree::Group(group), _) => self.walk(group.stream(), module, parts, false)?,
                (TokenTree::Ident(word), Some(TokenTree::Ident(name))) if word == "mod" => {
                    self.child(&name.to_string(), tokens.get(at + 2), module, parts)?;
                    at += 3;
                    continue;
                }
                (TokenTree::Ident(word), Some(next)) if word == "use" && !is(next, '<') => {
                    let end = (at..tokens.len()).find(|&at| is(&tokens[at], ';')).unwrap_or(at);
                    self.bring(&tokens[at + 1..end], &[], module);
                    at = end;
                }
                (TokenTree::Ident(word), Some(TokenTree::Ident(name)))
                    if top && defines(&word.to_string()) =>
                {
                    self.modules[module].items.insert(name.to_string());
                }
                (TokenTree::Ident(word), Some(mark)) if top && word == "macro_rules" && is(mark, '!') => {
                    if let Some(TokenTree::Ident(name)) = tokens.get(at + 2) {
                        self.modules[module].items.insert(name.to_string());
                    }
                }
                (TokenTree::Ident(word), _) if !continues(&tokens, at) => {
                    let (segments, end) = path(&tokens, at);
                    if segments.len() > 1 {
                        self.modules[module].imports.push(Import {
                            segments,
                            glob: false,
                            line: word.span().start().line,
                        });
                    }
                    at = end;
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        Ok(())
    }

    /// `mod name;` or `mod name { … }`.
    fn child(
        &mut self,
        name: &str,
        body: Option<&TokenTree>,
        parent: usize,
        parts: &Path,
    ) -> Result<(), String> {
        let (file, room) = (self.modules[parent].file, self.modules[parent].room.clone());
        let room = if self.modules[parent].parent.is_none() {
            name
        } else {
            &room
        };
        let parts = parts.join(name);
        let module = if let Some(TokenTree::Group(group)) = body {
            let module = self.module(file, Some(parent), room);
            self.walk(group.stream(), module, &parts, true)?;
            module
        } else {
            let path = [parts.with_extension("rs"), parts.join("mod.rs")];
            let path = path.into_iter().find(|path| path.exists()).ok_or_else(|| {
                let here = self.files[file].path.display();
                format!("{here}: no file for `mod {name}`")
            })?;
            self.file(path, self.files[file].package, Some(parent), room, &parts)?
        };
        self.modules[parent].children.insert(name.to_owned(), module);
        Ok(())
    }

    /// One tree of a `use`, below the segments in `prefix`.
    fn bring(&mut self, tree: &[TokenTree], prefix: &[String], module: usize) {
        let Some(first) = tree.first() else { return };
        if let TokenTree::Group(group) = first {
            let inner: Vec<TokenTree> = group.stream().into_iter().collect();
            for tree in inner.split(|token| is(token, ',')) {
                self.bring(tree, prefix, module);
            }
            return;
        }
        if is(first, ':') {
            // `use ::name` starts at a crate, as does `use name` for a crate of the workspace.
            return self.bring(&tree[2..], prefix, module);
        }
        let line = first.span().start().line;
        let mut segments = prefix.to_vec();
        let glob = is(first, '*');
        let (mut more, mut end) = (Vec::new(), 0);
        if !glob {
            (more, end) = path(tree, 0);
        }
        segments.append(&mut more);
        let rest = &tree[end..];
        if rest.len() > 2 && is(&rest[0], ':') {
            return self.bring(&rest[2..], &segments, module);
        }
        if segments.last().is_some_and(|last| last == "self") {
            segments.pop();
        }
        let renamed = rest.get(1).map(ToString::to_string);
        let name = renamed.or_else(|| segments.last().cloned()).unwrap_or_default();
        let here = &mut self.modules[module];
        if !glob {
            here.names.insert(name, segments.clone());
        }
        here.imports.push(Import { segments, glob, line });
    }

    /// What a path that stands in a module leads to.
    fn resolve(&self, module: usize, segments: &[String], depth: usize) -> Found {
        let mut here = module;
        for (index, segment) in segments.iter().enumerate() {
            let of = &self.modules[here];
            match segment.as_str() {
                "crate" => here = self.root_of(here),
                "self" => {}
                "super" => here = of.parent.unwrap_or(here),
                name => {
                    if let Some(&child) = of.children.get(name) {
                        here = child;
                    } else if of.items.contains(name) {
                        return Found::Item(of.file);
                    } else if let Some(named) = of.names.get(name).filter(|_| depth < 16) {
                        match self.resolve(here, named, depth + 1) {
                            Found::Module(module) => here = module,
                            found => return found,
                        }
                    } else if index > 0 {
                        // Made by a macro, or brought by a glob.
                        return Found::Item(of.file);
                    } else if let Some(&root) = self.crates.get(name) {
                        here = root;
                    } else {
                        return Found::Elsewhere;
                    }
                }
            }
        }
        Found::Module(here)
    }

    fn root_of(&self, module: usize) -> usize {
        std::iter::successors(Some(module), |&module| self.modules[module].parent)
            .last()
            .unwrap_or(module)
    }

    /// Every import of what another file defines.
    fn arrows(&self) -> Vec<Arrow<'_>> {
        let mut arrows = Vec::new();
        for (module, of) in self.modules.iter().enumerate() {
            for path in &of.imports {
                let to = match self.resolve(module, &path.segments, 0) {
                    Found::Item(file) => file,
                    Found::Module(all) if path.glob => self.modules[all].file,
                    _ => continue,
                };
                if to != of.file {
                    let from = of.file;
                    arrows.push(Arrow {
                        from,
                        to,
                        module,
                        path,
                    });
                }
            }
        }
        let mut seen = HashSet::new();
        arrows.retain(|arrow| seen.insert((arrow.from, arrow.to)));
        arrows
    }

    /// Why an arrow points up, if it does.
    fn up(&self, packages: &[Package], arrow: &Arrow<'_>) -> Option<String> {
        let (from, to) = (&self.files[arrow.from], &self.files[arrow.to]);
        let package = &packages[from.package];
        let other = packages[to.package].name;
        if from.package != to.package {
            return (!package.knows.contains(&other))
                .then(|| format!("{} must not know {other}", package.name));
        }
        let parents = std::iter::successors(Some(arrow.module), |&module| self.modules[module].parent);
        if parents
            .map(|module| self.modules[module].file)
            .any(|file| file == arrow.to)
        {
            return Some("up to the file that declares this module".into());
        }
        let rank = |room: &str| package.rooms.iter().position(|other| other == &room);
        let goal = self.modules.iter().find(|module| module.file == arrow.to)?;
        let (low, high) = (&self.modules[arrow.module].room, &goal.room);
        if package.rooms.is_empty() || low.is_empty() || high.is_empty() {
            return None;
        }
        match (rank(low), rank(high)) {
            (Some(from), Some(to)) => (from < to).then(|| format!("up from {low} to {high}")),
            (None, _) => Some(format!("the room {low} has no place in the table of imports.rs")),
            (_, None) => Some(format!("the room {high} has no place in the table of imports.rs")),
        }
    }

    fn told(&self, arrow: &Arrow<'_>) -> String {
        let short = |file: usize| {
            let path = &self.files[file].path;
            path.strip_prefix(&self.root).unwrap_or(path).display()
        };
        format!(
            "{}:{}: {} is in {}",
            short(arrow.from),
            arrow.path.line,
            arrow.path.segments.join("::"),
            short(arrow.to)
        )
    }
}

/// The folders of the packages under a folder, with their names.
fn manifests(folder: &Path, found: &mut Vec<(PathBuf, String)>) -> std::io::Result<()> {
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
    let package = manifest
        .split_once("[package]")
        .map_or("", |(_, package)| package);
    let name = package.lines().find_map(|line| line.strip_prefix("name = "));
    found.extend(name.map(|name| (folder.to_owned(), name.trim_matches('"').to_owned())));
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let hidden = path
            .file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if path.is_dir() && !hidden && !path.join("CACHEDIR.TAG").exists() {
            manifests(&path, found)?;
        }
    }
    Ok(())
}

/// The name of a package's library in code.
fn library(package: &str) -> String {
    package
        .strip_prefix("absorber-")
        .unwrap_or(package)
        .replace('-', "_")
}

fn is(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark)
}

fn defines(word: &str) -> bool {
    matches!(
        word,
        "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union"
    )
}

/// Whether an attribute is `cfg(test)` or a condition that asks for it.
fn only_for_tests(attribute: TokenStream) -> bool {
    let told = attribute.to_string();
    let words: Vec<&str> = told.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    words[0] == "cfg" && words.contains(&"test") && !words.contains(&"not")
}

/// Where the item ends that starts at `at`: after its braces or its semicolon.
fn after_item(tokens: &[TokenTree], at: usize) -> usize {
    let import = tokens[at..]
        .iter()
        .take_while(|token| !is(token, ';'))
        .any(|token| matches!(token, TokenTree::Ident(word) if word == "use"));
    let ends = |token: &TokenTree| {
        let braces =
            matches!(token, TokenTree::Group(group) if group.delimiter() == proc_macro2::Delimiter::Brace);
        is(token, ';') || braces && !import
    };
    (at..tokens.len())
        .find(|&at| ends(&tokens[at]))
        .map_or(tokens.len(), |end| end + 1)
}

/// Whether the word at `at` is no start of a path: a method, a lifetime, or what follows `::`.
fn continues(tokens: &[TokenTree], at: usize) -> bool {
    let before = |back: usize, mark| at >= back && is(&tokens[at - back], mark);
    before(1, '.') && !before(2, '.') || before(1, '\'') || before(1, ':') && before(2, ':')
}

/// The segments of the path that starts at `at`, and where it ends.
fn path(tokens: &[TokenTree], mut at: usize) -> (Vec<String>, usize) {
    let mut segments = Vec::new();
    while let Some(TokenTree::Ident(word)) = tokens.get(at) {
        segments.push(word.to_string().trim_start_matches("r#").to_owned());
        at += 1;
        let on = matches!(&tokens[at..], [a, b, TokenTree::Ident(_), ..] if is(a, ':') && is(b, ':'));
        if !on {
            break;
        }
        at += 2;
    }
    (segments, at)
}

/// The circles, each told once by a shortest way around.
fn circles<'a>(files: usize, arrows: &'a [Arrow<'a>]) -> Vec<Vec<&'a Arrow<'a>>> {
    let mut from: BTreeMap<usize, Vec<&Arrow<'_>>> = BTreeMap::new();
    for arrow in arrows {
        from.entry(arrow.from).or_default().push(arrow);
    }
    let mut told = HashSet::new();
    let mut circles = Vec::new();
    for start in 0..files {
        if told.contains(&start) {
            continue;
        }
        let mut reached: HashMap<usize, &Arrow<'_>> = HashMap::new();
        let mut open = VecDeque::from([start]);
        while let Some(file) = open.pop_front() {
            for arrow in from.get(&file).into_iter().flatten() {
                reached.entry(arrow.to).or_insert_with(|| {
                    open.push_back(arrow.to);
                    arrow
                });
            }
        }
        if !reached.contains_key(&start) {
            continue;
        }
        let mut circle = vec![reached[&start]];
        while circle[circle.len() - 1].from != start {
            circle.push(reached[&circle[circle.len() - 1].from]);
        }
        told.extend(circle.iter().map(|arrow| arrow.from));
        circle.reverse();
        circles.push(circle);
    }
    circles
}

#[cfg(test)]
mod tests {
    use super::*;

    const PACKAGES: &[Package] = &[
        package("low-one", &[]),
        Package {
            name: "high",
            knows: &["low-one"],
            rooms: &["cellar", "attic"],
        },
    ];

    /// What the check says of a workspace with these files in `low` and `high`.
    fn told(files: &[(&str, &str)]) -> Result<String, String> {
        let dir = tempfile::tempdir().unwrap();
        let manifests = [
            ("low/Cargo.toml", "[package]\nname = \"low-one\"\n"),
            ("high/Cargo.toml", "[package]\nname = \"high\"\n"),
        ];
        for (name, text) in manifests.iter().chain(files) {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        check(dir.path(), PACKAGES)
    }

    #[test]
    fn arrows_down_between_crates_rooms_and_files_are_counted() {
        let found = told(&[
            ("low/src/lib.rs", "pub mod a; pub use a::A;"),
            ("low/src/a.rs", "pub struct A;"),
            ("high/src/main.rs", "fn main() { high::attic::run() }"),
            ("high/src/lib.rs", "pub mod attic; pub mod cellar;"),
            (
                "high/src/attic.rs",
                "mod box; pub fn run() { crate::cellar::Shelf::new(box::lid(1)) }",
            ),
            (
                "high/src/attic/box.rs",
                "pub fn lid(n: u8) -> low_one::A { std::mem::take(n) }",
            ),
            ("high/src/cellar/mod.rs", "pub struct Shelf;"),
        ]);
        let arrows = "lib to a, main to attic, attic to cellar, attic to box, box to a"
            .split(',')
            .count();
        assert_eq!(
            found,
            Ok(format!(
                "imports: 0 circles, 0 arrows up, in 7 files with {arrows} arrows"
            ))
        );
    }

    #[test]
    fn a_circle_is_told_with_the_lines_that_draw_it() {
        let found = told(&[
            ("low/src/lib.rs", "mod a;\nmod b;\nmod c;"),
            ("low/src/a.rs", "use crate::b::B;\npub struct A;"),
            ("low/src/b.rs", "\nuse super::c;\npub struct B(c::C);"),
            (
                "low/src/c.rs",
                "pub struct C;\nfn f() { println!(\"{}\", crate::a::A) }",
            ),
        ]);
        let lines = [
            "imports: 1 circle, 0 arrows up",
            "a circle:",
            "    low/src/a.rs:1: crate::b::B is in low/src/b.rs",
            "    low/src/b.rs:3: c::C is in low/src/c.rs",
            "    low/src/c.rs:2: crate::a::A is in low/src/a.rs",
        ];
        assert_eq!(found.unwrap_err(), lines.join("\n"));
    }

    #[test]
    fn a_reexport_hides_no_circle() {
        let found = told(&[
            (
                "low/src/lib.rs",
                "mod a; mod b; pub use {a::A, crate::b::B as Bee};",
            ),
            ("low/src/a.rs", "use crate::{Bee};\npub struct A;"),
            (
                "low/src/b.rs",
                "pub struct B; impl B { fn f(self) -> crate::A { self.0 } }",
            ),
        ]);
        assert!(
            found
                .as_ref()
                .unwrap_err()
                .starts_with("imports: 1 circle, 0 arrows up"),
            "{found:?}"
        );
    }

    #[test]
    fn a_module_that_uses_what_its_parent_defines_points_up() {
        let (lib, child) = ("mod a; pub struct Top;", "mod b { use super::super::Top; }");
        let found = told(&[("low/src/lib.rs", lib), ("low/src/a.rs", child)]);
        assert_eq!(
            found.unwrap_err(),
            "imports: 0 circles, 1 arrow up\n\
             low/src/a.rs:1: super::super::Top is in low/src/lib.rs: up to the file that declares this module"
        );
        let (lib, child) = (
            "mod a; mod b; pub use b::Top;",
            "use crate::Top; use super::Top as Other;",
        );
        let found = told(&[
            ("low/src/lib.rs", lib),
            ("low/src/a.rs", child),
            ("low/src/b.rs", "pub enum Top {}"),
        ]);
        assert_eq!(
            found.unwrap(),
            "imports: 0 circles, 0 arrows up, in 3 files with 2 arrows"
        );
    }

    #[test]
    fn a_lower_room_must_not_know_a_higher_one() {
        let found = told(&[
            ("high/src/lib.rs", "pub mod attic; pub mod cellar;"),
            ("high/src/attic.rs", "pub struct Trunk;"),
            ("high/src/cellar.rs", "mod shelf;"),
            ("high/src/cellar/shelf.rs", "use crate::{attic::{self, Trunk}};"),
        ]);
        assert_eq!(
            found.unwrap_err(),
            "imports: 0 circles, 1 arrow up\n\
             high/src/cellar/shelf.rs:1: crate::attic::Trunk is in high/src/attic.rs: up from cellar to attic"
        );
    }

    #[test]
    fn a_crate_must_not_know_one_above_it() {
        let found = told(&[
            ("high/src/lib.rs", "#[macro_export] macro_rules! say { () => {} }"),
            ("low/src/lib.rs", "fn f() { high::say!() }"),
        ]);
        assert_eq!(
            found.unwrap_err(),
            "imports: 0 circles, 1 arrow up\n\
             low/src/lib.rs:1: high::say is in high/src/lib.rs: low-one must not know high"
        );
    }

    #[test]
    fn tests_comments_and_text_draw_no_arrows() {
        let found = told(&[
            ("low/src/lib.rs", "mod a; pub struct Top;"),
            (
                "low/src/a.rs",
                "//! crate::Top\n/* crate::Top */ const A: &str = \"crate::Top\";\n#[cfg(test)]\nuse crate::{Top};\n\
                 #[cfg(all(test, unix))]\n#[allow(x)]\nmod tests { use super::super::Top; }\n\
                 fn f<'a>(x: &'a X) -> Y { x.crate_::<Top>() }",
            ),
        ]);
        assert_eq!(
            found.unwrap(),
            "imports: 0 circles, 0 arrows up, in 2 files with 0 arrows"
        );
    }

    #[test]
    fn a_crate_or_a_room_that_is_not_in_the_table_is_refused() {
        let found = told(&[("new/Cargo.toml", "[package]\nname = \"new\"\n")]);
        assert_eq!(
            found.unwrap_err(),
            "the crate new has no row in the table of imports.rs"
        );
        let found = told(&[
            ("high/src/lib.rs", "pub mod hut; pub mod cellar;"),
            ("high/src/hut.rs", "use crate::cellar::Shelf;"),
            ("high/src/cellar.rs", "pub struct Shelf;"),
        ]);
        assert!(
            found
                .as_ref()
                .unwrap_err()
                .ends_with("the room hut has no place in the table of imports.rs"),
            "{found:?}"
        );
    }
}
