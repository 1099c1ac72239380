//! Points of a shaker: at each frequency the reference's acceleration and the response of the bead's sensor,
//! from a table, or from a record of both.

use std::path::Path;

use bead_compare::front_end::CODES;
use bead_instrument::{Choice, Trace, Waveform};
use bead_tables::printable::beginning;
use bead_tables::unit::{self, Quantity};
use hertz_chain::read_text;

use crate::calibration::{LeftOut, Observation, ObservedValue};
use crate::sine::{self, Tone};

/// Greatest number of points in a table.
const MOST: usize = 10_000;
/// Greatest number of samples in a record: 100 s of the bead's.
const SAMPLES_MOST: usize = 10_000_000;
/// Greatest rms of the rest, as a part of the tone's.
const DISTORTED: f64 = 0.3;
/// Greatest relative difference of the frequencies of a point's two records, which have separate clocks.
const CLOCKS: f64 = 1e-3;
/// Greatest relative difference of a typed frequency from that of the bead's scans.
const TYPED: f64 = 0.02;
/// Time from scan to scan, s: the image samples at 100 kHz and refuses another rate.
const SAMPLE_PERIOD: f64 = 1e-5;

/// A measured unit of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    /// V at the sensor.
    Volts,
    /// Codes of the converter at the high gain.
    Codes,
    /// m/s².
    Acceleration,
    /// N.
    Force,
}

impl Measured {
    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Volts => "V",
            Self::Codes => "codes",
            Self::Acceleration => "m/s²",
            Self::Force => "N",
        }
    }
}

/// A point of a shaker.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its name: a line of a table, or a pair of files.
    pub subject: String,
    /// Frequency, Hz.
    pub frequency: f64,
    /// Acceleration of the reference, m/s² rms.
    pub reference: f64,
    /// Response of the bead's sensor to it, rms.
    pub measured: f64,
}

/// Points with one unit of what was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// The points, in the order of the input.
    pub points: Vec<Point>,
    /// The unit.
    pub measured: Measured,
}

impl Point {
    /// The point as a certificate shows it, with a value derived from it.
    pub(crate) fn observed(&self, measured: Measured, result: ObservedValue) -> Observation {
        Observation {
            subject: self.subject.clone(),
            values: vec![
                ObservedValue::new("frequency", "Hz", self.frequency),
                ObservedValue::new("reference", "m/s² rms", self.reference),
                ObservedValue::new("measured", measured.unit(), self.measured),
                result,
            ],
        }
    }
}

impl Points {
    /// Size of the measured unit in the SI unit that a procedure `takes`; a code has the size `per_code`.
    ///
    /// # Errors
    /// The points have another unit: one line that ends with `would_do`, what the procedure needs instead.
    pub(crate) fn size(&self, takes: Measured, per_code: f64, would_do: &str) -> Result<f64, String> {
        match self.measured {
            Measured::Codes => Ok(per_code),
            measured if measured == takes => Ok(1.0),
            other => Err(format!("the points are in {}; {would_do}", other.unit())),
        }
    }

    /// The points at frequencies that count, and the others with the reason.
    pub(crate) fn split(
        &self,
        counts: impl Fn(f64) -> bool,
        why: impl Fn(f64) -> String,
    ) -> (Vec<&Point>, Vec<LeftOut>) {
        let (kept, others): (Vec<_>, Vec<_>) = self.points.iter().partition(|point| counts(point.frequency));
        let left_out = others.into_iter().map(|point| LeftOut {
            subject: point.subject.clone(),
            why: why(point.frequency),
        });
        (kept, left_out.collect())
    }

    /// Takes the low-pass in front of the converter out of points in codes, as the bead does for its
    /// signals. `pole` is in Hz; 0 for none.
    #[must_use]
    pub fn without_pole(mut self, pole: f64) -> Self {
        if self.measured == Measured::Codes && pole > 0.0 {
            for point in &mut self.points {
                point.measured *= f64::hypot(1.0, point.frequency / pole);
            }
        }
        self
    }
}

/// Reads a table with a heading: frequency, reference, and measured quantity, each with its unit after `_`
/// or in brackets: `frequency_hz,reference_mps2,voltage_v`.
///
/// # Errors
/// One line: file, line, what is wrong and what would do.
pub fn table(path: &Path) -> Result<Points, String> {
    let name = path.display();
    let text = read_text(path, "a CSV table of frequency, reference and measured quantity");
    let text = text.map_err(|error| error.to_string())?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let (at, heading) = lines
        .next()
        .ok_or_else(|| format!("{name} is empty; give a heading and a line for each frequency"))?;
    let separator = [';', '\t', ',']
        .into_iter()
        .find(|letter| heading.contains(*letter));
    let separator = separator.unwrap_or(',');
    let mut columns = [None; 2];
    let mut measured = None;
    for (place, head) in heading.split(separator).enumerate() {
        let head = head.trim().trim_matches('"');
        let (stem, size) = quantity(head);
        let stem = stem.to_lowercase();
        match (size, &stem[..]) {
            (Some((Quantity::Frequency, size)), _) => columns[0] = Some((place, size)),
            (Some((Quantity::Acceleration, size)), stem) if stem.starts_with("ref") => {
                columns[1] = Some((place, size));
            }
            (Some((Quantity::Acceleration, size)), _) => {
                measured = Some((place, size, Measured::Acceleration))
            }
            (Some((Quantity::Voltage, size)), _) => measured = Some((place, size, Measured::Volts)),
            (Some((Quantity::Force, size)), _) => measured = Some((place, size, Measured::Force)),
            (None, "codes" | "code") => measured = Some((place, 1.0, Measured::Codes)),
            _ => {}
        }
    }
    let (Some(frequency), Some(reference), Some(measured)) = (columns[0], columns[1], measured) else {
        return Err(format!(
            "{name}:{at}: the heading `{}` lacks a frequency, reference or measured column; name all three \
             with their units, such as frequency_hz,reference_mps2,voltage_v; the last may also be codes, \
             force_n or intruder_mps2",
            beginning(heading, 60)
        ));
    };
    let mut points = Vec::new();
    for (line, row) in lines {
        let cells: Vec<&str> = row.split(separator).collect();
        let number = |(place, size): (usize, f64)| {
            let cell = cells.get(place).map_or("", |cell| cell.trim().trim_matches('"'));
            let value = cell.parse::<f64>().ok().map(|value| value * size);
            value
                .filter(|value| value.is_finite() && *value > 0.0)
                .ok_or_else(|| {
                    format!(
                        "{name}:{line}: `{}` is not a number above 0; give frequency and both rms values",
                        beginning(cell, 40)
                    )
                })
        };
        points.push(Point {
            subject: format!("line {line}"),
            frequency: number(frequency)?,
            reference: number(reference)?,
            measured: number((measured.0, measured.1))?,
        });
        if points.len() > MOST {
            return Err(format!("{name} has more than {MOST} lines; give fewer"));
        }
    }
    Ok(Points {
        points,
        measured: measured.2,
    })
}

/// Stem of a heading, and quantity and size of its unit.
fn quantity(head: &str) -> (&str, Option<(Quantity, f64)>) {
    if let Some((stem, unit)) = unit::Unit::of_column(head) {
        return (stem, Some((unit.quantity, unit.size)));
    }
    let (stem, text) = unit::split(head);
    let found = text.and_then(|text| match text.trim().to_lowercase().as_str() {
        "hz" => Some((Quantity::Frequency, 1.0)),
        "khz" => Some((Quantity::Frequency, 1e3)),
        _ => unit::parse(text).map(|unit| (unit.quantity, unit.size)),
    });
    (stem, found)
}

/// A channel of the bead's scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The force at the high gain.
    Force,
    /// The acceleration at the high gain.
    Acceleration,
}

impl Channel {
    /// Place among the codes of a scan.
    fn place(self) -> usize {
        usize::from(self == Self::Acceleration)
    }
}

fn is_at_rail(code: u16) -> bool {
    code == 0 || code >= CODES - 1
}

/// The point of a pair of records of one steady tone: scans as `bead command raw` writes them, and the
/// reference's acceleration, which `choice` finds in its file.
///
/// # Errors
/// One line: a file that cannot be read, codes at a rail, or no tone.
pub fn pair(scans: &Path, reference: &Path, choice: &Choice, channel: Channel) -> Result<Point, String> {
    let codes = codes(scans, channel)?;
    let waveform = Waveform::read(reference, choice, None).map_err(|error| error.to_string())?;
    let shown = reference.display();
    let trace: &Trace = waveform.acceleration.as_ref().ok_or_else(|| {
        format!("{shown} has no acceleration; name its column: --read acceleration=COLUMN:UNIT")
    })?;
    let samples: Vec<(f64, f64)> = trace.points().take(SAMPLES_MOST).collect();
    let of_reference = tone(&samples, None, &shown.to_string())?;
    let of_bead = tone(&codes, Some(of_reference.frequency), &scans.display().to_string())?;
    if (of_bead.frequency / of_reference.frequency - 1.0).abs() > CLOCKS {
        return Err(format!(
            "{} has a tone of {:.3} Hz and {shown} one of {:.3} Hz; were both recorded at the same time?",
            scans.display(),
            of_bead.frequency,
            of_reference.frequency
        ));
    }
    Ok(Point {
        subject: scans
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        frequency: of_reference.frequency,
        reference: of_reference.rms,
        measured: of_bead.rms,
    })
}

/// The one steady tone in samples of the file `name`.
fn tone(samples: &[(f64, f64)], near: Option<f64>, name: &str) -> Result<Tone, String> {
    let tone = sine::fit(samples, near).map_err(|why| format!("{name}: {why}"))?;
    if tone.rest > DISTORTED * tone.rms {
        return Err(format!(
            "{name}: components besides its tone of {:.1} Hz amount to {:.0} % of the tone; shake with one \
             steady tone",
            tone.frequency,
            100.0 * tone.rest / tone.rms
        ));
    }
    Ok(tone)
}

/// The point of a steady tone in a bead's scans: sample index and codes of force and acceleration. The
/// reference is given by its frequency, Hz, and acceleration, m/s² rms.
///
/// # Errors
/// One line: codes at a rail, no tone, or one of another frequency.
pub fn steady(
    scans: &[(u64, [u16; 2])],
    channel: Channel,
    (frequency, reference): (f64, f64),
) -> Result<Point, String> {
    let begin = scans.first().map_or(0, |(index, _)| *index);
    let mut samples = Vec::with_capacity(scans.len());
    for (index, codes) in scans.iter().take(SAMPLES_MOST) {
        let code = codes[channel.place()];
        if is_at_rail(code) {
            return Err(format!(
                "the code {code} is at a rail of the converter; shake more softly"
            ));
        }
        let since = index.checked_sub(begin).map(|since| since as f64 * SAMPLE_PERIOD);
        let time = since.filter(|time| samples.last().is_none_or(|(last, _)| last < time));
        let time = time.ok_or("the bead restarted while it sent its scans; shake again")?;
        samples.push((time, f64::from(code)));
    }
    let tone = tone(&samples, None, "the bead's scans")?;
    if (tone.frequency / frequency - 1.0).abs() > TYPED {
        return Err(format!(
            "the bead's scans have a tone of {:.2} Hz, but {frequency} Hz was typed; type the frequency of the \
             shaker",
            tone.frequency
        ));
    }
    Ok(Point {
        subject: format!("{frequency} Hz"),
        frequency: tone.frequency,
        reference,
        measured: tone.rms,
    })
}

/// Times, s, and codes of the scans of a file that `bead command raw` wrote.
fn codes(path: &Path, channel: Channel) -> Result<Vec<(f64, f64)>, String> {
    let name = path.display();
    let text = read_text(path, "scans as `bead command raw --out F.csv` writes them");
    let text = text.map_err(|error| error.to_string())?;
    let mut lines = (1..).zip(text.lines());
    let heading = lines.next().map_or("", |(_, heading)| heading.trim());
    if heading != "sample_index,force_code,acceleration_code" {
        return Err(format!(
            "{name}: `{}` is not the heading of a file of scans; give a file that `bead command raw --out \
             F.csv` wrote",
            beginning(heading, 40)
        ));
    }
    let mut first = None;
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for (line, row) in lines.take(SAMPLES_MOST) {
        let wrong = || format!("{name}:{line}: not a scan; give the file as `bead command raw` wrote it");
        let mut cells = row.split(',');
        let index: u64 = cells
            .next()
            .and_then(|cell| cell.parse().ok())
            .ok_or_else(wrong)?;
        let code: u16 = cells
            .nth(channel.place())
            .and_then(|cell| cell.trim().parse().ok())
            .ok_or_else(wrong)?;
        if is_at_rail(code) {
            return Err(format!(
                "{name}:{line}: the code {code} is at a rail of the converter; shake more softly"
            ));
        }
        let since = index.checked_sub(*first.get_or_insert(index)).ok_or_else(wrong)?;
        let time = since as f64 * SAMPLE_PERIOD;
        if samples.last().is_some_and(|(last, _)| *last >= time) {
            return Err(wrong());
        }
        samples.push((time, f64::from(code)));
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use bead_testing::paper_settings;

    use super::*;
    use crate::simulated::SimulatedBead;
    use crate::simulated::sines::{self, Shaken};

    #[test]
    fn a_table_is_read_by_the_units_of_its_heading_and_a_wrong_cell_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            table(&path)
        };
        let found = read("# shaker\nfrequency (kHz);reference (g);voltage (mV)\n\n0.16;1;10.2\n").unwrap();
        let point = &found.points[0];
        assert_eq!(found.measured, Measured::Volts);
        let values = [point.frequency, point.reference, point.measured];
        for (value, expected) in values.into_iter().zip([160.0, 9.806_65, 0.0102]) {
            assert!((value - expected).abs() < 1e-9, "{point:?}");
        }
        let measured =
            |column: &str, row: &str| read(&format!("frequency_hz,reference_mps2{column}\n{row}\n"));
        assert_eq!(
            measured(",codes", "160,10,81.9").unwrap().measured,
            Measured::Codes
        );
        assert_eq!(
            measured(",force_n", "160,10,0.1").unwrap().measured,
            Measured::Force
        );
        for (refused, says) in [
            (measured("", "160,10"), ":1: the heading"),
            (
                measured(",codes", "160,10,nan"),
                ":2: `nan` is not a number above 0",
            ),
            (measured(",codes", "160,10"), ":2: `` is not a number above 0"),
            (read(""), "is empty"),
        ] {
            let refused = refused.unwrap_err();
            assert!(refused.contains(says), "{refused}");
        }
    }

    #[test]
    fn a_pair_of_records_gives_the_ratio_of_its_tones_and_other_records_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [scans, reference] = ["scans.csv", "reference.csv"].map(|name| folder.path().join(name));
        let bead = SimulatedBead::with_gains(&paper_settings(), [1.0, 1.1]);
        let write = |of_bead: f64, of_reference: f64, rms: f64| {
            let tone = |frequency| Shaken::new(frequency, rms, None, 0.0);
            std::fs::write(&scans, sines::scans(&bead, &tone(of_bead), 0.3, 1)).unwrap();
            std::fs::write(&reference, sines::reference(&tone(of_reference), 1.0, 0.3, 1)).unwrap();
            pair(&scans, &reference, &Choice::default(), Channel::Acceleration)
        };
        let point = write(160.0, 160.0, 30.0).unwrap();
        let per_code = point.reference / point.measured;
        let expected = 1.1 * paper_settings().description().acceleration.per_code;
        assert!((per_code / expected - 1.0).abs() < 1e-4, "{per_code} {expected}");
        let rails = write(160.0, 160.0, 300.0).unwrap_err();
        assert!(
            rails.contains("at a rail of the converter; shake more softly"),
            "{rails}"
        );
        let other = write(160.0, 315.0, 30.0).unwrap_err();
        assert!(
            other.contains("besides its tone") || other.contains("does not converge"),
            "{other}"
        );
    }
}
