//! Plain words in place of Rust's own in errors of the command line.

use std::io::IsTerminal;
use std::ops::RangeInclusive;

/// Errors of Rust's number parsers, each with its plain words.
const PLAIN: [(&str, &str); 6] = [
    ("invalid digit found in string", WHOLE),
    ("cannot parse integer from empty string", WHOLE),
    (
        "number too large to fit in target type",
        "this number is too large",
    ),
    ("number too small to fit in target type", WHOLE),
    ("invalid float literal", "give a number"),
    ("cannot parse float from empty string", "give a number"),
];
const WHOLE: &str = "give a whole number, 0 or more";

/// Prints the error of a command line and ends the program with the status of clap: 2, or 0 after help.
pub(super) fn exit(error: &clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    let rendered = error.render();
    let terminal = std::io::stderr().is_terminal();
    let text = if terminal {
        rendered.ansi().to_string()
    } else {
        rendered.to_string()
    };
    eprint!("{}", plain(&text));
    std::process::exit(error.exit_code());
}

/// The text in plain words.
fn plain(text: &str) -> String {
    let lines = text.split_inclusive('\n').map(|line| {
        let line = PLAIN
            .iter()
            .fold(line.to_owned(), |line, (rust, plain)| line.replace(rust, plain));
        in_words(&line).unwrap_or(line)
    });
    lines.collect()
}

/// A line that ends with a range of Rust, such as `0 is not in 1..=10`, with the range in words.
fn in_words(line: &str) -> Option<String> {
    let (before, range) = line.split_once(" is not in ")?;
    let before = before.trim_end_matches(|letter: char| letter.is_ascii_digit() || letter == '-');
    let range = range_of(range.trim_end())?;
    Some(format!(
        "{before}give a whole number from {} to {}\n",
        range.start(),
        range.end()
    ))
}

/// A range as Rust writes it: `1..=10`, `0..255`.
fn range_of(text: &str) -> Option<RangeInclusive<i64>> {
    let (first, last) = text.split_once("..")?;
    let (last, inside) = match last.strip_prefix('=') {
        Some(last) => (last, 0),
        None => (last, 1),
    };
    Some(first.parse().ok()?..=last.parse::<i64>().ok()? - inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_speak_of_numbers_and_not_of_types() {
        let value = "error: invalid value 'x' for '--seed <S>': ";
        for (rust, said) in [
            ("invalid digit found in string", "give a whole number, 0 or more"),
            ("invalid float literal", "give a number"),
            ("0 is not in 1..=10000", "give a whole number from 1 to 10000"),
            ("-1 is not in 0..255", "give a whole number from 0 to 254"),
        ] {
            assert_eq!(
                plain(&format!("{value}{rust}\n\nmore\n")),
                format!("{value}{said}\n\nmore\n")
            );
        }
    }

    #[test]
    fn what_is_not_rusts_stays() {
        for text in ["error: bead 9 is not in the chain\n", "tip: write 1..=3\n"] {
            assert_eq!(plain(text), text);
        }
    }
}
