//! Reads TOML files. An error is one line with file, line, key, the fault, and advice.
//!
//! # Design
//!
//! Values are checked as plain data, so data built in code get the same messages as data from a file. A check
//! knows only the key, such as `intruder[1].mass`; [`TomlFile::locate`] adds the file and the line of the
//! key.

use std::fmt::{self, Write as _};
use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use super::words::plain_words;

/// An error in an input: its place, its kind, and a remedy. Its text is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError {
    /// The file, as it was named; none for data built in code.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// The key, such as `chain.radius` or `intruder[2].mass` (tables of an array are counted from 1). Empty
    /// for the whole file.
    pub key: String,
    /// The error.
    pub what: String,
    /// The remedy.
    pub advice: String,
}

impl InputError {
    /// An error at a key, before its file and line are known.
    pub fn at(key: impl Into<String>, what: impl Into<String>, advice: impl Into<String>) -> Self {
        Self {
            file: None,
            line: None,
            key: key.into(),
            what: what.into(),
            advice: advice.into(),
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = OneLine(f);
        if let Some(file) = &self.file {
            let number = self.line.map_or(String::new(), |number| format!("{number}:"));
            write!(line, "{file}:{number} ")?;
        }
        if !self.key.is_empty() {
            write!(line, "{}: ", self.key)?;
        }
        write!(line, "{}; {}", self.what, self.advice)
    }
}

/// Writes control characters as TOML does, such as `\u000a`: a quoted key can hold line breaks.
struct OneLine<'a, 'b>(&'a mut fmt::Formatter<'b>);

impl fmt::Write for OneLine<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|character| {
            if character.is_control() {
                write!(self.0, "\\u{:04x}", u32::from(character))
            } else {
                self.0.write_char(character)
            }
        })
    }
}

impl std::error::Error for InputError {}

/// Length of the longest text that is read, bytes. A device such as /dev/zero has no end.
const LONGEST: u64 = 16 << 20;

/// The text of a file, or of standard input for `-`; `wanted` names it in the advice if it cannot be read,
/// such as `a scenario file in TOML`. No more than 16 MiB is read of anything.
///
/// # Errors
/// [`InputError`] if the file cannot be read, is longer, or is no text.
pub fn read_text(path: &Path, wanted: &str) -> Result<String, InputError> {
    let wrong = |what: String| InputError {
        file: Some(path.display().to_string()),
        ..InputError::at("", what, format!("name {wanted}"))
    };
    let mut bytes = Vec::new();
    let read = if path == Path::new("-") {
        io::stdin().lock().take(LONGEST + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(LONGEST + 1).read_to_end(&mut bytes))
    };
    read.map_err(|error| wrong(format!("cannot be read ({error})")))?;
    if bytes.len() as u64 > LONGEST {
        return Err(wrong("has more than 16 MiB".to_owned()));
    }
    String::from_utf8(bytes).map_err(|_| wrong("is not text in UTF-8".to_owned()))
}

/// A TOML file that knows the position of each of its keys.
#[derive(Debug, Clone, Copy)]
pub struct TomlFile<'a> {
    text: &'a str,
    name: &'a str,
}

/// A part of a key.
#[derive(Clone, Copy)]
enum KeyPart<'a> {
    Name(&'a str),
    /// Number of a table in an array, from 1.
    Entry(usize),
}

/// Byte ranges of a key and of its value; of a table, the header.
struct KeySpans {
    name: Range<usize>,
    value: Range<usize>,
}

/// Calls `see` with each key of a table and of the tables in it. Only one key is in memory at a time: a file
/// can have millions, each as long as all names around it together.
fn each_key<'a>(
    table: &'a DeTable<'_>,
    parts: &mut Vec<KeyPart<'a>>,
    see: &mut dyn FnMut(&[KeyPart<'_>], KeySpans),
) {
    let spans = |name, value| KeySpans { name, value };
    for (name, value) in table {
        parts.push(KeyPart::Name(name.get_ref()));
        see(parts, spans(name.span(), value.span()));
        match value.get_ref() {
            DeValue::Table(inner) => each_key(inner, parts, see),
            DeValue::Array(entries) => {
                for (number, entry) in (1..).zip(entries.iter()) {
                    if let DeValue::Table(inner) = entry.get_ref() {
                        parts.push(KeyPart::Entry(number));
                        see(parts, spans(entry.span(), entry.span()));
                        each_key(inner, parts, see);
                        parts.pop();
                    }
                }
            }
            _ => {}
        }
        parts.pop();
    }
}

/// A key for people, such as `chain.radius`, `intruder[1]` or `intruder[1].mass`.
fn path(parts: &[KeyPart<'_>]) -> String {
    let mut path = String::new();
    for part in parts {
        match part {
            KeyPart::Name(name) => {
                let dot = if path.is_empty() { "" } else { "." };
                path = format!("{path}{dot}{}", shortened(name, NAME_MOST));
            }
            KeyPart::Entry(number) => path = format!("{path}[{number}]"),
        }
    }
    path
}

/// Length of the part of `key` that these parts spell; `None` if the key begins otherwise.
fn begins(key: &str, parts: &[KeyPart<'_>]) -> Option<usize> {
    let mut rest = key;
    for part in parts {
        rest = match part {
            KeyPart::Name(name) if rest.len() == key.len() => rest.strip_prefix(name)?,
            KeyPart::Name(name) => rest.strip_prefix('.')?.strip_prefix(name)?,
            KeyPart::Entry(number) => rest.strip_prefix(&*format!("[{number}]"))?,
        };
    }
    let ends = rest.is_empty() || rest.starts_with(['.', '[']);
    ends.then_some(key.len() - rest.len())
}

impl<'a> TomlFile<'a> {
    /// Parses the text of a file; `name` is what messages call the file.
    ///
    /// # Errors
    /// [`InputError`] if the text is not TOML.
    pub fn parse(text: &'a str, name: &'a str) -> Result<Self, InputError> {
        let file = Self { text, name };
        let parsed = DeTable::parse(text).map_err(|error| {
            let what = format!("not TOML ({})", for_people(error.message()));
            let start = error.span().map_or(0, |span| span.start);
            file.place_at(start, InputError::at("", what, "correct the line"))
        });
        parsed.map(|_| file)
    }

    /// Name of the file in messages.
    pub(crate) fn name(&self) -> &'a str {
        self.name
    }

    fn each_key(&self, mut see: impl FnMut(&[KeyPart<'_>], KeySpans)) {
        // A text that is not TOML was refused before, and has no keys.
        if let Ok(table) = DeTable::parse(self.text) {
            each_key(table.get_ref(), &mut Vec::new(), &mut see);
        }
    }

    /// Splits the file at its tables: the text without the top-level keys of these names, and the text of
    /// these keys alone. Lines keep their numbers in both.
    pub fn split(&self, names: &[&str]) -> (String, String) {
        let lines: Vec<&str> = self.text.split_inclusive('\n').collect();
        let line_of = |at: usize| self.text[..at].matches('\n').count();
        let mut is_named = vec![false; lines.len()];
        self.each_key(|parts, place| {
            if matches!(parts.first(), Some(KeyPart::Name(name)) if names.contains(name)) {
                let last = place.value.end.max(place.name.end).saturating_sub(1);
                is_named[line_of(place.name.start)..=line_of(last)].fill(true);
            }
        });
        let of = |wanted: bool| -> String {
            let lines = lines.iter().zip(&is_named);
            let kept = lines.map(|(line, named)| if *named == wanted { *line } else { "\n" });
            kept.collect()
        };
        (of(false), of(true))
    }

    /// Reads the whole file. The type should refuse unknown fields (`#[serde(deny_unknown_fields)]`): the
    /// error for an unknown key then suggests the known one with the most similar spelling.
    ///
    /// # Errors
    /// [`InputError`]: a key is missing or unknown, or its value is of the wrong kind.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, InputError> {
        toml::from_str(self.text).map_err(|error| {
            let span = error.span().unwrap_or_default();
            let message = one_line(error.message());
            let (what, advice) = explain(&message);
            let is_unknown = unknown_field(&message).is_some();
            // The innermost key there; of an array and its only entry, which have the same place, the entry.
            let mut innermost = (usize::MAX, String::new());
            self.each_key(|parts, place| {
                let place = if is_unknown { place.name } else { place.value };
                let holds = place.start <= span.start && span.end <= place.end;
                if holds && place.len() <= innermost.0 {
                    innermost = (place.len(), path(parts));
                }
            });
            self.place_at(span.start, InputError::at(innermost.1, what, advice))
        })
    }

    /// Adds the file, and the line of the key, or of the table that should have the key if it is missing.
    pub fn locate(&self, error: InputError) -> InputError {
        let (mut most, mut start) = (0, 0);
        self.each_key(|parts, place| {
            if let Some(length) = begins(&error.key, parts).filter(|length| *length > most) {
                (most, start) = (length, place.name.start);
            }
        });
        self.place_at(start, error)
    }

    fn place_at(&self, start: usize, error: InputError) -> InputError {
        InputError {
            file: Some(self.name.to_owned()),
            line: Some(1 + self.text[..start].matches('\n').count()),
            ..error
        }
    }
}

/// Most characters shown of a name, and of a message of serde.
const NAME_MOST: usize = 60;
const MESSAGE_MOST: usize = 400;

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Prepares a message for people, which may quote a value of the file.
fn for_people(message: &str) -> String {
    shortened(&one_line(message), MESSAGE_MOST)
}

fn shortened(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Reads a table that is already in memory. The error names the key inside the table, without entries of
/// lists.
///
/// # Errors
/// [`InputError`] without file and line, as [`TomlFile::read`].
pub fn read_table<T: DeserializeOwned>(table: toml::Table) -> Result<T, InputError> {
    table.try_into().map_err(|error: toml::de::Error| {
        let (what, advice) = explain(&one_line(error.message()));
        // The library reports the key only in the text behind the message.
        let shown = error.to_string();
        let key = shown
            .rsplit_once("\nin `")
            .map_or("", |(_, key)| key.trim_end().trim_end_matches('`'));
        InputError::at(shortened(key, NAME_MOST), what, advice)
    })
}

/// The defect and the advice of an error of serde.
fn explain(message: &str) -> (String, String) {
    let advice = match unknown_field(message) {
        Some((name, known)) => return ("unknown key".to_owned(), nearest(name, &known)),
        None if message.starts_with("missing field") => "add it, in SI units",
        None => "give a value of that kind",
    };
    (for_people(&plain_words(message)), advice.to_owned())
}

/// The unknown field and the known ones, from the message of serde: it offers them in no other way.
fn unknown_field(message: &str) -> Option<(&str, Vec<&str>)> {
    let (name, known) = message.strip_prefix("unknown field `")?.split_once("`, ")?;
    Some((name, known.split('`').skip(1).step_by(2).collect()))
}

/// Advice for an unknown key.
fn nearest(key: &str, known: &[&str]) -> String {
    let distances = known.iter().map(|name| (strsim::levenshtein(key, name), name));
    match distances.min() {
        Some((distance, name)) if distance <= 2.max(key.len() / 3) => format!("did you mean `{name}`?"),
        _ => format!("known here are {}", known.join(", ")),
    }
}
