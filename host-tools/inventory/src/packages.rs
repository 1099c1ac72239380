//! The packages of a program, as cargo resolves them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Something that is given to users.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// The flash image.
    Image,
    /// `bead` and `bead-figures`, on the systems that they run on.
    Tools,
}

impl Product {
    /// What cargo calls it.
    fn selection(self) -> &'static str {
        match self {
            Product::Image => "-p bead-firmware --target thumbv7em-none-eabihf",
            Product::Tools => {
                "-p absorber-bead -p bead-figures --target x86_64-unknown-linux-gnu --target aarch64-unknown-linux-gnu"
            }
        }
    }

    /// Its package, the first if it has several.
    pub fn package(self) -> &'static str {
        match self {
            Product::Image => "bead-firmware",
            Product::Tools => "absorber-bead",
        }
    }
}

/// What is built here is built for one of these.
const SYSTEMS: [&str; 3] = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "thumbv7em-none-eabihf",
];

/// A package by name and version.
pub type Id = (String, String);

/// A package of the workspace's lock file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SPDX expression, as its manifest says it.
    pub licence: Option<String>,
    /// Who wrote it, as the manifest says.
    pub authors: Vec<String>,
    /// Where it is developed.
    pub repository: Option<String>,
    /// Where it comes from; `None` for one of this workspace.
    pub source: Option<String>,
    /// SHA-256 of its archive, from the lock file, in hexadecimal.
    pub checksum: Option<String>,
    /// The folder that it is in.
    pub folder: PathBuf,
    /// The packages that it is built from and with, for any system and in any feature that is on.
    pub needs: BTreeSet<Id>,
}

/// All packages of the lock file, and which of them is linked into what.
#[derive(Clone, Debug)]
pub struct Packages {
    /// All that cargo would use here, whatever for.
    pub all: BTreeMap<Id, Package>,
    /// What is linked into the image, `core` apart.
    pub image: BTreeSet<Id>,
    /// What is linked into the tools, `std` apart.
    pub tools: BTreeSet<Id>,
}

impl Packages {
    /// Asks cargo about the workspace at `root`. Cargo downloads what no build has asked for so far, such as
    /// the packages of the other one of our systems.
    ///
    /// # Errors
    /// Cargo does not run, or fails, or says something else than it does today; in words.
    pub fn of(root: &Path) -> Result<Self, String> {
        let systems = |option: &str| -> String {
            let systems = SYSTEMS.iter();
            systems.map(|system| format!(" {option} {system}")).collect()
        };
        // Without systems it would download those of all others.
        let metadata = format!(
            "metadata --format-version 1 --locked{}",
            systems("--filter-platform")
        );
        let told = cargo(root, &metadata)?;
        let metadata = serde_json::from_str(&told).map_err(|error| format!("cargo metadata: {error}"))?;
        let lock = std::fs::read_to_string(root.join("Cargo.lock"))
            .map_err(|error| format!("Cargo.lock: {error}"))?;
        let mut all = packages(&metadata, &lock)?;
        let tree = |words: &str| -> Result<BTreeSet<Id>, String> {
            let told = cargo(
                root,
                &format!("tree --locked --prefix none --format {{p}} {words}"),
            )?;
            let ids: BTreeSet<Id> = told.lines().filter_map(id_of_line).collect();
            match ids.iter().find(|id| !all.contains_key(*id)) {
                Some((name, version)) => Err(format!("cargo metadata does not know {name} {version}")),
                None => Ok(ids),
            }
        };
        let linked =
            |product: Product| tree(&format!("--edges normal,no-proc-macro {}", product.selection()));
        // `cargo metadata` names optional dependencies too that no feature turns on.
        let used = tree(&format!(
            "--workspace --edges normal,build,dev{}",
            systems("--target")
        ))?;
        let (image, tools) = (linked(Product::Image)?, linked(Product::Tools)?);
        all.retain(|id, _| used.contains(id));
        Ok(Self { all, image, tools })
    }

    /// What is linked into a product.
    pub fn linked(&self, product: Product) -> impl Iterator<Item = &Package> {
        let ids = match product {
            Product::Image => &self.image,
            Product::Tools => &self.tools,
        };
        ids.iter().map(|id| &self.all[id])
    }
}

fn cargo(root: &Path, words: &str) -> Result<String, String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(root).args(words.split(' '));
    let output = command
        .output()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!(
            "cargo {words}: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        )),
    }
}

/// From "serde v1.0.229 (*)" or "bead v0.1.0 (/folder)".
fn id_of_line(line: &str) -> Option<Id> {
    let mut words = line.split(' ');
    let name = words.next()?;
    let version = words.next()?.strip_prefix('v')?;
    Some((name.to_owned(), version.to_owned()))
}

fn packages(metadata: &Value, lock: &str) -> Result<BTreeMap<Id, Package>, String> {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let nodes = list(&metadata["resolve"]["nodes"]);
    let used: BTreeSet<_> = nodes.iter().map(|node| text(&node["id"])).collect();
    let mut packages = list(&metadata["packages"]);
    packages.retain(|package| used.contains(&text(&package["id"])));
    let mut ids = BTreeMap::new();
    for package in &packages {
        let id = text(&package["name"]).zip(text(&package["version"]));
        ids.insert(text(&package["id"]), id.ok_or("a package has no name")?);
    }
    let needs: BTreeMap<_, _> = nodes
        .iter()
        .map(|node| {
            let ids = list(&node["dependencies"])
                .into_iter()
                .filter_map(|id| ids.get(&text(&id)).cloned());
            (text(&node["id"]), ids.collect::<BTreeSet<_>>())
        })
        .collect();
    let checksums = checksums(lock)?;
    let package = |value: &Value| {
        let id = ids[&text(&value["id"])].clone();
        let manifest = PathBuf::from(text(&value["manifest_path"]).unwrap_or_default());
        let package = Package {
            name: id.0.clone(),
            version: id.1.clone(),
            licence: text(&value["license"]),
            authors: list(&value["authors"]).iter().filter_map(text).collect(),
            repository: text(&value["repository"]),
            source: text(&value["source"]),
            checksum: checksums.get(&id).cloned(),
            folder: manifest.parent().map(Path::to_owned).unwrap_or_default(),
            needs: needs.get(&text(&value["id"])).cloned().unwrap_or_default(),
        };
        (id, package)
    };
    Ok(packages.iter().map(package).collect())
}

fn checksums(lock: &str) -> Result<BTreeMap<Id, String>, String> {
    let lock: toml::Table = lock.parse().map_err(|error| format!("Cargo.lock: {error}"))?;
    let packages = lock.get("package").and_then(toml::Value::as_array);
    let text = |package: &toml::Value, key| package.get(key)?.as_str().map(str::to_owned);
    let checksum = |package| {
        Some((
            (text(package, "name")?, text(package, "version")?),
            text(package, "checksum")?,
        ))
    };
    Ok(packages.into_iter().flatten().filter_map(checksum).collect())
}
