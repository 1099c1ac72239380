//! Imports inside each crate point down: no circle between files, and no file that uses what the file
//! declaring it defines. Imports between crates are in their manifests.
//!
//! # Design
//! A path is an arrow to the file that *defines* its item: re-exports are followed, modules are passed
//! through. Paths in function bodies and in macros with the syntax of calls count as well as those after
//! `use`. Items under `cfg(test)` are skipped.

#![allow(clippy::unwrap_used, reason = "a source that cannot be read fails the test")]

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, ItemMod, ItemUse, Macro, Token, UseTree};

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
#[derive(Default)]
struct Module {
    file: PathBuf,
    parent: Option<usize>,
    children: HashMap<String, usize>,
    /// Names brought by `use`, with the paths that they stand for.
    names: HashMap<String, Vec<String>>,
    /// All paths of the file.
    paths: BTreeSet<Vec<String>>,
    /// Modules that are declared here and lie in files of their own.
    declared: Vec<String>,
    /// Number of inline modules around the item that is read.
    depth: usize,
}

impl Module {
    fn add(&mut self, mut path: Vec<String>) -> Vec<String> {
        // The first `super` of an inline module is this file.
        let supers = path.iter().take_while(|word| *word == "super").count();
        path[..supers.min(self.depth)].fill("self".into());
        self.paths.insert(path.clone());
        path
    }

    fn add_use(&mut self, tree: &UseTree, before: &[String]) {
        let with = |name: &syn::Ident| [before, &[word(name)]].concat();
        let (name, path) = match tree {
            UseTree::Path(part) => return self.add_use(&part.tree, &with(&part.ident)),
            UseTree::Group(group) => {
                return group.items.iter().for_each(|item| self.add_use(item, before));
            }
            UseTree::Glob(_) => ("*".to_owned(), [before, &["*".to_owned()]].concat()),
            UseTree::Name(item) if item.ident == "self" => {
                (before[before.len() - 1].clone(), before.to_vec())
            }
            UseTree::Name(item) => (word(&item.ident), with(&item.ident)),
            UseTree::Rename(item) => (word(&item.rename), with(&item.ident)),
        };
        let path = self.add(path);
        self.names.insert(name, path);
    }
}

fn word(name: &syn::Ident) -> String {
    name.to_string().trim_start_matches("r#").to_owned()
}

impl<'a> Visit<'a> for Module {
    fn visit_item(&mut self, item: &'a Item) {
        let attributes: &[Attribute] = match item {
            Item::Mod(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Fn(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            _ => &[],
        };
        if !attributes.iter().any(is_for_tests) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'a ItemMod) {
        if item.content.is_none() {
            self.declared.push(word(&item.ident));
        }
        self.depth += 1;
        visit::visit_item_mod(self, item);
        self.depth -= 1;
    }

    fn visit_item_use(&mut self, item: &'a ItemUse) {
        self.add_use(&item.tree, &[]);
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        if path.leading_colon.is_none() && path.segments.len() > 1 {
            self.add(path.segments.iter().map(|part| word(&part.ident)).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'a Macro) {
        self.visit_path(&call.path);
        let arguments = call.parse_body_with(Punctuated::<Expr, Token![,]>::parse_terminated);
        for argument in arguments.iter().flatten() {
            Visit::visit_expr(self, argument);
        }
    }
}

/// True for `#[cfg(test)]` and `#[cfg(all(test, …))]`.
fn is_for_tests(attribute: &Attribute) -> bool {
    let condition = attribute.meta.require_list().map(|list| list.tokens.to_string());
    let condition = condition.unwrap_or_default();
    let mut words = condition.split(|c: char| !c.is_alphanumeric());
    attribute.path().is_ident("cfg") && words.any(|word| word == "test") && !condition.contains("not")
}

/// Reads a file and those of the modules that it declares, in the folder `parts`; its place in `modules`.
fn read(file: PathBuf, parts: &Path, parent: Option<usize>, modules: &mut Vec<Module>) -> usize {
    let at = modules.len();
    let source = syn::parse_file(&fs::read_to_string(&file).unwrap());
    let source = source.unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut module = Module {
        file,
        parent,
        ..Module::default()
    };
    module.visit_file(&source);
    let declared = std::mem::take(&mut module.declared);
    modules.push(module);
    for name in declared {
        let (beside, below) = (parts.join(format!("{name}.rs")), parts.join(&name));
        let file = Some(beside).filter(|file| file.exists());
        let file = file.unwrap_or_else(|| below.join("mod.rs"));
        let child = read(file, &below, Some(at), modules);
        modules[at].children.insert(name, child);
    }
    at
}

/// The module that a path names (`Ok`) or that defines the named item (`Err`); `None` in other crates.
fn resolve(modules: &[Module], from: usize, path: &[String], depth: usize) -> Option<Result<usize, usize>> {
    let mut here = from;
    for (index, name) in path.iter().enumerate() {
        let module = &modules[here];
        let named = module
            .names
            .get(name)
            .filter(|named| depth < 16 && *named != path);
        match name.as_str() {
            "crate" => here = 0,
            "self" => {}
            "super" => here = module.parent?,
            "*" => return Some(Err(here)),
            name if module.children.contains_key(name) => here = module.children[name],
            _ => match named {
                Some(named) => match resolve(modules, here, named, depth + 1)? {
                    Ok(module) => here = module,
                    item => return Some(item),
                },
                None if index > 0 => return Some(Err(here)),
                None => return None,
            },
        }
    }
    Some(Ok(here))
}

/// The faults of one crate, one a line.
fn faults(folder: &Path) -> Vec<String> {
    let mut faults = Vec::new();
    for file in ["src/lib.rs", "src/main.rs"] {
        let file = folder.join(file);
        if file.exists() {
            let mut modules = Vec::new();
            read(file, &folder.join("src"), None, &mut modules);
            check(&modules, &mut faults);
        }
    }
    faults
}

fn check(modules: &[Module], faults: &mut Vec<String>) {
    let mut arrows = HashMap::new();
    for (from, module) in modules.iter().enumerate() {
        for path in &module.paths {
            let Some(Err(to)) = resolve(modules, from, path, 0).filter(|to| *to != Err(from)) else {
                continue;
            };
            let [user, definer] = [from, to].map(|of| modules[of].file.display());
            let place = format!("{user}: {} is in {definer}", path.join("::"));
            let mut ancestors = std::iter::successors(Some(from), |&module| modules[module].parent);
            if ancestors.any(|ancestor| ancestor == to) {
                faults.push(format!("{place}, which declares this module"));
            }
            arrows.entry((from, to)).or_insert(place);
        }
    }
    // A file without imports, or that no file imports, is on no circle.
    loop {
        let [users, definers] = [|arrow: &(usize, usize)| arrow.0, |arrow: &(usize, usize)| arrow.1]
            .map(|end| arrows.keys().map(end).collect::<BTreeSet<_>>());
        let before = arrows.len();
        arrows.retain(|(from, to), _| users.contains(to) && definers.contains(from));
        if arrows.len() == before {
            break;
        }
    }
    if !arrows.is_empty() {
        let mut places: Vec<String> = arrows.into_values().collect();
        places.sort();
        faults.push(format!("a circle:\n    {}", places.join("\n    ")));
    }
}

#[test]
fn circles_and_arrows_up_are_found_and_nothing_else() {
    // Modules are passed through, re-exports are followed, tests and comments are skipped.
    let sound = "
lib.rs: mod a; mod b; mod c; pub use {a::A, crate::b::B as Bee}; fn f() { c::d::run() }
a.rs: #[cfg(test)] use crate::{Bee}; #[cfg(all(test, unix))] mod tests { use super::super::Bee; } // crate::Bee
b.rs: pub struct B; impl B { fn f(self) -> crate::A { std::mem::take(self.0) } }
c/mod.rs: pub mod d;
c/d.rs: use crate::a; use super::super::b::{self, B}; fn run() { a::new(b::x()) }";
    let circle = "
lib.rs: mod a; mod b; pub use {a::A, crate::b::B as Bee};
a.rs: use crate::{Bee};
b.rs: fn f() { println!(\"{}\", crate::A::new()) }";
    let up = "
main.rs: mod a; struct Top;
a.rs: use super::Top;";
    for (files, expected) in [
        (sound, ""),
        (
            circle,
            "a circle:\n    a.rs: crate::Bee is in b.rs\n    b.rs: crate::A::new is in a.rs",
        ),
        (up, "a.rs: super::Top is in main.rs, which declares this module"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join("src/c")).unwrap();
        for (name, text) in files.trim().lines().map(|line| line.split_once(": ").unwrap()) {
            fs::write(folder.path().join("src").join(name), text).unwrap();
        }
        let prefix = format!("{}/src/", folder.path().display());
        assert_eq!(faults(folder.path()).join("\n").replace(&prefix, ""), expected);
    }
}
