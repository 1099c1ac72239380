//! JSON schemas of frames, made from the descriptions of their fields.

use bead_model::design::Description;
use bead_wire::{FieldDoc, Kind};
use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use bead_recording::fields::{Content, described};
use bead_recording::json::SCHEMA_VERSION;

/// The schema of the lines of `bead COMMAND`: one of these kinds of frames.
pub(super) fn of_lines(command: &str, kinds: &[Kind]) -> Value {
    let mut generator = generator();
    let frames: Vec<Value> = kinds.iter().map(|kind| frame(*kind, &mut generator)).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": format!("A line that `bead {command}` prints"),
        "oneOf": frames,
        "$defs": generator.take_definitions(true),
    })
}

/// The schema of the answer to `identity`: the body of a frame.
pub(super) fn of_identity() -> Value {
    let mut schema = of_body(Kind::Identity);
    describe(&mut schema, "command identity");
    schema
}

/// The schema of the answer to `status`: the bodies of several frames. A bead of an earlier version does not
/// send the last two.
pub(super) fn of_reports() -> Value {
    let mut properties = Map::new();
    for kind in [Kind::Status, Kind::Health, Kind::Link] {
        properties.insert(kind.name().to_owned(), of_body(kind));
    }
    for kind in [Kind::Guard, Kind::Load] {
        let body = json!({ "anyOf": [of_body(kind), { "type": "null" }] });
        properties.insert(kind.name().to_owned(), body);
    }
    let mut schema = object(properties, &[]);
    describe(&mut schema, "command status");
    schema
}

fn of_body(kind: Kind) -> Value {
    object(body(kind, &mut generator()), &[])
}

fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_serialize().into_generator()
}

/// The schema of a frame as [`Frame::json`](bead_recording::frames::Frame::json) shows it, with what
/// `decode` and `record` add.
fn frame(kind: Kind, generator: &mut SchemaGenerator) -> Value {
    let Value::Object(mut properties) = json!({
        "kind": { "const": kind.name() },
        "schema_version": { "const": SCHEMA_VERSION },
        "version": whole(),
        "address": whole(),
        "boot_low_byte": whole(),
        "sequence": whole(),
        "sample_index": whole(),
        "time_s": real(),
        "arrival": { "enum": ["first", "next", "restart", "late", "duplicate"] },
        "lost_before": whole(),
    }) else {
        unreachable!("the macro makes an object of braces");
    };
    properties.extend(body(kind, generator));
    let added = ["received", "host_time", "file"];
    properties.insert(
        "received".to_owned(),
        json!({ "type": "string", "format": "date-time" }),
    );
    properties.insert(
        "host_time".to_owned(),
        json!({ "type": ["string", "null"], "format": "date-time" }),
    );
    properties.insert("file".to_owned(), json!({ "type": "string" }));
    object(properties, &[&added[..], &["refused"]].concat())
}

/// The properties of a body.
fn body(kind: Kind, generator: &mut SchemaGenerator) -> Map<String, Value> {
    let mut properties = fields(kind.fields());
    match kind {
        Kind::Shape => drop(properties.insert("arrival_time_s".to_owned(), real())),
        Kind::Sync => drop(properties.insert("edge_time_s".to_owned(), real())),
        Kind::Settings => {
            let physical = generator.subschema_for::<Option<Description>>();
            properties.insert("settings".to_owned(), physical.into());
            properties.insert("settings_raw".to_owned(), json!({ "type": ["object", "null"] }));
            properties.insert("refused".to_owned(), json!({ "type": "string" }));
        }
        _ => {}
    }
    properties
}

/// A count, a number or an index.
fn whole() -> Value {
    json!({ "type": "integer", "minimum": 0 })
}

/// A quantity or a time; null where it is not known.
fn real() -> Value {
    json!({ "type": ["number", "null"] })
}

/// An object of these properties, which has all but the `optional` ones.
fn object(properties: Map<String, Value>, optional: &[&str]) -> Value {
    let required: Vec<_> = properties
        .keys()
        .filter(|key| !optional.contains(&&***key))
        .cloned()
        .collect();
    json!({ "type": "object", "properties": properties, "required": required })
}

fn fields(fields: &'static [FieldDoc]) -> Map<String, Value> {
    described(fields)
        .into_iter()
        .map(|entry| (entry.key, of_content(&entry.content)))
        .collect()
}

/// The schema of a value, by its description.
fn of_content(content: &Content<'_>) -> Value {
    match content {
        Content::Bool(_) => json!({ "type": "boolean" }),
        Content::Number(_) => whole(),
        Content::Bits(_) => json!({ "type": "integer" }),
        Content::Real(_) => real(),
        // Null for a number that this version knows no name of.
        Content::Name(_) => json!({ "type": ["string", "null"] }),
        Content::Names(_) => json!({ "type": "array", "items": { "type": "string" } }),
        Content::Text(_) => json!({ "type": "string" }),
        Content::Bytes(_) => json!({ "type": "string", "pattern": "^([0-9a-f]{2})*$" }),
        Content::Scans(_) => {
            json!({ "type": "array", "items": { "type": "array", "items": whole() } })
        }
        Content::Group(of, _) => json!({ "anyOf": [object(fields(of), &[]), { "type": "null" }] }),
    }
}

/// Adds the title, and `schema_version` to the properties of the object, or of each object of a list.
pub(super) fn describe(schema: &mut Value, command: &str) {
    schema["title"] = format!("Output of `bead {command}` as JSON").into();
    if let Some(item) = schema.pointer("/items/$ref").and_then(Value::as_str) {
        let item = item.trim_start_matches('#').to_owned();
        let object = schema
            .pointer_mut(&item)
            .expect("a reference leads to a definition");
        add_version(object);
    } else {
        add_version(schema);
    }
}

/// Adds `schema_version` to the schema of an object.
fn add_version(object: &mut Value) {
    object["properties"]["schema_version"] = json!({ "const": SCHEMA_VERSION });
    if let Value::Array(required) = &mut object["required"] {
        required.push("schema_version".into());
    }
}
