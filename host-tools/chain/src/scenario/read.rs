//! TOML files for people: what is wrong is told in one line, with file, line, key, and what would do.
//!
//! # Design
//!
//! Values are checked on plain data, so data built in code get the same answers as data from a file. A check
//! knows only the key (`intruder[1].mass`). [`TomlFile::place`] adds the file and the line of that key.

use std::fmt::{self, Write as _};
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

/// What is wrong with an input: where, what, and what would do. Its text is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError {
    /// The file, as it was named; none for data built in code.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// The key, such as `chain.radius` or `intruder[2].mass` (tables of an array are counted from 1). Empty
    /// for the whole file.
    pub key: String,
    /// What is wrong.
    pub what: String,
    /// What would do.
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
            write!(line, "{file}:")?;
            if let Some(number) = self.line {
                write!(line, "{number}:")?;
            }
            write!(line, " ")?;
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
        text.chars()
            .try_for_each(|character| match character.is_control() {
                true => write!(self.0, "\\u{:04x}", u32::from(character)),
                false => self.0.write_char(character),
            })
    }
}

impl std::error::Error for InputError {}

/// Length of the longest text that is read, bytes. A device such as /dev/zero has no end.
const LONGEST: u64 = 16 << 20;

/// The text of a file; `wanted` names it in the advice if it cannot be read, such as `a scenario file in
/// TOML`. No more than 16 MiB is read of anything.
///
/// # Errors
/// [`InputError`] if the file cannot be read, is longer, or is no text.
pub fn text_of(path: &Path, wanted: &str) -> Result<String, InputError> {
    let wrong = |what: String| InputError {
        file: Some(path.display().to_string()),
        ..InputError::at("", what, format!("name {wanted}"))
    };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST + 1).read_to_end(&mut bytes))
        .map_err(|error| wrong(format!("cannot be read ({error})")))?;
    if bytes.len() as u64 > LONGEST {
        return Err(wrong("has more than 16 MiB".to_owned()));
    }
    String::from_utf8(bytes).map_err(|_| wrong("is no text in UTF-8".to_owned()))
}

/// A TOML file that knows where each of its keys stands.
#[derive(Debug)]
pub struct TomlFile<'a> {
    text: &'a str,
    name: &'a str,
    keys: Vec<Key>,
}

/// A key of the file, or an entry of an array of tables.
#[derive(Debug)]
struct Key {
    /// From the root, such as `chain.radius`, `intruder[1]` or `intruder[1].mass`.
    path: String,
    /// Bytes of the text that hold the key.
    name: Range<usize>,
    /// Bytes of the text that hold its value; of a table, its head.
    value: Range<usize>,
}

impl<'a> TomlFile<'a> {
    /// Parses the text of a file; `name` is what messages call the file.
    ///
    /// # Errors
    /// [`InputError`] if the text is not TOML.
    pub fn parse(text: &'a str, name: &'a str) -> Result<Self, InputError> {
        let mut file = Self {
            text,
            name,
            keys: Vec::new(),
        };
        match DeTable::parse(text) {
            Ok(table) => file.collect_keys(table.get_ref(), ""),
            Err(error) => {
                let what = format!("not TOML ({})", one_line(error.message()));
                let start = error.span().map_or(0, |span| span.start);
                return Err(file.place_at(start, InputError::at("", what, "mend the line")));
            }
        }
        Ok(file)
    }

    fn collect_keys(&mut self, table: &DeTable<'_>, parent: &str) {
        for (name, value) in table {
            let dot = if parent.is_empty() { "" } else { "." };
            let path = format!("{parent}{dot}{}", name.get_ref());
            self.keys.push(Key {
                path: path.clone(),
                name: name.span(),
                value: value.span(),
            });
            match value.get_ref() {
                DeValue::Table(inner) => self.collect_keys(inner, &path),
                DeValue::Array(entries) => {
                    for (number, entry) in (1..).zip(entries.iter()) {
                        if let DeValue::Table(inner) = entry.get_ref() {
                            let path = format!("{path}[{number}]");
                            self.keys.push(Key {
                                path: path.clone(),
                                name: entry.span(),
                                value: entry.span(),
                            });
                            self.collect_keys(inner, &path);
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// Reads the whole file. The type should refuse unknown fields (`#[serde(deny_unknown_fields)]`): an
    /// unknown key is then answered with the known one that is spelt most like it.
    ///
    /// # Errors
    /// [`InputError`]: a key is missing or unknown, or its value is of the wrong kind.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, InputError> {
        toml::from_str(self.text).map_err(|error| {
            let span = error.span().unwrap_or_default();
            let message = one_line(error.message());
            let (place, what, advice): (fn(&Key) -> &Range<usize>, _, _) = match unknown_field(&message) {
                Some((name, known)) => (|key| &key.name, "unknown key".to_owned(), nearest(name, &known)),
                None if message.starts_with("missing field") => {
                    (|key| &key.value, message, "add it, in SI units".to_owned())
                }
                None => (|key| &key.value, message, "give a value of that kind".to_owned()),
            };
            // The innermost key there; of an array and its only entry, which have the same place, the entry.
            let holds = |key: &&Key| place(key).start <= span.start && span.end <= place(key).end;
            let holding = self.keys.iter().rev().filter(holds);
            let innermost = holding.min_by_key(|key| place(key).len());
            let path = innermost.map_or("", |key| &key.path);
            self.place_at(span.start, InputError::at(path, what, advice))
        })
    }

    /// Adds the file, and the line of the key or, where the file does not have it, of the table that should.
    pub fn place(&self, error: InputError) -> InputError {
        let mut path = error.key.as_str();
        let start = loop {
            if let Some(key) = self.keys.iter().find(|key| key.path == path) {
                break key.name.start;
            }
            match path.rfind(['.', '[']) {
                Some(end) => path = &path[..end],
                None => break 0,
            }
        };
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

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The field and the known ones, from what serde says of an unknown field: it has no other way to tell them.
fn unknown_field(message: &str) -> Option<(&str, Vec<&str>)> {
    let quoted = message.strip_prefix("unknown field ")?;
    let mut names = quoted.split('`').skip(1).step_by(2);
    Some((names.next()?, names.collect()))
}

/// Advice for an unknown key.
fn nearest(key: &str, known: &[&str]) -> String {
    let near = known.iter().map(|name| (distance(key, name), name)).min();
    match near {
        Some((distance, name)) if distance <= 2.max(key.len() / 3) => format!("did you mean `{name}`?"),
        _ => format!("known here are {}", known.join(", ")),
    }
}

/// Levenshtein's distance: how many letters to insert, delete or replace to make `b` of `a`.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let replace = diagonal + usize::from(letter != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = replace.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}
