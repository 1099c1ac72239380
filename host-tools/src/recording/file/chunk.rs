//! Chunks that another program has compressed: this one writes none, and reads them all the same.

use std::io::{Cursor, Read};

use crate::recording::file::records::ChunkHead;
use crate::recording::printable::one_line;

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
    let mut records = Vec::new();
    // A byte more than it should have is enough to see that it has too many.
    let limit = header.uncompressed.saturating_add(1);
    let read = match by {
        "zstd" => ruzstd::decoding::StreamingDecoder::new(Cursor::new(data))
            .map_err(|error| error.to_string())
            .and_then(|decoder| {
                decoder
                    .take(limit)
                    .read_to_end(&mut records)
                    .map_err(|error| error.to_string())
            }),
        "lz4" => lz4_flex::frame::FrameDecoder::new(data)
            .take(limit)
            .read_to_end(&mut records)
            .map_err(|error| error.to_string()),
        _ => {
            return Err(format!(
                "chunks are compressed with {}, which is not known here: run `mcap decompress` on it",
                one_line(by)
            ));
        }
    };
    match read {
        Ok(length) if length == size => Ok(records),
        Ok(_) => Err(format!(
            "a chunk, compressed with {by}, has another length than it says"
        )),
        Err(error) => Err(format!("a chunk, compressed with {by}, is damaged ({error})")),
    }
}
