//! The share of a wave's energy that the beads of a row absorb.
//!
//! # Design
//! The energy that came is the work of the first bead's force on its host ([`incident_work`]), and the share
//! is the sum of all beads' estimates A over it. Beads that share a calibration err alike, so their
//! uncertainties are added, which is an upper bound for others; the work goes with the square of the force's
//! scale. Strikes of several beads are one if their triggers are within [`TOGETHER`] by the host's time or,
//! where that is unknown, if they have the same number.

use bead_compare::incident::incident_work;
use bead_model::design::Uncertainty;
use bead_recording::clock::CommonTime;
use bead_recording::strikes::RecordedStrike;

use crate::quantity::Scalar;
use crate::values::{Measured, StrikeValues, force_part};

/// Greatest time from the first trigger of a row's beads to the others, s. A bead measures no two strikes
/// within 15 ms.
pub const TOGETHER: f64 = 10e-3;

/// A strike at a bead of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct FeltStrike {
    /// Number of the strike since the bead's reset.
    pub number: u32,
    /// Time of its trigger by the host, s; `None` if it is unknown.
    pub time: Option<f64>,
    /// Absorbed energy, estimate A, J.
    pub absorbed: Measured,
    /// Energy that came, J, if it is known.
    pub incident: Option<Measured>,
}

impl FeltStrike {
    /// The part of a strike in the energy of a row. The incident energy is computed only for the first bead
    /// (`if_first`).
    pub(crate) fn of(
        strike: &RecordedStrike,
        values: &StrikeValues,
        time: &CommonTime,
        stated: Option<&Uncertainty>,
        if_first: bool,
    ) -> Option<Self> {
        let incident = Some(strike).filter(|_| if_first).and_then(incident_work);
        let part = force_part(strike, stated);
        Some(Self {
            number: strike.said.strike,
            time: time.host(strike, strike.said.trigger_index as f64),
            absorbed: values.get(Scalar::Measured).ok()?,
            incident: incident.map(|value| Measured {
                value,
                u: part.map(|part| 2.0 * part * value),
            }),
        })
    }

    fn is_with(&self, other: &Self) -> bool {
        match self.time.zip(other.time) {
            Some((one, other)) => (one - other).abs() < TOGETHER,
            None => self.number == other.number,
        }
    }
}

/// The share that a row absorbs of each strike of its first bead: the strike's number, and the share or why
/// there is none. `beads` are in the order of the row, from the striker on, each with its address.
pub fn shares(beads: &[(u8, Vec<FeltStrike>)]) -> Vec<(u32, Result<Measured, String>)> {
    let [(_, first), others @ ..] = beads else {
        return Vec::new();
    };
    let share = |strike: &FeltStrike| {
        if others.is_empty() {
            return Err("the recording has one bead, and a row has two or more; record them together, with a --port for each".to_owned());
        }
        let Some(came) = strike.incident else {
            return Err(
                "the energy that came to the first bead is unknown: its force left the sensor's range, samples are missing, or \
                 the chain is under a load; fix that, and strike again"
                    .to_owned(),
            );
        };
        let mut sum = strike.absorbed;
        for (address, felt) in others {
            let Some(here) = felt.iter().find(|here| here.is_with(strike)) else {
                return Err(format!(
                    "bead {address} has no such strike; fetch it with `bead fetch`"
                ));
            };
            sum.value += here.absorbed.value;
            sum.u = sum.u.zip(here.absorbed.u).map(|(sum, u)| sum + u);
        }
        let value = sum.value / came.value;
        let u = sum.u.zip(came.u);
        Ok(Measured {
            value,
            u: u.map(|(sum, came_u)| (sum / came.value).hypot(value * came_u / came.value)),
        })
    };
    first
        .iter()
        .map(|strike| (strike.number, share(strike)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn felt(number: u32, time: Option<f64>, absorbed: f64, came: Option<f64>) -> FeltStrike {
        FeltStrike {
            number,
            time,
            absorbed: Measured {
                value: absorbed,
                u: Some(0.02 * absorbed),
            },
            incident: came.map(|value| Measured {
                value,
                u: Some(0.03 * value),
            }),
        }
    }

    #[test]
    fn a_row_absorbs_the_sum_of_its_beads_of_one_strike() {
        // The second bead lost the first strike, so its numbers differ.
        let first = vec![
            felt(0, Some(1.0), 1.0, Some(10.0)),
            felt(1, Some(1.5), 2.0, Some(20.0)),
        ];
        let second = vec![felt(0, Some(1.501), 3.0, None)];
        let found = shares(&[(7, first.clone()), (8, second)]);
        let why = found[0].1.as_ref().unwrap_err();
        assert!(why.starts_with("bead 8 has no such strike"), "{why}");
        let share = found[1].1.as_ref().unwrap();
        assert!((share.value - 0.25).abs() < 1e-12);
        assert!((share.u.unwrap() - 0.25 * 0.02_f64.hypot(0.03)).abs() < 1e-12);
        // Without times the numbers decide, and without a second bead there is no row.
        let timeless = vec![felt(0, None, 3.0, None)];
        assert!(shares(&[(7, first.clone()), (8, timeless)])[0].1.is_ok());
        let alone = shares(&[(7, first)]).remove(0).1.unwrap_err();
        assert!(alone.contains("has one bead"), "{alone}");
        let unknown = vec![felt(0, None, 1.0, None)];
        assert!(shares(&[(7, unknown.clone()), (8, unknown)])[0].1.is_err());
    }
}
