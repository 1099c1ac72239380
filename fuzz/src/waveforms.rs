//! Waveforms of other instruments: text tables, WAV, Parquet, recordings.

use bead_instrument::{Choice, Waveform};

use crate::file;

/// Opens the bytes as a file, without and with a choice of columns.
///
/// # Panics
/// A waveform that was accepted has no end, or a refusal is not one line.
pub fn check(bytes: &[u8]) {
    let given = Choice {
        time: "1:ms".parse().ok(),
        force: "2:8.9N".parse().ok(),
        rate_hz: None,
        ..Choice::default()
    };
    let even = Choice {
        force: "1:N".parse().ok(),
        rate_hz: Some(1e5),
        ..Choice::default()
    };
    file::with(bytes, |path| {
        for choice in [Choice::default(), given, even] {
            match Waveform::read(path, &choice, None) {
                Ok(waveform) => assert!(waveform.seconds().is_finite() && waveform.seconds() >= 0.0),
                Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
            }
        }
    });
}
