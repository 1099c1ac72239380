//! Catalogues of springs that can be bought.

use std::collections::HashSet;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::OptimiseError;
use crate::scenario::{InputError, TableCheck, TomlFile, ValueRange, read_text};

/// Greatest loss factor of a search: a damper a thousand times as stiff as its spring holds the intruder
/// fast.
const LOSS_FACTOR_MOST: f64 = 1e3;

/// A spring that can be bought, or an intruder that is sold as a whole.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CatalogueSpring {
    /// Name or order number.
    pub name: String,
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping, N·s/m, of a spring that has one of its own. Without it and a loss factor, the damping is
    /// searched.
    #[serde(default)]
    pub damping: Option<f64>,
    /// Loss factor η = c / √(k m) of its material.
    #[serde(default)]
    pub loss_factor: Option<f64>,
    /// Mass of the intruder, kg, if it comes with the spring. Without it, the mass is searched.
    #[serde(default)]
    pub mass: Option<f64>,
    /// Greatest displacement that it allows, m.
    #[serde(default)]
    pub stroke: Option<f64>,
}

/// Springs to choose from, from the softest to the stiffest.
#[derive(Debug, Clone, PartialEq)]
pub struct Catalogue {
    springs: Vec<CatalogueSpring>,
}

/// The text of a catalogue.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CatalogueText {
    #[serde(default, rename = "spring")]
    springs: Vec<CatalogueSpring>,
}

impl Catalogue {
    /// Reads a catalogue in TOML, a `[[spring]]` for each spring; `file` is its name in messages.
    ///
    /// # Errors
    /// [`InputError`] with file, line and key: a value is missing, unknown or out of range.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, InputError> {
        let file = TomlFile::parse(text, file)?;
        let CatalogueText { mut springs } = file.read()?;
        check(&springs).map_err(|error| file.locate(error))?;
        springs.sort_by(|one, other| one.stiffness.total_cmp(&other.stiffness));
        Ok(Self { springs })
    }

    /// Reads a file as [`from_toml`](Self::from_toml) does.
    ///
    /// # Errors
    /// As for `from_toml`, and if the file cannot be read.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, InputError> {
        let path = path.as_ref();
        let text = read_text(path, "a catalogue of springs in TOML")?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// The springs, from the softest to the stiffest.
    pub fn springs(&self) -> &[CatalogueSpring] {
        &self.springs
    }

    /// The springs whose stiffness, damping and mass are in these ranges, where they have them.
    ///
    /// # Errors
    /// [`OptimiseError::Search`] if there is none.
    pub(super) fn within(
        &self,
        [mass, stiffness, damping]: [[f64; 2]; 3],
    ) -> Result<Vec<&CatalogueSpring>, OptimiseError> {
        let inside = |value: Option<f64>, [low, high]: [f64; 2]| {
            value.is_none_or(|value| (low..=high).contains(&value))
        };
        let springs = self.springs.iter().filter(|spring| {
            inside(Some(spring.stiffness), stiffness)
                && inside(spring.damping, damping)
                && inside(spring.mass, mass)
        });
        let springs: Vec<_> = springs.collect();
        if !springs.is_empty() {
            return Ok(springs);
        }
        let what = format!(
            "none of its {} springs is within the bounds: {:e} to {:e} N/m, {:e} to {:e} N·s/m, {:e} to {:e} kg",
            self.springs.len(),
            stiffness[0],
            stiffness[1],
            damping[0],
            damping[1],
            mass[0],
            mass[1],
        );
        let advice = "widen the bounds, or name another catalogue";
        Err(OptimiseError::Search(InputError::at("catalogue", what, advice)))
    }
}

/// Refuses a loss factor of a spring or of a search that is out of range.
pub(super) fn check_loss_factor(key: &str, factor: Option<f64>) -> Result<(), InputError> {
    let Some(factor) = factor.filter(|factor| !(*factor > 0.0 && *factor <= LOSS_FACTOR_MOST)) else {
        return Ok(());
    };
    let what = format!("{factor} is not a loss factor c/√(k m)");
    let advice = format!("give a number above 0, at most {LOSS_FACTOR_MOST}, such as 0.1");
    Err(InputError::at(key, what, advice))
}

fn check(springs: &[CatalogueSpring]) -> Result<(), InputError> {
    if springs.is_empty() {
        let advice = "add a [[spring]] with name and stiffness";
        return Err(InputError::at("", "it has no spring", advice));
    }
    let mut names = HashSet::new();
    for (spring, number) in springs.iter().zip(1..) {
        let at = TableCheck::of(format!("spring[{number}]."));
        let name = &spring.name;
        if name.is_empty() || name.chars().any(char::is_control) || !names.insert(name) {
            let what = format!("{name:?} is not a unique name on one line");
            let advice = "give each spring a name of its own";
            return Err(InputError::at(format!("spring[{number}].name"), what, advice));
        }
        for (key, value, unit) in [
            ("stiffness", Some(spring.stiffness), "N/m, such as 3.95e5"),
            ("damping", spring.damping, "N·s/m, such as 12.0"),
            ("mass", spring.mass, "kg, such as 3.7e-3"),
            ("stroke", spring.stroke, "m, such as 2e-5"),
        ] {
            at.check(key, value, ValueRange::Positive(unit))?;
        }
        let key = format!("spring[{number}].loss_factor");
        check_loss_factor(&key, spring.loss_factor)?;
        if spring.loss_factor.is_some() && spring.damping.is_some() {
            let what = "a spring has either a damping or a loss factor";
            return Err(InputError::at(key, what, "leave one of them out"));
        }
    }
    Ok(())
}
