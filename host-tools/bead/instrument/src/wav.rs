//! WAV files: a channel for each sensor, without units.

use std::io::{self, ErrorKind};
use std::path::Path;

use crate::choice::{Choice, option};
use crate::columns::{ColumnHeader, Picked, pick};
use crate::error::WaveformError;
use crate::riff::WavSamples;
use crate::rows::Rows;
use crate::signals::Waveform;
use bead_tables::unit::Quantity;

/// Reads a WAV file. The full scale of a channel is 1, for float and integer samples alike.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unfit = |what: &str| WaveformError::unfit(path, what);
    let unread = |error: io::Error| match error.kind() {
        _ if error.raw_os_error().is_some() => WaveformError::unread(path)(error),
        ErrorKind::UnexpectedEof => unfit("is a damaged WAV file: it ends before its samples; save it again"),
        ErrorKind::Unsupported => unfit(
            "is a WAV file of a kind that is not read; save it as PCM of 8 to 32 bits, or as 32-bit float",
        ),
        _ => WaveformError::unfit(path, format!("is a damaged WAV file: {error}; save it again")),
    };
    let mut samples = WavSamples::open(path).map_err(unread)?;
    let form = samples.form();
    let channels = usize::from(form.channels);
    if form.rate_hz == 0 {
        return Err(unfit("is a WAV file without a rate or without channels"));
    }
    if choice.strike.is_some() {
        return Err(unfit(
            "is a WAV file, whose strikes are not numbered; leave --read strike out",
        ));
    }
    if choice.force.is_none() && choice.acceleration.is_none() {
        return Err(WaveformError::unfit(
            path,
            format!(
                "is a WAV file, which has no units; give the full scale of a channel (it has {channels}): {}1:500N or \
                 {}1:5000m/s2",
                option(Quantity::Force),
                option(Quantity::Acceleration)
            ),
        ));
    }
    let headers: Vec<_> = (0..channels).map(ColumnHeader::without_name).collect();
    // A rate given by the caller replaces that of the file.
    let rate_hz = choice.rate_hz.unwrap_or(f64::from(form.rate_hz));
    let choice = Choice {
        rate_hz: Some(rate_hz),
        ..choice.clone()
    };
    let picks = pick(path, &headers, &choice)?;
    let mut rows = Rows::picked(path, "sample", Some(rate_hz), &picks);
    let mut row = vec![0.0; channels];
    let mut number = 0;
    while samples.read(&mut row).map_err(unread)? {
        number += 1;
        let value = |picked: Option<Picked>| picked.map(|picked| row[picked.place] * picked.size);
        rows.push(number, [None, value(picks.force), value(picks.acceleration)])?;
    }
    rows.end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::riff::{EXTENSIBLE, FLOAT, PCM};
    use crate::testing::read;

    /// A chunk: its name, the length that it declares, and its bytes.
    type Chunk<'a> = (&'a [u8; 4], u32, &'a [u8]);

    fn chunk<'a>(name: &'a [u8; 4], body: &'a [u8]) -> Chunk<'a> {
        (name, body.len() as u32, body)
    }

    /// Reads a file with these chunks in it.
    fn of_chunks(chunks: &[Chunk<'_>], choice: &Choice) -> Result<Waveform, String> {
        let mut bytes = b"RIFF\0\0\0\0WAVE".to_vec();
        for (name, length, body) in chunks {
            bytes.extend([&name[..], &length.to_le_bytes(), body].concat());
        }
        read(bytes, choice)
    }

    /// A chunk `fmt ` of a channel at 48 kHz with samples of `bytes` bytes, and `more` after its first 16
    /// bytes.
    fn form(tag: u16, bytes: u16, bits: u16, more: &[u8]) -> Vec<u8> {
        let rate = 48_000_u32;
        let mut form = [tag, 1].map(u16::to_le_bytes).concat();
        form.extend([rate, rate * u32::from(bytes)].map(u32::to_le_bytes).concat());
        form.extend([bytes, bits].map(u16::to_le_bytes).concat());
        form.extend(more);
        form
    }

    /// The end of an extensible form: valid bits, channels, and PCM.
    fn valid(bits: u8) -> Vec<u8> {
        let pcm = b"\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71";
        [&[22, 0, bits, 0, 4, 0, 0, 0], &pcm[..]].concat()
    }

    /// A pulse of half of full scale at sample 100 of 200, from below zero to above it, as floats or as
    /// integers of `bytes` bytes.
    fn samples(tag: u16, bytes: usize) -> Vec<u8> {
        let sample = |n: i32| {
            let value = 0.5 * (-(f64::from(n - 100) / 20.0).powi(2)).exp() - 0.25;
            if tag == FLOAT {
                return (value as f32).to_le_bytes();
            }
            let mut sample = ((value * 2_f64.powi(31)) as i32).to_le_bytes();
            sample[3] ^= if bytes == 1 { 0x80 } else { 0 };
            sample
        };
        (0..200).flat_map(|n| sample(n)[4 - bytes..].to_vec()).collect()
    }

    fn of(wanted: &str) -> Choice {
        Choice {
            force: Some(wanted.parse().unwrap()),
            ..Choice::default()
        }
    }

    /// Checks that a full scale of 500 N gives the pulse, to `step` N.
    fn is_the_pulse(chunks: &[Chunk<'_>], step: f64) {
        let force = of_chunks(chunks, &of("1:500N")).unwrap().force.unwrap();
        let peak = force
            .points()
            .find(|(time, _)| (time * 48_000.0).round() == 100.0);
        let (_, peak) = peak.unwrap();
        assert!((peak - 250.0).abs() <= step, "{peak}");
        assert_eq!((force.rows(), force.highest().1), (200, peak));
    }

    #[test]
    fn full_scale_is_what_the_caller_says_in_every_form() {
        for (tag, bytes, bits, more) in [
            (PCM, 1, 8, &[][..]),
            (PCM, 2, 16, &[]),
            (PCM, 3, 24, &[]),
            (PCM, 4, 32, &[]),
            (PCM, 4, 32, &[0, 0]),
            (FLOAT, 4, 32, &[0, 0]),
            // Valid bits are the highest of their bytes.
            (EXTENSIBLE, 4, 32, &valid(24)),
            (EXTENSIBLE, 4, 32, &valid(32)),
            (EXTENSIBLE, 3, 24, &valid(20)),
            (EXTENSIBLE, 2, 16, &valid(16)),
        ] {
            let (form, samples) = (form(tag, bytes, bits, more), samples(tag, bytes.into()));
            // The pulse begins 0.0002 N above its foot, and that is taken for its zero.
            let step = (500.0 / 2_f64.powi(8 * i32::from(bytes) - 1)).max(3e-4);
            is_the_pulse(&[chunk(b"fmt ", &form), chunk(b"data", &samples)], step);
        }
    }

    #[test]
    fn other_chunks_and_streams_of_unknown_length_are_read() {
        let (form, samples) = (form(PCM, 2, 16, &[]), samples(PCM, 2));
        let (form, data) = (chunk(b"fmt ", &form), chunk(b"data", &samples));
        for (length, bytes) in [(3, &b"abc\0"[..]), (3, b"abc"), (4, b"abcd")] {
            let note: Chunk<'_> = (b"note", length, bytes);
            is_the_pulse(&[note, form, note, data, note], 0.02);
        }
        // The stream ends within a sample.
        let cut = [&samples[..], &[0]].concat();
        for length in [u32::MAX, 0x7FFF_EFDC] {
            is_the_pulse(&[form, (b"data", length, &cut)], 0.02);
        }
        for (chunks, message) in [
            (vec![form, (b"data", 402, &samples)], "damaged WAV file: it ends"),
            (vec![form], "ends before its samples; save it again"),
            (vec![data, form], "its samples come before their format"),
        ] {
            let why = of_chunks(&chunks, &of("1:500N")).unwrap_err();
            assert!(why.contains(message), "{why}");
        }
    }

    #[test]
    fn other_forms_of_samples_are_named() {
        for form in [
            form(FLOAT, 8, 64, &[0, 0]),
            form(EXTENSIBLE, 8, 64, &valid(64)),
            // The place of the bits in the four bytes is unknown.
            form(PCM, 4, 24, &[]),
            form(EXTENSIBLE, 4, 24, &valid(24)),
            form(6, 1, 8, &[0, 0]),
            form(PCM, 0, 16, &[]),
            form(PCM, 2, 0, &[]),
            form(EXTENSIBLE, 4, 32, &[]),
        ] {
            let chunks = [chunk(b"fmt ", &form), chunk(b"data", &[0; 1600])];
            let why = of_chunks(&chunks, &of("1:500N")).unwrap_err();
            assert!(why.contains("of a kind that is not read; save it"), "{why}");
        }
    }

    #[test]
    fn without_units_it_is_refused_and_says_what_to_give() {
        let (form, samples) = (form(PCM, 2, 16, &[]), samples(PCM, 2));
        let chunks = [chunk(b"fmt ", &form), chunk(b"data", &samples)];
        let none = Choice::default();
        for (choice, part) in [
            (
                none,
                "the full scale of a channel (it has 1): --read force=1:500N",
            ),
            (of("3:500N"), "no such column of numbers; there are 1"),
            (of("1"), "column 1 has no unit"),
        ] {
            let why = of_chunks(&chunks, &choice).unwrap_err();
            assert!(why.contains(part), "{why}");
        }
    }
}
