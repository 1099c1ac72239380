//! The strikes of a row of beads: the ones of several beads that are one.

use std::collections::BTreeMap;

use crate::row::member::{Felt, Member};

/// Two beads' strikes are one if the striker hit within this time, s. A bead measures no two strikes within
/// twice of it, and the host's time is within a millisecond for each.
const SAME: f64 = 7.5e-3;

/// The beads of a row, and their strikes.
pub struct Row {
    /// The beads, from the striker on.
    pub members: Vec<Member>,
    /// Each strike: for each bead, which of its strikes that is.
    pub strikes: Vec<Vec<Option<usize>>>,
}

impl Row {
    /// Finds which strikes are one.
    pub fn of(members: Vec<Member>) -> Self {
        let strikes = together(&members);
        Self { members, strikes }
    }

    /// Each bead's record of a strike.
    pub(super) fn felt(&self, strike: &[Option<usize>]) -> Vec<Option<&Felt>> {
        let beads = self.members.iter().zip(strike);
        beads.map(|(member, at)| Some(&member.felt[(*at)?])).collect()
    }

    /// The instant of the striker's hit, s on the time in common; none if fewer than two beads can tell. The
    /// differences of the arrivals from the simulation then have the mean 0.
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
                "{timeless} of {felt} strikes have no time by the host, as their boot was short or told no sample rate: \
                 by their time they belong to no strike of another bead"
            )
        });
        let of = |(place, member): (usize, &Member)| {
            let felt = self
                .strikes
                .iter()
                .filter(|strike| strike[place].is_some())
                .count();
            let bead = member.bead;
            match felt {
                0 => Some(format!(
                    "bead {bead} never saw a strike: what its intruder took is the simulation's"
                )),
                _ if felt < all => Some(format!("bead {bead} has {felt} of {all} strikes")),
                _ => None,
            }
        };
        apart
            .into_iter()
            .chain(self.members.iter().enumerate().filter_map(of))
            .collect()
    }
}

/// A strike of a bead: its number, the bead's place, and which of the bead's strikes it is.
type Numbered = (u32, usize, usize);

/// The strikes, in the order of their time: for each bead, which of its strikes that is.
fn together(members: &[Member]) -> Vec<Vec<Option<usize>>> {
    let mut all = Vec::new();
    for (place, member) in members.iter().enumerate() {
        let of = |(at, felt): (usize, &Felt)| (felt.struck, (felt.number, place, at));
        all.extend(member.felt.iter().enumerate().map(of));
    }
    by_time_or_number(all, members.len())
}

/// Of strikes with the time at which the striker hit, if that is known. Among those without, one number is
/// one strike.
fn by_time_or_number(all: Vec<(Option<f64>, Numbered)>, beads: usize) -> Vec<Vec<Option<usize>>> {
    let (mut timed, mut timeless) = (Vec::new(), Vec::new());
    for (struck, strike) in all {
        match struck {
            Some(struck) => timed.push((struck, strike.1, strike.2)),
            None => timeless.push(strike),
        }
    }
    let mut strikes = by_time(timed, beads);
    strikes.extend(by_number(timeless, beads));
    strikes
}

fn by_number(mut told: Vec<Numbered>, beads: usize) -> Vec<Vec<Option<usize>>> {
    told.sort_unstable();
    let mut strikes = BTreeMap::new();
    for (number, place, at) in told {
        let strike = strikes.entry(number).or_insert_with(|| vec![None; beads]);
        // After a reset the numbers begin anew; only the first of them can be told.
        strike[place].get_or_insert(at);
    }
    strikes.into_values().collect()
}

/// Of strikes with the time at which the striker hit, the bead's place among `beads`, and which of its
/// strikes it is.
fn by_time(mut told: Vec<(f64, usize, usize)>, beads: usize) -> Vec<Vec<Option<usize>>> {
    told.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut strikes: Vec<(f64, Vec<Option<usize>>)> = Vec::new();
    for (struck, place, at) in told {
        match strikes.last_mut() {
            Some((first, strike)) if struck - *first < SAME && strike[place].is_none() => {
                strike[place] = Some(at)
            }
            _ => {
                let mut strike = vec![None; beads];
                strike[place] = Some(at);
                strikes.push((struck, strike));
            }
        }
    }
    strikes.into_iter().map(|(_, strike)| strike).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strikes_are_told_apart_by_their_time_also_where_a_bead_lost_one() {
        // Three strikes, 50 ms apart; the second bead lost the first of them.
        let of = |place: usize, from: usize| {
            (from..3).map(move |n| (n as f64 * 0.05 + place as f64 * 3e-4, place, n - from))
        };
        let told = of(0, 0).chain(of(1, 1)).chain(of(2, 0)).collect();
        assert_eq!(
            by_time(told, 3),
            [
                [Some(0), None, Some(0)],
                [Some(1), Some(0), Some(1)],
                [Some(2), Some(1), Some(2)]
            ]
        );
    }

    #[test]
    fn strikes_without_a_time_go_by_their_number_and_leave_the_others_to_their_time() {
        // The second bead lost its first strike: by number the others would be another's.
        let timed = [(0.0, (0, 0, 0)), (0.05, (1, 0, 1)), (0.05, (0, 1, 0))];
        let timed = timed.map(|(struck, strike)| (Some(struck), strike));
        let timeless = [(None, (0, 0, 2)), (None, (0, 1, 1)), (None, (1, 1, 2))];
        assert_eq!(
            by_time_or_number([timed, timeless].concat(), 2),
            [
                [Some(0), None],
                [Some(1), Some(0)],
                [Some(2), Some(1)],
                [None, Some(2)]
            ]
        );
    }

    #[test]
    fn a_bead_has_one_strike_of_each() {
        assert_eq!(
            by_time(vec![(0.0, 0, 0), (1e-3, 0, 1)], 1),
            [[Some(0)], [Some(1)]]
        );
    }
}
