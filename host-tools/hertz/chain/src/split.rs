//! Energy of a wave at intruders: reflected, transmitted, in secondary waves, absorbed.

use crate::pulse::{Pulse, PulseSearch};
use crate::solution::Solution;

/// Energies of an incident pulse, J, at two contacts with the intruders between; see [`Solution::split`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Split {
    /// The incident pulse: the strongest at the near contact.
    pub incident: Pulse,
    /// The main transmitted pulse: the strongest at the far contact.
    pub main: Pulse,
    /// Energy that returns through the near contact after the incident pulse.
    pub reflected: f64,
    /// Energy that passes the far contact after the main pulse: the secondary waves.
    pub secondary: f64,
    /// Energy dissipated in the intruders between the contacts.
    pub absorbed: f64,
    /// The rest: energy dissipated in the contacts between the two, or still in the chain there.
    pub rest: f64,
}

impl Solution {
    /// Follows the strongest pulse that passes contact `near`: the energy that returns there and the energy
    /// that passes contact `far`, over the time of the search. `None` if there is no pulse at a contact.
    ///
    /// End the search before waves from the ends of the chain come back. The incident pulse must have passed
    /// `near` before its reflection arrives; a pulse's length (some five beads) ahead of the first host is
    /// enough. The sum of `main.energy`, `reflected`, `secondary`, `absorbed` and `rest` is `incident.energy`
    /// by definition of `rest`.
    ///
    /// # Panics
    /// If a contact is not of this chain or `near` is not before `far`.
    pub fn split(&self, near: usize, far: usize, search: &PulseSearch) -> Option<Split> {
        assert!(near < far, "the near contact comes before the far one");
        let end = search.to.min(self.end());
        let strongest = |pulses: Vec<Pulse>| pulses.into_iter().max_by(|a, b| a.force.total_cmp(&b.force));
        let (near_flow, far_flow) = (self.flow(near), self.flow(far));
        let incident = strongest(self.pulses_of(&near_flow, near, search))?;
        let main = strongest(self.pulses_of(&far_flow, far, search))?;
        let reflected = 0.0 - near_flow.between(incident.to, end).energy;
        let secondary = far_flow.between(main.to, end).energy;
        let lost = |t: f64| self.at(t).region(near..=far - 1).intruder_dissipated;
        let absorbed = lost(end) - lost(incident.from);
        let rest = incident.energy - main.energy - reflected - secondary - absorbed;
        Some(Split {
            incident,
            main,
            reflected,
            secondary,
            absorbed,
            rest,
        })
    }
}
