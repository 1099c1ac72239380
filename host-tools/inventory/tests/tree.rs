//! Whether this workspace is made of what it may be made of, and says so.

use std::fs;
use std::sync::LazyLock;

use bead_inventory::packages::{Packages, Product};
use bead_inventory::policy::Policy;
use bead_inventory::{PAGE, bill, notices, root};

fn packages() -> Packages {
    static PACKAGES: LazyLock<Packages> = LazyLock::new(|| Packages::of(root()).expect("cargo tells"));
    PACKAGES.clone()
}

fn deny() -> String {
    fs::read_to_string(root().join("deny.toml")).expect("it is committed")
}

fn policy() -> Policy {
    Policy::parse(&deny()).expect("it is well-formed")
}

#[test]
fn every_package_has_an_allowed_licence_and_origin_and_one_version_or_a_reason() {
    let findings = policy().findings(&packages());
    assert!(findings.is_empty(), "\n{}", findings.join("\n"));
}

#[test]
fn what_is_not_allowed_is_found_in_image_and_tools() {
    let changed = |package: &str, change: fn(&mut bead_inventory::packages::Package)| {
        let mut packages = packages();
        let found = packages.all.values_mut().find(|found| found.name == package);
        change(found.expect("it is linked"));
        policy().findings(&packages)
    };
    let mpl = "MPL-2.0";
    for package in ["heapless", "clap"] {
        let findings = changed(package, |package| {
            package.licence = Some("GPL-3.0-only AND MIT".into())
        });
        assert!(
            findings.len() == 1 && findings[0].contains("GPL-3.0-only AND MIT is not allowed"),
            "{findings:?}"
        );
        let findings = changed(package, |package| package.licence = None);
        assert!(
            findings.len() == 1 && findings[0].contains("names no licence"),
            "{findings:?}"
        );
        let findings = changed(package, |package| package.licence = Some("my own".into()));
        assert!(
            findings.len() == 1 && findings[0].contains("`my own`"),
            "{findings:?}"
        );
        let findings = changed(package, |package| {
            package.source = Some("git+https://github.com/a/b".into())
        });
        assert!(
            findings.len() == 1 && findings[0].contains("crates.io alone"),
            "{findings:?}"
        );
    }
    // What a tool may be linked with by way of exception, the image may not.
    let mut packages = packages();
    let exception = packages
        .all
        .keys()
        .find(|(name, _)| name == "serialport")
        .cloned()
        .unwrap();
    assert_eq!(packages.all[&exception].licence.as_deref(), Some(mpl));
    packages.image.insert(exception);
    let findings = policy().findings(&packages);
    assert!(
        findings.len() == 1 && findings[0].contains("MPL-2.0 is not allowed in the image"),
        "{findings:?}"
    );
}

#[test]
fn a_second_version_needs_a_reason_and_a_reason_a_second_version() {
    let mut packages = packages();
    let (id, package) = packages
        .all
        .iter()
        .find(|((name, _), _)| name == "heapless")
        .unwrap();
    let second = bead_inventory::packages::Package {
        version: "0.0.1".into(),
        ..package.clone()
    };
    packages
        .all
        .insert((id.0.clone(), second.version.clone()), second);
    let findings = policy().findings(&packages);
    assert!(
        findings.len() == 1 && findings[0].starts_with("heapless is there in 2 versions"),
        "{findings:?}"
    );

    let skipped = deny().replace(
        "skip = [",
        "skip = [\n    { crate = \"heapless@0.0.1\", reason = \"none\" },",
    );
    assert_eq!(
        Policy::parse(&skipped).unwrap().findings(&packages),
        Vec::<String>::new()
    );
    let findings = Policy::parse(&skipped).unwrap().findings(&self::packages());
    assert!(
        findings.len() == 1 && findings[0].contains("second heapless"),
        "{findings:?}"
    );
    let without = skipped.replace("reason = \"none\"", "reason = \"\"");
    assert!(Policy::parse(&without).unwrap_err().contains("no reason"));
}

#[test]
fn the_page_names_all_that_others_made() {
    let page = notices::page(&packages(), &policy()).unwrap();
    let committed = fs::read_to_string(root().join(PAGE)).unwrap_or_default();
    assert!(
        page == committed,
        "{PAGE} is not what cargo links: `cargo xtask notices` writes it anew"
    );
    assert!(page.contains("| [heapless ") && page.contains("| [serialport "));
}

#[test]
fn every_package_has_a_text_of_its_licence() {
    let packages = packages();
    let texts = notices::texts(&packages, &policy()).unwrap();
    for id in packages.image.union(&packages.tools) {
        let package = &packages.all[id];
        let named = format!("{} {}", package.name, package.version);
        assert!(package.source.is_none() || texts.contains(&named), "{named}");
    }
    for words in [
        "Permission is hereby granted",
        "Apache License",
        "Mozilla Public License",
    ] {
        assert!(texts.contains(words), "{words}");
    }
}

#[test]
fn a_bill_of_materials_has_each_package_once_with_checksum_and_licence() {
    let packages = packages();
    for (product, linked) in [
        (Product::Image, &packages.image),
        (Product::Tools, &packages.tools),
    ] {
        let bill = bill::of(&packages, &policy(), product).unwrap();
        let components = bill["components"].as_array().unwrap();
        // The program itself is not a part of itself.
        assert_eq!(components.len(), linked.len() - 1);
        assert_eq!(bill["metadata"]["component"]["name"], product.package());
        let mut references: Vec<_> = components
            .iter()
            .map(|part| part["bom-ref"].as_str().unwrap())
            .collect();
        references.push(bill["metadata"]["component"]["bom-ref"].as_str().unwrap());
        for part in components {
            let ours = part.get("purl").is_none();
            let checksum = part["hashes"][0]["content"].as_str().unwrap_or_default();
            assert!(ours || checksum.len() == 64, "{part}");
            let licence = part["licenses"][0]["expression"].as_str().unwrap();
            assert!(spdx::Expression::parse(licence).is_ok(), "{part}");
        }
        let dependencies = bill["dependencies"].as_array().unwrap();
        assert_eq!(dependencies.len(), linked.len());
        for needed in dependencies
            .iter()
            .flat_map(|part| part["dependsOn"].as_array().unwrap())
        {
            assert!(references.contains(&needed.as_str().unwrap()), "{needed}");
        }
    }
}
