//! Windows of strikes in the Universal File Format, which programs for vibration measurements read.
//!
//! # Design
//! Dataset 164 says that all is in SI units. Then comes a dataset 58 for each force and each acceleration, in
//! text, which every reader accepts: a function of time, evenly spaced, in double precision (SDRC I-DEAS Test
//! Data Analysis, Universal Dataset 58). Its twelve digits after the point distinguish every value of the
//! bead from the next: forces are multiples of 2^-16 N below 2^15, accelerations multiples of 2^-12 m/s²
//! below 2^19. The node is the address of the bead; time 0 is the trigger.

use std::io::{self, Write};

use crate::strikes::RecordedStrike;

const YEAR_2000_NS: i64 = 946_684_800_000_000_000;

/// Begins a file.
///
/// # Errors
/// It cannot be written.
pub fn begin(out: &mut impl Write) -> io::Result<()> {
    dataset(out, 164, |out| {
        writeln!(out, "{:>10}{:<20}{:>10}", 1, "SI: m, N, s", 2)?;
        let one = scientific(1.0, 17).replace('E', "D");
        writeln!(out, "{one:>25}{one:>25}{one:>25}")?;
        writeln!(out, "{:>25}", scientific(0.0, 17).replace('E', "D"))
    })
}

/// Writes the two functions of a strike. Returns false and writes nothing if its settings or its quiet start
/// are unknown, as no value in SI units is then known.
///
/// # Errors
/// It cannot be written.
pub fn strike(out: &mut impl Write, recording: &str, strike: &RecordedStrike) -> io::Result<bool> {
    let (Some(signal), Some(rate)) = (strike.signal(), strike.rate()) else {
        return Ok(false);
    };
    let axes = [
        // The codes of an excitation force and of an acceleration.
        (13, "Force", "N", &signal.force),
        (12, "Acceleration", "m/s^2", &signal.acceleration),
    ];
    for (number, (code, name, unit, values)) in (1u32..).zip(axes) {
        dataset(out, 58, |out| {
            let said = &strike.said;
            let place = match number {
                1 => "at the incoming contact",
                _ => "of the intruder",
            };
            // A time soon after 1970 is that of an emulated bead since its power-up.
            let received = strike.received_ns.and_then(|ns| i64::try_from(ns).ok());
            let received = received.filter(|ns| *ns > YEAR_2000_NS).map(|ns| {
                let at = chrono::DateTime::from_timestamp_nanos(ns);
                at.format("%d-%b-%y %H:%M:%S").to_string()
            });
            let named = strike.settings.map(|settings| settings.description().name);
            let named = named.as_ref().map_or("", |name| name.as_str());
            let boot = match strike.nth_boot {
                Some(nth) => format!("boot {nth} of the recording"),
                None => format!("boot with low byte {}", strike.boot),
            };
            for text in [
                format!("{name} {place}, strike {}", said.strike),
                recording.to_owned(),
                received.unwrap_or_default(),
                format!("bead {} {named}, {boot}", strike.address),
                format!("trigger at sample index {}", said.trigger_index),
            ] {
                let plain = text.chars().map(|c| if c.is_ascii_graphic() { c } else { ' ' });
                let plain: String = plain.take(80).collect();
                writeln!(out, "{}", if plain.trim().is_empty() { "NONE" } else { &plain })?;
            }
            // A function of time (1), its number; the bead is the node, in direction +X (1).
            writeln!(
                out,
                "{:>5}{:>10}{:>5}{:>10} {:<10}{:>10}{:>4} {:<10}{:>10}{:>4}",
                1,
                said.strike,
                0,
                0,
                "NONE",
                u32::from(strike.address),
                1,
                "NONE",
                0,
                0
            )?;
            let (rate, before) = (
                f64::from(rate),
                said.trigger_index.saturating_sub(said.first_index) as f64,
            );
            // Real numbers of double precision (4), evenly spaced (1).
            let [start, step, zero] = [-before / rate, 1.0 / rate, 0.0].map(|number| scientific(number, 5));
            writeln!(
                out,
                "{:>10}{:>10}{:>10}{start:>13}{step:>13}{zero:>13}",
                4,
                values.len(),
                1
            )?;
            for (code, name, unit) in [
                (17, "Time", "s"),
                (code, name, unit),
                (0, "NONE", "NONE"),
                (0, "NONE", "NONE"),
            ] {
                writeln!(out, "{code:>10}{:>5}{:>5}{:>5} {name:<20} {unit:<20}", 0, 0, 0)?;
            }
            for four in values.chunks(4) {
                let four: String = four
                    .iter()
                    .map(|value| format!("{:>20}", scientific(*value, 12)))
                    .collect();
                writeln!(out, "{four}")?;
            }
            Ok(())
        })?;
    }
    Ok(true)
}

fn dataset<W: Write>(
    out: &mut W,
    number: u32,
    fill: impl FnOnce(&mut W) -> io::Result<()>,
) -> io::Result<()> {
    writeln!(out, "{:>6}\n{number:>6}", -1)?;
    fill(out)?;
    writeln!(out, "{:>6}", -1)
}

/// A number as Fortran writes it, `1.500E-03`.
fn scientific(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$E}");
    match text
        .split_once('E')
        .map(|(mantissa, exponent)| (mantissa, exponent.parse::<i32>()))
    {
        Some((mantissa, Ok(exponent))) => format!("{mantissa}E{exponent:+03}"),
        _ => text,
    }
}
