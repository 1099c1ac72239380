//! The texts of a certificate that are not measured: laboratory, owner, references, conditions.

use bead_model::design::Day;
use hertz_chain::{InputError, TomlFile};
use serde::{Deserialize, Serialize};

/// Longest accepted text, bytes.
const LONGEST: usize = 400;
/// Greatest length of the number of a certificate, which goes into the settings, bytes.
const NUMBER: usize = 16;

/// The texts of a certificate, as a file has them. What is empty is not stated.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct About {
    /// Number of the certificate, up to 16 bytes; it goes into the settings, and so into every strike's
    /// budget.
    pub number: String,
    /// Laboratory that calibrates, with its address.
    pub laboratory: String,
    /// Place of the calibration, if it is another.
    pub place: String,
    /// Owner of the bead.
    pub owner: String,
    /// The bead in words.
    pub item: String,
    /// Temperature.
    pub temperature: String,
    /// Humidity.
    pub humidity: String,
    /// Other conditions, and deviations from the method.
    pub remarks: String,
    /// Person who authorises the certificate.
    pub authorised_by: String,
    /// The references that the results are traceable to.
    #[serde(rename = "reference")]
    pub references: Vec<Reference>,
}

/// A reference, such as a balance or an accelerometer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Reference {
    /// The instrument.
    pub name: String,
    /// The quantity that it gives.
    pub gives: String,
    /// Its certificate.
    pub certificate: String,
    /// Last day on which that holds.
    pub valid_until: Option<Day>,
}

impl About {
    /// Reads a file with the texts of a certificate.
    ///
    /// # Errors
    /// One line: file, line, key, what is wrong and what would do.
    pub fn parse(text: &str, name: &str) -> Result<Self, InputError> {
        let file = TomlFile::parse(text, name)?;
        let about: Self = file.read()?;
        about.check().map_err(|error| file.locate(error))?;
        Ok(about)
    }

    fn check(&self) -> Result<(), InputError> {
        let check = |key: &str, text: &str, most: usize| {
            let is_fit = text.len() <= most && !text.contains(char::is_control);
            let what = format!("the text is longer than {most} bytes or contains control characters");
            let refused = || InputError::at(key, what, "give a shorter text on one line");
            is_fit.then_some(()).ok_or_else(refused)
        };
        check("number", &self.number, NUMBER)?;
        for (key, text) in self.texts() {
            check(key, text, LONGEST)?;
        }
        for (number, reference) in (1..).zip(&self.references) {
            for (key, text) in [
                ("name", &reference.name),
                ("gives", &reference.gives),
                ("certificate", &reference.certificate),
            ] {
                check(&format!("reference[{number}].{key}"), text, LONGEST)?;
            }
        }
        Ok(())
    }

    fn texts(&self) -> [(&'static str, &str); 8] {
        [
            ("laboratory", &self.laboratory),
            ("place", &self.place),
            ("owner", &self.owner),
            ("item", &self.item),
            ("temperature", &self.temperature),
            ("humidity", &self.humidity),
            ("remarks", &self.remarks),
            ("authorised_by", &self.authorised_by),
        ]
    }

    /// A line for the first reference whose certificate has expired on a day.
    pub fn expired(&self, on: Day) -> Option<String> {
        let expired = |reference: &&Reference| reference.valid_until.is_some_and(|until| until < on);
        let reference = self.references.iter().find(expired)?;
        let until = reference.valid_until?;
        Some(format!(
            "the certificate {} of {} expired on {until}, before {on}: its value is no longer traceable; have \
             the reference recalibrated",
            reference.certificate, reference.name
        ))
    }

    /// The references in one line.
    pub fn references_line(&self) -> String {
        let shown = |reference: &Reference| match reference.certificate.as_str() {
            "" => reference.name.clone(),
            certificate => format!("{} ({certificate})", reference.name),
        };
        let all: Vec<_> = self.references.iter().map(shown).collect();
        match all[..] {
            [] => "no reference stated".to_owned(),
            _ => all.join(", "),
        }
    }

    /// Statements that ISO/IEC 17025 (7.8.2 and 7.8.4) requires of a certificate and this file lacks.
    pub fn missing(&self) -> Vec<&'static str> {
        let asked = [
            (self.number.is_empty(), "number of the certificate"),
            (self.laboratory.is_empty(), "laboratory and its address"),
            (self.owner.is_empty(), "owner of the bead"),
            (self.item.is_empty(), "description of the bead"),
            (self.temperature.is_empty(), "temperature"),
            (self.references.is_empty(), "references, with their certificates"),
            (
                self.references
                    .iter()
                    .any(|reference| reference.certificate.is_empty()),
                "certificate of a reference",
            ),
            (self.authorised_by.is_empty(), "person who authorises"),
        ];
        asked
            .into_iter()
            .filter(|(is, _)| *is)
            .map(|(_, name)| name)
            .collect()
    }

    /// A file with every key explained, to be edited.
    pub const TEMPLATE: &str = "\
# Texts of a calibration's certificate, for `bead calibrate … --about`. The certificate
# shows an empty text as not stated.
number = \"\"               # of the certificate, up to 16 bytes; it goes into the bead's settings
laboratory = \"\"           # name and address
place = \"\"                # of the calibration, if not the laboratory's
owner = \"\"                # of the bead
item = \"\"                 # the bead in words: kind, number, state
temperature = \"\"          # such as 22.4 °C ± 0.5 °C
humidity = \"\"
remarks = \"\"              # other conditions, deviations from the method
authorised_by = \"\"        # name and function

# An instrument that the result is traceable to; one table for each.
# [[reference]]
# name = \"balance AB204, no. 17\"
# gives = \"mass of the ball\"
# certificate = \"K-2026-113\"
# valid_until = \"2027-03-31\"
";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_is_read_states_nothing_and_with_its_remarks_names_a_reference() {
        let about = About::parse(About::TEMPLATE, "a.toml").unwrap();
        assert_eq!(about, About::default());
        assert_eq!(about.missing().len(), 7);
        let (texts, reference) = About::TEMPLATE.split_once("# [[").unwrap();
        let stated = texts.to_owned() + "[[" + &reference.replace("\n# ", "\n");
        let about = About::parse(&stated, "a.toml").unwrap();
        let day = |text| Day::parse(text).unwrap();
        assert_eq!(about.expired(day("2027-03-31")), None);
        let expired = about.expired(day("2027-04-01")).unwrap();
        assert!(
            expired.contains("K-2026-113 of balance AB204, no. 17 expired on 2027-03-31"),
            "{expired}"
        );
    }

    #[test]
    fn unknown_keys_and_long_texts_are_refused_with_their_line() {
        for (text, says) in [
            ("laboratry = \"\"", "a.toml:1: laboratry: unknown key"),
            (
                "\nnumber = \"seventeen bytes !!\"",
                "a.toml:2: number: the text is longer than 16 bytes",
            ),
            ("owner = \"a\\u0007b\"", "a.toml:1: owner: the text is longer"),
        ] {
            let refused = About::parse(text, "a.toml").unwrap_err().to_string();
            assert!(refused.starts_with(says), "{refused}");
        }
    }
}
