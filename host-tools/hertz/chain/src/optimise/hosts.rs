//! The choice of beads that hold an intruder.
//!
//! # Design
//!
//! All beads that may hold an intruder begin with one. The intruder whose loss costs least is dropped, and
//! the others are improved, until as few are left as are wanted. Then an intruder moves to a bead without
//! one, past others or by moving these on. Such moves are first tried as they are, and then improved in the
//! order of their values. The choice is final when no move gains. An additional intruder never costs
//! anything, since its spring can hold it fast, so no choice has fewer than are wanted.

use std::collections::HashSet;

use super::design::Design;
use super::error::OptimiseError;
use super::problem::{Problem, SearchProgress, TriedDesign};
use super::search::Search;
use crate::simulate::SimulateError;

/// The end of the search for hosts.
pub(super) struct ChosenHosts {
    /// The search for intruders in the chosen hosts only.
    pub(super) search: Search,
    /// A good design for the chosen hosts.
    pub(super) design: Design,
    /// Progress of the search.
    pub(super) sofar: SearchProgress,
    /// True if no move gains.
    pub(super) settled: bool,
}

/// Hosts, in the order of the beads, and the best design that was found for them.
struct Hosted {
    hosts: Vec<usize>,
    best: TriedDesign,
}

impl Problem<'_> {
    /// Chooses `most` of the hosts.
    pub(super) fn choose_hosts(&self, most: usize) -> Result<ChosenHosts, OptimiseError> {
        let mut now = self.with_all_hosts()?;
        while now.hosts.len() > most {
            now = self.without_one(now)?;
        }
        let mut tried = HashSet::from([now.hosts.clone()]);
        let mut settled = now.best.settled;
        while let Some(better) = self.moved(&now, &mut tried)? {
            now = better;
        }
        settled &= self.left() > 0 && !self.stopped.get();
        let search = self.for_hosts(now.hosts);
        Ok(ChosenHosts {
            design: now.best.design,
            sofar: self.sofar.get(),
            settled,
            search,
        })
    }

    fn for_hosts(&self, hosts: Vec<usize>) -> Search {
        Search {
            hosts,
            hosts_at_most: None,
            ..self.search.clone()
        }
    }

    /// Runs part of the search in these hosts only.
    fn in_hosts<T>(
        &self,
        hosts: &[usize],
        run: impl FnOnce(&Problem<'_>) -> Result<T, SimulateError>,
    ) -> Result<T, SimulateError> {
        let search = self.for_hosts(hosts.to_vec());
        let problem = self.on(&search);
        let found = run(&problem);
        self.sofar.set(problem.sofar.get());
        self.stopped.set(problem.stopped.get());
        found
    }

    fn with_all_hosts(&self) -> Result<Hosted, SimulateError> {
        let bounds = [self.bounds];
        let mut starts = self.coarse()?;
        let mut best = starts.swap_remove(0);
        for start in std::iter::once(best.clone()).chain(starts) {
            best.take(self.descend(start, &bounds, self.left() / 8, f64::INFINITY)?);
        }
        if !self.search.alike && self.hosts.len() > 1 {
            let start = self.starts(&best).swap_remove(0);
            best.take(self.descend(start, &bounds, self.left() / 4, f64::INFINITY)?);
        }
        Ok(Hosted {
            hosts: self.hosts.clone(),
            best,
        })
    }

    /// Drops the intruder whose loss costs least, and improves the others.
    fn without_one(&self, now: Hosted) -> Result<Hosted, SimulateError> {
        let places = 0..now.hosts.len();
        let dropped = places.map(|place| {
            let (mut hosts, mut design) = (now.hosts.clone(), now.best.design.clone());
            hosts.remove(place);
            if design.intruders.len() > 1 {
                design.intruders.remove(place);
            }
            (hosts, design)
        });
        let all = self.ranked(dropped.collect())?;
        // A stopped search has ranked none.
        let (hosts, start) = all.into_iter().next().unwrap_or_else(|| {
            let mut hosts = now.hosts.clone();
            hosts.pop();
            let mut design = now.best.design.clone();
            design.intruders.truncate(hosts.len());
            (hosts, TriedDesign::untried(design))
        });
        let best = self.in_hosts(&hosts, |problem| {
            problem.descend(start, &[problem.bounds], problem.left() / 4, f64::INFINITY)
        })?;
        Ok(Hosted { hosts, best })
    }

    /// Moves one intruder to a bead without one, if that gains. Returns `None` if no move gains, or if the
    /// search was spent or stopped.
    fn moved(&self, now: &Hosted, tried: &mut HashSet<Vec<usize>>) -> Result<Option<Hosted>, SimulateError> {
        let empty = self.hosts.iter().filter(|host| !now.hosts.contains(host));
        let mut moves = Vec::new();
        for &host in empty {
            for place in 0..now.hosts.len() {
                let mut hosts = now.hosts.clone();
                hosts[place] = host;
                let mut design = now.best.design.clone();
                let mut order: Vec<usize> = (0..hosts.len()).collect();
                order.sort_by_key(|&place| hosts[place]);
                hosts.sort_unstable();
                if tried.contains(&hosts) {
                    continue;
                }
                // Good intruders become stiffer along the hosts, so all of them may have to move on by one.
                moves.push((hosts.clone(), design.clone()));
                if design.intruders.len() > 1 && !order.is_sorted() {
                    let moved = order.iter().map(|&place| now.best.design.intruders[place]);
                    design.intruders = moved.collect();
                    moves.push((hosts, design));
                }
            }
        }
        for (hosts, start) in self.ranked(moves)? {
            if self.left() == 0 || self.stopped.get() {
                return Ok(None);
            }
            if !tried.insert(hosts.clone()) {
                continue;
            }
            let found = self.in_hosts(&hosts, |problem| {
                problem.descend(start, &[problem.bounds], problem.left(), now.best.rival())
            })?;
            if found.gains_on(&now.best) {
                return Ok(Some(Hosted { hosts, best: found }));
            }
        }
        Ok(None)
    }

    /// Unimproved designs on other hosts, the best first; those tried before the search was stopped.
    fn ranked(
        &self,
        designs: Vec<(Vec<usize>, Design)>,
    ) -> Result<Vec<(Vec<usize>, TriedDesign)>, SimulateError> {
        let mut ranked = Vec::new();
        for (hosts, design) in designs {
            let tried = self.in_hosts(&hosts, |problem| problem.tried(vec![design]))?;
            ranked.extend(tried.into_iter().map(|design| (hosts.clone(), design)));
        }
        ranked.sort_by(|(_, one), (_, other)| {
            let excess = one.excess.total_cmp(&other.excess);
            excess.then(one.value.total_cmp(&other.value))
        });
        Ok(ranked)
    }
}
