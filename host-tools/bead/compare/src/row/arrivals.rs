//! Arrivals of the wave at the beads of a row, and its speed from one to the next.
//!
//! # Design
//! The wave arrives when the force rises through half of its height ([`bead_recording::arrival`]). Each
//! strike is placed where the beads' differences from the simulation have the mean 0, so a single bead has no
//! arrival. A speed needs no such zero: it is the sum of the diameters between two contacts over the
//! difference of the arrivals there.

use serde::Serialize;

use crate::row::chain::RowChain;
use crate::row::mean::mean;
use crate::row::member::RowBead;
use crate::row::strikes::BeadRow;

/// Arrivals and speeds, as in the JSON.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Arrivals {
    /// Root mean square of the differences from the simulation, over beads and strikes, s; none without a
    /// time in common.
    pub off_rms_s: Option<f64>,
    /// For each bead that has one.
    pub beads: Vec<BeadArrival>,
    /// Between each two neighbours that both have one.
    pub speeds: Vec<Speed>,
}

/// Arrival of the wave at a bead, s since the striker hit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BeadArrival {
    /// The bead.
    pub bead: usize,
    /// By the bead: the mean over its strikes.
    pub device_s: f64,
    /// By the chain.
    pub f64_chain_s: f64,
    /// Delay by the bead.
    pub off_s: f64,
}

/// Speed of the wave from one bead to another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Speed {
    /// The bead that it came to first.
    pub from: usize,
    /// The other.
    pub to: usize,
    /// By the beads, m/s.
    pub device: f64,
    /// By the chain, m/s.
    pub f64_chain: f64,
}

impl Speed {
    /// Deviation of the beads' speed, as a part of the chain's.
    pub fn off(&self) -> f64 {
        self.device / self.f64_chain - 1.0
    }
}

impl Arrivals {
    pub(super) fn of(row: &BeadRow, chain: &RowChain) -> Self {
        let members = &row.members;
        let fronts: Vec<f64> = members.iter().map(|member| member.chain.front()).collect();
        // For each strike its zero and, for each bead, when the force rose.
        let strike = |strike: &Vec<Option<usize>>| {
            let felt = row.felt(strike).into_iter();
            let rises: Vec<Option<f64>> = felt.map(|felt| felt?.rise).collect();
            (row.zero(strike), rises)
        };
        let strikes: Vec<_> = row.strikes.iter().map(strike).collect();
        let off = |place: usize| -> Vec<f64> {
            let off = |(zero, rises): &(Option<f64>, Vec<_>)| Some(rises[place]? - (*zero)? - fronts[place]);
            strikes.iter().filter_map(off).collect()
        };
        let off: Vec<Vec<f64>> = (0..members.len()).map(off).collect();
        let all: Vec<f64> = off.iter().flatten().copied().collect();
        let squares: f64 = all.iter().map(|off| off * off).sum();
        let arrival = |place: usize| {
            let off_s = mean(&off[place])?;
            Some(BeadArrival {
                bead: members[place].bead,
                device_s: fronts[place] + off_s,
                f64_chain_s: fronts[place],
                off_s,
            })
        };
        let speed = |place: usize| {
            let (from, to) = (members[place].bead, members[place + 1].bead);
            let diameter = |bead| 2.0 * chain.solution.model().radius(bead);
            let length: f64 = (from..to).map(diameter).sum();
            let took = |(_, rises): &(_, Vec<Option<f64>>)| Some(rises[place + 1]? - rises[place]?);
            let times: Vec<f64> = strikes.iter().filter_map(took).collect();
            Some(Speed {
                from,
                to,
                device: length / mean(&times)?,
                f64_chain: length / (fronts[place + 1] - fronts[place]),
            })
        };
        Self {
            off_rms_s: (!all.is_empty()).then(|| (squares / all.len() as f64).sqrt()),
            beads: (0..members.len()).filter_map(arrival).collect(),
            speeds: (1..members.len()).filter_map(|place| speed(place - 1)).collect(),
        }
    }

    /// The arrival at a bead.
    pub fn at(&self, bead: usize) -> Option<&BeadArrival> {
        self.beads.iter().find(|arrival| arrival.bead == bead)
    }

    /// A line for each bead that has no place on the time in common.
    pub(super) fn notes(&self, row: &BeadRow) -> Vec<String> {
        let felt = row.members.iter().filter(|member| !member.felt.is_empty());
        if self.beads.is_empty() {
            let none = "no common time: no two beads have two sync edges in common, so there are no arrivals and no speeds; \
                        energies need no common time";
            return (felt.count() > 1).then(|| none.to_owned()).into_iter().collect();
        }
        let note = |member: &RowBead| {
            let bead = member.bead;
            if member.felt.iter().any(|felt| felt.rise_drawn.is_some()) {
                format!(
                    "bead {bead} is not on the common time: it has no two sync edges in common with the others, so \
                     its arrival is unknown"
                )
            } else {
                format!(
                    "bead {bead} has no strike with all its samples and its force in range, so its arrival is unknown"
                )
            }
        };
        let off = felt.filter(|member| self.at(member.bead).is_none());
        off.map(note).collect()
    }
}
