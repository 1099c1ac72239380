//! Text and bytes of bounded length, stored in place.

use core::fmt;

use heapless::{String, Vec};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::body::{Field, FieldKind, Value, counted};

/// Text of at most `N` bytes. Longer text is cut between two characters; it is never refused.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Text<const N: usize>(String<N>);

impl<const N: usize> Text<N> {
    /// Formats like `format!`, and cuts what is too long.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut text = Self(String::new());
        // `write_str` never fails. If a `Display` fails, what it wrote so far stays.
        let _ = fmt::Write::write_fmt(&mut text, arguments);
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl<const N: usize> From<&str> for Text<N> {
    fn from(text: &str) -> Self {
        Self::new(format_args!("{text}"))
    }
}

impl<const N: usize> fmt::Write for Text<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = N - self.0.len();
        let fits = text.get(..text.floor_char_boundary(room));
        self.0.push_str(fits.unwrap_or_default()).map_err(|_| fmt::Error)
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl<const N: usize> Field for Text<N> {
    const LONGEST: usize = counted(N);
    const FORM: &'static str = "text";
    const KIND: FieldKind = FieldKind::Text;
    fn value(&self) -> Value<'_> {
        Value::Text(&self.0)
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        let mut text = Self::default();
        for _ in 0..random() as usize % (N + 1) {
            // Characters of one to four bytes.
            let letter = ['x', '\u{e9}', '\u{2026}', '\u{1f41d}'][random() as usize % 4];
            let _ = fmt::Write::write_char(&mut text, letter);
        }
        text
    }
}

/// Longest settings block that fits a frame, in bytes. The longest block of `bead-model` is just as long.
pub const MAX_BLOCK: usize = 256;

/// A settings block, exactly as `bead-model` encoded it. This crate does not look into it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Block(Vec<u8, MAX_BLOCK>);

/// A block has this many bytes, which is more than fits a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a settings block of {0} bytes; a frame takes at most {MAX_BLOCK}")]
pub struct BlockTooLong(pub usize);

impl Block {
    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl TryFrom<&[u8]> for Block {
    type Error = BlockTooLong;
    fn try_from(bytes: &[u8]) -> Result<Self, BlockTooLong> {
        Vec::from_slice(bytes)
            .map(Self)
            .map_err(|_| BlockTooLong(bytes.len()))
    }
}

impl Serialize for Block {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de> Deserialize<'de> for Block {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::try_from(<&[u8]>::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

/// Longest body of a frame that another one carries, in bytes: that of a settings block.
const MAX_INNER: usize = counted(MAX_BLOCK);

/// The body of a frame that another one carries.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inner(Vec<u8, MAX_INNER>);

impl Inner {
    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Builds a text by `write`, which fills the room of the longest body and returns the length.
    pub fn filled_by(write: impl FnOnce(&mut [u8]) -> usize) -> Self {
        Self::filled(|room| Ok::<_, core::convert::Infallible>(write(room)))
    }

    /// Builds a text by `write`, which returns the length. It is empty if `write` fails.
    pub(crate) fn filled<E>(write: impl FnOnce(&mut [u8]) -> Result<usize, E>) -> Self {
        let mut bytes = Vec::new();
        // This cannot fail: there is room for as many.
        let _ = bytes.resize_default(MAX_INNER);
        let length = write(&mut bytes).unwrap_or(0);
        bytes.truncate(length);
        Self(bytes)
    }
}

impl Serialize for Inner {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de> Deserialize<'de> for Inner {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bytes = <&[u8]>::deserialize(deserializer)?;
        Vec::from_slice(bytes)
            .map(Self)
            .map_err(|_| de::Error::custom("a body that no request has"))
    }
}

impl Field for Inner {
    const LONGEST: usize = counted(MAX_INNER);
    const FORM: &'static str = "bytes";
    const KIND: FieldKind = FieldKind::Bytes;
    fn value(&self) -> Value<'_> {
        Value::Bytes(&self.0)
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        let length = random() as usize % (MAX_INNER + 1);
        Self((0..length).map(|_| random() as u8).collect())
    }
}

impl Field for Block {
    const LONGEST: usize = counted(MAX_BLOCK);
    const FORM: &'static str = "bytes";
    const KIND: FieldKind = FieldKind::Bytes;
    fn value(&self) -> Value<'_> {
        Value::Bytes(&self.0)
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        let length = random() as usize % (MAX_BLOCK + 1);
        Self((0..length).map(|_| random() as u8).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws a field from these bits and those that follow them.
    fn drawn<F: Field>(first: usize, next: impl Fn(u64) -> u64) -> F {
        let mut taken = 0;
        F::draw(&mut || {
            taken += 1;
            if taken == 1 { first as u64 } else { next(taken - 2) }
        })
    }

    #[test]
    fn texts_and_bytes_of_every_length_are_drawn() {
        for length in 0..=8 {
            assert_eq!(drawn::<Text<8>>(length, |_| 0).as_str(), &"xxxxxxxx"[..length]);
        }
        assert_eq!(drawn::<Text<8>>(9, |_| 0).as_str(), "");
        assert_eq!(drawn::<Text<8>>(3, |n| n).as_str(), "x\u{e9}\u{2026}");
        for length in [0, 1, 7, MAX_BLOCK] {
            assert!(
                drawn::<Block>(length, |n| n)
                    .bytes()
                    .iter()
                    .copied()
                    .eq((0..length).map(|n| n as u8))
            );
        }
        for length in [0, 1, 7, MAX_INNER] {
            assert!(
                drawn::<Inner>(length, |n| n)
                    .bytes()
                    .iter()
                    .copied()
                    .eq((0..length).map(|n| n as u8))
            );
        }
        assert_eq!(drawn::<Block>(MAX_BLOCK + 1, |n| n).bytes(), []);
        assert_eq!(drawn::<Inner>(MAX_INNER + 1, |n| n).bytes(), []);
    }

    #[test]
    fn a_text_that_comes_in_pieces_is_cut_where_it_is_full() {
        // What is known when this is compiled would come as one piece.
        let [first, second] = core::hint::black_box(["abcdef", "ghijk"]);
        let text = Text::<8>::new(format_args!("{first}{second}"));
        assert_eq!(text.as_str(), "abcdefgh");
        assert_eq!(std::format!("{text}"), "abcdefgh");
        // Two bytes do not fit behind seven.
        let [first, second] = core::hint::black_box(["abcdefg", "\u{e9}"]);
        assert_eq!(
            Text::<8>::new(format_args!("{first}{second}")).as_str(),
            "abcdefg"
        );
    }
}
