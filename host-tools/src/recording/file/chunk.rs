//! Chunks that another program has compressed: this one writes none, and reads them all the same.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use mcap::records::ChunkHeader;

/// The records in a chunk, at most `most` bytes.
///
/// # Errors
/// What is wrong with it, for people.
pub(super) fn records<'a>(
    header: &ChunkHeader,
    data: &'a [u8],
    most: usize,
) -> Result<Cow<'a, [u8]>, String> {
    let by = header.compression.as_str();
    if by.is_empty() {
        return Ok(data.into());
    }
    let size = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX);
    if size > most {
        return Err(format!(
            "a chunk of {size} bytes, compressed with {by}, is larger than any chunk"
        ));
    }
    let mut records = Vec::new();
    // A byte more than it should have is enough to see that it has too many.
    let limit = header.uncompressed_size + 1;
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
                "chunks are compressed with {by}, which is not known here: run `mcap decompress` on it"
            ));
        }
    };
    match read {
        Ok(length) if length == size => Ok(records.into()),
        Ok(_) => Err(format!(
            "a chunk, compressed with {by}, has another length than it says"
        )),
        Err(error) => Err(format!("a chunk, compressed with {by}, is damaged ({error})")),
    }
}
