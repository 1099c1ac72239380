//! CRC-32/ISO-HDLC, the one checksum of the project: of frames, settings blocks and the record of a fault.
//!
//! # Design
//! Eight bytes at a time, from eight tables of 256 words in flash ("slicing by 8": Kounavis and Berry, *A systematic
//! approach to building high performance software-based CRC generators*, ISCC 2005). Table `k` gives what a byte adds
//! that `k` bytes follow.
#![no_std]
#![forbid(unsafe_code)]

/// The polynomial 0x04C11DB7, its bits reversed.
const POLYNOMIAL: u32 = 0xEDB8_8320;

static TABLES: [[u32; 256]; 8] = tables();

const fn tables() -> [[u32; 256]; 8] {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut table = 0;
        while table < 8 {
            let mut bit = 0;
            while bit < 8 {
                crc = crc >> 1 ^ POLYNOMIAL * (crc & 1);
                bit += 1;
            }
            tables[table][byte] = crc;
            table += 1;
        }
        byte += 1;
    }
    tables
}

/// The CRC of `bytes`.
pub fn checksum(bytes: &[u8]) -> u32 {
    extend(0, bytes)
}

/// The CRC of bytes whose CRC is `crc`, followed by `bytes`.
///
/// Never inlined: one copy is enough, and its instructions can be counted by its symbol.
#[inline(never)]
pub fn extend(crc: u32, bytes: &[u8]) -> u32 {
    let (eights, rest) = bytes.as_chunks::<8>();
    let mut crc = !crc;
    for &[a, b, c, d, e, f, g, h] in eights {
        let [a, b, c, d] = (u32::from_le_bytes([a, b, c, d]) ^ crc).to_le_bytes();
        crc = 0;
        for (table, byte) in TABLES.iter().zip([h, g, f, e, d, c, b, a]) {
            crc ^= table[usize::from(byte)];
        }
    }
    for byte in rest {
        let [low, ..] = crc.to_le_bytes();
        crc = crc >> 8 ^ TABLES[0][usize::from(low ^ byte)];
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_the_catalogues_text_is_the_catalogues() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn every_length_and_every_cut_give_what_an_independent_implementation_gives() {
        let other = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
        let bytes: [u8; 64] = core::array::from_fn(|i| (i * i * 37 + 11) as u8);
        for length in 0..=bytes.len() {
            let bytes = &bytes[..length];
            let expected = other.checksum(bytes);
            for cut in 0..=length {
                assert_eq!(
                    extend(checksum(&bytes[..cut]), &bytes[cut..]),
                    expected,
                    "{length} {cut}"
                );
            }
        }
    }
}
