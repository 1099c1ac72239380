//! Text from files, devices and names, made safe for a terminal.

use std::borrow::Cow;

/// Escapes control characters as JSON does (`\u001b`), but for line ends and tabs. Text from a device or a
/// file can hold sequences that clear a terminal, rename its window, write into the clipboard or reverse
/// letters, so everything that is printed passes through here.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |character| {
        is_control(character) && !matches!(character, '\n' | '\t')
    })
}

/// Escapes control characters as [`printable`] does, with line ends and tabs.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_control)
}

/// Cuts a text to `most` characters and marks the cut with an ellipsis. A name in a file may have megabytes.
pub fn beginning(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
        None => Cow::Borrowed(text),
    }
}

/// Lists the first `most` names, and the number of further ones.
pub fn first_of<T: ToString>(names: impl IntoIterator<Item = T>, most: usize) -> String {
    let mut names = names.into_iter();
    let first: Vec<String> = names.by_ref().take(most).map(|name| name.to_string()).collect();
    match names.count() {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// A number of things: `1 strike`, `2 strikes`.
pub fn count(number: u64, one: &str) -> String {
    match number {
        1 => format!("1 {one}"),
        _ => format!("{number} {one}s"),
    }
}

/// True for control characters, separators of lines, and marks that change the direction of writing, with
/// which a name can look like another (Unicode annex 9, section 2).
fn is_control(character: char) -> bool {
    match character {
        '\u{2028}' | '\u{2029}' => true,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        other => other.is_control(),
    }
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::new();
    for character in text.chars() {
        if is_escaped(character) {
            safe.push_str(&format!("\\u{:04x}", u32::from(character)));
        } else {
            safe.push(character);
        }
    }
    Cow::Owned(safe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_list_names_its_first_entries() {
        assert_eq!(first_of([1, 2], 2), "1, 2");
        assert_eq!(first_of(1..=22, 3), "1, 2, 3 and 19 more");
        assert_eq!(first_of([""; 0], 3), "");
        assert_eq!(
            [count(1, "strike"), count(0, "strike")],
            ["1 strike", "0 strikes"]
        );
    }

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(printable("a\tb\nµ"), "a\tb\nµ");
        assert_eq!(printable("\u{1b}]52;c;eA==\u{7}"), "\\u001b]52;c;eA==\\u0007");
        assert_eq!(printable("\r\u{9b}2J\u{7f}"), "\\u000d\\u009b2J\\u007f");
        assert_eq!(one_line("a\tb\nµ\u{1b}"), "a\\u0009b\\u000aµ\\u001b");
        assert_eq!(one_line("a b"), "a b");
        assert_eq!(one_line("nep\u{202e}.mcap\u{2028}"), "nep\\u202e.mcap\\u2028");
        assert_eq!(one_line("חרוז Perlé 珠"), "חרוז Perlé 珠");
    }

    #[test]
    fn a_long_text_is_cut() {
        assert_eq!(beginning("µm", 2), "µm");
        assert_eq!(beginning("µmµ", 2), "µm…");
        assert_eq!(beginning("", 0), "");
    }
}
