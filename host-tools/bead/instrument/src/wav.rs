//! WAV files: a channel for each sensor, without units.

use std::io::ErrorKind;
use std::path::Path;

use hound::{Error, SampleFormat, WavReader};

use crate::choice::{Choice, option};
use crate::columns::{Header, Picked, pick};
use crate::error::WaveformError;
use crate::riff::plain;
use crate::rows::Rows;
use crate::signals::Waveform;
use bead_tables::unit::Quantity;

/// Reads a WAV file. The full scale of a channel is 1, for float and whole samples alike.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unread = |error: Error| match error {
        Error::IoError(source) if source.raw_os_error().is_some() => WaveformError::File {
            path: path.to_owned(),
            source,
        },
        Error::IoError(source) if source.kind() == ErrorKind::UnexpectedEof => WaveformError::unfit(
            path,
            "is a damaged WAV file: it ends before its samples; save it again",
        ),
        Error::Unsupported => WaveformError::unfit(
            path,
            "is a WAV file of a kind that is not read; save it as PCM of 8 to 32 bits, or as float of 32",
        ),
        error => WaveformError::unfit(path, format!("is a damaged WAV file: {error}")),
    };
    let mut reader = plain(path).and_then(WavReader::new).map_err(unread)?;
    let spec = reader.spec();
    let channels = usize::from(spec.channels);
    if spec.sample_rate == 0 || channels == 0 {
        return Err(WaveformError::unfit(
            path,
            "is a WAV file without a rate or without channels",
        ));
    }
    if choice.strike.is_some() {
        return Err(WaveformError::unfit(
            path,
            "is a WAV file, whose strikes have no numbers; leave --waveform-strike out",
        ));
    }
    if choice.force.is_none() && choice.acceleration.is_none() {
        return Err(WaveformError::unfit(
            path,
            format!(
                "is a WAV file, which has no units; say for a channel (it has {channels}) what full scale is: {} 1:500N or \
                 {} 1:5000m/s2",
                option(Quantity::Force),
                option(Quantity::Acceleration)
            ),
        ));
    }
    let channel = |place| Header {
        place,
        name: (place + 1).to_string(),
        unit: None,
    };
    let headers: Vec<_> = (0..channels).map(channel).collect();
    // A given rate corrects that of the file.
    let rate_hz = choice.rate_hz.unwrap_or(f64::from(spec.sample_rate));
    let choice = Choice {
        rate_hz: Some(rate_hz),
        ..choice.clone()
    };
    let picks = pick(path, &headers, &choice)?;
    let mut rows = Rows::picked(path, "sample", Some(rate_hz), &picks);
    let mut row = vec![0.0; channels];
    let (mut at, mut number) = (0, 0);
    let mut take = |sample: f64| -> Result<(), WaveformError> {
        row[at] = sample;
        at += 1;
        if at < channels {
            return Ok(());
        }
        (at, number) = (0, number + 1);
        let value = |picked: Option<Picked>| picked.map(|picked| row[picked.place] * picked.size);
        rows.push(number, [None, value(picks.force), value(picks.acceleration)])
    };
    match spec.sample_format {
        SampleFormat::Float => {
            for sample in reader.samples::<f32>() {
                take(f64::from(sample.map_err(unread)?))?;
            }
        }
        SampleFormat::Int => {
            let full = 2f64.powi(i32::from(spec.bits_per_sample) - 1);
            for sample in reader.samples::<i32>() {
                take(f64::from(sample.map_err(unread)?) / full)?;
            }
        }
    }
    rows.end()
}

#[cfg(test)]
mod tests {
    use hound::{WavSpec, WavWriter};

    use super::*;
    use crate::riff::{EXTENSIBLE, FLOAT, PCM};

    /// A pulse on channel 2 of 2, half of full scale.
    fn file(folder: &Path, bits: u16, format: SampleFormat) -> std::path::PathBuf {
        let path = folder.join("drop.wav");
        let spec = WavSpec {
            channels: 2,
            sample_rate: 48_000,
            bits_per_sample: bits,
            sample_format: format,
        };
        let mut writer = WavWriter::create(&path, spec).unwrap();
        for n in 0..480 {
            let value = 0.5 * (-(f64::from(n - 240) / 20.0).powi(2)).exp();
            match format {
                SampleFormat::Float => {
                    writer.write_sample(0.1_f32).unwrap();
                    writer.write_sample(value as f32).unwrap();
                }
                SampleFormat::Int => {
                    writer.write_sample(1_i32).unwrap();
                    let full = 2f64.powi(i32::from(bits) - 1);
                    writer.write_sample((value * full).round() as i32).unwrap();
                }
            }
        }
        writer.finalize().unwrap();
        path
    }

    fn of(wanted: &str) -> Choice {
        Choice {
            force: Some(wanted.parse().unwrap()),
            ..Choice::default()
        }
    }

    #[test]
    fn full_scale_is_what_the_caller_says_in_every_width() {
        let folder = tempfile::tempdir().unwrap();
        for (bits, format, step) in [
            (8, SampleFormat::Int, 1.0 / 128.0),
            (16, SampleFormat::Int, 1.0 / 32768.0),
            (24, SampleFormat::Int, 2f64.powi(-23)),
            (32, SampleFormat::Int, 2f64.powi(-31)),
            (32, SampleFormat::Float, 2f64.powi(-24)),
        ] {
            let path = file(folder.path(), bits, format);
            let waveform = Waveform::read(&path, &of("2:500N"), None).unwrap();
            let force = waveform.force.unwrap();
            let (time, peak) = force.highest();
            assert!((peak - 250.0).abs() <= 500.0 * step, "{bits} {format:?}: {peak}");
            // Eight bits have a flat top.
            let flat = if bits == 8 { 3.1 } else { 1e-6 };
            assert!((time * 48_000.0 - 240.0).abs() < flat, "{bits}: {time}");
        }
    }

    /// A file of 200 samples of one channel, from chunks: a pulse of half of full scale at sample 100.
    fn of_chunks(path: &Path, chunks: &[(&[u8; 4], u32, &[u8])]) {
        let mut bytes = b"RIFF\0\0\0\0WAVE".to_vec();
        for (name, length, body) in chunks {
            bytes.extend(*name);
            bytes.extend(length.to_le_bytes());
            bytes.extend(*body);
        }
        std::fs::write(path, bytes).unwrap();
    }

    /// A chunk `fmt ` of samples of `bytes` bytes, with `more` behind its first 16 bytes.
    fn form(tag: u16, bytes: u16, bits: u16, more: &[u8]) -> Vec<u8> {
        let rate = 48_000_u32;
        let mut form = [tag, 1].map(u16::to_le_bytes).as_flattened().to_vec();
        let rates = [rate, rate * u32::from(bytes)].map(u32::to_le_bytes);
        form.extend(rates.as_flattened());
        form.extend([bytes, bits].map(u16::to_le_bytes).as_flattened());
        form.extend(more);
        form
    }

    /// The end of an extensible form: valid bits, channels, and PCM.
    fn valid(bits: u8) -> Vec<u8> {
        let pcm = b"\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71";
        [&[22, 0, bits, 0, 4, 0, 0, 0], &pcm[..]].concat()
    }

    /// The pulse as whole numbers of `bytes` bytes.
    fn samples(bytes: usize) -> Vec<u8> {
        let sample = |n: i32| {
            let value = 0.5 * (-(f64::from(n - 100) / 20.0).powi(2)).exp();
            (value * 2_f64.powi(31)) as i32
        };
        let samples = (0..200).flat_map(|n| sample(n).to_le_bytes()[4 - bytes..].to_vec());
        samples.collect()
    }

    fn chunk<'a>(name: &'a [u8; 4], body: &'a [u8]) -> (&'a [u8; 4], u32, &'a [u8]) {
        (name, body.len() as u32, body)
    }

    fn is_the_pulse(path: &Path) {
        let force = Waveform::read(path, &of("1:500N"), None).unwrap().force.unwrap();
        let (time, peak) = force.highest();
        assert!((peak - 250.0).abs() < 0.02, "{peak}");
        assert_eq!((force.rows(), (time * 48_000.0).round()), (200, 100.0));
    }

    #[test]
    fn valid_bits_are_the_highest_of_their_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drop.wav");
        for (bytes, bits) in [(4, 24), (4, 32), (3, 20), (2, 16)] {
            let form = form(EXTENSIBLE, bytes, 8 * bytes, &valid(bits));
            let samples = samples(bytes.into());
            of_chunks(&path, &[chunk(b"fmt ", &form), chunk(b"data", &samples)]);
            is_the_pulse(&path);
        }
        // Without that, a form of 18 bytes.
        let form = form(PCM, 4, 32, &[0, 0]);
        of_chunks(&path, &[chunk(b"fmt ", &form), chunk(b"data", &samples(4))]);
        is_the_pulse(&path);
    }

    #[test]
    fn other_chunks_and_streams_of_unknown_length_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drop.wav");
        let (form, samples) = (form(PCM, 2, 16, &[]), samples(2));
        for note in [
            (b"note", 3, &b"abc\0"[..]),
            (b"note", 3, &b"abc"[..]),
            (b"note", 4, &b"abcd"[..]),
        ] {
            of_chunks(
                &path,
                &[note, chunk(b"fmt ", &form), note, chunk(b"data", &samples), note],
            );
            is_the_pulse(&path);
        }
        // With the first byte of a sample that was cut.
        let cut = [&samples[..], &[0]].concat();
        for length in [u32::MAX, 0x7FFF_EFDC] {
            of_chunks(&path, &[chunk(b"fmt ", &form), (b"data", length, &cut)]);
            is_the_pulse(&path);
        }
        let refused = |chunks: &[(&[u8; 4], u32, &[u8])], message: &str| {
            of_chunks(&path, chunks);
            let error = Waveform::read(&path, &of("1:500N"), None)
                .unwrap_err()
                .to_string();
            assert!(error.contains(message), "{error}");
        };
        refused(
            &[chunk(b"fmt ", &form), (b"data", 402, &samples)],
            "is a damaged WAV file",
        );
        refused(&[chunk(b"fmt ", &form)], "ends before its samples; save it again");
        refused(
            &[chunk(b"data", &samples), chunk(b"fmt ", &form)],
            "is a damaged WAV file",
        );
    }

    #[test]
    fn other_forms_of_samples_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drop.wav");
        for form in [
            form(FLOAT, 8, 64, &[0, 0]),
            form(EXTENSIBLE, 8, 64, &valid(64)),
            // Where in the four bytes?
            form(PCM, 4, 24, &[]),
            form(EXTENSIBLE, 4, 24, &valid(24)),
            form(6, 1, 8, &[0, 0]),
            form(PCM, 0, 16, &[]),
            form(PCM, 2, 0, &[]),
            form(EXTENSIBLE, 4, 32, &[]),
        ] {
            of_chunks(&path, &[chunk(b"fmt ", &form), chunk(b"data", &[0; 1600])]);
            let why = Waveform::read(&path, &of("1:500N"), None)
                .unwrap_err()
                .to_string();
            assert!(
                why.contains("is a WAV file of a kind that is not read; save it as PCM"),
                "{why}"
            );
        }
    }

    #[test]
    fn without_units_or_cut_short_it_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), 16, SampleFormat::Int);
        let says = |choice: &Choice| Waveform::read(&path, choice, None).unwrap_err().to_string();
        let why = says(&Choice::default());
        assert!(
            why.contains("(it has 2) what full scale is: --force-column 1:500N"),
            "{why}"
        );
        assert!(says(&of("3:500N")).contains("no such column of numbers; there are 1, 2"));
        assert!(says(&of("2")).contains("column 2 has no unit"));
        let whole = std::fs::read(&path).unwrap();
        for length in [12, 20, 43, 44, 45, 301] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let why = says(&of("2:500N"));
            assert_eq!(why.lines().count(), 1, "{why}");
        }
    }
}
