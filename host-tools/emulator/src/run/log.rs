//! The image's log: the bytes drained from RTT, decoded with the defmt strings in the image's own ELF. An image without
//! defmt is taken to write lines of text.

use std::fmt;
use std::path::Path;

use defmt_decoder::{DecodeError, Table};

use super::RunError;

/// One line of the image's log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogLine {
    /// `trace`, `debug`, `info`, `warn` or `error`; `None` for `println`.
    pub level: Option<String>,
    /// As the image's `defmt::timestamp!` formats it; `None` if it has none.
    pub timestamp: Option<String>,
    /// The message.
    pub text: String,
}

impl LogLine {
    fn plain(text: &str) -> Self {
        Self {
            level: None,
            timestamp: None,
            text: text.into(),
        }
    }
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(timestamp) = &self.timestamp {
            write!(f, "{timestamp} ")?;
        }
        if let Some(level) = &self.level {
            write!(f, "{:5} ", level.to_uppercase())?;
        }
        f.write_str(&self.text)
    }
}

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
        return Ok(String::from_utf8_lossy(bytes)
            .lines()
            .map(LogLine::plain)
            .collect());
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
