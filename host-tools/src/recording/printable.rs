//! Text from outside, made safe to print.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, Write};

/// The text with each control character as JSON writes it, such as `\u001b`; line ends and tabs stay. A
/// device, a file or its name can hold sequences that steer a terminal: clear it, rename its window, write
/// into the clipboard, or turn letters around. All that this library and its programs print goes through
/// here.
pub fn printable(text: &str) -> Cow<'_, str> {
    without(text, |character| {
        steers(character) && !matches!(character, '\n' | '\t')
    })
}

/// The same in one line: line ends and tabs are shown too. Names in a file can hold them.
pub fn one_line(text: &str) -> Cow<'_, str> {
    without(text, steers)
}

/// The first `most` characters of a text, with a mark where it goes on: a name in a file may have megabytes.
pub fn beginning(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
        None => Cow::Borrowed(text),
    }
}

/// The first `most` of some names, as a list for people, and how many more there are.
pub fn first_of<T: ToString>(names: impl IntoIterator<Item = T>, most: usize) -> String {
    let mut names = names.into_iter();
    let first: Vec<String> = names.by_ref().take(most).map(|name| name.to_string()).collect();
    match names.count() {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// Control characters, separators of lines, and those that change the direction of writing (Unicode annex 9,
/// section 2): with these a name can look like another.
fn steers(character: char) -> bool {
    match character {
        '\u{2028}' | '\u{2029}' => true,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        other => other.is_control(),
    }
}

fn without(text: &str, shown: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&shown) {
        return Cow::Borrowed(text);
    }
    let written = |character: char| match shown(character) {
        true => format!("\\u{:04x}", u32::from(character)),
        false => character.to_string(),
    };
    Cow::Owned(text.chars().map(written).collect())
}

/// Says something beside the result in one line, on standard error. What could steer a terminal is shown, not
/// sent. Where standard error is closed, nobody can be told, and the work goes on.
pub fn note(what: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "bead: {}", one_line(&what.to_string()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_names_the_first_are_told() {
        assert_eq!(first_of([1, 2], 2), "1, 2");
        assert_eq!(first_of(1..=22, 3), "1, 2, 3 and 19 more");
        assert_eq!(first_of([""; 0], 3), "");
    }

    #[test]
    fn what_would_steer_a_terminal_is_shown() {
        assert_eq!(printable("a\tb\nµ"), "a\tb\nµ");
        assert_eq!(printable("\u{1b}]52;c;eA==\u{7}"), "\\u001b]52;c;eA==\\u0007");
        assert_eq!(printable("\r\u{9b}2J\u{7f}"), "\\u000d\\u009b2J\\u007f");
        assert_eq!(one_line("a\tb\nµ\u{1b}"), "a\\u0009b\\u000aµ\\u001b");
        assert_eq!(one_line("a b"), "a b");
        assert_eq!(one_line("nep\u{202e}.mcap\u{2028}"), "nep\\u202e.mcap\\u2028");
        assert_eq!(one_line("חרוז Perlé 珠"), "חרוז Perlé 珠");
    }

    #[test]
    fn of_a_long_text_the_beginning_is_told() {
        assert_eq!(beginning("µm", 2), "µm");
        assert_eq!(beginning("µmµ", 2), "µm…");
        assert_eq!(beginning("", 0), "");
    }

    #[test]
    fn json_stays_json() {
        let text = serde_json::to_string("\u{9b}2J").expect("a string");
        let back: String = serde_json::from_str(&printable(&text)).expect("still JSON");
        assert_eq!(back, "\u{9b}2J");
    }
}
