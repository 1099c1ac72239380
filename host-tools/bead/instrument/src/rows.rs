//! Rows of any file, checked and made into a waveform. Gaps, disorder and odd values are refused here.

use std::path::Path;

use crate::choice::Choice;
use crate::columns::Picks;
use crate::doubts::{cut_off, noise};
use crate::error::WaveformError;
use crate::signals::Waveform;
use crate::trace::{Times, Trace, thinned, zeroed};
use bead_tables::unit::Quantity;

/// Greatest number of rows of a waveform: three columns of them take 240 MB.
pub(super) const MOST: usize = 10_000_000;
/// Greatest value in SI units, as in scenarios: sums and differences stay finite.
const GREATEST: f64 = 1e30;
/// Least number of rows of a waveform.
const LEAST: usize = 8;
/// Shortest gap, in usual steps of time.
const GAP: f64 = 1.5;

/// Delay of a bead's acceleration behind the force of the same scan, s: two conversions of 27 cycles at
/// 21 MHz.
pub(super) const ACCELERATION_LATER: f64 = 2.0 * 27.0 / 21e6;

/// The rows of a file, in SI units.
pub(super) struct Rows<'a> {
    path: &'a Path,
    /// Word for a row in messages: `line`, `row`, `sample`.
    row: &'static str,
    rate_hz: Option<f64>,
    count: usize,
    time: Vec<f64>,
    force: Option<Vec<f64>>,
    acceleration: Option<Vec<f64>>,
    /// Offset of the rows' times, s.
    pub(super) since: f64,
    /// Delay of the acceleration behind the force of the same row, s.
    pub(super) acceleration_later: f64,
    pub(super) remarks: Vec<String>,
}

impl<'a> Rows<'a> {
    /// No rows yet. `of` states if they have a force, and if they have an acceleration. With a rate, times
    /// are not used.
    pub(super) fn new(path: &'a Path, row: &'static str, rate_hz: Option<f64>, of: [bool; 2]) -> Self {
        let [force, acceleration] = of.map(|there| there.then(Vec::new));
        Self {
            path,
            row,
            rate_hz,
            count: 0,
            time: Vec::new(),
            force,
            acceleration,
            since: 0.0,
            acceleration_later: 0.0,
            remarks: Vec::new(),
        }
    }

    /// No rows yet, of the columns of `picks`.
    pub(super) fn picked(path: &'a Path, row: &'static str, rate_hz: Option<f64>, picks: &Picks) -> Self {
        let of = [picks.force.is_some(), picks.acceleration.is_some()];
        let mut rows = Self::new(path, row, rate_hz, of);
        rows.remarks.clone_from(&picks.remarks);
        rows
    }

    fn unfit<T>(&self, what: String) -> Result<T, WaveformError> {
        Err(WaveformError::unfit(self.path, what))
    }

    /// Appends the row that messages call `number`: time, force and acceleration in SI units, `None` where
    /// the file has no number.
    ///
    /// # Errors
    /// A value is missing or too great, or the time does not increase.
    pub(super) fn push(&mut self, number: u64, values: [Option<f64>; 3]) -> Result<(), WaveformError> {
        let (path, row) = (self.path, self.row);
        if self.count == MOST {
            return self.unfit(format!(
                "has more than {} million {row}s; save only the strike, or every tenth {row}",
                MOST / 1_000_000
            ));
        }
        let unfit = |what| Err(WaveformError::unfit(path, what));
        let columns = [
            (self.rate_hz.is_none().then_some(&mut self.time), Quantity::Time),
            (self.force.as_mut(), Quantity::Force),
            (self.acceleration.as_mut(), Quantity::Acceleration),
        ];
        for ((column, quantity), value) in columns.into_iter().zip(values) {
            let Some(column) = column else { continue };
            let Some(value) = value.filter(|value| value.is_finite()) else {
                return unfit(format!(
                    "{row} {number} has no number for the {}; a waveform must have no gaps: fill in the number, or \
                     remove the {row}",
                    quantity.name()
                ));
            };
            if value.abs() > GREATEST {
                return unfit(format!(
                    "{row} {number} has {value:.3e} {} for the {}, but values up to {GREATEST:e} are read; correct \
                     the value, or its unit",
                    quantity.si(),
                    quantity.name()
                ));
            }
            column.push(value);
        }
        if let [.., before, time] = self.time[..]
            && time <= before
        {
            let what = if time == before {
                "stands still"
            } else {
                "goes back"
            };
            let (before, time) = (before + self.since, time + self.since);
            return unfit(format!(
                "time {what} at {row} {number}, from {before} to {time} s; sort the rows, or give their true rate with \
                 --read rate=HZ"
            ));
        }
        self.count += 1;
        Ok(())
    }

    /// Makes the waveform of all rows.
    ///
    /// # Errors
    /// There are too few rows, or a gap in time.
    pub(super) fn end(mut self) -> Result<Waveform, WaveformError> {
        if self.count < LEAST {
            let what = format!(
                "has {} {}s of numbers, and a strike needs more",
                self.count, self.row
            );
            return self.unfit(what);
        }
        let start = self.since + self.time.first().copied().unwrap_or(0.0);
        let times = self.times()?;
        let later = self.acceleration_later;
        let mut remarks = std::mem::take(&mut self.remarks);
        let columns = [
            (Quantity::Force, self.force.take(), 0.0),
            (Quantity::Acceleration, self.acceleration.take(), later),
        ];
        let [force, acceleration] = columns.map(|(quantity, values, later)| {
            let mut values = values?;
            let (offset, quiet) = zeroed(&mut values);
            remarks.extend(doubts(quantity, &values, quiet));
            let (times, values, middle) = thinned(&times, values);
            let trace = Trace::new(times, values, later + middle);
            remarks.extend(self::remarks(quantity, &trace, offset));
            Some(trace)
        });
        Ok(Waveform {
            force,
            acceleration,
            start,
            remarks,
        })
    }

    /// The times since the first row. Steps that are even but for rounding become even.
    fn times(&mut self) -> Result<Times, WaveformError> {
        if let Some(rate_hz) = self.rate_hz {
            return Ok(Times::Even {
                step: 1.0 / rate_hz,
                count: self.count,
            });
        }
        let mut time = std::mem::take(&mut self.time);
        let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        let (_, usual, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
        let usual = *usual;
        drop(steps);
        if let Some(pair) = time.windows(2).find(|pair| pair[1] - pair[0] > GAP * usual) {
            let (from, to) = (pair[0] + self.since, pair[1] + self.since);
            return self.unfit(format!(
                "has a gap from {from} to {to} s, where its {}s are {usual:.3e} s apart; fill in the gap, cut it out, or \
                 resample the values at even steps",
                self.row
            ));
        }
        let start = time[0];
        // Instruments round times, by up to a whole step.
        let even = (time[self.count - 1] - start) / (self.count - 1) as f64;
        let is_even = (0..).zip(&time).all(|(row, time)| {
            let row = f64::from(row);
            (time - start - row * even).abs() <= 0.6 * even
        });
        if is_even {
            return Ok(Times::Even {
                step: even,
                count: self.count,
            });
        }
        time.iter_mut().for_each(|time| *time -= start);
        Ok(Times::Each(time.into()))
    }
}

/// Greatest noise of a quantity without a remark, as a part of its highest value.
const NOISE_MOST: f64 = 0.01;

/// Remarks on values that were cut off, and on noise. The zero comes from the first `quiet` rows.
fn doubts(quantity: Quantity, values: &[f64], quiet: usize) -> Vec<String> {
    let (name, si) = (quantity.name(), quantity.si());
    let mut remarks = Vec::new();
    if let Some((rows, value)) = cut_off(values) {
        remarks.push(format!(
            "the {name} stays at {value:.4} {si} for {rows} rows and leaves that value steeply: it was cut off there, so \
             energies from it are too low; record it again with a wider range"
        ));
    }
    let greatest = values.iter().fold(0.0, |most, value| f64::max(most, value.abs()));
    let noise = noise(values, quiet);
    if noise > NOISE_MOST * greatest {
        remarks.push(format!(
            "the {name} has noise of {noise:.3} {si} rms, {:.1} % of its highest value, and its zero, the mean of {quiet} rows, \
             is known only to about {:.3} {si}: energies from it are doubtful; filter it, or average several records",
            100.0 * noise / greatest,
            noise / (quiet as f64).sqrt()
        ));
    }
    remarks
}

/// Remarks on the zero, the sign, the end and the rate of a quantity.
fn remarks(quantity: Quantity, trace: &Trace, offset: f64) -> Vec<String> {
    let (name, si) = (quantity.name(), quantity.si());
    let (_, highest) = trace.highest();
    let greatest = trace.greatest();
    let mut remarks = Vec::new();
    if greatest == 0.0 {
        return vec![format!("the {name} is {offset} {si} throughout")];
    }
    if offset.abs() > 0.01 * greatest {
        remarks.push(format!(
            "the {name} begins at {offset:.4} {si}, which is taken as its zero"
        ));
    }
    if quantity == Quantity::Force && highest < 0.5 * greatest {
        remarks.push(
            "the force is mostly below zero, but compression counts as positive; to invert it, give -1N as its unit"
                .to_owned(),
        );
    }
    let last = trace.last();
    if last.abs() > 0.05 * greatest {
        remarks.push(format!(
            "the {name} ends at {last:.4} {si}, {:.0} % of its highest value, and not at rest",
            100.0 * last.abs() / greatest
        ));
    }
    // The formula for the error of the cubic at the top is from the test in trace.rs.
    if let Some(wide) = trace.rows_wide().filter(|wide| *wide < 6.0) {
        remarks.push(format!(
            "the {name}'s pulse is only {wide:.1} rows wide at half its height, so its top is known to about {:.1} % at best; \
             sample faster",
            100.0 * (1.9 / wide).powi(4).min(0.5)
        ));
    }
    remarks
}

/// The strikes of a table of `bead export`, of which one is wanted.
pub(super) struct StrikeFilter {
    /// True if a column identifies strikes.
    has_column: bool,
    wanted: Option<usize>,
    last: Option<f64>,
    found: usize,
}

impl StrikeFilter {
    pub(super) fn new(picks: &Picks, choice: &Choice) -> Self {
        Self {
            has_column: picks.strike.is_some(),
            wanted: choice.strike,
            last: None,
            found: 0,
        }
    }

    /// True for a row of the wanted strike, or of no strike.
    pub(super) fn is_wanted(&mut self, strike: Option<f64>) -> bool {
        let Some(strike) = strike else { return true };
        if self.last.replace(strike) != Some(strike) {
            self.found += 1;
        }
        strike == self.wanted.unwrap_or(0) as f64
    }

    /// Makes the waveform of the wanted strike's rows.
    pub(super) fn finish(self, mut rows: Rows<'_>) -> Result<Waveform, WaveformError> {
        let found = self.found;
        match (self.has_column, self.wanted) {
            (false, Some(_)) => {
                return rows.unfit(
                    "has no column `id` that tells strikes apart; leave --read strike out".to_owned(),
                );
            }
            (true, Some(wanted)) if rows.count == 0 => {
                return rows.unfit(format!(
                    "has {found} strikes, and none has the id {wanted}; choose one with --read strike=N"
                ));
            }
            (true, None) if found > 1 => rows.remarks.push(format!(
                "it has {found} strikes, and the one with id 0 is taken; choose another with --read strike=N"
            )),
            _ => {}
        }
        if self.has_column {
            rows.acceleration_later = ACCELERATION_LATER;
        }
        rows.end()
    }
}
