//! Quantities of beads from their strikes, as `bead identify` finds them.

use bead_identify::bead::{BeadStrikes, Request, identify_bead, take};
use bead_identify::method::Method;
use bead_identify::quantity::{QUANTITIES, Quantity};
use bead_identify::report::IdentifyReport;
use bead_identify::ring_down::Mounting;
use bead_recording::beads::GatheredBead;
use bead_recording::strikes::RecordedStrike;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::scenario::Scenario;

/// The keyword arguments, as a dictionary that has them all.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Arguments {
    scenario: Option<Py<Scenario>>,
    place: Option<usize>,
    method: Option<String>,
    mounting: String,
    fit: Vec<String>,
    /// Address of the only bead that is wanted.
    bead: Option<u8>,
    /// Numbers of the strikes of each bead; all if it is empty.
    strikes: Vec<usize>,
    doubtful: bool,
}

/// The checked arguments of `Recording.identify`.
pub(crate) struct Asked {
    given: Arguments,
    method: Method,
    mounting: Mounting,
    fit: Vec<Quantity>,
}

impl Asked {
    /// Checks the arguments.
    pub(crate) fn of(given: Arguments) -> PyResult<Self> {
        let fit = given.fit.iter().map(|name| quantity(name));
        Ok(Self {
            method: method_of(given.method.as_deref(), given.scenario.is_some())?,
            mounting: mounting_of(&given.mounting)?,
            fit: fit.collect::<PyResult<_>>()?,
            given,
        })
    }

    fn is_wanted(&self, bead: u8) -> bool {
        self.given.bead.is_none_or(|wanted| wanted == bead)
    }

    /// Adds a strike to its bead if it is wanted.
    pub(crate) fn take(&self, beads: &mut Vec<BeadStrikes>, name: &str, strike: &RecordedStrike) {
        let (place, number) = GatheredBead::count(beads, strike);
        let numbers = &self.given.strikes;
        if self.is_wanted(strike.address) && (numbers.is_empty() || numbers.contains(&number)) {
            take(&mut beads[place], (0, name), strike, self.given.doubtful);
        }
    }

    /// The quantities of all beads, as JSON.
    pub(crate) fn identified(&self, beads: &[BeadStrikes], name: &str) -> Result<String, String> {
        let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
        if let Some(bead) = self.given.bead.filter(|bead| !addresses.contains(bead)) {
            return Err(format!(
                "bead {bead} has no strike in the recording; the beads with strikes are {addresses:?}"
            ));
        }
        let names = [name.to_owned()];
        let request = Request {
            method: self.method,
            mounting: self.mounting,
            fit: self.fit.clone(),
            scenario: self.given.scenario.as_ref().map(|scenario| &scenario.get().0),
            place: self.given.place,
            stated: None,
            from: None,
            names: &names,
            draws: false,
            samples: false,
        };
        let (mut results, mut failed) = (Vec::new(), None);
        for bead in beads.iter().filter(|bead| self.is_wanted(bead.address)) {
            match identify_bead(&request, bead) {
                Ok(bead) => results.push(bead.result),
                // The other beads go on.
                Err(error) => failed = failed.or(Some(error.to_string())),
            }
        }
        match failed {
            Some(why) if results.is_empty() => Err(why),
            _ => {
                let report = IdentifyReport::new(self.method, results);
                serde_json::to_string(&report).map_err(|error| error.to_string())
            }
        }
    }
}

fn method_of(name: Option<&str>, has_scenario: bool) -> PyResult<Method> {
    let why = match (name, has_scenario) {
        (None | Some("chain"), true) => return Ok(Method::Chain),
        (None | Some("ring_down"), false) => return Ok(Method::RingDown),
        (Some("pairs"), false) => return Ok(Method::Pairs),
        (Some("chain"), false) => {
            "method 'chain' simulates the chain from the striker to the bead: give scenario=Scenario.load(…)"
        }
        (Some("ring_down" | "pairs"), true) => {
            "scenario= describes a chain, but the method takes taps on a bead outside of a chain: leave out one of them"
        }
        (Some(other), _) => &format!("method {other:?} is not one of 'ring_down', 'pairs' and 'chain'"),
    };
    Err(PyValueError::new_err(why.to_owned()))
}

fn mounting_of(name: &str) -> PyResult<Mounting> {
    match name {
        "free" => Ok(Mounting::Free),
        "held" => Ok(Mounting::Held),
        other => Err(PyValueError::new_err(format!(
            "mounting {other:?} is neither 'free' nor 'held'"
        ))),
    }
}

fn quantity(name: &str) -> PyResult<Quantity> {
    Quantity::named(name).ok_or_else(|| {
        let names: Vec<_> = QUANTITIES.iter().map(|one| one.symbol()).collect();
        PyValueError::new_err(format!("fit {name:?} is not one of {}", names.join(", ")))
    })
}
