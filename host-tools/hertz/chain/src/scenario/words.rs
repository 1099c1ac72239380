//! Plain words in place of serde's own in errors of TOML files.

/// Rewrites a message of serde with texts, numbers, lists and tables in place of Rust's types. A message of
/// an unknown form is returned unchanged.
pub fn plain_words(message: &str) -> String {
    for (start, said) in [
        ("missing field `", "is missing"),
        ("duplicate field `", "occurs twice"),
    ] {
        let key = message
            .strip_prefix(start)
            .and_then(|text| text.strip_suffix('`'));
        if let Some(key) = key {
            return format!("the key `{key}` {said}");
        }
    }
    if let Some((found, known)) = variant(message) {
        return format!("{found} is not known; known are {known}");
    }
    if message.starts_with("data did not match any variant of untagged enum") {
        return "a value of another kind belongs here".to_owned();
    }
    let kinds = ["invalid type: ", "invalid value: ", "invalid length "];
    let rest = kinds.iter().find_map(|kind| message.strip_prefix(kind));
    match rest.and_then(|rest| rest.rsplit_once(", expected ")) {
        Some((found, expected)) => format!("{}, where {} belongs", what_is(found), what_belongs(expected)),
        None => message.to_owned(),
    }
}

/// The unknown name, and the known names.
fn variant(message: &str) -> Option<(&str, &str)> {
    let (found, known) = message
        .strip_prefix("unknown variant ")?
        .split_once(", expected ")?;
    Some((found, known.strip_prefix("one of ").unwrap_or(known)))
}

/// Words for the value in the file.
fn what_is(found: &str) -> String {
    let quoted = |kind: &str| Some(found.strip_prefix(kind)?.trim_matches('`'));
    if let Some(text) = found.strip_prefix("string ") {
        return format!("the text {text}");
    }
    if let Some(number) = quoted("integer ").or_else(|| quoted("floating point ")) {
        return format!("the number {number}");
    }
    match found {
        "map" => "a table".to_owned(),
        "sequence" => "a list".to_owned(),
        count if count.parse::<usize>().is_ok() => format!("a list of {count}"),
        other => quoted("boolean ").unwrap_or(other).to_owned(),
    }
}

/// Words for the value that belongs there.
fn what_belongs(expected: &str) -> String {
    let word = match expected {
        "f32" | "f64" => "a number",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or more,",
        "a string" | "string" => "a text",
        "a sequence" => "a list",
        "a boolean" => "true or false",
        "a map" => "a table",
        other if other.starts_with("struct ") => "a table",
        _ => "",
    };
    if !word.is_empty() {
        return word.to_owned();
    }
    let length = expected.strip_prefix("an array of length ");
    length.map_or_else(|| expected.to_owned(), |length| format!("a list of {length}"))
}

#[cfg(test)]
mod tests {
    use super::plain_words;

    /// Messages of serde, and the words for them.
    const MESSAGES: &str = r#"
missing field `axis` => the key `axis` is missing
duplicate field `axis` => the key `axis` occurs twice
invalid type: string "fast", expected f64 => the text "fast", where a number belongs
invalid value: integer `-3`, expected usize => the number -3, where a whole number, 0 or more, belongs
invalid type: integer `8`, expected a sequence => the number 8, where a list belongs
invalid type: boolean `true`, expected a string => true, where a text belongs
invalid type: floating point `0.5`, expected struct Chain => the number 0.5, where a table belongs
invalid length 2, expected an array of length 3 => a list of 2, where a list of 3 belongs
unknown variant `loud`, expected one of `printed`, `clipped` => `loud` is not known; known are `printed`, `clipped`
the mass is below zero => the mass is below zero
"#;

    #[test]
    fn no_type_of_rust_is_named() {
        for row in MESSAGES.trim().lines() {
            let (rust, said) = row.split_once(" => ").unwrap();
            assert_eq!(plain_words(rust), said);
        }
    }
}
