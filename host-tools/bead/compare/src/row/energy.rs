//! The energy along a row: E(n) after n intruders, and T, the part of it that each lets pass.
//!
//! # Design
//! **E(n) = E(0) - Σ absorbed**: the energy that came to the first bead, less the energy that the first n
//! intruders took, once by estimate A and once by B. E(0) is the first bead's own: the work of its force on
//! the host of the reduced chain, over the main wave. (The law of a solitary wave between equal beads gives
//! 13 % too little behind a host with 12 g.) It is the simulation's where samples are missing, where the
//! force left the sensor's range, or under a static load. For a host that did not record, the simulation's
//! value is taken. All energies are parts of E(0), so strikes of different speeds can be averaged.
//!
//! The paper's E(n) compares the energies at the end of chains with n intruders and with none
//! ([`energies_left`]); it has its own column. In a row of ten, later intruders send waves back: this changes
//! E by 1e-4 for m = 2.7 g, and by 0.02 after the first for 12 g. The column also has the energy that lossy
//! contacts take.

use hertz_chain::{TransmissionFit, energies_left};
use serde::Serialize;

use crate::error::CompareError;
use crate::row::chain::RowChain;
use crate::row::member::{DeviceAndChain, FeltStrike};
use crate::row::strikes::BeadRow;

/// The energy along a row, as in the JSON.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct EnergyAlong {
    /// Energy of the wave that reached the first bead that recorded, J; none if no bead felt a strike.
    pub incident: Option<DeviceAndChain>,
    /// The first bead that recorded.
    pub incident_at: Option<usize>,
    /// Source of the device's value: `bead`, or `simulation`.
    pub incident_by: &'static str,
    /// After 0, 1 and all further intruders.
    pub after: Vec<After>,
    /// The line through ln E(n); of A and B only if no host between the first and the last is missing.
    pub fit: FourSides<Option<TransmissionFit>>,
    /// Hosts without a recording, between the first and the last with one; if there are any, A and B have no
    /// line.
    pub not_measured: Vec<usize>,
    /// Why there is no energy along the row, or why that of the wave is not the bead's own.
    #[serde(skip)]
    why: Option<&'static str>,
}

/// The energy that n intruders leave.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct After {
    /// Number of intruders.
    pub n: usize,
    /// The bead of the last of them; none after 0.
    pub bead: Option<usize>,
    /// E(n) as a part of E(0).
    pub left: FourSides<f64>,
    /// T = E(n) / E(n-1); by A and B of what a bead measured only.
    pub transmission: Option<Transmission>,
}

/// A value from four sides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FourSides<V> {
    /// By the beads' estimate A.
    pub by_a: V,
    /// By their estimate B.
    pub by_b: V,
    /// By what the chain's intruders take in the simulation of this row.
    pub f64_chain: V,
    /// By simulations of rows with n intruders each, as in the paper's Fig. 5.
    pub rows_of_n: V,
}

/// The part of the energy that an intruder lets pass.
pub type Transmission = FourSides<Option<f64>>;

impl<V: Copy> FourSides<V> {
    /// Each of the four.
    pub fn each(&self) -> [V; 4] {
        [self.by_a, self.by_b, self.f64_chain, self.rows_of_n]
    }

    fn of(side: impl Fn(usize) -> V) -> Self {
        Self {
            by_a: side(0),
            by_b: side(1),
            f64_chain: side(2),
            rows_of_n: side(3),
        }
    }
}

/// The energy that a host's intruder took, as a part of the energy at the first bead: by A, by B, by the
/// chain.
struct Taken {
    bead: usize,
    measured: Option<[f64; 2]>,
    f64_chain: f64,
}

impl EnergyAlong {
    pub(super) fn of(row: &BeadRow, chain: &RowChain) -> Result<Self, CompareError> {
        let none = |why| Self {
            incident: None,
            incident_at: None,
            incident_by: "simulation",
            after: Vec::new(),
            fit: FourSides::of(|_| None),
            not_measured: Vec::new(),
            why,
        };
        let Some(first) = row.members.iter().position(|member| !member.felt.is_empty()) else {
            return Ok(none(None));
        };
        let leader = &row.members[first];
        let Some(simulated) = leader.chain.incident() else {
            let why = "the main wave does not come from the striker's end: there is no E(n) and no T";
            return Ok(none(Some(why)));
        };
        let rows_of_n = energies_left(&chain.scenario)?;
        // Its own energies for all strikes or for none, so that all parts are of one kind.
        let is_own = leader.felt.iter().all(|felt| felt.incident.is_some());
        let came = |felt: &FeltStrike| felt.incident.filter(|_| is_own).unwrap_or(simulated);
        let end = chain.solution.at(chain.scenario.duration);
        let taken = |host: &usize| {
            let member = row.members.iter().position(|member| member.bead == *host);
            let intruders = chain.solution.model().intruders_of(*host);
            let dissipated: f64 = intruders.map(|number| end.dissipated_by(number)).sum();
            Taken {
                bead: *host,
                measured: member.and_then(|place| share(row, first, place, came)),
                f64_chain: dissipated / simulated,
            }
        };
        let taken: Vec<Taken> = chain.hosts.iter().map(taken).collect();
        let count = leader.felt.len() as f64;
        let after = after(&taken, leader.bead, &rows_of_n);
        let (fit, not_measured) = fits(&after, &taken);
        Ok(Self {
            incident: Some(DeviceAndChain {
                device: leader.felt.iter().map(came).sum::<f64>() / count,
                f64_chain: simulated,
            }),
            incident_at: Some(leader.bead),
            incident_by: if is_own { "bead" } else { "simulation" },
            after,
            fit,
            not_measured,
            why: match (is_own, leader.chain.load > 0.0) {
                (true, _) => None,
                (false, true) => Some(
                    "the chain is under a load, which the bead ignores: the energy that came to the first bead is the \
                     simulation's",
                ),
                (false, false) => Some(
                    "the first bead has a strike with missing samples, or beyond its sensor's range: the energy that came to \
                     it is the simulation's",
                ),
            },
        })
    }

    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.why.map(str::to_owned).into_iter().collect();
        if !self.not_measured.is_empty() {
            let beads: Vec<String> = self.not_measured.iter().map(usize::to_string).collect();
            notes.push(format!(
                "no T is fitted to the beads' energies, as these beads among them measured nothing: {}",
                beads.join(", ")
            ));
        }
        notes
    }
}

/// The energy that the bead at `place` took by A and by B, as a part of that at the bead at `first`: the mean
/// over the strikes that both felt.
fn share(row: &BeadRow, first: usize, place: usize, came: impl Fn(&FeltStrike) -> f64) -> Option<[f64; 2]> {
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for strike in &row.strikes {
        let felt = row.felt(strike);
        if let (Some(leader), Some(felt)) = (felt[first], felt[place]) {
            sum[0] += felt.device.absorbed_measured / came(leader);
            sum[1] += felt.device.absorbed_predicted / came(leader);
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum.map(|sum| sum / count))
}

/// E(n) from the energy that each host's intruder took, as a part of the energy that came to `first`.
fn after(taken: &[Taken], first: usize, rows_of_n: &[f64]) -> Vec<After> {
    let of = |taken: &Taken| {
        let [a, b] = taken.measured.unwrap_or([taken.f64_chain; 2]);
        [a, b, taken.f64_chain]
    };
    let before = taken.iter().filter(|one| one.bead < first);
    let before: f64 = before.map(|one| one.f64_chain).sum();
    let whole = 1.0 + before;
    let mut left = [whole; 3];
    let mut all = vec![After {
        n: 0,
        bead: None,
        left: FourSides::of(|_| 1.0),
        transmission: None,
    }];
    for (n, one) in (1..).zip(taken) {
        let was = left;
        for (left, taken) in left.iter_mut().zip(of(one)) {
            *left -= taken;
        }
        let through = |side: usize| match side {
            3 => Some(rows_of_n[n] / rows_of_n[n - 1]),
            2 => Some(left[2] / was[2]),
            _ => one.measured.map(|_| left[side] / was[side]),
        };
        all.push(After {
            n,
            bead: Some(one.bead),
            left: FourSides::of(|side| match side {
                3 => rows_of_n[n],
                _ => left[side] / whole,
            }),
            transmission: Some(FourSides::of(through)),
        });
    }
    all
}

/// The lines through ln E(n) from the first to the last host that measured, and the hosts between them that
/// measured nothing. With such hosts there are no lines by A and B.
fn fits(after: &[After], taken: &[Taken]) -> (FourSides<Option<TransmissionFit>>, Vec<usize>) {
    let is_measured = |one: &Taken| one.measured.is_some();
    let ends = (
        taken.iter().position(is_measured),
        taken.iter().rposition(is_measured),
    );
    let (Some(from), Some(to)) = ends else {
        return (FourSides::of(|_| None), Vec::new());
    };
    let gaps = taken[from..=to].iter().filter(|one| !is_measured(one));
    let gaps: Vec<usize> = gaps.map(|one| one.bead).collect();
    // E before the first of them, and after each.
    let stretch = &after[from..=to + 1];
    let fit = |side: usize| {
        let points: Vec<(usize, f64)> = stretch.iter().map(|one| (one.n, one.left.each()[side])).collect();
        TransmissionFit::of(&points).filter(|_| side > 1 || gaps.is_empty())
    };
    (FourSides::of(fit), gaps)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// E(n) where each host from bead 7 takes a tenth of the energy that comes to it, and a thousandth more
    /// by B, as parts of the energy at the first host that recorded. Hosts whose `measured` is false did not
    /// record.
    fn energies(measured: &[bool]) -> (Vec<After>, FourSides<Option<TransmissionFit>>, Vec<usize>) {
        let first = measured.iter().position(|measured| *measured).unwrap();
        let power = |n: usize| 0.9_f64.powi(n as i32);
        let one = |(n, measured): (usize, &bool)| {
            let f64_chain = 0.1 * power(n) / power(first);
            Taken {
                bead: 7 + n,
                measured: measured.then_some([f64_chain, f64_chain * 1.001]),
                f64_chain,
            }
        };
        let taken: Vec<Taken> = measured.iter().enumerate().map(one).collect();
        let rows_of_n: Vec<f64> = (0..=measured.len()).map(power).collect();
        let after = after(&taken, 7 + first, &rows_of_n);
        for one in &after {
            let [a, chain] = [one.left.by_a, one.left.f64_chain].map(|left| left - power(one.n));
            assert!(a.abs() < 1e-12 && chain.abs() < 1e-12, "{one:?}");
            assert!(one.left.by_b <= one.left.by_a);
        }
        let (fit, gaps) = fits(&after, &taken);
        (after, fit, gaps)
    }

    #[test]
    fn what_is_left_is_what_came_less_what_was_taken() {
        let (_, fit, gaps) = energies(&[true; 5]);
        assert!(gaps.is_empty());
        for side in [fit.by_a, fit.f64_chain, fit.rows_of_n].map(Option::unwrap) {
            let off = (side.transmission - 0.9).abs();
            assert!(off < 1e-12 && side.residual < 1e-12, "{side:?}");
        }
        assert!(fit.by_b.unwrap().transmission < 0.9);
    }

    #[test]
    fn a_host_that_did_not_record_takes_what_the_simulation_says_and_has_no_transmission() {
        let (after, fit, gaps) = energies(&[true, false, true, true]);
        let transmission = after[2].transmission.unwrap();
        assert_eq!((transmission.by_a, transmission.by_b), (None, None));
        assert!((transmission.f64_chain.unwrap() - 0.9).abs() < 1e-12);
        assert_eq!((gaps, fit.by_a), (vec![8], None));
    }

    #[test]
    fn hosts_before_the_first_that_recorded_count_by_the_simulation() {
        let (_, fit, _) = energies(&[false, false, true, true, true]);
        assert!((fit.by_a.unwrap().transmission - 0.9).abs() < 1e-12);
    }
}
