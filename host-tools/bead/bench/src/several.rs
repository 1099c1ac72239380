//! Several beads of one chain that share strike and time: their places, and their runs.
//!
//! # Design
//! Each bead is an image in its own QEMU, so its bytes do not depend on how many run at once. The beads
//! share true time: the strike, the sync line, and the times in the recording.
//!
//! All beads first run without the trigger line. A bead that would have kept a window for a pull of another
//! then runs again, with the line as the others pulled it, until nothing changes (waveform relaxation:
//! Lelarasmee, Ruehli and Sangiovanni-Vincentelli, 1982). A bead pulls milliseconds after its cause, so
//! each round is right for that much longer. Where all beads feel the strike, none runs twice.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use bead_wire::{Message, Strike, StrikeFlags};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::emulation::{Emulation, Placed, Ran};
use crate::error::BenchError;
use bead_recording::file::{BeadIndex, RecordingError, RecordingWriter};

/// Deviations of the crystals.
#[derive(Debug, Clone, PartialEq)]
pub enum Crystals {
    /// Deviation of each bead's crystal in order, ppm; a single value holds for every bead.
    Each(Vec<f64>),
    /// Greatest deviation of crystals that are drawn at random, ppm.
    Spread(f64),
}

/// The beads at these places. Each has its place as its address; if a place exceeds the greatest address,
/// the beads are numbered from 1. All that is left to chance, noise included, follows from `seed`.
///
/// # Errors
/// There are more beads than addresses, or the numbers of clocks and beads differ.
pub fn placed(
    beads: &[usize],
    crystals: &Crystals,
    start_spread: f64,
    seed: u64,
    noise: bool,
) -> Result<Vec<Placed>, BenchError> {
    if let Crystals::Each(ppm) = crystals
        && ppm.len() != 1
        && ppm.len() != beads.len()
    {
        let (crystals, beads) = (ppm.len(), beads.len());
        return Err(BenchError::Unfit(format!(
            "[clock] ppm has {crystals} crystals for {beads} beads; give one for each, or one for all"
        )));
    }
    let by_place = beads.iter().all(|bead| *bead <= LAST_ADDRESS);
    if !by_place && beads.len() > LAST_ADDRESS {
        return Err(BenchError::Unfit(format!(
            "--bead: {} beads, but a line has only {LAST_ADDRESS} addresses; give fewer beads",
            beads.len()
        )));
    }
    let mut chance = ChaCha8Rng::seed_from_u64(seed ^ BY_CHANCE);
    let place = |(number, &bead): (usize, &usize)| Placed {
        bead,
        address: (if by_place { bead } else { number + 1 }) as u8,
        // Neighbouring seeds are uncorrelated.
        seed: noise.then(|| seed.wrapping_add(bead as u64)),
        clock_ppm: {
            let part = chance.random_range(-1.0..=1.0);
            match crystals {
                Crystals::Each(ppm) => *ppm.get(number).unwrap_or(&ppm[0]),
                Crystals::Spread(most) => part * most,
            }
        },
        began: chance.random_range(0.0..=1.0) * start_spread,
        uncertainty: None,
        owners: None,
    };
    Ok(beads.iter().enumerate().map(place).collect())
}

/// Addresses from 1 to this one are single beads'.
const LAST_ADDRESS: usize = 254;
/// Keeps what is left to chance apart from the noise of the same seed.
const BY_CHANCE: u64 = 0x9e37_79b9_7f4a_7c15;

/// Runs the beads, as many at once as this computer has cores. `done` takes the number of finished ones.
///
/// # Errors
/// One of them cannot be prepared or run.
pub fn run(
    placed: &[Placed],
    prepare: impl Fn(Placed) -> Result<Emulation, BenchError> + Sync,
    done: impl Fn(usize) + Sync,
) -> Result<Vec<(Emulation, Ran)>, BenchError> {
    let beads = placed.len();
    let count = AtomicUsize::new(0);
    let one = |placed: &Placed| -> Result<(Emulation, Ran), BenchError> {
        let mut emulation = prepare(*placed)?;
        // A single bead has no listener on the trigger line.
        emulation.pulls = beads > 1;
        let ran = emulation.run()?;
        done(count.fetch_add(1, Ordering::Relaxed) + 1);
        Ok((emulation, ran))
    };
    // Of several errors, the first bead's is returned.
    let all: Vec<_> = placed.par_iter().with_max_len(1).map(one).collect();
    let mut all = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    loop {
        let lines: Vec<_> = (0..all.len()).map(|bead| pulled_by_others(&all, bead)).collect();
        let again = all.par_iter_mut().with_max_len(1).zip(lines);
        let again: Vec<_> = again.map(|(one, line)| run_again(one, line)).collect();
        if !again.into_iter().collect::<Result<Vec<_>, _>>()?.contains(&true) {
            return Ok(all);
        }
    }
}

/// Intervals in which the other beads hold the trigger line low, in s of shared time.
fn pulled_by_others(all: &[(Emulation, Ran)], bead: usize) -> Vec<[f64; 2]> {
    let others = all.iter().enumerate().filter(|(other, _)| *other != bead);
    let low = others.flat_map(|(_, (emulation, ran))| {
        let shared = |ns: u64| emulation.truth.began + (ns as f64 - ran.first_scan_ns as f64) * 1e-9;
        ran.pulls_ns.iter().map(move |times| times.map(shared))
    });
    joined(low.collect())
}

/// Intervals in ascending order, with overlapping ones merged.
pub(crate) fn joined(mut times: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    times.sort_by(|a, b| a[0].total_cmp(&b[0]));
    times.dedup_by(|later, earlier| {
        let overlaps = later[0] <= earlier[1];
        if overlaps {
            earlier[1] = earlier[1].max(later[1]);
        }
        overlaps
    });
    times
}

/// Runs a bead again with the present line if the result may change. Returns true if the bead ran.
fn run_again((emulation, ran): &mut (Emulation, Ran), line: Vec<[f64; 2]>) -> Result<bool, BenchError> {
    let before = falls_followed(emulation, ran);
    let given = std::mem::take(&mut emulation.truth.line_low);
    emulation.line(line);
    if falls_followed(emulation, ran) == before {
        emulation.truth.line_low = given;
        return Ok(false);
    }
    *ran = emulation.run()?;
    Ok(true)
}

/// Scans from the one that triggers to the fall of the line (`firmware/app/src/trigger_line.rs`).
const LINE_DELAY: u64 = 600;

/// Falls of the line that a bead may follow, in s since its first scan. A bead follows no fall while it
/// measures a strike of its own, and none whose window would reach back into that strike.
fn falls_followed(emulation: &Emulation, ran: &Ran) -> Vec<f64> {
    let history = emulation.settings.window.history;
    let own = ran.frames.iter().filter_map(|frame| match &frame.message {
        Message::Strike(strike) if !strike.flags.has(StrikeFlags::TRIGGERED_BY_LINE) => {
            Some(deaf_to_line(strike, history))
        }
        _ => None,
    });
    let own: Vec<_> = own.collect();
    let is_heard = |fall: &f64| {
        let index = emulation.truth.index_at(*fall);
        !own.iter().any(|window| window.contains(&index))
    };
    let falls = emulation.truth.line_low.iter().map(|[fall, _]| *fall);
    falls.filter(is_heard).collect()
}

/// Indices at which a bead certainly follows no fall of the line, because of a strike of its own. Windows
/// begin `history` scans before their trigger.
fn deaf_to_line(strike: &Strike, history: u16) -> Range<f64> {
    /// Greatest error of the index of a fall, scans.
    const UNSURE: f64 = 3.0;
    // An image of another firmware may send any index.
    let last = strike.first_index.saturating_add(strike.samples.into());
    let end = last.saturating_add(u64::from(history) + LINE_DELAY);
    strike.trigger_index as f64 + UNSURE..end as f64 - UNSURE
}

/// Records the bytes of all beads, in the order of time.
///
/// # Errors
/// The file cannot be written.
pub fn write(ran: &[(BeadIndex, &Ran, f64)], writer: &mut RecordingWriter) -> Result<(), RecordingError> {
    let mut pieces: Vec<_> = ran
        .iter()
        .flat_map(|(bead, ran, began)| {
            let zero_ns = (began * 1e9).round() as u64;
            ran.pieces(zero_ns).map(move |(at, bytes)| (at, *bead, bytes))
        })
        .collect();
    // Of pieces with equal times, the first bead's comes first.
    pieces.sort_by_key(|(at, ..)| *at);
    for (at, bead, bytes) in pieces {
        writer.write_of(bead, bytes, Some(at), |_| {})?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use bead_wire::Kind;

    use super::*;

    #[test]
    fn an_image_may_say_any_index_of_a_window() {
        let Message::Strike(mut strike) = Message::draw(Kind::Strike, &mut || 0) else {
            panic!("a strike");
        };
        (strike.first_index, strike.trigger_index, strike.samples) = (1000, 1159, 672);
        assert_eq!(deaf_to_line(&strike, 160), 1162.0..2429.0);
        strike.first_index = u64::MAX;
        assert_eq!(deaf_to_line(&strike, 160).end, u64::MAX as f64);
    }

    #[test]
    fn chance_follows_from_the_seed_and_stays_within_its_bounds() {
        let place = |seed| placed(&[7, 8, 9], &Crystals::Spread(100.0), 0.01, seed, true).unwrap();
        assert_eq!(place(1), place(1));
        assert_ne!(place(1), place(2));
        for one in place(3) {
            assert!(
                one.clock_ppm.abs() <= 100.0 && (0.0..=0.01).contains(&one.began),
                "{one:?}"
            );
            let (address, seed) = (usize::from(one.address), 3 + one.bead as u64);
            assert_eq!((address, one.seed), (one.bead, Some(seed)));
        }
    }

    /// Address and crystal of each of these beads, or the reason why they are refused.
    fn each(beads: &[usize], ppm: &[f64]) -> Result<Vec<(u8, f64)>, String> {
        let placed = placed(beads, &Crystals::Each(ppm.to_vec()), 0.0, 1, false);
        let placed = placed.map_err(|error| error.to_string())?;
        Ok(placed.iter().map(|one| (one.address, one.clock_ppm)).collect())
    }

    #[test]
    fn beads_too_far_behind_for_an_address_are_counted_and_each_has_a_crystal() {
        assert_eq!(each(&[200, 254], &[0.0]).unwrap(), [(200, 0.0), (254, 0.0)]);
        assert_eq!(each(&[200, 255], &[0.0]).unwrap(), [(1, 0.0), (2, 0.0)]);
        let many: Vec<usize> = (1..=255).collect();
        assert!(each(&many, &[0.0]).unwrap_err().contains("254 addresses"));
        let beads = [7, 8, 9];
        assert_eq!(each(&beads, &[20.0]).unwrap(), [(7, 20.0), (8, 20.0), (9, 20.0)]);
        let crystals = [1.0, 2.0, 3.0];
        assert_eq!(each(&beads, &crystals).unwrap(), [(7, 1.0), (8, 2.0), (9, 3.0)]);
        let refused = each(&beads, &[1.0, 2.0]).unwrap_err();
        assert!(refused.contains("2 crystals for 3 beads"), "{refused}");
    }
}
