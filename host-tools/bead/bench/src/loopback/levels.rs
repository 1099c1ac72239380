//! Levels: the straight line from an output to its input, noise, and cross-talk from the other output.

use std::time::Duration;

use bead_line::conversation::{Conversation, LineError};
use bead_wire::{Message, Played, Raw, Request};

use super::report::CheckRow;

/// Time of a level, ms: about half of its scans come over the line.
const LEVEL_MS: u32 = 25;
/// Codes of one output while the other is at [`MIDDLE`]. The outputs' buffers reach from 249 to 3846.
const CODES: [u16; 5] = [400, 1200, 2048, 2900, 3700];
const MIDDLE: u16 = 2048;

/// Bounds in codes, from the data sheet (DocID022152). The output has an offset of 10 mV (12 codes), a gain
/// error of 0.5 % and a bend of 4 codes; the input has an offset of 2.5 codes, and a gain error and a bend
/// of 3 codes.
const OFF: f64 = 20.0;
const GAIN_OFF: f64 = 0.01;
const BEND: f64 = 8.0;
/// Greatest noise at [`MIDDLE`], and greatest change for a full-range step of the other output, in codes.
const NOISE: f64 = 0.8;
const CROSS_TALK: f64 = 0.1;
/// Standard errors by which noise alone may take a change beyond its bound.
const ERRORS: f64 = 3.0;

pub(super) const NAMES: [&str; 9] = [
    "force, level",
    "acceleration, level",
    "force, linearity",
    "acceleration, linearity",
    "force, noise",
    "acceleration, noise",
    "force, cross-talk",
    "acceleration, cross-talk",
    "open inputs",
];

/// Mean and standard deviation of a channel's codes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Level {
    pub(super) mean: f64,
    pub(super) deviation: f64,
    /// Standard error of the mean.
    error: f64,
}

impl Level {
    fn of(codes: impl Iterator<Item = u16> + Clone) -> Self {
        let count = codes.clone().count().max(1) as f64;
        let mean = codes.clone().map(f64::from).sum::<f64>() / count;
        let square = codes.map(|code| (f64::from(code) - mean).powi(2)).sum::<f64>() / count;
        Self {
            mean,
            deviation: square.sqrt(),
            error: (square / count).sqrt(),
        }
    }

    /// Levels of both sensitive channels over the wanted scans.
    fn of_both(pieces: &[Raw], wanted: impl Fn(u64) -> bool) -> Option<[Self; 2]> {
        let scans: Vec<[u16; 2]> = pieces
            .iter()
            .flat_map(|raw| (raw.first_index..).zip(raw.codes.iter()))
            .filter(|(index, _)| wanted(*index))
            .map(|(_, codes)| codes)
            .collect();
        let channel = |channel: usize| Self::of(scans.iter().map(move |codes| codes[channel]));
        (scans.len() > 100).then(|| [channel(0), channel(1)])
    }
}

/// Lets the outputs hold codes, and returns the levels at both inputs.
pub(super) fn hold(
    bead: &mut Conversation,
    [force, acceleration]: [u16; 2],
) -> Result<[Level; 2], LineError> {
    let answer = bead.request_done(&Request::Hold {
        force,
        acceleration,
        duration_ms: LEVEL_MS,
    })?;
    let Played {
        first_index, scans, ..
    } = answer.last("played frame", |frame| match frame.message {
        Message::Played(played) => Some(played),
        _ => None,
    })?;
    let pieces: Vec<Raw> = answer
        .frames
        .into_iter()
        .filter_map(|frame| match frame.message {
            Message::Raw(raw) => Some(raw),
            _ => None,
        })
        .collect();
    let played = first_index..first_index + u64::from(scans);
    Level::of_both(&pieces, |index| played.contains(&index)).ok_or_else(|| {
        LineError::Failed("too few scans of a level came over the line: is the line noisy?".to_owned())
    })
}

/// The straight line from an output's codes to its input's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    gain: f64,
    /// Code of the input at [`MIDDLE`].
    level: f64,
}

impl Line {
    /// Fits a line by least squares. Returns it with the greatest distance from it.
    fn fit(points: &[(f64, f64)]) -> (Self, f64) {
        let count = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|point| point.0), mean(|point| point.1));
        let sum = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
        let gain = sum(&|point| (point.0 - x) * (point.1 - y)) / sum(&|point| (point.0 - x).powi(2));
        let line = Self {
            gain,
            level: y + gain * (f64::from(MIDDLE) - x),
        };
        let off = points.iter().map(|point| (point.1 - line.at(point.0)).abs());
        (line, off.fold(0.0, f64::max))
    }

    pub(super) fn at(&self, code: f64) -> f64 {
        self.level + self.gain * (code - f64::from(MIDDLE))
    }
}

/// Measurements of both channels.
pub(super) struct Levels {
    pub(super) lines: [Line; 2],
    bends: [f64; 2],
    middle: [Level; 2],
    /// Change of each channel for the full step of the other output, and its standard error.
    cross_talk: [(f64, f64); 2],
    open: [Level; 2],
}

impl Levels {
    pub(super) fn measure(bead: &mut Conversation) -> Result<Self, LineError> {
        let mut points = [Vec::new(), Vec::new()];
        let mut middle = [Level::default(); 2];
        let mut cross_talk = [(0.0, 0.0); 2];
        for channel in 0..2 {
            let mut others = Vec::new();
            for code in CODES {
                let mut codes = [MIDDLE; 2];
                codes[channel] = code;
                let found = hold(bead, codes)?;
                points[channel].push((f64::from(code), found[channel].mean));
                others.push(found[1 - channel]);
                if code == MIDDLE {
                    middle[channel] = found[channel];
                }
            }
            let [first, last] = [others[0], others[CODES.len() - 1]];
            let part = f64::from(CODES[CODES.len() - 1] - CODES[0]) / 4096.0;
            let error = first.error.hypot(last.error);
            cross_talk[1 - channel] = ((last.mean - first.mean) / part, error / part);
        }
        let stream = bead.raw(Duration::from_millis(LEVEL_MS.into()))?;
        let open = Level::of_both(&stream.pieces, |_| true).unwrap_or_default();
        let fits = points.map(|points| Line::fit(&points));
        Ok(Self {
            lines: fits.map(|(line, _)| line),
            bends: fits.map(|(_, bend)| bend),
            middle,
            cross_talk,
            open,
        })
    }

    pub(super) fn rows(&self) -> Vec<CheckRow> {
        let each = |row: &dyn Fn(usize) -> CheckRow| [row(0), row(1)];
        let levels = each(&|channel| {
            let line = self.lines[channel];
            let (off, gain) = (line.level - f64::from(MIDDLE), line.gain);
            CheckRow::of(
                NAMES[channel],
                format!("gain {gain:.4}, off by {off:.1} codes"),
                format!("1 within {GAIN_OFF}, {OFF:.0}"),
                (gain - 1.0).abs() <= GAIN_OFF && off.abs() <= OFF,
            )
            .with("gain", gain)
            .with("off_codes", off)
        });
        let bends = each(&|channel| {
            let bend = self.bends[channel];
            CheckRow::of(
                NAMES[2 + channel],
                format!("{bend:.2} codes off the line"),
                format!("{BEND:.0} codes"),
                bend <= BEND,
            )
            .with("codes", bend)
        });
        let noise = each(&|channel| {
            let noise = self.middle[channel].deviation;
            CheckRow::of(
                NAMES[4 + channel],
                format!("{noise:.2} codes rms"),
                format!("below {NOISE}"),
                noise < NOISE,
            )
            .with("codes_rms", noise)
        });
        let cross_talk = each(&|channel| {
            let (codes, error) = self.cross_talk[channel];
            CheckRow::of(
                NAMES[6 + channel],
                format!("{codes:.3} ± {:.3} codes for the other's range", 2.0 * error),
                format!("below {CROSS_TALK}"),
                codes.abs() < CROSS_TALK + ERRORS * error,
            )
            .with("codes", codes)
            .with("u_codes", error)
        });
        let [force, acceleration] = self.open;
        let open = CheckRow::of(
            NAMES[8],
            format!(
                "{:.1} and {:.1} codes rms",
                force.deviation, acceleration.deviation
            ),
            "no bound",
            true,
        );
        let open = open
            .without_bound()
            .with("force_rms", force.deviation)
            .with("acceleration_rms", acceleration.deviation);
        [levels, bends, noise, cross_talk]
            .into_iter()
            .flatten()
            .chain([open])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_with_what_is_off_it() {
        let straight = |code: u16| (f64::from(code), 0.99 * f64::from(code) + 30.0);
        let (line, off) = Line::fit(&CODES.map(straight));
        assert!((line.gain - 0.99).abs() < 1e-12 && off < 1e-9, "{line:?} {off}");
        assert!((line.level - (0.99 * 2048.0 + 30.0)).abs() < 1e-9);
        let mut bent = CODES.map(straight);
        bent[2].1 += 10.0;
        let (_, off) = Line::fit(&bent);
        // The fit follows a fifth of an outlier in the middle of five; four fifths remain.
        assert!((off - 8.0).abs() < 0.1, "{off}");
    }
}
