//! Messages as Protobuf with their schemas, for programs that know nothing of beads.
//!
//! # Design
//! The schema of a message follows from its fields, under the names of [`fields`](crate::fields);
//! bits stay out. Quantities are doubles; every double is exact. A body of the wire never changes, so neither
//! do the numbers of its fields: the header has 1 to 5, the body 16 and so on in the order of the wire, times
//! 128 and so on, and what follows from several frames 256 and so on.

use bead_wire::{FieldDoc, Fields, Kind, Message, Strike};
use prost::Message as _;
use prost::encoding as wire;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use crate::fields::{Content, Entry, Role, described, entries};
use crate::frames::Frame;
use crate::signal::Signal;
use crate::uncertainties::{ENERGIES, GROUP, of_energies};

/// Number of the first field of a body.
const BODY: u32 = 16;
/// Number of the time that belongs to a body's field 0.
const TIMES: u32 = 128;

/// Number of the group of uncertainties of a shape.
const UNCERTAINTIES: u32 = 256;

/// A schema: its name, and a `FileDescriptorSet` that defines it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// The message's full name.
    pub name: String,
    /// The encoded descriptors.
    pub descriptors: Vec<u8>,
}

fn schema(name: &str, fields: Vec<FieldDescriptorProto>, nested: Vec<DescriptorProto>) -> Schema {
    let file = FileDescriptorProto {
        // Programs keep the files of all channels in one pool, by their names.
        name: Some(format!("bead/{name}.proto")),
        package: Some("bead".to_owned()),
        message_type: vec![DescriptorProto {
            name: Some(name.to_owned()),
            field: fields,
            nested_type: nested,
            ..DescriptorProto::default()
        }],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    Schema {
        name: format!("bead.{name}"),
        descriptors: FileDescriptorSet { file: vec![file] }.encode_to_vec(),
    }
}

fn field(number: u32, name: &str, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: i32::try_from(number).ok(),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        ..FieldDescriptorProto::default()
    }
}

fn repeated(number: u32, name: &str, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        label: Some(Label::Repeated.into()),
        ..field(number, name, kind)
    }
}

fn header() -> Vec<FieldDescriptorProto> {
    vec![
        field(1, "address", Type::Uint32),
        field(2, "boot_low_byte", Type::Uint32),
        field(3, "sequence", Type::Uint32),
        field(4, "sample_index", Type::Uint64),
        field(5, "time_s", Type::Double),
    ]
}

/// The schema of the frames of a kind, called `name`: of their body, and for a shape the uncertainties of the
/// energies of its strike in J.
pub fn schema_of(name: &str, kind: Kind) -> Schema {
    let mut fields = header();
    let mut nested = describe(kind.fields(), BODY, &mut fields);
    if kind == Kind::Shape {
        let keys = (1..).zip(ENERGIES);
        let group = keys.map(|(number, key)| field(number, key, Type::Double));
        let group = (group.collect(), Vec::new());
        add_group(UNCERTAINTIES, GROUP, group, &mut fields, &mut nested);
    }
    schema(name, fields, nested)
}

/// Number of an entry in a message whose fields begin at `first`; `None` for bits.
fn number(entry: &Entry<'_>, first: u32) -> Option<u32> {
    match entry.role {
        Role::Value => Some(first + entry.field),
        Role::Time => Some(TIMES + entry.field),
        Role::Raw => None,
    }
}

/// Adds the fields of a body, and returns the messages nested in it.
fn describe(
    body: &'static [FieldDoc],
    first: u32,
    fields: &mut Vec<FieldDescriptorProto>,
) -> Vec<DescriptorProto> {
    let mut nested = Vec::new();
    for entry in described(body) {
        let Some(number) = number(&entry, first) else {
            continue;
        };
        let name = &entry.key;
        let kind = match entry.content {
            Content::Bool(_) => Type::Bool,
            Content::Number(_) | Content::Bits(_) => Type::Uint64,
            Content::Real(_) => Type::Double,
            Content::Name(_) | Content::Text(_) => Type::String,
            Content::Names(_) => {
                fields.push(repeated(number, name, Type::String));
                continue;
            }
            Content::Bytes(_) | Content::Scans(_) => Type::Bytes,
            Content::Group(group, _) => {
                let mut inner = Vec::new();
                let deeper = describe(group, 1, &mut inner);
                add_group(number, name, (inner, deeper), fields, &mut nested);
                continue;
            }
        };
        fields.push(field(number, name, kind));
    }
    nested
}

/// Adds a field `name` whose message has fields and messages of its own.
fn add_group(
    number: u32,
    name: &str,
    (own, deeper): (Vec<FieldDescriptorProto>, Vec<DescriptorProto>),
    fields: &mut Vec<FieldDescriptorProto>,
    nested: &mut Vec<DescriptorProto>,
) {
    let kind = format!("Of_{name}");
    nested.push(DescriptorProto {
        name: Some(kind.clone()),
        field: own,
        nested_type: deeper,
        ..DescriptorProto::default()
    });
    fields.push(FieldDescriptorProto {
        type_name: Some(kind),
        ..field(number, name, Type::Message)
    });
}

/// The header of a frame, as a message without a body.
fn head(frame: &Frame) -> Vec<u8> {
    let mut bytes = Vec::new();
    let header = &frame.header;
    wire::uint32::encode(1, &header.address.into(), &mut bytes);
    wire::uint32::encode(2, &header.boot.into(), &mut bytes);
    wire::uint32::encode(3, &header.sequence, &mut bytes);
    wire::uint64::encode(4, &header.sample_index, &mut bytes);
    if let Some(seconds) = frame.seconds(header.sample_index as f64) {
        wire::double::encode(5, &seconds, &mut bytes);
    }
    bytes
}

/// A frame as a message of the [`schema_of`] its kind. An uncertainty that is not known is NaN: without a
/// value it would be read as 0.
pub fn message(frame: &Frame) -> Vec<u8> {
    let mut bytes = head(frame);
    fill(&frame.message, frame.sample_rate_hz, BODY, &mut bytes);
    if let Message::Shape(shape) = &frame.message
        && let Some(known) = frame.strike.and_then(|strike| of_energies(shape, &strike))
    {
        let mut group = Vec::new();
        for (number, u) in (1..).zip(known) {
            wire::double::encode(number, &u.unwrap_or(f64::NAN), &mut group);
        }
        wire::bytes::encode(UNCERTAINTIES, &group, &mut bytes);
    }
    bytes
}

fn fill(body: &dyn Fields, rate: Option<u32>, first: u32, bytes: &mut Vec<u8>) {
    for entry in entries(body, rate) {
        let Some(number) = number(&entry, first) else {
            continue;
        };
        match entry.content {
            Content::Bool(Some(yes)) => wire::bool::encode(number, &yes, bytes),
            Content::Number(Some(count)) => wire::uint64::encode(number, &count, bytes),
            Content::Real(Some(value)) => wire::double::encode(number, &value, bytes),
            Content::Name(Some((code, name))) => {
                let name = name.map_or_else(|| code.to_string(), str::to_owned);
                wire::string::encode(number, &name, bytes);
            }
            Content::Names(Some(names)) => {
                for name in names {
                    wire::string::encode(number, &name.to_owned(), bytes);
                }
            }
            Content::Text(Some(text)) => wire::string::encode(number, &text.to_owned(), bytes),
            Content::Bytes(Some(data)) | Content::Scans(Some(data)) => {
                wire::bytes::encode(number, &data.to_vec(), bytes);
            }
            Content::Group(_, Some(group)) => {
                let mut inner = Vec::new();
                fill(group, rate, 1, &mut inner);
                wire::bytes::encode(number, &inner, bytes);
            }
            // Not known.
            _ => {}
        }
    }
}

/// The schema of the window of a strike.
pub fn waveform_schema() -> Schema {
    let mut fields = header();
    fields.extend([
        field(16, "strike", Type::Uint64),
        field(17, "first_index", Type::Uint64),
        field(18, "trigger_index", Type::Uint64),
        field(19, "sample_period_s", Type::Double),
        repeated(20, "time_from_trigger_s", Type::Float),
        repeated(21, "force_n", Type::Float),
        repeated(22, "acceleration_mps2", Type::Float),
    ]);
    schema("Waveform", fields, Vec::new())
}

/// The window of a strike as a message of [`waveform_schema`], at this number of scans a second (Hz). `frame`
/// is the strike frame. Signals are floats, which keep a force below 256 N and an acceleration below
/// 4096 m/s² exactly.
pub fn waveform(frame: &Frame, strike: &Strike, sample_rate_hz: u32, signal: &Signal) -> Vec<u8> {
    let mut bytes = head(frame);
    let rate = f64::from(sample_rate_hz);
    wire::uint64::encode(16, &strike.strike.into(), &mut bytes);
    wire::uint64::encode(17, &strike.first_index, &mut bytes);
    wire::uint64::encode(18, &strike.trigger_index, &mut bytes);
    wire::double::encode(19, &(1.0 / rate), &mut bytes);
    let before = strike.trigger_index.saturating_sub(strike.first_index) as f64;
    let times = (0..signal.force.len()).map(|sample| ((sample as f64 - before) / rate) as f32);
    wire::float::encode_packed(20, &times.collect::<Vec<_>>(), &mut bytes);
    for (number, values) in [(21, &signal.force), (22, &signal.acceleration)] {
        let values: Vec<f32> = values.iter().map(|value| *value as f32).collect();
        wire::float::encode_packed(number, &values, &mut bytes);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_wire::{Arrival, Body, Shape};

    #[test]
    fn a_quantity_that_was_not_found_is_absent() {
        let frame = |bits| Frame::of(0, 0, Arrival::First, Shape::draw(&mut || bits));
        let length = |bits| message(&frame(bits)).len();
        // Without a sample rate arrival and width are absent as well. Ringing and decay are a key of two
        // bytes and a double each.
        assert_eq!(length(2) - length(0), 2 * (2 + 8));
    }
}
