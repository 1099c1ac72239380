//! Compares schemas with those in docs/schemas, and holds documents against these.

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
    let (mut kept, mut wanted) = (serde_json::from_str(&kept).unwrap_or_default(), schema.clone());
    [&mut kept, &mut wanted].into_iter().for_each(strip_descriptions);
    assert!(
        kept == wanted,
        "{path} differs; if that is meant, run this test with SCHEMAS=overwrite. It should be:\n{schema:#}"
    );
}

fn strip_descriptions(schema: &mut Value) {
    match schema {
        Value::Object(entries) => {
            entries.retain(|key, value| key != "description" || !value.is_string());
            entries.values_mut().for_each(strip_descriptions);
        }
        Value::Array(items) => items.iter_mut().for_each(strip_descriptions),
        _ => {}
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

/// Keywords of our schemas, checked here or descriptive.
const KEYWORDS: &str = "$ref type const enum minimum maximum minItems maxItems items anyOf oneOf required \
                        properties additionalProperties description format default title $schema $defs pattern";

/// Keys of an object that a schema knows.
type Known = BTreeSet<String>;

/// Holds a value against a schema. `at` is the place of the value.
fn check(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let known = matches(root, schema, value, at)?;
    let mut keys = value.as_object().into_iter().flat_map(Map::keys);
    // A schema without properties is for any object.
    match keys.find(|key| !known.is_empty() && !known.contains(*key)) {
        Some(key) => Err(format!("{at}/{key}: the schema has no such key")),
        None => Ok(()),
    }
}

fn matches(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<Known, String> {
    let Value::Object(schema) = schema else {
        return Ok(Known::new());
    };
    let is_known = |keyword: &String| KEYWORDS.split(' ').any(|known| known == keyword);
    assert!(schema.keys().all(is_known), "{at}: {schema:?}");
    let limit = |keyword: &str| schema.get(keyword).and_then(Value::as_f64);
    let is_within = |least: &str, most: &str, number: f64| {
        limit(least).is_none_or(|least| number >= least) && limit(most).is_none_or(|most| number <= most)
    };
    let items = value.as_array().map(Vec::len);
    let is_value = schema.get("const").is_none_or(|wanted| wanted == value)
        && list(schema, "enum").is_none_or(|wanted| wanted.contains(value))
        && value
            .as_f64()
            .is_none_or(|it| is_within("minimum", "maximum", it))
        && items.is_none_or(|count| is_within("minItems", "maxItems", count as f64));
    if !of_type(schema, value) || !is_value {
        return Err(format!("{at}: {value} is not what {schema:?} asks for"));
    }
    let mut known = within(root, schema, value, at)?;
    if let Some(place) = schema.get("$ref").and_then(Value::as_str) {
        let definition = root.pointer(place.trim_start_matches('#')).unwrap();
        known.extend(matches(root, definition, value, at)?);
    }
    for keyword in ["anyOf", "oneOf"] {
        let Some(choices) = list(schema, keyword) else {
            continue;
        };
        let tried = choices.iter().map(|choice| matches(root, choice, value, at));
        let (held, failed): (Vec<_>, Vec<_>) = tried.partition(Result::is_ok);
        if held.is_empty() || keyword == "oneOf" && held.len() > 1 {
            return Err(format!("{at}: {} of {keyword} hold: {failed:?}", held.len()));
        }
        known.extend(held.into_iter().flatten().flatten());
    }
    Ok(known)
}

fn list<'a>(schema: &'a Map<String, Value>, keyword: &str) -> Option<&'a Vec<Value>> {
    schema.get(keyword).and_then(Value::as_array)
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

/// Holds the entries of an object and the items of an array against a schema.
fn within(root: &Value, schema: &Map<String, Value>, value: &Value, at: &str) -> Result<Known, String> {
    let mut known = Known::new();
    if let Some(entries) = value.as_object() {
        let mut required = list(schema, "required").into_iter().flatten();
        if let Some(key) = required.find(|key| !entries.contains_key(key.as_str().unwrap())) {
            return Err(format!("{at}: {key} is missing"));
        }
        let properties = schema.get("properties").and_then(Value::as_object);
        known.extend(properties.into_iter().flat_map(Map::keys).cloned());
        for (key, value) in entries {
            let property = properties.and_then(|all| all.get(key));
            if let Some(property) = property.or(schema.get("additionalProperties")) {
                known.insert(key.clone());
                check(root, property, value, &format!("{at}/{key}"))?;
            }
        }
    }
    for (number, item) in value.as_array().into_iter().flatten().enumerate() {
        if let Some(of_item) = schema.get("items") {
            check(root, of_item, item, &format!("{at}/{number}"))?;
        }
    }
    Ok(known)
}
