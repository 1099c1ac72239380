//! The name that an owner gives a bead.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Longest name, bytes of UTF-8.
pub const NAME_MAX: usize = 16;
/// Letters of a wrong name that its error shows.
const SHOWN: usize = 32;

/// The name of a bead: UTF-8 filled up with zeros. Text in JSON and TOML, [`NAME_MAX`] bytes in a block.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Name([u8; NAME_MAX]);

impl Name {
    /// A name of at most [`NAME_MAX`] bytes without control characters; `None` for other text.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = [0; NAME_MAX];
        bytes.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        (!name.contains(char::is_control)).then_some(Self(bytes))
    }

    /// True if the bytes are text that can be shown: a block can hold any bytes.
    pub(crate) fn is_text(&self) -> bool {
        let (name, rest) = self.0.split_at(self.length());
        let text = core::str::from_utf8(name);
        text.is_ok_and(|text| !text.contains(char::is_control)) && rest.iter().all(|&byte| byte == 0)
    }

    /// The text; empty if the bead has no name.
    pub fn as_str(&self) -> &str {
        core::str::from_utf8(&self.0[..self.length()]).unwrap_or_default()
    }

    fn length(&self) -> usize {
        self.0.iter().position(|&byte| byte == 0).unwrap_or(NAME_MAX)
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.as_str().fmt(f)
    }
}

impl Serialize for Name {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            self.as_str().serialize(serializer)
        } else {
            self.0.serialize(serializer)
        }
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            deserializer.deserialize_str(TextVisitor)
        } else {
            Deserialize::deserialize(deserializer).map(Self)
        }
    }
}

struct TextVisitor;

impl de::Visitor<'_> for TextVisitor {
    type Value = Name;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a string")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Name, E> {
        Name::new(text).ok_or_else(|| {
            let (shown, more) = match text.char_indices().nth(SHOWN) {
                Some((end, _)) => (&text[..end], "…"),
                None => (text, ""),
            };
            E::custom(format_args!(
                "`{}{more}` is not a name: give up to {NAME_MAX} bytes of text without control characters",
                shown.escape_debug()
            ))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::de::IntoDeserializer;

    #[test]
    fn a_name_is_text_without_control_characters_up_to_its_first_zero() {
        // Each text is tried as a name, and as the bytes in a block.
        for (text, is_name) in [
            ("", true),
            ("a", true),
            ("Kügelchen", true),
            ("sixteen bytes ok", true),
            ("a\0b", false),
            ("\0b", false),
            ("a\tb", false),
            ("\x1b]52;c;", false),
        ] {
            let mut name = Name::default();
            name.0[..text.len()].copy_from_slice(text.as_bytes());
            assert_eq!(name.is_text(), is_name, "{text:?}");
            assert_eq!(Name::new(text), is_name.then_some(name), "{text:?}");
            assert!(!is_name || name.as_str() == text);
            // As a table of settings has it.
            let read: Result<_, de::value::Error> = Name::deserialize(text.into_deserializer());
            assert_eq!(read.ok(), is_name.then_some(name), "{text:?}");
        }
        assert_eq!(Name::new("seventeen bytes.."), None);
        let mut wrong = Name::default();
        wrong.0[0] = 0xFF;
        assert_eq!((wrong.is_text(), wrong.as_str()), (false, ""));
    }
}
