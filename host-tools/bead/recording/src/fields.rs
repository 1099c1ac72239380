//! The fields of a message under the keys that JSON, Protobuf and tables give them.
//!
//! # Design
//! [`entries`] walks over a message, [`described`] over the description of its fields; both give the same
//! keys in the same order. The rules of names are only here:
//!
//! - A quantity is in its SI unit, which ends the key: `peak_force_n`. Its bits are beside it:
//!   `peak_force_raw`.
//! - A number with a name, and a set of names, have the number beside them: `cause`, `cause_raw`.
//! - The index of a sample has the bead's time beside it: `first_index`, `first_time_s`.

use bead_wire::{FieldDoc, FieldKind, Fields, Value, named};

/// One value under its key.
pub struct Entry<'a> {
    /// Position of its field in the body, from 0.
    pub field: u32,
    /// Relation to that field.
    pub role: Role,
    /// Key in JSON and tables, and name in Protobuf.
    pub key: String,
    /// The value.
    pub content: Content<'a>,
}

/// Relation of an entry to its field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Value of the field.
    Value,
    /// Bits or number behind the value.
    Raw,
    /// Time that belongs to an index, s since the reset.
    Time,
}

/// Value of an entry; `None` in a description, and where the value is not known.
pub enum Content<'a> {
    /// Yes or no.
    Bool(Option<bool>),
    /// A count, a number or the index of a scan.
    Number(Option<u64>),
    /// Bits of a quantity or a set, or the number of a name.
    Bits(Option<i64>),
    /// A quantity in its SI unit, or a time in s.
    Real(Option<f64>),
    /// A number of a list and its name, `None` where this version knows no such number.
    Name(Option<(u8, Option<&'static str>)>),
    /// Names of the bits that are set.
    Names(Option<Vec<&'static str>>),
    /// Text.
    Text(Option<&'a str>),
    /// Bytes.
    Bytes(Option<&'a [u8]>),
    /// Packed scans.
    Scans(Option<&'a [u8]>),
    /// Fields within the field.
    Group(&'static [FieldDoc], Option<&'a dyn Fields>),
}

/// The entries of a message, at `rate` scans a second (Hz).
pub fn entries(body: &dyn Fields, rate: Option<u32>) -> Vec<Entry<'_>> {
    let rate = rate.filter(|rate| *rate > 0);
    let (mut entries, mut position) = (Vec::new(), 0);
    body.each(&mut |field, value| {
        add(&mut entries, position, field, Some(value), rate);
        position += 1;
    });
    entries
}

/// The entries of a message with these fields, without values.
pub fn described(fields: &'static [FieldDoc]) -> Vec<Entry<'static>> {
    let mut entries = Vec::new();
    for (position, field) in (0..).zip(fields) {
        add(&mut entries, position, field, None, None);
    }
    entries
}

fn add<'a>(
    entries: &mut Vec<Entry<'a>>,
    position: u32,
    field: &'static FieldDoc,
    value: Option<Value<'a>>,
    rate: Option<u32>,
) {
    let (mut integer, mut text, mut bytes, mut group) = (None, None, None, None);
    match value {
        Some(Value::Integer(value)) => integer = Some(value),
        Some(Value::Text(value)) => text = Some(value),
        Some(Value::Bytes(value)) => bytes = Some(value),
        Some(Value::Group(value)) => group = value,
        None => {}
    }
    let bits = integer.and_then(|bits| i64::try_from(bits).ok());
    let name = field.name;
    let mut push = |role, key: String, content| {
        entries.push(Entry {
            field: position,
            role,
            key,
            content,
        });
    };
    let (value, raw) = (name.to_owned(), format!("{name}_raw"));
    match field.kind {
        FieldKind::Bool => push(Role::Value, value, Content::Bool(integer.map(|yes| yes != 0))),
        FieldKind::Number => {
            let number = integer.and_then(|number| u64::try_from(number).ok());
            push(Role::Value, value, Content::Number(number));
            if let Some(stem) = name.strip_suffix("_index") {
                let time = number
                    .zip(rate)
                    .map(|(index, rate)| index as f64 / f64::from(rate));
                push(Role::Time, format!("{stem}_time_s"), Content::Real(time));
            }
        }
        FieldKind::Quantity(unit) => {
            let si = bits.and_then(|bits| unit.si(bits, rate));
            push(Role::Value, value + unit.suffix, Content::Real(si));
            push(Role::Raw, raw, Content::Bits(bits));
        }
        FieldKind::Name(names) => {
            let number = integer.and_then(|number| u8::try_from(number).ok());
            let name = |number| names.iter().find(|row| row.0 == number).map(|row| row.1);
            let named = number.map(|number| (number, name(number)));
            push(Role::Value, value, Content::Name(named));
            push(Role::Raw, raw, Content::Bits(bits));
        }
        FieldKind::Set(names) => {
            let set = integer.and_then(|bits| u32::try_from(bits).ok());
            let names = set.map(|bits| named(bits, names).collect());
            push(Role::Value, value, Content::Names(names));
            push(Role::Raw, raw, Content::Bits(bits));
        }
        FieldKind::Text => push(Role::Value, value, Content::Text(text)),
        FieldKind::Bytes => push(Role::Value, value, Content::Bytes(bytes)),
        FieldKind::Scans => push(Role::Value, value, Content::Scans(bytes)),
        FieldKind::Group(fields) => push(Role::Value, value, Content::Group(fields, group)),
    }
}
