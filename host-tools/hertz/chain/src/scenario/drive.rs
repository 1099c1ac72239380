//! The drive of a chain's first end: its table, and reading a record from a file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::read::{InputError, read_text};

/// Quantity that a [`Drive`] gives body 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DriveQuantity {
    /// A displacement in m. The body follows it whatever force it takes, as on a strong shaker.
    Displacement,
    /// A force in N, in addition to the static load. The body has the striker's mass.
    Force,
}

/// A drive of the chain's first end. Body 0 stays in front of bead 1 in place of the striker: it has the
/// striker's radius and material, and carries the static load.
///
/// The signal is a sine from t = 0 on, a chirp, or a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Drive {
    /// Quantity that the signal is.
    pub quantity: DriveQuantity,
    /// Amplitude of a sine, m or N. The values of a record are multiplied by it.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub amplitude: f64,
    /// Frequency of a sine, or of a chirp at t = 0, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency: Option<f64>,
    /// Frequency of a chirp at the end of its sweep, Hz. It stays there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_end: Option<f64>,
    /// Length of the sweep, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep: Option<f64>,
    /// Time in which a sine grows smoothly to its amplitude, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub ramp: f64,
    /// A record: times in s, increasing from 0, each with a value in m or N. A cubic spline joins them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub samples: Vec<[f64; 2]>,
    /// A file with the record in place of `samples`: two columns, with commas between them, without or with a
    /// line of names. A relative name counts from the folder of the scenario.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

pub(super) fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn one() -> f64 {
    1.0
}

fn is_one(value: &f64) -> bool {
    *value == 1.0
}

impl Drive {
    /// A sine of `amplitude`, m or N, and `frequency`, Hz.
    pub const fn sine(quantity: DriveQuantity, amplitude: f64, frequency: f64) -> Self {
        Self {
            quantity,
            amplitude,
            frequency: Some(frequency),
            frequency_end: None,
            sweep: None,
            ramp: 0.0,
            samples: Vec::new(),
            file: None,
        }
    }

    /// A record of times, s, each with a value, m or N.
    pub const fn record(quantity: DriveQuantity, samples: Vec<[f64; 2]>) -> Self {
        Self {
            quantity,
            amplitude: 1.0,
            frequency: None,
            frequency_end: None,
            sweep: None,
            ramp: 0.0,
            samples,
            file: None,
        }
    }

    /// The highest frequency of a sine or chirp, Hz; `None` for a record.
    pub fn highest_frequency(&self) -> Option<f64> {
        self.frequency
            .map(|from| from.max(self.frequency_end.unwrap_or(from)))
    }

    /// Refuses a sine or chirp that would alias when sampled at this rate, Hz.
    ///
    /// # Errors
    /// [`InputError`]: it has frequencies above half of the rate.
    pub fn check_rate(&self, rate: f64) -> Result<(), InputError> {
        let Some(highest) = self.highest_frequency().filter(|highest| 2.0 * highest > rate) else {
            return Ok(());
        };
        let what = format!("{rate} samples a second cannot show a drive of up to {highest} Hz");
        let advice = format!("take {} samples a second or more", 2.0 * highest);
        Err(InputError::at("drive.frequency", what, advice))
    }

    /// Reads the file of the record, if there is one, into `samples`. `scenario` is the name of the
    /// scenario's file.
    pub(super) fn read_file(&mut self, scenario: &str) -> Result<(), InputError> {
        let Some(file) = &self.file else { return Ok(()) };
        if !self.samples.is_empty() {
            let what = "a drive has either samples or a file with them";
            return Err(InputError::at("drive.file", what, "leave out one of them"));
        }
        let folder = Path::new(scenario).parent().unwrap_or(Path::new(""));
        let path = folder.join(file);
        let text = read_text(&path, "a file of two columns, time and value").map_err(|error| {
            let what = format!("{}: {}", path.display(), error.what);
            InputError::at("drive.file", what, error.advice)
        })?;
        self.samples = samples(&text).map_err(|line| {
            let what = format!("{}:{line}: not a time and a value", path.display());
            let advice = "give two numbers with a comma between them, such as 1e-5,0.25";
            InputError::at("drive.file", what, advice)
        })?;
        self.file = None;
        Ok(())
    }
}

/// The samples of a text of two columns, or the number of the first line that has none. The first line may
/// have names.
fn samples(text: &str) -> Result<Vec<[f64; 2]>, usize> {
    let mut samples = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        let numbers: Vec<Option<f64>> = line.split(',').map(|cell| cell.trim().parse().ok()).collect();
        match numbers[..] {
            [Some(time), Some(value)] => samples.push([time, value]),
            [None] if line.trim().is_empty() => {}
            [None, None] if number == 1 => {}
            _ => return Err(number),
        }
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_two_columns_of_numbers_below_names_or_none() {
        let both = Ok(vec![[0.0, 1.5], [1e-5, -2.0]]);
        assert_eq!(samples("time_s,force_n\n0,1.5\n1e-5, -2\n\n"), both);
        assert_eq!(samples("0,1.5\r\n1e-5,-2\r\n"), both);
        assert_eq!(samples("0,1.5\ntime,force\n"), Err(2));
        assert_eq!(samples("0,1.5\n1e-5\n"), Err(2));
        assert_eq!(samples("0,1.5,3\n"), Err(1));
    }
}
