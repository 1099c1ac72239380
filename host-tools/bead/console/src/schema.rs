//! JSON schemas of results, made from the types that are printed.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Value, json};

use bead_recording::json::SCHEMA_VERSION;

/// The schema of what `bead COMMAND` prints, with the version that [`print`](crate::output::print)
/// puts into each object.
pub fn of<T: JsonSchema>(command: &str) -> Value {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    described(generator.into_root_schema_for::<T>().into(), command)
}

/// Adds the title, and `schema_version` to the properties of the object, or of each object of a list.
pub fn described(mut schema: Value, command: &str) -> Value {
    schema["title"] = format!("Output of `bead {command}` as JSON").into();
    let item = schema.pointer("/items/$ref").and_then(Value::as_str);
    let item = item.map_or(String::new(), |item| item.trim_start_matches('#').to_owned());
    let object = schema
        .pointer_mut(&item)
        .expect("a reference leads to a definition");
    object["properties"]["schema_version"] = json!({ "const": SCHEMA_VERSION });
    if let Value::Array(required) = &mut object["required"] {
        required.push("schema_version".into());
    }
    schema
}
