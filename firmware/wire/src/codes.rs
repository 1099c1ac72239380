//! ADC codes packed two to three bytes.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeSeq};

/// Highest code of the 12-bit converter.
pub const MAX_CODE: u16 = 0xFFF;
/// Most scans in one waveform frame.
pub const MAX_SCANS: usize = 32;

/// Scans of two 12-bit codes, force then acceleration, at one of the two gains, packed in three bytes each.
///
/// A scan is the number `force | acceleration << 12`, 24 bits, little-endian.
///
/// ```
/// use bead_wire::Codes;
/// let mut bytes = [0; 6];
/// let codes = Codes::pack([[0x123, 0xABC], [0, 4095]], &mut bytes)?;
/// assert_eq!(codes.bytes(), [0x23, 0xC1, 0xAB, 0x00, 0xF0, 0xFF]);
/// assert!(codes.iter().eq([[0x123, 0xABC], [0, 4095]]));
/// # Ok::<(), bead_wire::CodeError>(())
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Codes<'a>(&'a [u8]);

/// Why scans could not be packed or unpacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodeError {
    /// A code needs more than 12 bits.
    #[error("ADC code {0} is above 4095")]
    TooHigh(u16),
    /// The scans need more bytes than the buffer has.
    #[error("the scans need more than the {0} bytes given")]
    BufferTooSmall(usize),
    /// The bytes do not end where a scan does.
    #[error("{0} bytes are no whole number of scans of 3 bytes")]
    PartialScan(usize),
}

impl<'a> Codes<'a> {
    /// Packs `[force, acceleration]` scans into the head of `buffer`, three bytes each.
    ///
    /// # Errors
    /// A code above [`MAX_CODE`], or a buffer too small.
    pub fn pack(scans: impl IntoIterator<Item = [u16; 2]>, buffer: &'a mut [u8]) -> Result<Self, CodeError> {
        let room = buffer.len();
        let mut packed = buffer.as_chunks_mut().0.iter_mut();
        for [force, acceleration] in scans {
            if force | acceleration > MAX_CODE {
                return Err(CodeError::TooHigh(force.max(acceleration)));
            }
            let scan = u32::from(force) | u32::from(acceleration) << 12;
            let [low, middle, high, _] = scan.to_le_bytes();
            *packed.next().ok_or(CodeError::BufferTooSmall(room))? = [low, middle, high];
        }
        let length = room / 3 - packed.len();
        Ok(Self(&buffer[..3 * length]))
    }

    /// Takes packed bytes as they are.
    ///
    /// # Errors
    /// A length that is not a multiple of three.
    pub const fn from_bytes(bytes: &'a [u8]) -> Result<Self, CodeError> {
        if bytes.len().is_multiple_of(3) {
            Ok(Self(bytes))
        } else {
            Err(CodeError::PartialScan(bytes.len()))
        }
    }

    /// The packed bytes.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// How many scans there are.
    pub const fn len(&self) -> usize {
        self.0.len() / 3
    }

    /// Whether there is no scan.
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The scans, `[force, acceleration]`, oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [u16; 2]> + Clone + 'a {
        self.0.chunks_exact(3).map(|scan| {
            let [low, middle, high] = [scan[0], scan[1], scan[2]].map(u16::from);
            [low | (middle & 0xF) << 8, middle >> 4 | high << 4]
        })
    }
}

impl core::fmt::Debug for Codes<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// Packed bytes on the wire, pairs of numbers in formats that people read.
impl Serialize for Codes<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !serializer.is_human_readable() {
            return serializer.serialize_bytes(self.0);
        }
        let mut pairs = serializer.serialize_seq(Some(self.len()))?;
        for scan in self.iter() {
            pairs.serialize_element(&scan)?;
        }
        pairs.end()
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Codes<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::from_bytes(<&[u8]>::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}
