//! Numbers that have names: causes, outcomes, checks; and sets of bits that have names.
//!
//! # Design
//! A list may grow at its end; that needs no other version. A number that this version does not know is kept:
//! the frame arrives with the number and all its other fields, and only the name is missing.

use crate::body::Named;

/// Declares an enumeration. A row has the number, the name in JSON and the variant.
macro_rules! names {
    (
        $(#[doc = $about:literal])*
        pub enum $type:ident {
            $($(#[doc = $doc:literal])* $number:literal $name:literal $variant:ident,)*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $type {
            $($(#[doc = $doc])* $variant,)*
            /// A number that this version does not know.
            Unknown(u8),
        }

        impl $type {
            /// Number, name and meaning of each that this version knows, in the order of the numbers.
            pub const LIST: &'static [$crate::body::Named] = &[$(($number, $name, concat!($($doc),*)),)*];

            /// The one with this number.
            pub const fn from_number(number: u8) -> Self {
                match number {
                    $($number => Self::$variant,)*
                    other => Self::Unknown(other),
                }
            }

            /// Its number on the wire.
            pub const fn number(self) -> u8 {
                match self {
                    $(Self::$variant => $number,)*
                    Self::Unknown(number) => number,
                }
            }

            /// Its name in JSON, if this version knows it.
            pub const fn name(self) -> Option<&'static str> {
                match self {
                    $(Self::$variant => Some($name),)*
                    Self::Unknown(_) => None,
                }
            }
        }

        /// Its name, or its number where it has none.
        impl core::fmt::Display for $type {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self.name() {
                    Some(name) => f.write_str(name),
                    None => write!(f, "number {}", self.number()),
                }
            }
        }

        /// The number on the wire; in formats that people read the name, if there is one.
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self.name().filter(|_| serializer.is_human_readable()) {
                    Some(name) => serializer.serialize_str(name),
                    None => serializer.serialize_u8(self.number()),
                }
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                u8::deserialize(deserializer).map(Self::from_number)
            }
        }

        impl $crate::body::Field for $type {
            const LONGEST: usize = 1;
            const FORM: &'static str = "u8, a number of the list below";
            const KIND: $crate::body::FieldKind = $crate::body::FieldKind::Name(Self::LIST);
            fn value(&self) -> $crate::body::Value<'_> {
                $crate::body::Value::Integer(self.number().into())
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                Self::from_number(random() as u8)
            }
        }
    };
}
pub(crate) use names;

/// Declares a set of bits over an integer. A row has the number of the bit, its name in JSON and its
/// constant.
macro_rules! bits {
    (
        $(#[doc = $about:literal])*
        pub struct $type:ident($bits:ty) {
            $($(#[doc = $doc:literal])* $number:literal $name:literal $constant:ident,)*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $type($bits);

        impl $type {
            /// No bit.
            pub const NONE: Self = Self(0);
            $($(#[doc = $doc])* pub const $constant: Self = Self(1 << $number);)*

            /// Number, name and meaning of each bit that has one.
            pub const LIST: &'static [$crate::body::Named] = &[$(($number, $name, concat!($($doc),*)),)*];

            /// The set with these bits; bits without a name are kept.
            pub const fn from_bits(bits: $bits) -> Self {
                Self(bits)
            }

            /// Its bits, as they travel.
            pub const fn bits(self) -> $bits {
                self.0
            }

            /// Returns `true` if any of `others` is in the set.
            pub const fn has(self, others: Self) -> bool {
                self.0 & others.0 != 0
            }

            /// The set with `others` in it.
            pub const fn with(self, others: Self) -> Self {
                Self(self.0 | others.0)
            }

            /// The set with `others` in it if `condition`.
            pub const fn with_if(self, condition: bool, others: Self) -> Self {
                if condition { self.with(others) } else { self }
            }

            /// The set without `others`.
            pub const fn without(self, others: Self) -> Self {
                Self(self.0 & !others.0)
            }

            /// Names of the bits in the set that have one.
            pub fn names(self) -> impl Iterator<Item = &'static str> {
                $crate::names::named(self.0.into(), Self::LIST)
            }
        }

        impl $crate::body::Field for $type {
            const LONGEST: usize = <$bits as $crate::body::Field>::LONGEST;
            const FORM: &'static str = concat!(stringify!($bits), ", a bit for each of the list below");
            const KIND: $crate::body::FieldKind = $crate::body::FieldKind::Set(Self::LIST);
            fn value(&self) -> $crate::body::Value<'_> {
                $crate::body::Value::Integer(self.0.into())
            }
            fn draw(random: &mut dyn FnMut() -> u64) -> Self {
                Self(random() as $bits)
            }
        }
    };
}
pub(crate) use bits;

/// Names of the bits that are set, by this list.
pub fn named(bits: u32, names: &'static [Named]) -> impl Iterator<Item = &'static str> {
    names
        .iter()
        .filter(move |row| bits >> row.0 & 1 == 1)
        .map(|row| row.1)
}
