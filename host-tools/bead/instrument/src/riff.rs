//! The samples of a WAV file (RIFF).
//!
//! # Design
//! This reads files that simpler readers get wrong: chunks of odd length with and without padding, streams
//! of unknown length, and samples whose valid bits are the highest of their bytes (Microsoft,
//! `WAVEFORMATEXTENSIBLE`).

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::path::Path;

/// Numbers of the forms of samples.
pub(super) const PCM: u16 = 1;
pub(super) const FLOAT: u16 = 3;
/// The form is in the extension of the chunk.
pub(super) const EXTENSIBLE: u16 = 0xFFFE;
/// Least stated length that means an unknown one: in a stream, `sox` states a little less than 2^31, `ffmpeg`
/// 2^32 - 1.
const STREAM: u32 = 0x7FFF_0000;

/// A reader of the samples of a file.
pub(super) struct WavSamples {
    form: SampleForm,
    file: BufReader<File>,
    /// Number of samples of each channel that are left.
    left: u32,
}

/// The form of samples.
#[derive(Clone, Copy)]
pub(super) struct SampleForm {
    tag: u16,
    pub(super) channels: u16,
    /// Samples a second of each channel, Hz.
    pub(super) rate_hz: u32,
    /// Size of one sample of each channel, bytes.
    frame: u16,
}

impl WavSamples {
    /// Reads up to the first sample.
    ///
    /// # Errors
    /// `UnexpectedEof` if the file ends before the first sample, `Unsupported` for samples of another form,
    /// `InvalidData` if the samples come before their form.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
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
                (b"fmt ", _) => form = Some(SampleForm::read(&mut file, length)?),
                (b"data", Some(form)) => {
                    let rest = size.saturating_sub(file.stream_position()?);
                    let length = match u32::try_from(rest) {
                        Ok(rest) if length >= STREAM => length.min(rest),
                        _ => length,
                    };
                    let left = length / u32::from(form.frame);
                    return Ok(Self { form, file, left });
                }
                (b"data", None) => {
                    let what = "its samples come before their format";
                    return Err(io::Error::new(ErrorKind::InvalidData, what));
                }
                _ => file.seek_relative(length.into())?,
            }
            // Some programs leave the padding out. A chunk's name never begins with 0.
            if length % 2 == 1 && file.fill_buf()?.first() == Some(&0) {
                file.consume(1);
            }
        }
    }

    pub(super) fn form(&self) -> SampleForm {
        self.form
    }

    /// Reads the next sample of each channel into `row`; full scale is 1. Returns false after the last.
    ///
    /// # Errors
    /// The file cannot be read, or ends within its samples.
    pub(super) fn read(&mut self, row: &mut [f64]) -> io::Result<bool> {
        if self.left == 0 {
            return Ok(false);
        }
        self.left -= 1;
        let mut sample = [0; 4];
        let bytes = usize::from(self.form.frame / self.form.channels);
        for value in row {
            // Valid bits are the highest of their bytes, so full scale is that of all four.
            self.file.read_exact(&mut sample[4 - bytes..])?;
            if bytes == 1 {
                // Only samples of 8 bits are unsigned.
                sample[3] ^= 0x80;
            }
            *value = if self.form.tag == FLOAT {
                f32::from_le_bytes(sample).into()
            } else {
                f64::from(i32::from_le_bytes(sample)) / 2_f64.powi(31)
            };
        }
        Ok(true)
    }
}

impl SampleForm {
    fn read(file: &mut BufReader<File>, length: u32) -> io::Result<Self> {
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
        // In a sample with more bytes than its bits need, the place of the bits is unknown.
        let is_read = matches!((tag, bytes), (PCM, 1..=4) | (FLOAT, 4)) && bits.div_ceil(8) == bytes;
        if !is_read || bytes * channels != frame {
            return Err(ErrorKind::Unsupported.into());
        }
        let rate_hz = u32::from_le_bytes([fields[4], fields[5], fields[6], fields[7]]);
        Ok(Self {
            tag,
            channels,
            rate_hz,
            frame,
        })
    }
}
