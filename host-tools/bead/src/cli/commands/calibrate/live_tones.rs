//! Tones of a shaker from a live bead, beside the reference that a person reads.

use std::io::BufRead;
use std::time::Duration;

use bead_calibrate::points::{Channel, Point, steady};
use bead_line::port::Address;

use crate::cli::commands::prelude::*;
use crate::cli::line_options::{TIMEOUT, open};

/// Duration of the scans of a tone.
const DURATION: Duration = Duration::from_millis(500);
/// Least number of tones of a procedure.
const FEWEST: usize = 2;

/// Asks for tones until an empty line, and writes them as a table. It is written anew after each tone, so an
/// interruption loses none.
///
/// # Errors
/// The port does not open, the bead does not answer, or fewer than two tones came.
pub(super) fn record(
    (port, baud): (&Address, u32),
    mut target: Target,
    channel: Channel,
) -> Result<(), Failure> {
    let mut bead = open(port, baud, None, None, TIMEOUT)?;
    note!(
        "shake with a steady tone, then type its frequency in Hz and the reference's rms in m/s², such as: 80 35.2; an \
         empty line ends"
    );
    let mut points: Vec<Point> = Vec::new();
    for line in std::io::stdin().lock().lines() {
        let line = line.context("cannot read standard input")?;
        if line.trim().is_empty() {
            break;
        }
        let Some((frequency, reference)) = typed(&line) else {
            note!(
                "this is not a frequency in Hz and an rms in m/s²; type two numbers above 0, such as: 80 35.2"
            );
            continue;
        };
        let stream = bead.raw(DURATION)?;
        let scans = stream.pieces.iter().flat_map(|piece| {
            let indices = (0..).map(|place| piece.first_index.wrapping_add(place));
            indices.zip(piece.codes.iter())
        });
        let scans: Vec<(u64, [u16; 2])> = scans.collect();
        match steady(&scans, channel, (frequency, reference)) {
            Ok(point) => {
                note!(
                    "{:.2} Hz: {:.2} codes rms from {} scans; the next tone, or an empty line",
                    point.frequency,
                    point.measured,
                    scans.len()
                );
                points.push(point);
                target.write_bytes(table(&points))?;
                // This command has written the file and may replace it.
                target = target.replacing(true);
            }
            Err(why) => note!("{why}; this tone is not taken"),
        }
    }
    if points.len() < FEWEST {
        bail!(
            Input,
            "a calibration needs at least {FEWEST} tones, and {} came; shake, and type a line for each",
            points.len()
        );
    }
    Ok(())
}

/// Frequency and rms in a line.
fn typed(line: &str) -> Option<(f64, f64)> {
    let words: Vec<&str> = line
        .split([' ', '\t', ',', ';'])
        .filter(|word| !word.is_empty())
        .collect();
    let [frequency, reference] = words[..] else {
        return None;
    };
    Some((positive(frequency).ok()?, positive(reference).ok()?))
}

/// The points as `bead calibrate` reads them again.
fn table(points: &[Point]) -> String {
    let heading = "frequency_hz,reference_mps2,codes\n".to_owned();
    points.iter().fold(heading, |table, point| {
        let Point {
            frequency,
            reference,
            measured,
            ..
        } = point;
        format!("{table}{frequency:.6},{reference},{measured:.6}\n")
    })
}
