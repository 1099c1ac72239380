//! The chain of a scenario at other values of its quantities.

use bead_tables::printable::first_of;
use hertz_chain::tangents::{Parameter, tangents};
use hertz_chain::{Contact, Scenario};

use crate::quantity::{Quantity, Values, ungained};

/// Longest step of the integration, s.
const LONGEST_STEP: f64 = 5e-6;
/// Least number of steps while the striker touches the first bead.
const STEPS_IN_CONTACT: f64 = 25.0;
/// Most beads that a message names.
const NAMED: usize = 10;
/// Directions of the tangents: the striker's velocity, then those that all strikes share.
pub(crate) const DIRECTIONS: usize = 8;

/// A host in a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainOfScenario {
    pub(crate) scenario: Scenario,
    pub(crate) bead: usize,
    /// The `[[intruder]]` table of its intruder, if there is one.
    table: Option<usize>,
    mass: f64,
    /// Step of the integration, s.
    pub(crate) step: f64,
}

impl ChainOfScenario {
    /// The intruder in bead `bead` of a scenario.
    ///
    /// # Errors
    /// The bead has no intruder or several, or no run has tangents: one line.
    pub fn new(scenario: &Scenario, bead: usize) -> Result<Self, String> {
        let tables = scenario.intruders.iter().enumerate();
        let held: Vec<usize> = tables
            .filter(|(_, one)| one.beads.contains(&bead))
            .map(|(table, _)| table)
            .collect();
        match held[..] {
            [table] => Self::of(scenario, bead, Some(table)),
            [] => {
                let with = scenario.hosts();
                Err(format!(
                    "bead {bead} of the scenario has no intruder; those with one are {with:?}"
                ))
            }
            _ => Err(format!(
                "bead {bead} of the scenario has {} intruders, but a chain can be identified only with at most \
                 one in each bead",
                held.len()
            )),
        }
    }

    /// The intruder of a bead with this address: in bead `place`, else in the bead with the address as its
    /// number, else in the only host.
    ///
    /// # Errors
    /// Several beads have intruders and none is named; or an error of [`Self::new`].
    pub fn of_bead(scenario: &Scenario, place: Option<usize>, address: u8) -> Result<Self, String> {
        let hosts = scenario.hosts();
        let named = hosts.iter().find(|host| **host == usize::from(address));
        match (place.or(named.copied()), &hosts[..]) {
            (Some(place), _) | (None, &[place]) => Self::new(scenario, place),
            (None, []) => {
                Err("no bead of this scenario has an intruder; add an [[intruder]] to it".to_owned())
            }
            (None, hosts) => Err(format!(
                "several beads of the scenario have intruders ({}), but not bead {address}; give the place of \
                 the bead",
                first_of(hosts, NAMED)
            )),
        }
    }

    /// A chain without intruders. `bead` is the one whose mass is that of the chain's beads.
    ///
    /// # Errors
    /// No run has tangents, or there is no such bead: one line.
    pub fn without_intruder(scenario: &Scenario, bead: usize) -> Result<Self, String> {
        if !(1..=scenario.chain.beads).contains(&bead) {
            return Err(format!(
                "bead {bead} is not in the scenario's chain of {} beads",
                scenario.chain.beads
            ));
        }
        Self::of(scenario, bead, None)
    }

    fn of(scenario: &Scenario, bead: usize, table: Option<usize>) -> Result<Self, String> {
        let model = hertz_chain::Model::of(scenario).map_err(|error| error.to_string())?;
        let is_cubic = |table: usize| scenario.intruders[table].cubic_stiffness != 0.0;
        if let Some(table) = table.filter(|table| is_cubic(*table)) {
            let key = format!("intruder[{}].cubic_stiffness", table + 1);
            return Err(format!(
                "{key}: k and c describe a linear spring; leave this key out"
            ));
        }
        let step = step_of(&model);
        tangents::<0>(scenario, &[], &[], None, (step, step)).map_err(|error| error.to_string())?;
        Ok(Self {
            scenario: scenario.clone(),
            bead,
            table,
            mass: model.mass(bead),
            step,
        })
    }

    /// The values of the scenario, with gains of 1.
    pub fn values(&self) -> Values {
        let chain = &self.scenario.chain;
        let springs = self.table.map_or([1.0; 3], |table| {
            let intruder = &self.scenario.intruders[table];
            [intruder.stiffness, intruder.damping, intruder.mass]
        });
        ungained(springs, [self.mass, chain.young, chain.relaxation])
    }

    /// The contact behind the bead at these values.
    ///
    /// # Errors
    /// No chain has these values.
    pub fn contact(&self, values: &Values) -> Result<Contact, String> {
        let model = hertz_chain::Model::of(&self.with(values, 1.0)).map_err(|error| error.to_string())?;
        let behind = (self.bead + 1).min(model.contacts());
        Ok(model.contact(behind))
    }

    /// The scenario at these values, with the striker `faster` by a factor.
    pub fn with(&self, values: &Values, faster: f64) -> Scenario {
        let mut scenario = self.scenario.clone();
        let of = |quantity: Quantity| values[quantity.place()];
        if let Some(table) = self.table {
            let intruder = &mut scenario.intruders[table];
            intruder.stiffness = of(Quantity::Stiffness);
            intruder.damping = of(Quantity::Damping);
            intruder.mass = of(Quantity::IntruderMass);
        }
        scenario.chain.young = of(Quantity::Young);
        scenario.chain.relaxation = of(Quantity::Relaxation);
        scenario.chain.density *= of(Quantity::BeadMass) / self.mass;
        scenario.striker.velocity *= faster;
        scenario
    }

    /// The shared directions, and the striker's velocity as the first one.
    pub(crate) fn directions(&self) -> [Parameter; DIRECTIONS] {
        // The tangents of a missing table are 0.
        let table = self.table.unwrap_or(usize::MAX);
        [
            Parameter::StrikerVelocity,
            Parameter::Stiffness(table),
            Parameter::Damping(table),
            Parameter::IntruderMass(table),
            Parameter::Density,
            Parameter::Young,
            Parameter::Relaxation,
            Parameter::CubicStiffness(table),
        ]
    }
}

/// A step much shorter than the fastest contact, the striker's (docs/physics.md, two bodies alone), s.
fn step_of(model: &hertz_chain::Model) -> f64 {
    let (striker, bead) = (model.mass(0), model.mass(1));
    let reduced = striker * bead / (striker + bead);
    let (stiffness, speed) = (model.contact(1).stiffness, model.striker_speed().abs());
    let contact = 3.218 * (reduced * reduced / (stiffness * stiffness * speed)).powf(0.2);
    // For a striker at rest, `contact` is infinite.
    (contact / STEPS_IN_CONTACT).min(LONGEST_STEP)
}
