//! Scripts of faults: drawn by a seed, written as a file for `bead emulate --faults`, and read again.

use std::fmt::Write as _;

use bead_bench::faults::{self, KINDS, Planned, PlannedKind};
use bead_compare::sensed::Timing;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Faults, and the strikes that come meanwhile.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// The faults, in any order.
    pub faults: Vec<Planned>,
    /// Number of strikes.
    pub strikes: u32,
    /// Interval of the strikes, s.
    pub interval: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Quiet before the first strike, s: that of `bead emulate`.
const LEAD_IN: f64 = 0.02;
/// Most faults of a script.
const MOST: u32 = 6;
/// The first faults come within this time, s.
const SPAN: f64 = 0.5;

impl Script {
    /// Draws the script of a seed. A `short` one has nothing that takes seconds: no hang, and no port that is
    /// given up.
    pub fn draw(seed: u64, short: bool) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let interval = tenths(random.random_range(0.05..0.12));
        let mut faults: Vec<Planned> = Vec::new();
        for _ in 0..random.random_range(1..=MOST) {
            let (_, kind) = KINDS[random.random_range(0..KINDS.len())];
            if short && kind == PlannedKind::Hang {
                continue;
            }
            let anywhere = random.random_range(0.0..SPAN);
            let at = match (random.random_range(0..4), faults.last()) {
                // In the course of a strike: before its wave comes, in its window, or while its frames leave.
                (0 | 1, _) => {
                    let strike = LEAD_IN + (anywhere / interval).floor() * interval;
                    strike + random.random_range(-0.002..0.02)
                }
                // Close to another fault, while the bead deals with it.
                (2, Some(before)) => before.at + random.random_range(0.0..0.1),
                _ => anywhere,
            };
            let logarithmic = |random: &mut ChaCha8Rng, least: f64, most: f64| {
                least * (most / least).powf(random.random_range(0.0..1.0))
            };
            let duration = match kind {
                PlannedKind::Supply => Some(logarithmic(&mut random, 0.001, 0.1)),
                PlannedKind::UartStall if !short && random.random_range(0..3) == 0 => {
                    Some(random.random_range(1.5..2.5))
                }
                PlannedKind::UartStall => Some(logarithmic(&mut random, 0.001, 0.5)),
                PlannedKind::ForceStuck
                | PlannedKind::AccelerationStuck
                | PlannedKind::ForceRailed
                | PlannedKind::AccelerationRailed => Some(logarithmic(&mut random, 0.002, 0.3)),
                _ => None,
            };
            let volts = (kind == PlannedKind::Supply).then(|| tenths(random.random_range(1.8..3.3)));
            faults.push(Planned {
                kind,
                at: tenths(at.max(0.0)),
                duration: duration.map(tenths),
                volts,
            });
        }
        if faults.is_empty() {
            return Self::draw(seed + (1 << 32), short);
        }
        Self {
            strikes: strikes(&faults, interval),
            faults,
            interval,
            seed: seed % 1000,
        }
    }

    /// Times of the strikes.
    pub fn timing(&self) -> Timing {
        Timing {
            lead_in: LEAD_IN,
            strikes: self.strikes,
            interval: self.interval,
        }
    }

    /// Reads a script that [`Script::text`] has written.
    ///
    /// # Errors
    /// The text is not a script; the reason is one line.
    pub fn read(text: &str, name: &str) -> Result<Self, String> {
        let word = |option: &str| {
            let after = text.lines().next()?.split_once(option)?.1;
            after.split_whitespace().next()
        };
        let number = |option: &str| {
            let found = word(option).and_then(|word| word.parse::<f64>().ok());
            found.ok_or_else(|| format!("{name}: its first line gives no {option}"))
        };
        let strikes = word("--strikes").and_then(|word| word.split_once(':'));
        let (strikes, interval) = strikes
            .and_then(|(strikes, interval)| Some((strikes.parse::<f64>().ok()?, interval.parse().ok()?)))
            .ok_or_else(|| format!("{name}: its first line gives no --strikes K:S"))?;
        Ok(Self {
            faults: faults::parse(text, name).map_err(|error| error.to_string())?,
            strikes: strikes as u32,
            interval,
            seed: number("--seed")? as u64,
        })
    }

    /// Returns the text of a file for `bead emulate --faults`, whose first line says how to run it.
    pub fn text(&self) -> String {
        let Self {
            strikes,
            interval,
            seed,
            ..
        } = self;
        let mut text = format!(
            "# bead emulate docs/scenarios/paper-strike.toml --bead 8 --strikes {strikes}:{interval} --seed {seed} --faults\n"
        );
        for fault in &self.faults {
            let _ = write!(
                text,
                "\n[[fault]]\nat = {}\nkind = \"{}\"\n",
                fault.at,
                fault.kind.name()
            );
            for (key, value) in [("duration", fault.duration), ("volts", fault.volts)] {
                if let Some(value) = value {
                    let _ = writeln!(text, "{key} = {value}");
                }
            }
        }
        text
    }

    /// Scripts that are a little smaller: without one fault, or with rounder numbers.
    pub(super) fn smaller(&self) -> Vec<Self> {
        let mut smaller = Vec::new();
        for without in 0..self.faults.len() {
            let mut script = self.clone();
            script.faults.remove(without);
            if !script.faults.is_empty() {
                script.strikes = strikes(&script.faults, script.interval);
                smaller.push(script);
            }
        }
        let round = |value: f64| (value * 1e3).round() * 1e-3;
        for which in 0..self.faults.len() {
            let mut script = self.clone();
            let fault = &mut script.faults[which];
            fault.at = tenths(round(fault.at));
            fault.duration = fault.duration.map(|duration| tenths(round(duration).max(1e-3)));
            if script != *self {
                smaller.push(script);
            }
        }
        smaller
    }
}

/// Strikes until the bead surely measures again.
fn strikes(faults: &[Planned], interval: f64) -> u32 {
    let ends = faults.iter().map(|fault| {
        let after = match fault.kind {
            PlannedKind::Hang => 2.1,
            _ => 0.0,
        };
        fault.at + fault.duration.unwrap_or(0.0) + after
    });
    // Hangs one after the other take longer, which is as good.
    let ends = ends.fold(0.0, f64::max) + 0.4;
    (ends / interval).ceil() as u32
}

/// Rounded to tenths of a millisecond, so that a file has the same number.
fn tenths(seconds: f64) -> f64 {
    (seconds * 1e4).round() / 1e4
}
