//! Whether the packages are such as `deny.toml` allows.

use std::collections::{BTreeMap, BTreeSet};

use spdx::{Expression, LicenseReq, Licensee};
use toml::{Table, Value};

use crate::packages::{Package, Packages};

/// What `deny.toml` says.
#[derive(Clone, Debug)]
pub struct Policy {
    allowed: Vec<Licensee>,
    /// Further licences of single packages.
    exceptions: BTreeMap<String, Vec<Licensee>>,
    /// Expressions of packages whose manifest has none.
    clarified: BTreeMap<String, String>,
    registries: Vec<String>,
    /// Packages that may be there in more than one version: those named.
    skipped: BTreeSet<String>,
}

impl Policy {
    /// Reads `deny.toml`.
    ///
    /// # Errors
    /// It is no TOML, names a licence that SPDX does not know, or gives no reason for a second version; in
    /// words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let table: Table = text.parse().map_err(|error| format!("deny.toml: {error}"))?;
        let part = |name| {
            table
                .get(name)
                .and_then(Value::as_table)
                .ok_or(format!("deny.toml: no [{name}]"))
        };
        let (licences, sources, bans) = (part("licenses")?, part("sources")?, part("bans")?);
        let mut policy = Self {
            allowed: known(licences.get("allow"))?,
            exceptions: BTreeMap::new(),
            clarified: BTreeMap::new(),
            registries: texts(sources.get("allow-registry")),
            skipped: BTreeSet::new(),
        };
        for exception in list(licences.get("exceptions")) {
            let name = text_of(exception, "crate").ok_or("deny.toml: an exception names no crate")?;
            policy.exceptions.insert(name, known(exception.get("allow"))?);
        }
        for clarify in list(licences.get("clarify")) {
            let said = text_of(clarify, "crate").zip(text_of(clarify, "expression"));
            policy.clarified.extend(said);
        }
        for skip in list(bans.get("skip")) {
            let spec = text_of(skip, "crate").ok_or("deny.toml: a skip names no crate")?;
            if text_of(skip, "reason").is_none_or(|reason| reason.is_empty()) {
                return Err(format!("deny.toml: no reason is given for a second {spec}"));
            }
            policy.skipped.insert(spec);
        }
        Ok(policy)
    }

    /// The licence of a package, as its manifest says it or else as `deny.toml` does.
    pub fn licence(&self, package: &Package) -> Option<String> {
        package
            .licence
            .clone()
            .or_else(|| self.clarified.get(&package.name).cloned())
    }

    /// What is wrong with the packages, one a line; nothing if all is well.
    pub fn findings(&self, packages: &Packages) -> Vec<String> {
        let mut findings = Vec::new();
        for (id, package) in &packages.all {
            let Package { name, version, .. } = package;
            if let Some(source) = &package.source
                && !self
                    .registries
                    .iter()
                    .any(|allowed| source.strip_prefix("registry+") == Some(allowed))
            {
                findings.push(format!(
                    "{name} {version} comes from {source}; crates.io alone is allowed"
                ));
            }
            if let Err(why) = self.licensed(package, packages.image.contains(id)) {
                findings.push(format!("{name} {version}: {why}"));
            }
        }
        findings.extend(self.versions(packages));
        findings
    }

    /// Whether a package may be used; in the image without exceptions.
    fn licensed(&self, package: &Package, in_image: bool) -> Result<(), String> {
        let licence = self
            .licence(package)
            .ok_or("its manifest names no licence; deny.toml can clarify it")?;
        let expression = read(&licence)?;
        let exceptions = match in_image {
            true => None,
            false => self.exceptions.get(&package.name),
        };
        let granted = |asked: &LicenseReq| {
            let extra = exceptions.into_iter().flatten();
            self.allowed
                .iter()
                .chain(extra)
                .any(|licence| licence.satisfies(asked))
        };
        match expression.evaluate(granted) {
            true => Ok(()),
            false if in_image => Err(format!("{licence} is not allowed in the image")),
            false => Err(format!("{licence} is not allowed")),
        }
    }

    /// Second versions without a reason, and reasons for what is there once.
    fn versions(&self, packages: &Packages) -> Vec<String> {
        let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (name, version) in packages.all.keys() {
            versions.entry(name).or_default().push(version);
        }
        let skips = |name: &str, version: &str| {
            self.skipped.contains(name)
                || self
                    .skipped
                    .iter()
                    .filter_map(|spec| spec.strip_prefix(name)?.strip_prefix('@'))
                    .any(|skipped| version == skipped || version.starts_with(&format!("{skipped}.")))
        };
        let mut findings = Vec::new();
        for (name, versions) in &versions {
            let counted: Vec<_> = versions.iter().filter(|version| !skips(name, version)).collect();
            if versions.len() > 1 && counted.len() > 1 {
                findings.push(format!(
                    "{name} is there in {} versions: {}",
                    versions.len(),
                    versions.join(", ")
                ));
            }
        }
        for spec in &self.skipped {
            let name = spec.split('@').next().unwrap_or(spec);
            if versions.get(name).is_none_or(|versions| versions.len() < 2) {
                findings.push(format!(
                    "deny.toml has a reason for a second {name}, and there is one"
                ));
            }
        }
        findings
    }

    /// The licences that are taken of those that an expression offers, as cargo-deny would take them: the
    /// least of those allowed.
    ///
    /// # Errors
    /// SPDX does not know it, or it is not allowed; in words.
    pub fn taken(&self, package: &Package) -> Result<Vec<LicenseReq>, String> {
        let licence = self.licence(package).ok_or("it names no licence")?;
        let mut accepted = self.allowed.clone();
        accepted.extend(self.exceptions.get(&package.name).into_iter().flatten().cloned());
        read(&licence)?
            .minimized_requirements(&accepted)
            .map_err(|error| format!("{licence}: {error}"))
    }
}

/// An expression, in the form that old manifests have too.
fn read(licence: &str) -> Result<Expression, String> {
    Expression::parse_mode(licence, spdx::ParseMode::LAX)
        .map_err(|error| format!("`{licence}`: {}", error.reason))
}

fn list(value: Option<&Value>) -> impl Iterator<Item = &Value> {
    value.and_then(Value::as_array).into_iter().flatten()
}

fn texts(value: Option<&Value>) -> Vec<String> {
    list(value).filter_map(Value::as_str).map(str::to_owned).collect()
}

fn text_of(value: &Value, key: &str) -> Option<String> {
    value.get(key)?.as_str().map(str::to_owned)
}

fn known(value: Option<&Value>) -> Result<Vec<Licensee>, String> {
    let parse = |name: String| {
        Licensee::parse(&name).map_err(|error| format!("deny.toml: `{name}`: {}", error.reason))
    };
    texts(value).into_iter().map(parse).collect()
}
