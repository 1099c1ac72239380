//! Bodies of messages: structs whose fields know their form, their greatest length, their unit and their
//! meaning.
//!
//! # Design
//! [`body!`] declares the struct of a message once. From that one declaration follow its postcard form, the
//! longest body in bytes, the walk over its fields that JSON, Protobuf, tables and replay use, and its table
//! in `docs/protocol.md`.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::unit::Unit;

/// Value of one field. [`FieldDoc::kind`] says what it stands for.
#[derive(Clone, Copy)]
pub enum Value<'a> {
    /// A number, a bool (0 or 1), the bits of a quantity or of a set, or the number of a name.
    Integer(i128),
    /// Text.
    Text(&'a str),
    /// Bytes, or packed scans.
    Bytes(&'a [u8]),
    /// Fields within a field; `None` where they are absent.
    Group(Option<&'a dyn Fields>),
}

/// A walk over the fields of a body.
pub trait Fields {
    /// Calls `visit` with the description and the value of each field, in the order of the wire.
    fn each<'a>(&'a self, visit: &mut dyn FnMut(&'static FieldDoc, Value<'a>));
}

/// Number, name and meaning of one entry of a list.
pub type Named = (u8, &'static str, &'static str);

/// Kind of value that a field has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldKind {
    /// Yes or no.
    Bool,
    /// A count, a number or the index of a scan.
    Number,
    /// A physical quantity, in the fixed-point bits that the bead computed.
    Quantity(&'static Unit),
    /// One of a list of names. A number without a name is of a later version.
    Name(&'static [Named]),
    /// A set of named bits. A bit without a name is of a later version.
    Set(&'static [Named]),
    /// Text.
    Text,
    /// Bytes.
    Bytes,
    /// Packed scans, as [`unpacked`](crate::codes::unpacked) reads them.
    Scans,
    /// Fields within the field, or nothing.
    Group(&'static [FieldDoc]),
}

/// Description of a field: one row of its body's table in the documentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldDoc {
    /// Name, as in JSON.
    pub name: &'static str,
    /// Form on the wire.
    pub form: &'static str,
    /// Longest form on the wire, in bytes.
    pub longest: usize,
    /// Its meaning.
    pub about: &'static str,
    /// Kind of its value, with the unit of a quantity and the names of a list.
    pub kind: FieldKind,
}

impl FieldDoc {
    /// Describes a field with this name and meaning.
    pub(crate) const fn of<T: Field>(name: &'static str, about: &'static str) -> Self {
        Self {
            name,
            form: T::FORM,
            longest: T::LONGEST,
            about,
            kind: T::KIND,
        }
    }
}

/// The body of a message.
pub trait Body: Fields + Serialize + DeserializeOwned {
    /// Longest form on the wire, in bytes.
    const LONGEST: usize;
    /// Its fields, in the order of the wire.
    const FIELDS: &'static [FieldDoc];
    /// Its meaning, in one paragraph or more.
    const ABOUT: &'static str;
    /// A body with every field drawn from random bits, within its bounds. For tests and fuzzing.
    fn draw(random: &mut dyn FnMut() -> u64) -> Self;
}

/// A type that can be a field of a body.
pub trait Field: Serialize + DeserializeOwned {
    /// Longest form on the wire, in bytes.
    ///
    /// [Postcard](https://postcard.jamesmunns.com/wire-format) writes an integer wider than a byte as a
    /// varint of seven bits a byte, a signed one in zigzag order. It writes text or bytes as their length, a
    /// varint, and then the bytes.
    const LONGEST: usize;
    /// Form on the wire.
    const FORM: &'static str;
    /// Kind of its value.
    const KIND: FieldKind;
    /// The value.
    fn value(&self) -> Value<'_>;
    /// Any value, drawn from random bits.
    fn draw(random: &mut dyn FnMut() -> u64) -> Self;
}

/// Longest varint of an integer of this many bits, in bytes.
pub(crate) const fn varint(bits: u32) -> usize {
    bits.div_ceil(7) as usize
}

/// Longest form of text or bytes of at most `most` bytes, in bytes.
pub(crate) const fn counted(most: usize) -> usize {
    assert!(most < 1 << 14, "a length of three varint bytes");
    most + if most < 1 << 7 { 1 } else { 2 }
}

/// The greatest of some lengths.
pub(crate) const fn longest(lengths: &[usize]) -> usize {
    match lengths {
        [] => 0,
        [first, rest @ ..] => {
            let other = longest(rest);
            if *first > other { *first } else { other }
        }
    }
}

macro_rules! numbers_are_fields {
    ($($type:ty: $longest:expr),*) => {$(
        impl Field for $type {
            const LONGEST: usize = $longest;
            const FORM: &'static str = stringify!($type);
            const KIND: FieldKind = FieldKind::Number;
            fn value(&self) -> Value<'_> {
                Value::Integer((*self).into())
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                random() as Self
            }
        }
    )*};
}
numbers_are_fields!(u8: 1, u16: varint(16), u32: varint(32), u64: varint(64));

impl Field for bool {
    const LONGEST: usize = 1;
    const FORM: &'static str = "bool";
    const KIND: FieldKind = FieldKind::Bool;
    fn value(&self) -> Value<'_> {
        Value::Integer((*self).into())
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        random() & 1 == 1
    }
}

/// A device id, a key or a code. They travel without a length, because the length is fixed.
macro_rules! arrays_are_fields {
    ($($length:literal $form:literal),*) => {$(
        impl Field for [u8; $length] {
            const LONGEST: usize = $length;
            const FORM: &'static str = $form;
            const KIND: FieldKind = FieldKind::Bytes;
            fn value(&self) -> Value<'_> {
                Value::Bytes(self)
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                [(); $length].map(|()| random() as u8)
            }
        }
    )*};
}
arrays_are_fields!(12 "12 bytes", 16 "16 bytes");

impl<T: Body> Field for Option<T> {
    const LONGEST: usize = 1 + T::LONGEST;
    const FORM: &'static str = "bool; if true, the fields below follow";
    const KIND: FieldKind = FieldKind::Group(T::FIELDS);
    fn value(&self) -> Value<'_> {
        Value::Group(self.as_ref().map(|body| body as &dyn Fields))
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        bool::draw(random).then(|| T::draw(random))
    }
}

/// Declares the struct of a body. Further traits to derive follow its name.
macro_rules! body {
    (
        $(#[doc = $about:literal])*
        pub struct $name:ident $(: $($derived:ident),+)? {
            $($(#[doc = $doc:literal])* pub $field:ident: $type:ty,)*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        $(#[derive($($derived),+)])?
        pub struct $name {
            $($(#[doc = $doc])* pub $field: $type,)*
        }

        impl $crate::body::Fields for $name {
            fn each<'a>(
                &'a self,
                visit: &mut dyn FnMut(&'static $crate::body::FieldDoc, $crate::body::Value<'a>),
            ) {
                let values = [$($crate::body::Field::value(&self.$field)),*];
                <Self as $crate::body::Body>::FIELDS
                    .iter()
                    .zip(values)
                    .for_each(|(field, value)| visit(field, value));
            }
        }

        impl $crate::body::Body for $name {
            const LONGEST: usize = 0 $(+ <$type as $crate::body::Field>::LONGEST)*;
            const FIELDS: &'static [$crate::body::FieldDoc] =
                &[$($crate::body::FieldDoc::of::<$type>(stringify!($field), concat!($($doc),*))),*];
            const ABOUT: &'static str = concat!($($about, "\n"),*);
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                Self { $($field: $crate::body::Field::draw(random),)* }
            }
        }
    };
}
pub(crate) use body;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_128_bytes_needs_a_second_byte_for_its_length() {
        assert_eq!([counted(0), counted(127), counted(128)], [1, 128, 130]);
    }
}
