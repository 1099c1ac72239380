//! Standard uncertainties of the energies of a strike, by its bead and by its chain.

use bead_recording::strikes::RecordedStrike;
use bead_recording::uncertainties::of_energies;
use serde::Serialize;

/// Standard uncertainties of the energies of a strike, J: those that the bead sent, and the errors that the
/// simulated chain explains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct EnergyUncertainties {
    /// Of estimate A; none if a flag or the chain means an error that no bound holds.
    pub u_absorbed_measured: Option<f64>,
    /// Of estimate B; none as of A.
    pub u_absorbed_predicted: Option<f64>,
    /// Of A - B; none if one of both is none.
    pub u_difference: Option<f64>,
}

impl EnergyUncertainties {
    /// `None` if the bead sent none. `explained` has the greatest errors of A and of B that the chain
    /// explains, as parts: rectangular (JCGM 100, 4.3.7), and infinite without a bound.
    pub fn of(strike: &RecordedStrike, explained: [f64; 2]) -> Option<Self> {
        let [a, b, difference] = of_energies(strike.shape.as_ref()?, &strike.said)?;
        let energies = [strike.said.absorbed_measured, strike.said.absorbed_predicted];
        let errors = [0, 1].map(|place| explained[place] * energies[place].joules() / 3.0_f64.sqrt());
        let with = |u: Option<f64>, error: f64| Some(u?.hypot(error)).filter(|u| u.is_finite());
        Some(Self {
            u_absorbed_measured: with(a, errors[0]),
            u_absorbed_predicted: with(b, errors[1]),
            u_difference: with(difference, errors[0].hypot(errors[1])),
        })
    }

    /// The uncertainties of A and of B.
    pub fn each(&self) -> [Option<f64>; 2] {
        [self.u_absorbed_measured, self.u_absorbed_predicted]
    }

    /// A line that explains ± beside the energies of these strikes; `None` if `of` is empty.
    pub fn legend<'a>(of: impl IntoIterator<Item = &'a Self>) -> Option<String> {
        let mut all = of.into_iter().flat_map(Self::each).peekable();
        all.peek()?;
        let lacking = all.any(|u| u.is_none());
        let why = "; none where a flag or the chain means an error without a bound";
        Some(format!(
            "2 u of the stated calibration{}",
            if lacking { why } else { "" }
        ))
    }
}
