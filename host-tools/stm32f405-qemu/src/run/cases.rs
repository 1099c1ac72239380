//! The test cases of an image made with the crate `embedded-test`.
//!
//! Each is a symbol in the section `.embedded_test`. The symbol's name is a JSON object that describes the
//! case. It holds the address of the case's function and the name of its module. The host runs one by giving
//! the image the command line `run_addr ADDRESS`, by semihosting.

use std::path::Path;

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};
use serde::Deserialize;

use super::error::RunError;

/// The section with the cases, and the symbol with the version of their format.
const SECTION: &str = ".embedded_test";
const VERSION_SYMBOL: &str = "EMBEDDED_TEST_VERSION";
/// The supported version.
const VERSION: u32 = 1;

/// A test case of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct TestCase {
    /// Path of the case, without the crate: `tests::it_adds`.
    pub name: String,
    /// Address of the case's function.
    pub address: u32,
    /// True if the case runs only on request.
    pub ignored: bool,
    /// True if the case passes by panicking.
    pub should_panic: bool,
    /// Time limit of the case, in seconds.
    pub timeout_s: Option<u32>,
}

/// The JSON text in a symbol's name.
#[derive(Deserialize)]
struct Described {
    name: String,
    #[serde(default)]
    ignored: bool,
    #[serde(default)]
    should_panic: bool,
    timeout: Option<u32>,
}

/// The test cases of an image, sorted by name. `None` if it was not made with `embedded-test`.
///
/// # Errors
/// [`RunError::ImageMissing`] and [`RunError::NotArmElf`]; the latter also for cases of another format.
pub fn test_cases(elf: &Path) -> Result<Option<Vec<TestCase>>, RunError> {
    let bytes = std::fs::read(elf).map_err(|source| RunError::ImageMissing(elf.into(), source))?;
    let odd = |why: String| RunError::NotArmElf(elf.into(), why);
    let file = object::File::parse(&*bytes).map_err(|e| odd(e.to_string()))?;
    let Some(section) = file.section_by_name(SECTION) else {
        return Ok(None);
    };
    let data = section.data().map_err(|e| odd(e.to_string()))?;
    let word = |address: u64| {
        let at = usize::try_from(address.checked_sub(section.address())?).ok()?;
        Some(u32::from_le_bytes(
            data.get(at..at.checked_add(4)?)?.try_into().ok()?,
        ))
    };
    let symbols = || {
        file.symbols()
            .filter(|symbol| symbol.section_index() == Some(section.index()))
    };
    let version = symbols().find(|symbol| symbol.name() == Ok(VERSION_SYMBOL));
    let version = version.and_then(|symbol| word(symbol.address()));
    if version.is_some_and(|version| version != VERSION) {
        return Err(odd(format!(
            "its embedded-test cases have format {version:?}, but only {VERSION} is known"
        )));
    }
    let mut cases = Vec::new();
    for symbol in symbols() {
        let Ok(name) = symbol.name() else { continue };
        let Ok(described) = serde_json::from_str::<Described>(name) else {
            continue;
        };
        let words = [0, 4, 8].map(|offset| word(symbol.address() + offset));
        let [Some(address), Some(start), Some(length)] = words else {
            return Err(odd(format!(
                "its test case {} is outside {SECTION}",
                described.name
            )));
        };
        let mut segments = file.segments();
        let module = segments.find_map(|s| s.data_range(start.into(), length.into()).ok()?);
        let module = module.unwrap_or_default();
        let module = String::from_utf8_lossy(module);
        // The crate's name is that of the image.
        let module = module.split_once("::").map_or("", |(_, module)| module);
        let separator = if module.is_empty() { "" } else { "::" };
        cases.push(TestCase {
            name: format!("{module}{separator}{}", described.name),
            address,
            ignored: described.ignored,
            should_panic: described.should_panic,
            timeout_s: described.timeout,
        });
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Some(cases))
}
