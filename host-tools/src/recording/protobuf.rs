//! Messages as Protobuf with their schemas, for programs that know nothing of beads.
//!
//! # Design
//! A message of the wire knows its fields ([`Fields`]), so its schema follows from it. Quantities are doubles
//! in SI units with the unit in the name; every double is exact. An index of a sample has the bead's time
//! beside it. A body of the wire never changes, so neither do the numbers of its fields: the header has 1 to
//! 5, the body 16 and so on in the order of the wire, times 128 and so on.

use bead_wire::{Body, Fields, Value, named};
use prost::Message as _;
use prost::encoding as wire;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

use crate::recording::frames::Frame;
use crate::recording::signal::Signal;

/// Number of the first field of a body.
const BODY: u32 = 16;
/// Number of the time that belongs to a body's field 0.
const TIMES: u32 = 128;

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

/// The fields of the header.
fn header() -> Vec<FieldDescriptorProto> {
    vec![
        field(1, "address", Type::Uint32),
        field(2, "boot_low_byte", Type::Uint32),
        field(3, "sequence", Type::Uint32),
        field(4, "sample_index", Type::Uint64),
        field(5, "time_s", Type::Double),
    ]
}

/// The schema of a body, called `name`.
pub fn schema_of<T: Body>(name: &str) -> Schema {
    // Every optional part is there.
    let whole = T::draw(&mut || u64::MAX);
    let mut fields = header();
    let mut nested = Vec::new();
    describe(&whole, BODY, &mut fields, &mut nested);
    schema(name, fields, nested)
}

fn describe(
    body: &dyn Fields,
    first: u32,
    fields: &mut Vec<FieldDescriptorProto>,
    nested: &mut Vec<DescriptorProto>,
) {
    let mut number = first;
    body.each(&mut |name, value| {
        match value {
            Value::Bool(_) => fields.push(field(number, name, Type::Bool)),
            Value::Number(_) => {
                fields.push(field(number, name, Type::Uint64));
                if let Some(stem) = name.strip_suffix("_index") {
                    fields.push(field(
                        TIMES + number - first,
                        &format!("{stem}_time_s"),
                        Type::Double,
                    ));
                }
            }
            Value::Quantity { unit, .. } => {
                fields.push(field(number, &format!("{name}{}", unit.suffix), Type::Double));
            }
            Value::Name { .. } | Value::Text(_) => fields.push(field(number, name, Type::String)),
            Value::Set { .. } => fields.push(repeated(number, name, Type::String)),
            Value::Bytes(_) | Value::Scans(_) => fields.push(field(number, name, Type::Bytes)),
            Value::Group(body) => {
                let (mut inner, mut deeper) = (Vec::new(), Vec::new());
                if let Some(body) = body {
                    describe(body, 1, &mut inner, &mut deeper);
                }
                let kind = format!("Of_{name}");
                fields.push(FieldDescriptorProto {
                    type_name: Some(kind.clone()),
                    ..field(number, name, Type::Message)
                });
                nested.push(DescriptorProto {
                    name: Some(kind),
                    field: inner,
                    nested_type: deeper,
                    ..DescriptorProto::default()
                });
            }
        }
        number += 1;
    });
}

/// A frame whose body is `body`, as a message of [`schema_of`] that body.
pub fn message(frame: &Frame, body: &dyn Fields) -> Vec<u8> {
    let mut bytes = Vec::new();
    let header = &frame.header;
    wire::uint32::encode(1, &header.address.into(), &mut bytes);
    wire::uint32::encode(2, &header.boot.into(), &mut bytes);
    wire::uint32::encode(3, &header.sequence, &mut bytes);
    wire::uint64::encode(4, &header.sample_index, &mut bytes);
    if let Some(seconds) = frame.seconds(header.sample_index as f64) {
        wire::double::encode(5, &seconds, &mut bytes);
    }
    fill(frame, body, BODY, &mut bytes);
    bytes
}

fn fill(frame: &Frame, body: &dyn Fields, first: u32, bytes: &mut Vec<u8>) {
    let mut number = first;
    body.each(&mut |name, value| {
        match value {
            Value::Bool(yes) => wire::bool::encode(number, &yes, bytes),
            Value::Number(count) => {
                wire::uint64::encode(number, &count, bytes);
                let time = name
                    .strip_suffix("_index")
                    .and_then(|_| frame.seconds(count as f64));
                if let Some(time) = time {
                    wire::double::encode(TIMES + number - first, &time, bytes);
                }
            }
            Value::Quantity { bits, unit } => {
                if let Some(value) = unit.si(bits, frame.sample_rate_hz) {
                    wire::double::encode(number, &value, bytes);
                }
            }
            Value::Name { number: code, name } => {
                let name = name.map_or_else(|| code.to_string(), str::to_owned);
                wire::string::encode(number, &name, bytes);
            }
            Value::Text(text) => wire::string::encode(number, &text.to_owned(), bytes),
            Value::Set { bits, names } => {
                for name in named(bits, names) {
                    wire::string::encode(number, &name.to_owned(), bytes);
                }
            }
            Value::Bytes(data) | Value::Scans(data) => wire::bytes::encode(number, &data.to_vec(), bytes),
            Value::Group(Some(group)) => {
                let mut inner = Vec::new();
                fill(frame, group, 1, &mut inner);
                wire::bytes::encode(number, &inner, bytes);
            }
            Value::Group(None) => {}
        }
        number += 1;
    });
}

/// The window of a strike.
pub struct Waveform<'a> {
    /// Its strike frame.
    pub frame: &'a Frame,
    /// Number of the strike.
    pub strike: u32,
    /// Index of its first scan.
    pub first_index: u64,
    /// Index of the scan that triggered.
    pub trigger_index: u64,
    /// Scans a second, Hz.
    pub sample_rate_hz: u32,
    /// The signals.
    pub signal: &'a Signal,
}

impl Waveform<'_> {
    /// The schema of a waveform.
    pub fn schema() -> Schema {
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

    /// The message. Signals are floats here, which keep a force below 256 N and an acceleration below
    /// 4096 m/s² exactly.
    pub fn message(&self) -> Vec<u8> {
        struct Nothing;
        impl Fields for Nothing {
            fn each(&self, _: &mut dyn FnMut(&'static str, Value<'_>)) {}
        }
        let mut bytes = message(self.frame, &Nothing);
        let period = 1.0 / f64::from(self.sample_rate_hz);
        wire::uint64::encode(16, &self.strike.into(), &mut bytes);
        wire::uint64::encode(17, &self.first_index, &mut bytes);
        wire::uint64::encode(18, &self.trigger_index, &mut bytes);
        wire::double::encode(19, &period, &mut bytes);
        let before = self.trigger_index.saturating_sub(self.first_index) as f64;
        let floats = |values: &mut dyn Iterator<Item = f64>| -> Vec<f32> {
            values.map(|value| value as f32).collect()
        };
        let rate = f64::from(self.sample_rate_hz);
        let times = floats(&mut (0..self.signal.force.len()).map(|sample| (sample as f64 - before) / rate));
        wire::float::encode_packed(20, &times, &mut bytes);
        wire::float::encode_packed(21, &floats(&mut self.signal.force.iter().copied()), &mut bytes);
        wire::float::encode_packed(
            22,
            &floats(&mut self.signal.acceleration.iter().copied()),
            &mut bytes,
        );
        bytes
    }
}
