//! Arrivals of the wave at the beads of a row, and its speed from one to the next.
//!
//! # Design
//! The wave comes when the force rises through half of its height ([`bead_recording::arrival`]). The time
//! in common does not begin with the strike: of each strike the beads' differences from the simulation have
//! the mean 0. So one bead alone has no arrival. A speed needs no such zero: it is the sum of the diameters
//! between two contacts over the difference of the arrivals there.

use serde::Serialize;

use crate::row::chain::RowChain;
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

/// The time of the wave between two beads.
struct Way {
    length: f64,
    times: Vec<f64>,
}

impl Arrivals {
    pub(super) fn of(row: &BeadRow, chain: &RowChain) -> Self {
        let fronts: Vec<f64> = row.members.iter().map(|member| member.chain.front()).collect();
        let mut off: Vec<Vec<f64>> = vec![Vec::new(); fronts.len()];
        let mut ways: Vec<Way> = Vec::new();
        for pair in row.members.windows(2) {
            let beads = pair[0].bead..pair[1].bead;
            ways.push(Way {
                length: beads.map(|bead| 2.0 * chain.solution.model().radius(bead)).sum(),
                times: Vec::new(),
            });
        }
        for strike in &row.strikes {
            let rises: Vec<Option<f64>> = row.felt(strike).into_iter().map(|felt| felt?.rise).collect();
            if let Some(zero) = row.zero(strike) {
                for ((off, rise), front) in off.iter_mut().zip(&rises).zip(&fronts) {
                    off.extend(rise.map(|rise| rise - zero - front));
                }
            }
            for (way, pair) in ways.iter_mut().zip(rises.windows(2)) {
                way.times
                    .extend(pair[1].zip(pair[0]).map(|(later, earlier)| later - earlier));
            }
        }
        let all: Vec<f64> = off.iter().flatten().copied().collect();
        let squares: f64 = all.iter().map(|off| off * off).sum();
        let beads = row.members.iter().zip(&fronts).zip(&off);
        let arrival = |((member, front), off): ((&RowBead, &f64), &Vec<f64>)| {
            let off = mean(off)?;
            Some(BeadArrival {
                bead: member.bead,
                device_s: front + off,
                f64_chain_s: *front,
                off_s: off,
            })
        };
        let speed = |(at, way): (usize, &Way)| {
            Some(Speed {
                from: row.members[at].bead,
                to: row.members[at + 1].bead,
                device: way.length / mean(&way.times)?,
                f64_chain: way.length / (fronts[at + 1] - fronts[at]),
            })
        };
        Self {
            off_rms_s: (!all.is_empty()).then(|| (squares / all.len() as f64).sqrt()),
            beads: beads.filter_map(arrival).collect(),
            speeds: ways.iter().enumerate().filter_map(speed).collect(),
        }
    }

    /// Of a bead.
    pub fn at(&self, bead: usize) -> Option<&BeadArrival> {
        self.beads.iter().find(|arrival| arrival.bead == bead)
    }

    /// A line for each bead that has no place on the time in common.
    pub(super) fn notes(&self, row: &BeadRow) -> Vec<String> {
        let felt = row.members.iter().filter(|member| !member.felt.is_empty());
        if self.beads.is_empty() {
            return match felt.count() {
                0 | 1 => Vec::new(),
                _ => vec![
                    "no common time: no two beads saw two sync edges that are the same, so there are no arrivals and no \
                     speeds; energies need none"
                        .to_owned(),
                ],
            };
        }
        felt.filter(|member| self.at(member.bead).is_none())
            .map(|member| {
                let bead = member.bead;
                if member.felt.iter().any(|felt| felt.rise_drawn.is_some()) {
                    format!(
                        "bead {bead} is not on the common time: it has no two sync edges in common with the others; \
                         its arrival is not known"
                    )
                } else {
                    format!("bead {bead} has no strike with all its samples: its arrival is not known")
                }
            })
            .collect()
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
