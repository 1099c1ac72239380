//! The macro that turns the table of messages into types.

/// Declares [`Kind`](crate::Kind) and [`Message`](crate::Message). A row has the number, the name, which is
/// the name of the file too, and the body.
macro_rules! messages {
    ($($number:literal $name:ident $body:ident,)*) => {
        $(pub use $name::*;)*

        /// Kind of a frame: its second byte.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Kind {
            $(
                #[doc = concat!("[`", stringify!($body), "`](crate::", stringify!($body), ")")]
                $body = $number,
            )*
        }

        impl Kind {
            /// Every kind, in the order of the table.
            pub const ALL: &'static [Self] = &[$(Self::$body),*];

            /// The kind with this number on the wire, if there is one.
            pub const fn from_byte(byte: u8) -> Option<Self> {
                match byte {
                    $($number => Some(Self::$body),)*
                    _ => None,
                }
            }

            /// Its name in JSON and documentation.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$body => stringify!($name),)*
                }
            }

            /// Describes the kind's messages.
            pub const fn about(self) -> &'static str {
                match self {
                    $(Self::$body => <$name::$body as Body>::ABOUT,)*
                }
            }

            /// The fields of its body, in the order of the wire.
            pub const fn fields(self) -> &'static [FieldDoc] {
                match self {
                    $(Self::$body => <$name::$body as Body>::FIELDS,)*
                }
            }

            /// Longest body, in bytes.
            pub const fn longest(self) -> usize {
                match self {
                    $(Self::$body => <$name::$body as Body>::LONGEST,)*
                }
            }
        }

        /// One message. It owns its text and bytes.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum Message {
            $(
                #[doc = concat!("[`", stringify!($body), "`](crate::", stringify!($body), ")")]
                $body($name::$body),
            )*
        }

        $(
            impl From<$name::$body> for Message {
                fn from(body: $name::$body) -> Self {
                    Self::$body(body)
                }
            }

            /// The body of a message, if the message is of this kind.
            impl<'a> TryFrom<&'a Message> for &'a $name::$body {
                type Error = Kind;

                fn try_from(message: &'a Message) -> Result<Self, Kind> {
                    match message {
                        Message::$body(body) => Ok(body),
                        other => Err(other.kind()),
                    }
                }
            }
        )*

        impl Message {
            /// The kind in the frame of this message.
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$body(_) => Kind::$body,)*
                }
            }

            /// A message of this kind with every field drawn from random bits, within its bounds. For tests
            /// and fuzzing.
            pub fn draw(kind: Kind, random: &mut dyn FnMut() -> u64) -> Self {
                match kind {
                    $(Kind::$body => Self::$body(Body::draw(random)),)*
                }
            }

            /// Writes the body to the head of `buffer`; returns its length in bytes.
            pub(crate) fn encode(&self, buffer: &mut [u8]) -> postcard::Result<usize> {
                Ok(match self {
                    $(Self::$body(body) => postcard::to_slice(body, buffer)?,)*
                }
                .len())
            }

            /// Reads a body, and what follows it.
            pub(crate) fn decode(kind: Kind, body: &[u8]) -> postcard::Result<(Self, &[u8])> {
                Ok(match kind {
                    $(Kind::$body => {
                        let (body, rest) = postcard::take_from_bytes(body)?;
                        (Self::$body(body), rest)
                    })*
                })
            }
        }

        impl Fields for Message {
            fn each<'a>(&'a self, visit: &mut dyn FnMut(&'static FieldDoc, Value<'a>)) {
                match self {
                    $(Self::$body(body) => body.each(visit),)*
                }
            }
        }

        /// Longest body of any kind, in bytes.
        pub(crate) const MAX_BODY: usize = $crate::body::longest(&[$(<$name::$body as Body>::LONGEST),*]);
    };
}
pub(crate) use messages;

/// Declares [`Request`](crate::Request). A row has the number, the name, the variant and, in braces, the
/// fields of the body.
macro_rules! requests {
    ($(
        $(#[doc = $about:literal])*
        $number:literal $name:literal $variant:ident $({
            $($(#[doc = $doc:literal])* $field:ident: $type:ty,)*
        })?,
    )*) => {
        /// A request of a host. The list may grow at its end; a body never changes.
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum Request {
            $(
                $(#[doc = $about])*
                $variant $({ $($(#[doc = $doc])* $field: $type,)* })?,
            )*
        }

        impl Request {
            /// Number, name, meaning and fields of each, in the order of the numbers.
            pub const LIST: &'static [(u8, &'static str, &'static str, &'static [FieldDoc])] = &[$((
                $number,
                $name,
                concat!($($about, "\n"),*),
                &[$($(FieldDoc::of::<$type>(stringify!($field), concat!($($doc),*)),)*)?],
            ),)*];

            /// Its number on the wire: the second byte of its frame.
            pub const fn number(&self) -> u8 {
                match self {
                    $(Self::$variant { .. } => $number,)*
                }
            }

            /// A request of this number with every field drawn from random bits; `None` if there is no such
            /// number. For tests and fuzzing.
            pub fn draw(number: u8, random: &mut dyn FnMut() -> u64) -> Option<Self> {
                let _ = &random;
                match number {
                    $($number => Some(Self::$variant $({ $($field: <$type>::draw(random),)* })?),)*
                    _ => None,
                }
            }

            /// Writes the body to the head of `buffer`; returns its length in bytes.
            pub(crate) fn encode(&self, buffer: &mut [u8]) -> postcard::Result<usize> {
                match self {
                    $(Self::$variant $({ $($field,)* })? => {
                        Ok(postcard::to_slice(&($($($field,)*)?), buffer)?.len())
                    })*
                }
            }

            pub(crate) fn decode(number: u8, body: &[u8]) -> Result<Self, Cause> {
                match number {
                    $($number => {
                        let ($($($field,)*)?): ($($($type,)*)?) = whole(body)?;
                        Ok(Self::$variant $({ $($field,)* })?)
                    })*
                    other => Err(Cause::Kind(other)),
                }
            }
        }

        /// Longest body of any request, in bytes.
        const MAX_BODY: usize = $crate::body::longest(&[$(0 $($(+ <$type as Field>::LONGEST)*)?),*]);
    };
}
pub(crate) use requests;
