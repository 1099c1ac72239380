//! Plain words in place of Rust's own in errors of the command line.

use std::io::IsTerminal;

/// Errors of Rust's number parsers, each with its plain words.
const PLAIN: [(&str, &str); 6] = [
    ("invalid digit found in string", WHOLE),
    ("cannot parse integer from empty string", WHOLE),
    ("number too large to fit in target type", TOO_LARGE),
    ("number too small to fit in target type", WHOLE),
    ("invalid float literal", "give a number"),
    ("cannot parse float from empty string", "give a number"),
];
const TOO_LARGE: &str = "this number is too large";
const WHOLE: &str = "give a whole number, 0 or more";

/// Prints the error of a command line and ends the program with the status of clap: 2, or 0 after help.
pub fn exit(error: &clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    let rendered = error.render();
    let ansi = std::io::stderr()
        .is_terminal()
        .then(|| rendered.ansi().to_string());
    eprint!("{}", plain(&ansi.unwrap_or_else(|| rendered.to_string())));
    std::process::exit(error.exit_code());
}

fn plain(text: &str) -> String {
    let mut text = text.to_owned();
    for (rust, plain) in PLAIN {
        text = text.replace(rust, plain);
    }
    text.split_inclusive('\n')
        .map(|line| in_words(line).unwrap_or_else(|| line.to_owned()))
        .collect()
}

/// A line that ends with a range of Rust, such as `0 is not in 1..=10`, with the range in words.
fn in_words(line: &str) -> Option<String> {
    let (before, range) = line.split_once(" is not in ")?;
    let before = before.trim_end_matches(|letter: char| letter.is_ascii_digit() || letter == '-');
    let (first, last) = range.trim_end().split_once("..")?;
    let first: i64 = first.parse().ok()?;
    let last: i64 = match last.strip_prefix('=') {
        Some(last) => last.parse().ok()?,
        None => last.parse::<i64>().ok()? - 1,
    };
    Some(format!("{before}give a whole number from {first} to {last}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_speak_of_numbers_and_not_of_types_and_else_stay() {
        let value = "error: invalid value 'x' for '--seed <S>': ";
        for (rust, said) in [
            ("invalid digit found in string", "give a whole number, 0 or more"),
            ("invalid float literal", "give a number"),
            ("0 is not in 1..=10000", "give a whole number from 1 to 10000"),
            ("-1 is not in 0..255", "give a whole number from 0 to 254"),
        ] {
            let said = format!("{value}{said}\n\nmore\n");
            assert_eq!(plain(&format!("{value}{rust}\n\nmore\n")), said);
        }
        for text in ["error: bead 9 is not in the chain\n", "tip: write 1..=3\n"] {
            assert_eq!(plain(text), text);
        }
    }
}
