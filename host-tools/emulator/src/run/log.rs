//! The image's log. The bytes from RTT are decoded with the defmt strings in the image's own ELF. If an image
//! has no defmt, its log is taken as lines of text.

use std::path::Path;

use defmt_decoder::{DecodeError, Table};

use super::error::RunError;
use crate::outcome::LogLine;

/// # Errors
/// [`RunError::Log`] if the image's records are of a version that the decoder does not know. Bytes that are
/// not a frame (of a log that a reset has cut) are skipped if the encoding allows to find the next frame.
pub(super) fn decode(path: &Path, elf: &[u8], bytes: &[u8]) -> Result<Vec<LogLine>, RunError> {
    if bytes.is_empty() {
        return Ok(Vec::new());
    }
    let refused = |reason: String| RunError::Log(path.into(), reason);
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
