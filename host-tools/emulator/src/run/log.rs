//! The image's log: the bytes drained from RTT, decoded with the defmt strings in the image's own ELF. An image without
//! defmt is taken to write lines of text.

use std::path::Path;

use defmt_decoder::{DecodeError, Table};

use super::error::RunError;
use crate::outcome::LogLine;

/// # Errors
/// [`RunError::Log`] if the image's records are of a version that the decoder does not know. Bytes that make no frame
/// (a log cut by a reset) are passed over where the encoding can find its way back.
pub(super) fn decode(path: &Path, elf: &[u8], bytes: &[u8]) -> Result<Vec<LogLine>, RunError> {
    if bytes.is_empty() {
        return Ok(Vec::new());
    }
    let refused = |reason: String| RunError::Log {
        path: path.into(),
        reason,
    };
    let Some(table) = Table::parse(elf).map_err(|e| refused(e.to_string()))? else {
        let plain = |text: &str| LogLine {
            level: None,
            timestamp: None,
            text: text.into(),
        };
        return Ok(String::from_utf8_lossy(bytes).lines().map(plain).collect());
    };
    let mut decoder = table.new_stream_decoder();
    decoder.received(bytes);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => lines.push(LogLine {
                level: frame.level().map(|l| l.as_str().to_string()),
                timestamp: frame.display_timestamp().map(|t| t.to_string()),
                text: frame.display_message().to_string(),
            }),
            Err(DecodeError::UnexpectedEof) => return Ok(lines),
            Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
            Err(DecodeError::Malformed) => return Ok(lines),
        }
    }
}
