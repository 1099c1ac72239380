//! Chunks that another program has compressed: this one writes none, and reads them all the same.
//!
//! # Design
//! A few bytes can stand for megabytes, and a chunk says itself how many. What is unpacked is held against
//! that while it is unpacked. And [`work`] tells beforehand how much the libraries do for it, for the limit
//! of a whole file.

use std::io::Read;

use ruzstd::decoding::errors::FrameDecoderError;
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use crate::recording::file::records::{ChunkHead, RECORD_MOST};
use crate::tables::printable::one_line;

/// What a frame of LZ4 begins with (LZ4 frame format, "General structure"). The library knows an older form,
/// too, in which MCAP has no chunks.
const LZ4: [u8; 4] = 0x184D_2204_u32.to_le_bytes();

/// The bytes of a file that can be read in the time in which a chunk is unpacked, about. `data` is what it
/// has, or the first bytes of that.
pub(super) fn work(header: &ChunkHead, data: &[u8]) -> u64 {
    let besides = match header.compression.as_str() {
        // However short a block is, the library clears the room of a whole one first. Its size is in the
        // second byte behind the magic number: 64 KiB times a power of four.
        "lz4" => data.get(5).map_or(0, |size| (1 << (8 + 2 * (size >> 4 & 7))) / 4),
        // A block can have a megabyte of equal bytes before its length is looked at.
        "zstd" => 64 << 10,
        _ => 0,
    };
    header.uncompressed.min(RECORD_MOST) + besides
}

/// The records in a chunk, at most `most` bytes.
///
/// # Errors
/// What is wrong with it, for people.
pub(super) fn records(header: &ChunkHead, data: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let by = header.compression.as_str();
    let size = usize::try_from(header.uncompressed).unwrap_or(usize::MAX);
    if size > most {
        return Err(format!(
            "a chunk of {size} bytes, compressed with {}, is larger than any chunk",
            one_line(by)
        ));
    }
    // A byte more than it should have is enough to see that it has too many.
    let read = match by {
        "zstd" => unpack_zstd(data, size.saturating_add(1)).map_err(|error| error.to_string()),
        "lz4" if !data.starts_with(&LZ4) => Err("it does not begin as a frame of LZ4".to_owned()),
        "lz4" => {
            let mut records = Vec::new();
            lz4_flex::frame::FrameDecoder::new(data)
                .take(header.uncompressed.saturating_add(1))
                .read_to_end(&mut records)
                .map(|_| records)
                .map_err(|error| error.to_string())
        }
        _ => {
            return Err(format!(
                "chunks are compressed with {}, which is not known here: run `mcap decompress` on it",
                one_line(by)
            ));
        }
    };
    match read {
        Ok(records) if records.len() == size => Ok(records),
        Ok(_) => Err(format!(
            "a chunk, compressed with {by}, has another length than it says"
        )),
        Err(error) => Err(format!("a chunk, compressed with {by}, is damaged ({error})")),
    }
}

/// What a frame of Zstandard holds: all, or what a frame with more than `limit` bytes gives before it ends.
/// The library's reader would fill the window that the frame asks for, up to 128 MB, before it gives a byte
/// of it.
fn unpack_zstd(mut data: &[u8], limit: usize) -> Result<Vec<u8>, FrameDecoderError> {
    let mut decoder = FrameDecoder::new();
    decoder.init(&mut data)?;
    decoder.decode_blocks(&mut data, BlockDecodingStrategy::UptoBytes(limit))?;
    Ok(decoder.collect().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use lz4_flex::frame::{BlockSize, FrameEncoder, FrameInfo};

    use super::*;

    fn head(compression: &str, uncompressed: u64) -> ChunkHead {
        ChunkHead {
            uncompressed,
            crc: 0,
            compression: compression.to_owned(),
            begin: 0,
            length: 0,
        }
    }

    #[test]
    fn the_work_of_a_chunk_is_what_it_says_and_what_the_library_does_besides() {
        for (size, bytes) in [
            (BlockSize::Max64KB, 64 << 10),
            (BlockSize::Max256KB, 256 << 10),
            (BlockSize::Max1MB, 1 << 20),
            (BlockSize::Max4MB, 4 << 20),
        ] {
            let mut encoder = FrameEncoder::with_frame_info(FrameInfo::new().block_size(size), Vec::new());
            std::io::Write::write_all(&mut encoder, b"abc").unwrap();
            let packed = encoder.finish().unwrap();
            assert_eq!(records(&head("lz4", 3), &packed, 3).unwrap(), b"abc");
            assert_eq!(work(&head("lz4", 3), &packed), 3 + bytes / 4);
        }
        assert_eq!(work(&head("lz4", 3), &[]), 3);
        assert_eq!(work(&head("zstd", u64::MAX), &[]), RECORD_MOST + (64 << 10));
        assert_eq!(work(&head("brotli", 7), &[]), 7);
    }

    #[test]
    fn no_more_is_unpacked_than_a_byte_beyond_what_a_chunk_says() {
        // A window of 128 MB, a block of 128 KiB of one byte, and a block of a type that there is not.
        let window = [&0xFD2F_B528_u32.to_le_bytes()[..], &[0, 17 << 3]].concat();
        let packed = [&window[..], &[2, 0, 16, b'a', 6, 0, 0]].concat();
        let why = |size| records(&head("zstd", size), &packed, 1 << 20).unwrap_err();
        assert!(why(1).contains("another length than it says"), "{}", why(1));
        assert!(why(200_000).contains("is damaged"), "{}", why(200_000));
        let older = [0x02, 0x21, 0x4C, 0x18, 2, 0, 0, 0, 0x10, b'a'];
        let why = records(&head("lz4", 1), &older, 1).unwrap_err();
        assert!(why.contains("does not begin as a frame of LZ4"), "{why}");
    }
}
