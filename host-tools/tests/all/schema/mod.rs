//! JSON schemas made of documents, and held against those in docs/schemas.

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Map, Value, json};

/// The schema of one value.
fn schema(value: &Value) -> Value {
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(items) => {
            let items = items.iter().map(schema).reduce(|one, other| merged(&one, &other));
            return json!({ "type": ["array"], "items": items.unwrap_or(json!({})) });
        }
        Value::Object(entries) => {
            let properties: Map<_, _> = entries
                .iter()
                .map(|(key, value)| (key.clone(), schema(value)))
                .collect();
            let required: Vec<_> = entries.keys().cloned().collect();
            return json!({ "type": ["object"], "properties": properties, "required": required });
        }
    };
    json!({ "type": [kind] })
}

/// A schema that both hold.
fn merged(one: &Value, other: &Value) -> Value {
    let list = |schema: &Value, key: &str| -> Vec<String> {
        let list = schema[key].as_array().cloned().unwrap_or_default();
        list.iter()
            .filter_map(|item| item.as_str().map(str::to_owned))
            .collect()
    };
    let mut types: BTreeSet<_> = list(one, "type").into_iter().chain(list(other, "type")).collect();
    if types.contains("number") {
        types.remove("integer");
    }
    let mut all = json!({ "type": types });
    let of = |key: &str| [one, other].map(|schema| schema.get(key).cloned());
    match of("properties") {
        [Some(Value::Object(mut ours)), Some(Value::Object(theirs))] => {
            for (key, value) in theirs {
                let both = ours.get(&key).map_or(value.clone(), |mine| merged(mine, &value));
                ours.insert(key, both);
            }
            all["properties"] = ours.into();
            let theirs = list(other, "required");
            all["required"] = list(one, "required")
                .into_iter()
                .filter(|key| theirs.contains(key))
                .collect();
        }
        [ours, theirs] => {
            for (own, whose) in [(ours, one), (theirs, other)] {
                if let Some(own) = own {
                    all["properties"] = own;
                    all["required"] = whose["required"].clone();
                }
            }
        }
    }
    match of("items") {
        [Some(ours), Some(theirs)] if ours != json!({}) && theirs != json!({}) => {
            all["items"] = merged(&ours, &theirs)
        }
        [ours, theirs] => {
            let known = [ours, theirs]
                .into_iter()
                .flatten()
                .max_by_key(|items| items.to_string().len());
            if let Some(items) = known {
                all["items"] = items;
            }
        }
    }
    all
}

/// A schema that every one of the documents holds.
pub(crate) fn of_all<'a>(documents: impl IntoIterator<Item = &'a Value>) -> Value {
    let schemas = documents.into_iter().map(schema);
    schemas
        .reduce(|one, other| merged(&one, &other))
        .unwrap_or(json!({}))
}

/// Holds `found`, the schema of what `bead NAME` prints, against FOLDER/NAME.json, or writes it if that is
/// wished.
pub(crate) fn hold(folder: &str, name: &str, found: &Value) {
    let title = format!("What `bead {}` prints as JSON", name.replace('-', " "));
    let mut schema = json!({ "$schema": "https://json-schema.org/draft/2020-12/schema", "title": title });
    let entries = found.as_object().unwrap().clone();
    schema.as_object_mut().unwrap().extend(entries);
    let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
    let path = format!("{folder}/{name}.json");
    if std::env::var("SCHEMAS").is_ok_and(|wish| wish == "overwrite") {
        fs::create_dir_all(folder).unwrap();
        fs::write(&path, text).unwrap();
        return;
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    let first = kept.lines().zip(text.lines()).find(|(kept, found)| kept != found);
    assert!(
        kept == text,
        "{path} says something else, first {first:?}; if that is meant, run this test with SCHEMAS=overwrite"
    );
}
