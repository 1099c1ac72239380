//! The image's log. The bytes from RTT are decoded with the defmt strings in the image's own ELF. If an image
//! has no defmt, or logs text although it has, its log is read as lines of text.

use std::path::Path;

use defmt_decoder::{DecodeError, Table};
use object::{Object, ObjectSection};

use super::error::RunError;
use crate::outcome::LogLine;

/// # Errors
/// [`RunError::Log`] if the image's records are of a version that the decoder does not know. Bytes that are
/// not a frame (of a log cut by a reset) are skipped if the encoding allows finding the next frame.
pub(super) fn decode(path: &Path, elf: &[u8], bytes: &[u8]) -> Result<Vec<LogLine>, RunError> {
    if bytes.is_empty() {
        Ok(Vec::new())
    } else {
        Ok(lines(parse(path, elf)?.as_ref(), bytes))
    }
}

fn parse(path: &Path, elf: &[u8]) -> Result<Option<Table>, RunError> {
    if has_no_records(elf) {
        return Ok(None);
    }
    Table::parse(elf).map_err(|e| RunError::Log(path.into(), e.to_string()))
}

/// Returns `true` if the image was linked with defmt's script, but does not log with it. The script leaves a
/// byte in the section for the records.
fn has_no_records(elf: &[u8]) -> bool {
    let file = object::File::parse(elf).ok();
    file.and_then(|file| Some(file.section_by_name(".defmt")?.size()))
        .is_some_and(|size| size <= 1)
}

fn lines(table: Option<&Table>, bytes: &[u8]) -> Vec<LogLine> {
    match table {
        Some(table) if !is_text(bytes) => frames(table, bytes),
        _ => String::from_utf8_lossy(bytes).lines().map(plain).collect(),
    }
}

/// Length at which a record without an end is taken as a line, in bytes.
const LONGEST_RECORD: usize = 1 << 20;

/// A log that comes in pieces.
pub(super) struct Log {
    table: Option<Table>,
    /// The beginning of an incomplete record.
    rest: Vec<u8>,
    /// True once a frame of defmt has arrived: it may contain the byte that ends a line of text.
    framed: bool,
}

impl Log {
    /// # Errors
    /// As [`decode`].
    pub(super) fn new(path: &Path, elf: &[u8]) -> Result<Self, RunError> {
        let (table, rest) = (parse(path, elf)?, Vec::new());
        Ok(Self {
            table,
            rest,
            framed: false,
        })
    }

    /// Decodes the records that end in these bytes.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Vec<LogLine> {
        self.rest.extend(bytes);
        self.framed |= self.table.is_some() && bytes.contains(&0);
        let may_be_text = self.table.is_none() || (!self.framed && is_text(&self.rest));
        let ends = |byte: &u8| *byte == 0 || (*byte == b'\n' && may_be_text);
        let end = self.rest.iter().rposition(ends);
        let too_long = self.rest.len() > LONGEST_RECORD;
        let end = end.map_or(if too_long { self.rest.len() } else { 0 }, |end| end + 1);
        let whole: Vec<u8> = self.rest.drain(..end).collect();
        lines(self.table.as_ref(), &whole)
    }
}

/// Returns `true` if these bytes are text. A frame of defmt ends with a zero.
fn is_text(bytes: &[u8]) -> bool {
    let printed = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t' | '\u{1b}');
    str::from_utf8(bytes).is_ok_and(|text| text.chars().all(printed))
}

fn plain(text: &str) -> LogLine {
    LogLine {
        level: None,
        timestamp: None,
        text: text.into(),
    }
}

fn frames(table: &Table, bytes: &[u8]) -> Vec<LogLine> {
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
            Err(DecodeError::UnexpectedEof) => return lines,
            Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
            Err(DecodeError::Malformed) => return lines,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF with nothing but a section `.defmt`.
    fn elf_with_records(bytes: u32) -> Vec<u8> {
        let names = b"\0.defmt\0.shstrtab\0\0\0";
        let mut elf = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0\x02\0\x28\0\x01\0\0\0".to_vec();
        elf.extend([0, 0, 52 + 20, 0].map(u32::to_le_bytes).concat());
        elf.extend([52, 0, 0, 40, 3, 2].map(u16::to_le_bytes).concat());
        elf.extend(names);
        elf.extend([0; 40]);
        elf.extend([1, 1, 0, 0, 52, bytes, 0, 0, 1, 0].map(u32::to_le_bytes).concat());
        elf.extend([8, 3, 0, 0, 52, 20, 0, 0, 1, 0].map(u32::to_le_bytes).concat());
        elf
    }

    #[test]
    fn an_image_linked_with_the_script_of_defmt_that_logs_nothing_has_a_log_of_text() {
        let log = |bytes| Log::new(Path::new("image"), &elf_with_records(bytes));
        assert_eq!(log(1).unwrap().take(b"text\n"), [plain("text")]);
        let error = log(2).map(drop).unwrap_err().to_string();
        assert!(error.contains("cannot be decoded"), "{error}");
    }

    #[test]
    fn a_log_without_an_end_of_a_record_is_not_kept_for_ever() {
        let mut log = Log {
            table: None,
            rest: Vec::new(),
            framed: false,
        };
        assert_eq!(log.take(b"ab"), []);
        assert_eq!(log.take(b"c\nd"), [plain("abc")]);
        let lines: Vec<_> = (0..3).map(|_| log.take(&[b'x'; LONGEST_RECORD]).len()).collect();
        assert_eq!((lines, log.rest.len()), (vec![1, 0, 1], 0));
    }
}
