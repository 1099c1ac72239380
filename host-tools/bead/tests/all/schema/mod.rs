//! JSON schemas in docs/schemas: that they are up to date, and that documents hold them.

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Map, Value};

/// Asserts that FOLDER/NAME.json is this schema but for descriptions, which are comments, or writes it if
/// `SCHEMAS=overwrite`.
pub(crate) fn hold(folder: &str, name: &str, schema: &Value) {
    let path = format!("{folder}/{name}.json");
    if std::env::var("SCHEMAS").is_ok_and(|wish| wish == "overwrite") {
        fs::write(&path, serde_json::to_string_pretty(schema).unwrap() + "\n").unwrap();
        return;
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    let kept = serde_json::from_str(&kept).unwrap_or_default();
    assert!(
        without_descriptions(&kept) == without_descriptions(schema),
        "{path} differs; if that is meant, run this test with SCHEMAS=overwrite. It should be:\n{schema:#}"
    );
}

/// The schema without its texts for people.
fn without_descriptions(schema: &Value) -> Value {
    match schema {
        Value::Object(entries) => {
            let kept = entries
                .iter()
                .filter(|(key, value)| *key != "description" || !value.is_string());
            kept.map(|(key, value)| (key.clone(), without_descriptions(value)))
                .collect()
        }
        Value::Array(items) => items.iter().map(without_descriptions).collect(),
        other => other.clone(),
    }
}

/// Asserts that a document holds the published schema FOLDER/NAME.json, and has no key that it does not know.
pub(crate) fn assert_valid(folder: &str, name: &str, document: &Value) {
    let text = fs::read_to_string(format!("{folder}/{name}.json")).unwrap();
    let root = serde_json::from_str(&text).unwrap();
    if let Err(why) = check(&root, &root, document, "") {
        panic!("{name}: {why}\n{document}");
    }
}

/// Keys of an object that a schema knows.
type Known = BTreeSet<String>;

/// Holds a value against a schema: the keywords that our schemas use. `at` is the value's place.
fn check(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let known = matches(root, schema, value, at)?;
    let unknown = value
        .as_object()
        .and_then(|entries| entries.keys().find(|key| !known.contains(*key)));
    // A schema without properties is for any object.
    match unknown.filter(|_| !known.is_empty()) {
        Some(key) => Err(format!("{at}/{key}: the schema has no such key")),
        None => Ok(()),
    }
}

fn matches(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<Known, String> {
    let Value::Object(schema) = schema else {
        return Ok(Known::new());
    };
    let mut known = Known::new();
    if let Some(place) = schema.get("$ref").and_then(Value::as_str) {
        let definition = root
            .pointer(place.trim_start_matches('#'))
            .ok_or(format!("{place} leads nowhere"))?;
        known.extend(matches(root, definition, value, at)?);
    }
    if !of_type(schema, value) {
        return Err(format!("{at}: {value} is not of type {}", schema["type"]));
    }
    if schema.get("const").is_some_and(|wanted| wanted != value) {
        return Err(format!("{at}: {value} is not {}", schema["const"]));
    }
    if let Some(Value::Array(wanted)) = schema.get("enum")
        && !wanted.contains(value)
    {
        return Err(format!("{at}: {value} is none of {wanted:?}"));
    }
    if let (Some(least), Some(number)) = (schema.get("minimum"), value.as_f64())
        && number < least.as_f64().unwrap()
    {
        return Err(format!("{at}: {number} is below {least}"));
    }
    for keyword in ["allOf", "anyOf", "oneOf"] {
        let Some(Value::Array(choices)) = schema.get(keyword) else {
            continue;
        };
        let tried: Vec<_> = choices
            .iter()
            .map(|choice| matches(root, choice, value, at))
            .collect();
        let held = tried.iter().flatten().count();
        let holds = match keyword {
            "allOf" => held == choices.len(),
            "anyOf" => held > 0,
            _ => held == 1,
        };
        if !holds {
            let why: Vec<_> = tried.iter().filter_map(|tried| tried.as_ref().err()).collect();
            return Err(format!("{at}: {held} of {keyword}: {why:?}"));
        }
        known.extend(tried.into_iter().flatten().flatten());
    }
    known.extend(within(root, schema, value, at)?);
    Ok(known)
}

/// True if the value is of one of the schema's types.
fn of_type(schema: &Map<String, Value>, value: &Value) -> bool {
    let is = |kind: &Value| match kind.as_str().unwrap() {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("{other} is no type"),
    };
    match schema.get("type") {
        None => true,
        Some(Value::Array(kinds)) => kinds.iter().any(is),
        Some(kind) => is(kind),
    }
}

/// Holds what is within a value against its schema: the entries of an object, the items of an array.
fn within(root: &Value, schema: &Map<String, Value>, value: &Value, at: &str) -> Result<Known, String> {
    let mut known = Known::new();
    if let Some(entries) = value.as_object() {
        let required = schema.get("required").and_then(Value::as_array);
        let missing = |key: &&Value| !entries.contains_key(key.as_str().unwrap());
        if let Some(key) = required.into_iter().flatten().find(missing) {
            return Err(format!("{at}: {key} is missing"));
        }
        let properties = schema.get("properties").and_then(Value::as_object);
        for (key, property) in properties.into_iter().flatten() {
            known.insert(key.clone());
            if let Some(value) = entries.get(key) {
                check(root, property, value, &format!("{at}/{key}"))?;
            }
        }
        if let Some(of_others) = schema.get("additionalProperties") {
            for (key, value) in entries
                .iter()
                .filter(|(key, _)| properties.is_none_or(|all| !all.contains_key(*key)))
            {
                known.insert(key.clone());
                check(root, of_others, value, &format!("{at}/{key}"))?;
            }
        }
    }
    if let Some(items) = value.as_array() {
        let count = |keyword: &str| schema.get(keyword).and_then(Value::as_u64);
        let length = items.len() as u64;
        if count("minItems").is_some_and(|least| length < least)
            || count("maxItems").is_some_and(|most| length > most)
        {
            return Err(format!("{at}: {length} items"));
        }
        let first = schema
            .get("prefixItems")
            .and_then(Value::as_array)
            .map_or(&[][..], Vec::as_slice);
        for (number, item) in items.iter().enumerate() {
            if let Some(of_item) = first.get(number).or(schema.get("items")) {
                check(root, of_item, item, &format!("{at}/{number}"))?;
            }
        }
    }
    Ok(known)
}
