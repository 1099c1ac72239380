//! Results of a calibration as settings: a bead's file changes only where they are.
//!
//! # Design
//! The file is edited, not rewritten: comments, order and other keys stay. A key that the template has as a
//! comment, `# force_gain = ?`, replaces that comment. A line above each value gives its date, uncertainty
//! and certificate. Unless the new text is settings that a bead takes, the old file stays.

use bead_model::design::Description;
use bead_recording::physical::{self, Change};
use hertz_chain::InputError;
use serde_json::Value as Json;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

use crate::calibration::Calibration;

/// Beginning of the line above a calibrated value.
const REMARK: &str = "# calibrated ";
/// Column at which the template's comments begin.
const COLUMN: usize = 35;
/// Digits of a written value.
const DIGITS: i32 = 8;

/// A key with its new value, and the line above it.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Path of the key, such as `force.per_code`.
    pub key: String,
    /// Its value.
    pub value: Json,
    /// Line above it, without its mark; empty for none.
    pub remark: String,
}

/// Day, certificate and reference of a calibration, as settings name them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// The day, as 2026-11-28.
    pub day: String,
    /// Last day on which it holds.
    pub valid_until: Option<String>,
    /// Number of the certificate, up to 16 bytes.
    pub certificate: String,
    /// The references, in one line.
    pub references: String,
}

/// The settings that follow from a calibration of the bead with these settings.
pub fn entries(calibration: &Calibration, before: &Description, provenance: &Provenance) -> Vec<Entry> {
    let Provenance {
        day,
        valid_until,
        certificate,
        references,
    } = provenance;
    let mut entries = Vec::new();
    let mut push = |key: &str, value: Json, remark: String| {
        entries.push(Entry {
            key: key.to_owned(),
            value,
            remark,
        });
    };
    for result in &calibration.results {
        let combined = &result.combined;
        if let Some(key) = result.key {
            let how = match result.unit {
                "kg" if result.inputs.iter().all(|row| row.input.evaluation == "B") => "weighed".to_owned(),
                _ => format!("by bead calibrate {}", calibration.procedure),
            };
            let by = format!(
                "{day} {how}: u = {:.3} % (k = 1), U = {:.3} % (k = {:.2}); {certificate}; {references}",
                100.0 * result.relative_u,
                100.0 * combined.expanded / combined.value.abs(),
                combined.coverage_factor,
            );
            push(key, rounded(combined.value, DIGITS), by);
            // The low gain and the noise scale with the gain of their sensor.
            let scale = match key {
                "force.per_code" => Some(("force", &before.force)),
                "acceleration.per_code" => Some(("acceleration", &before.acceleration)),
                _ => None,
            };
            if let Some((sensor, scale)) = scale {
                let factor = combined.value / scale.per_code;
                let with = format!("{day} with {key}, keeping the ratio of both gains");
                let [wide, noise] = ["wide_per_code", "noise"].map(|name| format!("{sensor}.{name}"));
                push(&wide, rounded(scale.wide_per_code * factor, DIGITS), with);
                push(&noise, rounded(scale.noise * factor, 4), String::new());
            }
        }
        if let Some(key) = result.uncertainty_key {
            push(key, rounded(result.relative_u.max(1e-6), 3), String::new());
        }
    }
    for correlation in &calibration.correlations {
        if let Some(key) = correlation.key {
            // Rounding may make correlations near 1 inconsistent; reducing them slightly prevents it.
            push(key, rounded(0.9995 * correlation.correlation, 5), String::new());
        }
    }
    if let Some(volts) = calibration.supply_v {
        let mean = format!("{day}: the mean over the strikes");
        push("supply.voltage", rounded(volts, 5), mean);
    }
    let number = certificate.as_str().into();
    push("uncertainty.calibration", number, String::new());
    push("uncertainty.calibrated", day.as_str().into(), String::new());
    if let Some(day) = valid_until {
        push("uncertainty.valid_until", day.as_str().into(), String::new());
    }
    entries
}

/// A number with this many significant digits.
fn rounded(value: f64, digits: i32) -> Json {
    let text = format!("{value:.*e}", (digits - 1).max(0) as usize);
    text.parse::<f64>().unwrap_or(value).into()
}

/// The text of a settings file with new values, and what changes in the bead.
///
/// # Errors
/// One line: the file is no settings file, or no bead takes the new values.
pub fn updated(text: &str, name: &str, entries: &[Entry]) -> Result<(String, Vec<Change>), InputError> {
    let before = physical::parse(text, name)?;
    let mut text = text.to_owned();
    for entry in entries {
        text = uncommented(&text, &entry.key);
    }
    let mut document: DocumentMut = text
        .parse()
        .map_err(|error: toml_edit::TomlError| InputError::at("", one_line(&error), "check the file"))?;
    for entry in entries {
        set(&mut document, entry);
    }
    let text = document.to_string();
    let after = physical::parse(&text, name)?;
    let mut changes = physical::changes(before.description(), after.description());
    // A new table also sets its other keys to their defaults, which are no changes of this calibration.
    changes.retain(|change| entries.iter().any(|entry| entry.key == change.key));
    Ok((text, changes))
}

fn one_line(error: &toml_edit::TomlError) -> String {
    error.message().replace('\n', " ")
}

/// Uncomments the heading of a key's table, and the key itself, where the template has them as comments.
fn uncommented(text: &str, key: &str) -> String {
    let Some((table, name)) = key.split_once('.') else {
        return text.to_owned();
    };
    let (heading, entry) = (format!("[{table}]"), format!("# {name} = ?"));
    let mut within = false;
    let lines = text.split_inclusive('\n').map(|line| {
        let bare = line.trim_start_matches("# ").trim();
        if bare.starts_with('[') && bare.split(' ').count() == 1 {
            within = bare == heading;
            if within && line.starts_with("# ") {
                return format!("{heading}\n");
            }
        } else if within && line.starts_with(&entry) {
            // A value of the same width keeps the comment after it in its column.
            let rest = line.strip_prefix(&entry).unwrap_or_default();
            return format!("{name} = 0  {rest}");
        }
        line.to_owned()
    });
    lines.collect()
}

/// Sets a key and the line above it, and keeps the comment after it in its column.
fn set(document: &mut DocumentMut, entry: &Entry) {
    let (table, name) = match entry.key.split_once('.') {
        Some((table, name)) => (Some(table), name),
        None => (None, entry.key.as_str()),
    };
    let root = document.as_table_mut();
    let mut is_inline = false;
    let within: &mut dyn TableLike = match table {
        None => root,
        Some(table) => {
            let item = root.entry(table).or_insert_with(|| Item::Table(Table::new()));
            is_inline = item.is_inline_table();
            match item.as_table_like_mut() {
                Some(table) => table,
                // The file is valid as settings, so this is a table.
                None => return,
            }
        }
    };
    let shown = physical::shown(&entry.value);
    let mut value: Value = shown.parse().unwrap_or_else(|_| shown.into());
    if let Some(old) = within.get(name).and_then(Item::as_value) {
        *value.decor_mut() = old.decor().clone();
        let suffix = old.decor().suffix().and_then(|suffix| suffix.as_str());
        if let Some(comment) = suffix.and_then(|suffix| Some(suffix.get(suffix.find('#')?..)?.to_owned())) {
            let taken = name.len() + " = ".len() + physical::shown(&entry.value).len();
            let blanks = COLUMN.saturating_sub(taken).max(1);
            value
                .decor_mut()
                .set_suffix(format!("{}{comment}", " ".repeat(blanks)));
        }
    }
    // `insert` would discard the text before an existing key.
    match within.get_mut(name) {
        Some(item) => *item = Item::Value(value),
        None => _ = within.insert(name, Item::Value(value)),
    }
    // An inline table has no room for a line.
    if entry.remark.is_empty() || is_inline {
        return;
    }
    if let Some(mut key) = within.key_mut(name) {
        let decor = key.leaf_decor_mut();
        let before = decor
            .prefix()
            .and_then(|prefix| prefix.as_str())
            .unwrap_or_default();
        let others = before
            .split_inclusive('\n')
            .filter(|line| !line.starts_with(REMARK));
        let remark = entry.remark.replace(char::is_control, " ");
        let prefix = others.collect::<String>() + REMARK + &remark + "\n";
        decor.set_prefix(prefix);
    }
}

#[cfg(test)]
mod tests {
    use bead_testing::paper_settings;

    use super::*;

    fn entry(key: &str, value: impl Into<Json>, remark: &str) -> Entry {
        Entry {
            key: key.to_owned(),
            value: value.into(),
            remark: remark.to_owned(),
        }
    }

    #[test]
    fn values_change_and_the_owners_comments_and_other_keys_stay() {
        let template = physical::to_toml(paper_settings().description());
        let own = template.replace("[force]", "# My hammer broke in May.\n[force]");
        let entries = [
            entry("force.per_code", 0.0041, "2026-11-28 by a drop test"),
            entry("uncertainty.force_gain", 0.0018, ""),
            entry("uncertainty.calibrated", "2026-11-28", ""),
            entry("supply.voltage", 3.3012, ""),
        ];
        let (once, changes) = updated(&own, "bead.toml", &entries).unwrap();
        let keys: Vec<_> = changes.iter().map(|change| change.key).collect();
        assert_eq!(
            keys,
            [
                "force.per_code",
                "uncertainty.calibrated",
                "uncertainty.force_gain",
                "supply.voltage"
            ]
        );
        let lines = [
            "# My hammer broke in May.\n[force]\n# calibrated 2026-11-28 by a drop test\nper_code = 0.0041                  # N  per code at the high gain",
            "\n[uncertainty]\n# calibration = ?",
            "\ncalibrated = \"2026-11-28\"          # day of the calibration\n",
            "\nforce_gain = 0.0018                # of the force's scale",
            "\n# force_flatness = ?",
            "\n[supply]\nvoltage = 3.3012                   # V  VDDA",
        ];
        for line in lines {
            assert!(once.contains(line), "{line}\n---\n{once}");
        }
        // A second update replaces the line above the value and adds none.
        let again = [
            entry("force.per_code", 0.0042, "2026-12-01 by another"),
            entry("uncertainty.force_gain", 0.0017, ""),
            entry("uncertainty.stiffness", 0.003, ""),
        ];
        let (twice, _) = updated(&once, "bead.toml", &again).unwrap();
        assert_eq!(twice.lines().count(), once.lines().count());
        assert_eq!(twice.matches(REMARK).count(), 1);
        assert!(twice.contains("\n# acceleration_flatness = ?"), "{twice}");
        assert!(
            twice.contains("# calibrated 2026-12-01 by another\nper_code = 0.0042 "),
            "{twice}"
        );
    }

    #[test]
    fn values_that_no_bead_takes_are_refused_and_a_table_may_be_missing_or_inline() {
        let own = "bead = { mass = 0.051 }\nintruder = { mass = 0.0037, stiffness = 395000.0, damping = 12.0 }\n\
            contact = { stiffness = 3.6e8, relaxation = 4.2e-6 }\n\
            [force]\nper_code = 0.0039\nwide_per_code = 0.0625\npole = 0\nwide_pole = 0\nnoise = 0.005\n\
            [acceleration]\nper_code = 0.12\nwide_per_code = 1.95\npole = 0\nwide_pole = 0\nnoise = 0.05\n";
        let entries = [
            entry("intruder.stiffness", 4e5, "today"),
            entry("uncertainty.damping", 0.01, ""),
        ];
        let (text, changes) = updated(own, "bead.toml", &entries).unwrap();
        assert_eq!(changes.len(), 2, "{text}");
        assert!(!text.contains(REMARK), "{text}");
        let refused = updated(own, "bead.toml", &[entry("force.per_code", -1.0, "")]).unwrap_err();
        assert!(
            refused.to_string().contains("force.per_code: -1 is out of range"),
            "{refused}"
        );
    }
}
