//! The chunks of a WAV file (RIFF).
//!
//! # Design
//! `hound` takes chunks of odd length to have no padding, the length of a stream for true, and the valid bits
//! of a sample for its lowest ones; the format has padding, streams of unknown length, and valid bits that
//! are the highest. So the chunks are read here, and `hound` gets the samples behind a plain header.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::Path;

use hound::Error;

/// Numbers of the forms of samples.
pub(super) const PCM: u16 = 1;
pub(super) const FLOAT: u16 = 3;
/// The form follows further behind.
pub(super) const EXTENSIBLE: u16 = 0xFFFE;
/// Least length that stands for a stream of unknown end: `sox` writes a little less than 2^31, `ffmpeg`
/// 2^32 - 1.
const STREAM: u32 = 0x7FFF_0000;

/// The samples of a file behind a plain header. Valid bits are the highest of their bytes, so full scale is
/// that of all bytes.
pub(super) fn plain(path: &Path) -> hound::Result<impl Read + use<>> {
    let file = File::open(path)?;
    let size = file.metadata()?.len();
    let mut file = BufReader::new(file);
    file.seek_relative(12)?;
    let mut form = None;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head)?;
        let [_, _, _, _, length @ ..] = head;
        let length = u32::from_le_bytes(length);
        match (&head[..4], form) {
            (b"fmt ", _) => form = Some(Form::read(&mut file, length)?),
            (b"data", Some(form)) => {
                let rest = size.saturating_sub(file.stream_position()?);
                let length = match u32::try_from(rest) {
                    Ok(rest) if length >= STREAM && length > rest => rest - rest % u32::from(form.frame),
                    _ => length,
                };
                return Ok(Cursor::new(form.header(length)).chain(file));
            }
            (b"data", None) => return Err(Error::FormatError("its samples come before their form")),
            _ => file.seek_relative(length.into())?,
        }
        // Some programs leave the padding out. A chunk's name never begins with 0.
        if length % 2 == 1 && file.fill_buf()?.first() == Some(&0) {
            file.consume(1);
        }
    }
}

/// The form of samples.
#[derive(Clone, Copy)]
struct Form {
    tag: u16,
    channels: u16,
    rate: u32,
    /// Size of one sample of each channel, bytes.
    frame: u16,
}

impl Form {
    /// Reads the chunk `fmt `, and refuses forms that `hound` would read wrongly.
    fn read(file: &mut BufReader<File>, length: u32) -> hound::Result<Self> {
        let mut fields = [0; 40];
        let known = fields.len().min(length as usize);
        file.read_exact(&mut fields[..known])?;
        file.seek_relative(i64::from(length) - known as i64)?;
        let field = |at: usize| u16::from_le_bytes([fields[at], fields[at + 1]]);
        let tag = match field(0) {
            EXTENSIBLE => field(24),
            tag => tag,
        };
        let (channels, frame, bits) = (field(2), field(12), field(14));
        let bytes = frame.checked_div(channels).unwrap_or(0);
        // A sample with more bytes than its bits need does not tell where the bits are.
        let is_read = matches!((tag, bytes), (PCM, 1..=4) | (FLOAT, 4)) && bits.div_ceil(8) == bytes;
        if !is_read || bytes * channels != frame {
            return Err(Error::Unsupported);
        }
        Ok(Self {
            tag,
            channels,
            rate: u32::from_le_bytes([fields[4], fields[5], fields[6], fields[7]]),
            frame,
        })
    }

    /// A plain header of `length` bytes of samples.
    fn header(self, length: u32) -> Vec<u8> {
        let (rate, bits) = (self.rate, self.frame / self.channels * 8);
        let mut header = b"RIFF\0\0\0\0WAVEfmt \x10\0\0\0".to_vec();
        header.extend([self.tag, self.channels].map(u16::to_le_bytes).as_flattened());
        let bytes_a_second = rate.wrapping_mul(self.frame.into());
        header.extend([rate, bytes_a_second].map(u32::to_le_bytes).as_flattened());
        header.extend([self.frame, bits].map(u16::to_le_bytes).as_flattened());
        header.extend(b"data");
        header.extend(length.to_le_bytes());
        header
    }
}
