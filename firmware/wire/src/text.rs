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

/// At most `N` bytes, stored in place.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BoundedBytes<const N: usize>(Vec<u8, N>);

/// Longest settings block that fits a frame, in bytes. The longest block of `bead-model` is just as long.
pub const MAX_BLOCK: usize = 448;
/// A settings block, exactly as `bead-model` encoded it. This crate does not look into it.
pub type Block = BoundedBytes<MAX_BLOCK>;

/// The signed manifest of an image. This crate does not look into it.
pub type Manifest = BoundedBytes<256>;
/// Most bytes of an image in one request.
pub const MAX_PIECE: usize = 440;
/// Bytes of an image.
pub type Piece = BoundedBytes<MAX_PIECE>;

/// Longest body of a frame carried by another frame, in bytes: that of a settings block.
const MAX_INNER: usize = counted(MAX_BLOCK);
/// The body of a frame carried by another frame.
pub type Inner = BoundedBytes<MAX_INNER>;

/// The length of a block that does not fit a frame, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a settings block of {0} bytes is too long; a frame takes at most {MAX_BLOCK}")]
pub struct BlockTooLong(pub usize);

impl<const N: usize> BoundedBytes<N> {
    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Builds the bytes with `write`, which fills a buffer of `N` bytes and returns the length.
    pub fn filled_by(write: impl FnOnce(&mut [u8]) -> usize) -> Self {
        let mut bytes = Vec::new();
        // This cannot fail: there is room for as many.
        let _ = bytes.resize_default(N);
        let length = write(&mut bytes);
        bytes.truncate(length);
        Self(bytes)
    }
}

impl<const N: usize> TryFrom<&[u8]> for BoundedBytes<N> {
    type Error = BlockTooLong;
    fn try_from(bytes: &[u8]) -> Result<Self, BlockTooLong> {
        Vec::from_slice(bytes)
            .map(Self)
            .map_err(|_| BlockTooLong(bytes.len()))
    }
}

impl<const N: usize> Serialize for BoundedBytes<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de, const N: usize> Deserialize<'de> for BoundedBytes<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::try_from(<&[u8]>::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl<const N: usize> Field for BoundedBytes<N> {
    const LONGEST: usize = counted(N);
    const FORM: &'static str = "bytes";
    const KIND: FieldKind = FieldKind::Bytes;
    fn value(&self) -> Value<'_> {
        Value::Bytes(&self.0)
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        let length = random() as usize % (N + 1);
        Self((0..length).map(|_| random() as u8).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_comes_in_pieces_is_cut_where_it_is_full() {
        for (pieces, text) in [
            (["abcdef", "ghijk"], "abcdefgh"),
            // Two bytes do not fit behind seven.
            (["abcdefg", "\u{e9}"], "abcdefg"),
            (["abc\u{1f41d}\u{1f41d}", ""], "abc\u{1f41d}"),
        ] {
            // Text that is known to the compiler would come as one piece.
            let [first, second] = core::hint::black_box(pieces);
            let cut = Text::<8>::new(format_args!("{first}{second}"));
            assert_eq!(std::format!("{cut}"), text);
        }
    }
}
