//! ADC codes packed two to three bytes.

use heapless::Vec;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::body::{Field, FieldKind, Value, counted};

/// Highest code of the 12-bit converter.
pub const MAX_CODE: u16 = 0xFFF;
/// Most scans in one waveform frame.
pub const MAX_SCANS: usize = 32;

/// At most `BYTES / 3` scans, packed in three bytes each. A scan is two 12-bit codes, force then
/// acceleration, at one of the two gains.
///
/// The three bytes are the 24-bit number `force | acceleration << 12`, little-endian.
///
/// ```
/// use bead_wire::Codes;
/// let codes = Codes::<6>::pack([[0x123, 0xABC], [0, 4095]])?;
/// assert_eq!(codes.bytes(), [0x23, 0xC1, 0xAB, 0x00, 0xF0, 0xFF]);
/// assert!(codes.iter().eq([[0x123, 0xABC], [0, 4095]]));
/// # Ok::<(), bead_wire::CodeError>(())
/// ```
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Codes<const BYTES: usize>(Vec<u8, BYTES>);

/// Error of packing or unpacking scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodeError {
    /// A code needs more than 12 bits.
    #[error("ADC code {0} is above 4095")]
    TooHigh(u16),
    /// The scans need more than this number of bytes.
    #[error("the scans do not fit in {0} bytes")]
    TooMany(usize),
    /// The number of bytes is not a multiple of three.
    #[error("{0} bytes are not a whole number of scans of 3 bytes")]
    PartialScan(usize),
}

impl<const BYTES: usize> Codes<BYTES> {
    /// Packs `[force, acceleration]` scans, three bytes each.
    ///
    /// # Errors
    /// A code above [`MAX_CODE`], or more scans than fit.
    pub fn pack(scans: impl IntoIterator<Item = [u16; 2]>) -> Result<Self, CodeError> {
        let mut packed = Vec::new();
        for [force, acceleration] in scans {
            if force | acceleration > MAX_CODE {
                return Err(CodeError::TooHigh(force.max(acceleration)));
            }
            let [low, middle, high, _] = (u32::from(force) | u32::from(acceleration) << 12).to_le_bytes();
            packed
                .extend_from_slice(&[low, middle, high])
                .map_err(|_| CodeError::TooMany(BYTES))?;
        }
        Ok(Self(packed))
    }

    /// Takes bytes that are packed already.
    ///
    /// # Errors
    /// A length that is not a multiple of three, or more bytes than fit.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CodeError> {
        if !bytes.len().is_multiple_of(3) {
            return Err(CodeError::PartialScan(bytes.len()));
        }
        Vec::from_slice(bytes)
            .map(Self)
            .map_err(|_| CodeError::TooMany(BYTES))
    }

    /// The packed bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Number of scans.
    pub fn len(&self) -> usize {
        self.0.len() / 3
    }

    /// Returns `true` if it has no scan.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The scans, `[force, acceleration]`, oldest first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [u16; 2]> + Clone + '_ {
        unpacked(&self.0)
    }
}

/// The scans in packed bytes, `[force, acceleration]`, oldest first.
pub fn unpacked(packed: &[u8]) -> impl ExactSizeIterator<Item = [u16; 2]> + Clone + '_ {
    packed.chunks_exact(3).map(|scan| {
        let both = u32::from_le_bytes([scan[0], scan[1], scan[2], 0]);
        [(both & 0xFFF) as u16, (both >> 12) as u16]
    })
}

impl<const BYTES: usize> core::fmt::Debug for Codes<BYTES> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<const BYTES: usize> Serialize for Codes<BYTES> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(&self.0)
    }
}

impl<'de, const BYTES: usize> Deserialize<'de> for Codes<BYTES> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::from_bytes(<&[u8]>::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

impl<const BYTES: usize> Field for Codes<BYTES> {
    const LONGEST: usize = counted(BYTES);
    const FORM: &'static str = "scans";
    const KIND: FieldKind = FieldKind::Scans;
    fn value(&self) -> Value<'_> {
        Value::Bytes(&self.0)
    }
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        let bytes = random() as usize % (BYTES / 3 + 1) * 3;
        Self((0..bytes).map(|_| random() as u8).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_above_twelve_bits_are_refused_also_if_both_have_the_same_bit() {
        let high = 1 << 12;
        for (scan, worst) in [
            ([high, 0], high),
            ([0, high], high),
            ([high, high], high),
            ([MAX_CODE, high | 5], high | 5),
            ([u16::MAX, u16::MAX], u16::MAX),
        ] {
            assert_eq!(Codes::<30>::pack([scan]), Err(CodeError::TooHigh(worst)));
        }
    }

    #[test]
    fn scans_take_three_bytes_each_and_come_back_if_they_fit() {
        let scans = [
            [0, 0],
            [MAX_CODE, MAX_CODE],
            [MAX_CODE, 0],
            [0, MAX_CODE],
            [0x123, 0xABC],
        ];
        let packed = Codes::<15>::pack(scans).unwrap();
        assert_eq!(
            (packed.bytes().len(), packed.len(), packed.is_empty()),
            (15, 5, false)
        );
        assert!(packed.iter().eq(scans) && Codes::<15>::default().is_empty());
        assert_eq!(Codes::<12>::pack(scans), Err(CodeError::TooMany(12)));
        assert_eq!(Codes::<12>::from_bytes(&[0; 4]), Err(CodeError::PartialScan(4)));
        assert_eq!(Codes::<12>::from_bytes(&[0; 15]), Err(CodeError::TooMany(12)));
    }

    #[test]
    fn codes_are_shown_as_a_list_of_scans() {
        let codes = Codes::<6>::pack([[1, 2], [3, 4095]]).unwrap();
        assert_eq!(std::format!("{codes:?}"), "[[1, 2], [3, 4095]]");
    }
}
