//! JSON schemas of frames, made from the descriptions of their fields.

use bead_model::design::Description;
use bead_wire::{FieldDoc, Kind};
use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use crate::fields::{Content, described};
use crate::json::SCHEMA_VERSION;
use crate::uncertainties::{ENERGIES, GROUP};

/// The schema of one of these kinds of frames, as [`Frame::json`](crate::frames::Frame::json) shows it, with
/// what commands add.
pub fn of_frames(kinds: &[Kind]) -> Value {
    let mut generator = generator();
    let frames: Vec<Value> = kinds.iter().map(|kind| frame(*kind, &mut generator)).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "oneOf": frames,
        "$defs": generator.take_definitions(true),
    })
}

/// The schema of the bodies of frames of these kinds, by the names of the kinds. Those of `optional` may be
/// null.
pub fn of_bodies(kinds: &[Kind], optional: &[Kind]) -> Value {
    let name = |kind: &Kind| kind.name().to_owned();
    let mut properties: Map<String, Value> = kinds.iter().map(|kind| (name(kind), of_body(*kind))).collect();
    for kind in optional {
        let body = json!({ "anyOf": [of_body(*kind), { "type": "null" }] });
        properties.insert(name(kind), body);
    }
    object(properties, &[])
}

/// The schema of the body of a frame.
pub fn of_body(kind: Kind) -> Value {
    object(body(kind, &mut generator()), &[])
}

fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_serialize().into_generator()
}

/// The schema of a frame as [`Frame::json`](crate::frames::Frame::json) shows it, with what
/// `decode` and `record` add.
fn frame(kind: Kind, generator: &mut SchemaGenerator) -> Value {
    let mut properties = members(json!({
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
    }));
    properties.extend(body(kind, generator));
    properties.extend(members(json!({
        "received": { "type": "string", "format": "date-time" },
        "host_time": { "type": ["string", "null"], "format": "date-time" },
        "file": { "type": "string" },
    })));
    object(properties, &["received", "host_time", "file", "refused"])
}

fn members(object: Value) -> Map<String, Value> {
    object.as_object().cloned().unwrap_or_default()
}

fn body(kind: Kind, generator: &mut SchemaGenerator) -> Map<String, Value> {
    let mut properties = fields(kind.fields());
    match kind {
        Kind::Shape => {
            let known = ENERGIES.map(|key| (key.to_owned(), real()));
            let known = object(known.into_iter().collect(), &[]);
            properties.insert("arrival_time_s".to_owned(), real());
            properties.insert(GROUP.to_owned(), json!({ "anyOf": [known, { "type": "null" }] }));
        }
        Kind::Sync => drop(properties.insert("edge_time_s".to_owned(), real())),
        Kind::Settings => properties.extend(members(json!({
            "settings": generator.subschema_for::<Option<Description>>(),
            "settings_raw": { "type": ["object", "null"] },
            "refused": { "type": "string" },
        }))),
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
        .collect();
    json!({ "type": "object", "properties": properties, "required": required })
}

fn fields(fields: &'static [FieldDoc]) -> Map<String, Value> {
    let entries = described(fields).into_iter();
    entries
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
