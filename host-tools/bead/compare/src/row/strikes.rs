//! The strikes of a row of beads, each matched across the beads that felt it.

use rayon::prelude::*;

use crate::error::CompareError;
use crate::row::chain::{PlacedBead, RowChain};
use crate::row::member::{FeltStrike, RowBead};
use crate::velocity::FittedVelocity;
use bead_recording::clock::CommonTime;
use bead_recording::file::Recording;

/// Greatest difference of the hit times that two beads give for one strike, s. A bead measures no two strikes
/// within twice this time, and its host time is right to a millisecond.
const SAME: f64 = 7.5e-3;

/// The beads of a row, and their strikes.
pub struct BeadRow {
    /// The beads, from the striker on.
    pub members: Vec<RowBead>,
    /// For each strike and each bead, the place among the bead's strikes.
    pub strikes: Vec<Vec<Option<usize>>>,
}

impl BeadRow {
    /// Reads the beads' frames, compares them with the chain, and matches their strikes. `fitted` is the
    /// striker's velocity in the chain, if it was fitted.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn read(
        received: &Recording,
        beads: &[PlacedBead],
        chain: &RowChain,
        fitted: Option<&FittedVelocity>,
    ) -> Result<Self, CompareError> {
        let time = CommonTime::of(received)?;
        let read = |placed| RowBead::read(placed, chain, &time, fitted);
        let members: Vec<_> = beads.par_iter().map(read).collect();
        let members = members.into_iter().collect::<Result<Vec<_>, _>>()?;
        let strikes = together(&members);
        Ok(Self { members, strikes })
    }

    /// Each bead's record of a strike.
    pub(super) fn felt(&self, strike: &[Option<usize>]) -> Vec<Option<&FeltStrike>> {
        let beads = self.members.iter().zip(strike);
        beads.map(|(member, at)| Some(&member.felt[(*at)?])).collect()
    }

    /// The instant of the striker's hit in the common time, s, at which the arrivals differ from the
    /// simulation by 0 in the mean. `None` if fewer than two beads have an arrival.
    pub(super) fn zero(&self, strike: &[Option<usize>]) -> Option<f64> {
        let felt = self.felt(strike).into_iter().zip(&self.members);
        let late = felt.filter_map(|(felt, member)| Some(felt?.rise? - member.chain.front()));
        let late: Vec<f64> = late.collect();
        (late.len() > 1).then(|| late.iter().sum::<f64>() / late.len() as f64)
    }

    /// The beads that felt fewer strikes than there were.
    pub(super) fn missed(&self) -> Vec<String> {
        let all = self.strikes.len();
        let timeless = self.members.iter().flat_map(|member| &member.felt);
        let timeless = timeless.filter(|felt| felt.struck.is_none()).count();
        let felt: usize = self.members.iter().map(|member| member.felt.len()).sum();
        let apart = (timeless > 0 && timeless < felt).then(|| {
            format!(
                "{timeless} of {felt} strikes have no host time, as their boot was short or sent no sample rate: \
                 they are matched by number, and only with one another"
            )
        });
        let of = |(place, member): (usize, &RowBead)| {
            let felt = self.strikes.iter().filter(|strike| strike[place].is_some());
            let (bead, felt) = (member.bead, felt.count());
            (felt < all).then(|| match felt {
                0 => format!("bead {bead} never saw a strike: its intruder's energy is the simulation's"),
                _ => format!("bead {bead} has {felt} of {all} strikes"),
            })
        };
        let missed = self.members.iter().enumerate().filter_map(of);
        apart.into_iter().chain(missed).collect()
    }
}

#[derive(Debug, Clone, Copy)]
struct StrikeAtBead {
    /// When the striker hit, s, if that is known.
    struck: Option<f64>,
    /// Its number since the bead's reset.
    number: u32,
    /// The bead's place among the beads.
    place: usize,
    /// Its place among the bead's strikes.
    at: usize,
}

/// The strikes in the order of their time: for each bead, the place among its strikes.
fn together(members: &[RowBead]) -> Vec<Vec<Option<usize>>> {
    let mut all = Vec::new();
    for (place, member) in members.iter().enumerate() {
        all.extend(member.felt.iter().enumerate().map(|(at, felt)| StrikeAtBead {
            struck: felt.struck,
            number: felt.number,
            place,
            at,
        }));
    }
    grouped(all, members.len())
}

/// Groups strikes by their time. Those without a time follow, grouped by their number.
fn grouped(mut all: Vec<StrikeAtBead>, beads: usize) -> Vec<Vec<Option<usize>>> {
    all.sort_by(|a, b| {
        let [a_time, b_time] = [a, b].map(|strike| strike.struck.unwrap_or(f64::INFINITY));
        let [a, b] = [a, b].map(|strike| (strike.number, strike.place, strike.at));
        a_time.total_cmp(&b_time).then(a.cmp(&b))
    });
    let mut strikes: Vec<Vec<Option<usize>>> = Vec::new();
    let mut first: Option<StrikeAtBead> = None;
    for strike in all {
        let is_same = first.is_some_and(|first| match (first.struck, strike.struck) {
            (Some(first), Some(struck)) => struck - first < SAME,
            (None, None) => first.number == strike.number,
            _ => false,
        });
        match strikes.last_mut() {
            Some(beads) if is_same && beads[strike.place].is_none() => beads[strike.place] = Some(strike.at),
            // Numbers begin again after a reset, so only the first strike of a number can be identified.
            Some(_) if is_same && strike.struck.is_none() => {}
            _ => {
                let mut next = vec![None; beads];
                next[strike.place] = Some(strike.at);
                strikes.push(next);
                first = Some(strike);
            }
        }
    }
    strikes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strike at the time `struck`, s: its number, the bead's place, and its place among the bead's
    /// strikes.
    fn at(struck: impl Into<Option<f64>>, (number, place, at): (u32, usize, usize)) -> StrikeAtBead {
        StrikeAtBead {
            struck: struck.into(),
            number,
            place,
            at,
        }
    }

    #[test]
    fn strikes_are_told_apart_by_their_time_also_where_a_bead_lost_one() {
        // Three strikes, 50 ms apart; the second bead lost the first of them.
        let of = |place: usize, from: usize| {
            let strike = move |n: usize| at(n as f64 * 0.05 + place as f64 * 3e-4, (0, place, n - from));
            (from..3).map(strike)
        };
        let all = of(0, 0).chain(of(1, 1)).chain(of(2, 0)).collect();
        let first = [Some(0), None, Some(0)];
        assert_eq!(
            grouped(all, 3),
            [first, [Some(1), Some(0), Some(1)], [Some(2), Some(1), Some(2)]]
        );
        // A group has at most one strike of a bead.
        assert_eq!(
            grouped(vec![at(0.0, (0, 0, 0)), at(1e-3, (0, 0, 1))], 1),
            [[Some(0)], [Some(1)]]
        );
    }

    #[test]
    fn strikes_without_a_time_go_by_their_number_and_leave_the_others_to_their_time() {
        // The second bead lost its first strike: by number, its others would match the wrong strikes.
        let timed = [at(0.0, (0, 0, 0)), at(0.05, (1, 0, 1)), at(0.05, (0, 1, 0))];
        let timeless = [(0, 0, 2), (0, 1, 1), (1, 1, 2)].map(|strike| at(None, strike));
        let by_time = [[Some(0), None], [Some(1), Some(0)]];
        let by_number = [[Some(2), Some(1)], [None, Some(2)]];
        assert_eq!(
            grouped([timed, timeless].concat(), 2),
            [by_time, by_number].concat()
        );
    }
}
