//! `bead-inventory`: writes what others made in image and tools: `page` for the repository; `release FOLDER`,
//! the licences' texts and the bills of materials, for an archive.

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use bead_inventory::packages::{Packages, Product};
use bead_inventory::policy::Policy;
use bead_inventory::{bill, notices};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["page"] => page(),
        ["release", folder] => release(Path::new(folder)),
        _ => {
            eprintln!("usage: bead-inventory page | release FOLDER");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}

/// The workspace, its packages, and what is allowed.
fn read() -> Result<(Packages, Policy), String> {
    let packages = Packages::of(bead_inventory::root())?;
    let deny = fs::read_to_string(bead_inventory::root().join("deny.toml"));
    let policy = Policy::parse(&deny.map_err(|error| format!("deny.toml: {error}"))?)?;
    Ok((packages, policy))
}

fn page() -> Result<(), String> {
    let (packages, policy) = read()?;
    write(
        &bead_inventory::root().join(bead_inventory::PAGE),
        &notices::page(&packages, &policy)?,
    )
}

fn release(folder: &Path) -> Result<(), String> {
    let (packages, policy) = read()?;
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    write(&folder.join("licences.txt"), &notices::texts(&packages, &policy)?)?;
    for product in [Product::Image, Product::Tools] {
        let bill = bill::of(&packages, &policy, product)?;
        let file = folder.join(format!("{}.cdx.json", product.package()));
        write(&file, &format!("{bill:#}\n"))?;
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    println!("{} has {} bytes", path.display(), text.len());
    Ok(())
}
