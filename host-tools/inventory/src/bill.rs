//! Bills of materials: what a program is made of, for machines, as CycloneDX 1.5
//! (<https://cyclonedx.org/docs/1.5/json/>).

use std::collections::BTreeSet;

use serde_json::{Value, json};

use crate::packages::{Id, Package, Packages, Product};
use crate::policy::Policy;

/// The bill of a product: all that is linked into it, with licence, checksum and origin, and what needs what.
/// It has no time and no random number, so the bill of one commit is always the same.
///
/// # Errors
/// A package has no licence; in words.
pub fn of(packages: &Packages, policy: &Policy, product: Product) -> Result<Value, String> {
    let linked: Vec<&Package> = packages.linked(product).collect();
    let ids: BTreeSet<Id> = linked
        .iter()
        .map(|package| (package.name.clone(), package.version.clone()))
        .collect();
    let (mut root, mut components, mut dependencies) = (Value::Null, Vec::new(), Vec::new());
    for package in linked {
        let component = component(package, policy)?;
        let needs = package
            .needs
            .intersection(&ids)
            .map(reference)
            .collect::<Vec<_>>();
        dependencies.push(json!({ "ref": component["bom-ref"], "dependsOn": needs }));
        match package.name == product.package() {
            true => root = component,
            false => components.push(component),
        }
    }
    let kind = match product {
        Product::Image => "firmware",
        Product::Tools => "application",
    };
    root["type"] = kind.into();
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": root },
        "components": components,
        "dependencies": dependencies,
    }))
}

/// How a package is called in other people's lists (<https://github.com/package-url/purl-spec>).
fn reference((name, version): &Id) -> String {
    format!("pkg:cargo/{name}@{version}")
}

fn component(package: &Package, policy: &Policy) -> Result<Value, String> {
    let Package { name, version, .. } = package;
    let licence = policy
        .licence(package)
        .ok_or(format!("{name} {version} names no licence"))?;
    let reference = reference(&(name.clone(), version.clone()));
    let mut component = json!({
        "type": "library",
        "bom-ref": reference,
        "name": name,
        "version": version,
        // Before there was SPDX, a slash stood for OR.
        "licenses": [{ "expression": licence.replace(" / ", " OR ").replace('/', " OR ") }],
    });
    if package.source.is_some() {
        component["purl"] = reference.into();
    }
    if let Some(checksum) = &package.checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
    }
    if let Some(repository) = &package.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
    }
    Ok(component)
}
