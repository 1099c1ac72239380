//! The input of a search for intruders, and its check.

use serde::Serialize;

use super::bounds::Bounds;
use super::catalogue::{Catalogue, CatalogueSpring, check_loss_factor};
use super::design::{BeadRadius, Sizes, with_radii};
use super::error::OptimiseError;
use super::objective::Objective;
use super::remaining::{needs_strike, struck_at};
use super::spread::Spread;
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::run::Run;
use crate::scenario::{InputError, Intruder, Scenario, TableCheck, ValueRange};
use crate::simulate::{Accuracy, SimulateError};

/// The input of a search. [`Search::new`] sets bounds that suit the chain.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Search {
    /// The beads that may hold an intruder each.
    pub hosts: Vec<usize>,
    /// Greatest sum of the intruders' masses, kg.
    pub total_mass: f64,
    /// Least and greatest mass of each, kg.
    pub mass: [f64; 2],
    /// Least and greatest stiffness, N/m.
    pub stiffness: [f64; 2],
    /// Least and greatest damping, N·s/m.
    pub damping: [f64; 2],
    /// Loss factor η = c / √(k m) of all intruders: it ties the damping to mass and stiffness, as one
    /// material for all springs does. [`Search::damping`] is then ignored.
    pub loss_factor: Option<f64>,
    /// Greatest displacement |x| of an intruder from rest in its host, m, at any strike and corner of the
    /// spread; none if any is allowed.
    pub stroke: Option<f64>,
    /// Springs to choose from. Each intruder has one of those within the bounds.
    pub catalogue: Option<Catalogue>,
    /// Most of the hosts that hold an intruder; without it, all do.
    pub hosts_at_most: Option<usize>,
    /// Beads whose radii may vary too; without it, none do.
    pub sizes: Option<Sizes>,
    /// The quantity of each strike to be made small.
    pub objective: Objective,
    /// Speeds of the striker, m/s; without any, the scenario's own.
    pub speeds: Vec<f64>,
    /// Combination of the values of several speeds.
    pub aim: Aim,
    /// Deviations of springs and dampers, over whose corners the worst value counts.
    pub spread: Spread,
    /// True if all intruders are to be alike.
    pub alike: bool,
    /// Most designs to try, each at every speed and corner of the spread, where a gradient counts as
    /// [`Search::GRADIENT_RUNS`]. A spread allows as many again for the optimum without it, a choice of hosts
    /// as many for that choice, and a catalogue as many for the choice of springs.
    pub evaluations: usize,
}

/// Combination of an objective's values for several strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Aim {
    /// Their mean.
    #[default]
    Mean,
    /// The greatest.
    Worst,
}

impl Aim {
    /// The number for these values; not a number without any.
    pub fn of(self, values: &[f64]) -> f64 {
        match self {
            Self::Mean => values.iter().sum::<f64>() / values.len() as f64,
            Self::Worst => values.iter().copied().fold(f64::NAN, f64::max),
        }
    }
}

impl Search {
    /// Most hosts: a derivative takes six designs a host, each of which names all of them.
    pub const HOSTS_MOST: usize = 1000;

    /// Runs without derivatives, each by itself, that take as long as one with all of them, as `cargo xtask
    /// bench` measures.
    pub const GRADIENT_RUNS: usize = 4;

    /// A search with bounds taken from the chain. Masses go up to half the lightest host. Stiffness goes
    /// from 1e-5 M ω² to M ω², and damping from 1e-4 M ω to 0.2 M ω: M is the lightest host's mass and π/ω
    /// the shortest time of a contact.
    ///
    /// # Errors
    /// [`OptimiseError`]: a search cannot use the scenario, the hosts or the total mass.
    pub fn new(scenario: &Scenario, hosts: Vec<usize>, total_mass: f64) -> Result<Self, OptimiseError> {
        scenario.check()?;
        check_hosts(scenario, &hosts, total_mass).map_err(OptimiseError::Search)?;
        let (_, host) = lightest(scenario, &hosts, None);
        let rate = std::f64::consts::PI / Model::new(scenario).shortest_contact();
        let heaviest = 0.5 * host;
        Ok(Self {
            mass: [0.02 * heaviest.min(total_mass / hosts.len() as f64), heaviest],
            stiffness: [1e-5 * host * rate * rate, host * rate * rate],
            damping: [1e-4 * host * rate, 0.2 * host * rate],
            hosts,
            total_mass,
            loss_factor: None,
            stroke: None,
            catalogue: None,
            hosts_at_most: None,
            sizes: None,
            objective: Objective::default(),
            speeds: Vec::new(),
            aim: Aim::default(),
            spread: Spread::default(),
            alike: false,
            evaluations: 200_000,
        })
    }

    /// Lets the radii of some beads vary too. The masses of intruders then go up to half the lightest host at
    /// its smallest.
    ///
    /// # Errors
    /// [`OptimiseError`]: the sizes name other beads than the chain's, or no range of radii.
    pub fn vary_sizes(&mut self, scenario: &Scenario, sizes: Sizes) -> Result<(), OptimiseError> {
        sizes.check(scenario).map_err(OptimiseError::Search)?;
        let heaviest = 0.5 * lightest(scenario, &self.hosts, Some(&sizes)).1;
        let each = self.total_mass / self.hosts.len() as f64;
        self.mass = [0.02 * heaviest.min(each), heaviest];
        self.sizes = Some(sizes);
        Ok(())
    }

    /// Speeds of the strikes, m/s.
    pub fn strikes(&self, scenario: &Scenario) -> Vec<f64> {
        if self.speeds.is_empty() {
            vec![scenario.striker.velocity]
        } else {
            self.speeds.clone()
        }
    }

    /// The bounds of every intruder.
    pub(super) fn bounds(&self) -> Bounds {
        Bounds {
            properties: [self.mass, self.stiffness, self.damping],
            loss_factor: self.loss_factor,
            stroke: self.stroke.unwrap_or(f64::INFINITY),
        }
    }

    /// The scenario with the least radius of each bead that may vary.
    fn smallest(&self, scenario: &Scenario) -> Scenario {
        let least = self.sizes.iter().flat_map(|sizes| {
            let radius = sizes.radius[0];
            sizes.beads.iter().map(move |&bead| BeadRadius { bead, radius })
        });
        with_radii(scenario, least)
    }

    /// The scenario's own radii of the beads that may vary, or the nearest that they may have, m.
    pub(super) fn own_radii(&self, scenario: &Scenario) -> Vec<f64> {
        let Some(sizes) = &self.sizes else {
            return Vec::new();
        };
        let ([low, high], spheres) = (sizes.radius, scenario.spheres());
        let own = |&bead: &usize| spheres[bead - 1].radius.clamp(low, high);
        sizes.beads.iter().map(own).collect()
    }

    /// The values whose greatest a search minimises, given those of all strikes at one corner of the spread
    /// after the other.
    pub(super) fn parts(&self, shares: &[f64]) -> Vec<f64> {
        let corners = self.spread.corners().len();
        match self.aim {
            Aim::Worst => shares.to_vec(),
            Aim::Mean => {
                let corners = shares.chunks(shares.len() / corners);
                corners.map(|shares| self.aim.of(shares)).collect()
            }
        }
    }

    /// The value of a design with these shares.
    pub(super) fn value(&self, shares: &[f64]) -> f64 {
        Aim::Worst.of(&self.parts(shares))
    }

    /// Checks that a search can use these options, as [`optimise`](crate::optimise()) does first.
    ///
    /// # Errors
    /// [`OptimiseError`]: the search cannot use a value of the scenario or an option.
    pub fn check(&self, scenario: &Scenario) -> Result<(), OptimiseError> {
        scenario.check()?;
        needs_strike(scenario)?;
        self.check_values(scenario)
            .and_then(|()| self.check_rates(scenario))
            .map_err(OptimiseError::Search)?;
        self.usable_springs().map(|_| ())
    }

    /// The springs of the catalogue that are within the bounds; none without a catalogue.
    pub(super) fn usable_springs(&self) -> Result<Vec<&CatalogueSpring>, OptimiseError> {
        let bounds = self.bounds().properties;
        let springs = self.catalogue.as_ref().map(|catalogue| catalogue.within(bounds));
        springs.unwrap_or_else(|| Ok(Vec::new()))
    }

    /// Refuses bounds with intruders too fast for any run, since the run would blame such an intruder.
    fn check_rates(&self, scenario: &Scenario) -> Result<(), InputError> {
        let (mass, stiffness, damping) = (self.mass, self.stiffness, self.damping);
        let tied = |mass, stiffness| self.bounds().tied([mass, stiffness, damping[1]]);
        let strongest = match self.loss_factor {
            Some(factor) => ("loss_factor", factor, tied(mass[1], stiffness[1])),
            None => ("damping", damping[1], tied(mass[1], stiffness[0])),
        };
        for (key, bound, [mass, stiffness, damping]) in [
            ("stiffness", stiffness[1], [mass[1], stiffness[1], damping[0]]),
            strongest,
            ("mass", mass[0], tied(mass[0], stiffness[1])),
        ] {
            for speed in self.strikes(scenario) {
                let mut struck = struck_at(&self.smallest(scenario), speed);
                let oscillator = Oscillator::new(mass, stiffness, damping);
                struck.intruders = vec![Intruder::new(self.hosts.clone(), oscillator)];
                let Accuracy { longest_step, .. } = Accuracy::DRAFT;
                let run = Run::new(&struck, Accuracy::DRAFT);
                let checked = run.and_then(|run| run.check(struck.duration, longest_step));
                if let Err(SimulateError::TooStiff { time, steps, .. }) = checked {
                    let what = format!(
                        "{bound:e} gives an intruder a time constant of {time:.1e} s, and the run {steps:.1e} steps"
                    );
                    let advice = match key {
                        "mass" => "raise the least mass",
                        _ => "lower the greatest value; mass is in kg, stiffness in N/m, damping in N·s/m",
                    };
                    return Err(InputError::at(key, what, advice));
                }
            }
        }
        Ok(())
    }

    fn check_values(&self, scenario: &Scenario) -> Result<(), InputError> {
        check_hosts(scenario, &self.hosts, self.total_mass)?;
        self.objective.check(scenario)?;
        self.spread.check()?;
        check_loss_factor("loss_factor", self.loss_factor)?;
        for (key, [low, high], unit) in [
            ("mass", self.mass, "kg, such as 0.0037"),
            ("stiffness", self.stiffness, "N/m, such as 3.95e5"),
            ("damping", self.damping, "N·s/m, such as 12"),
        ] {
            if !(high.is_finite() && low > 0.0 && low < high) {
                let what = format!("{low} to {high} is not a range to search");
                let advice = "give two positive numbers, the lesser first";
                return Err(InputError::at(key, what, advice));
            }
            for bound in [low, high] {
                TableCheck::of("").check(key, bound, ValueRange::Positive(unit))?;
            }
        }
        if let Some(sizes) = &self.sizes {
            sizes.check(scenario)?;
        }
        let (bead, host) = lightest(scenario, &self.hosts, self.sizes.as_ref());
        let [least, greatest] = self.mass;
        if greatest >= host {
            let smallest = if self.sizes.is_some() {
                "at its smallest "
            } else {
                ""
            };
            let what =
                format!("{greatest} kg is at least as heavy as bead {bead} {smallest}of {host:.3e} kg");
            return Err(InputError::at("mass", what, "lower the greatest mass"));
        }
        let (count, total) = (self.hosts.len(), self.total_mass);
        if least * count as f64 > total {
            let what =
                format!("{count} hosts of at least {least} kg are more than the total mass of {total} kg");
            return Err(InputError::at("mass", what, "lower the least mass"));
        }
        if self.hosts_at_most == Some(0) {
            let (what, advice) = (
                "with 0 hosts there is no intruder",
                "give 1 or more, or leave it out",
            );
            return Err(InputError::at("hosts_at_most", what, advice));
        }
        if let Some(stroke) = self.stroke {
            TableCheck::of("").check("stroke", stroke, ValueRange::Positive("m, such as 2e-5"))?;
        }
        for &speed in &self.speeds {
            TableCheck::of("").check("speeds", speed, ValueRange::Positive("m/s, such as 0.45"))?;
        }
        let fewest = COARSE.iter().product::<usize>();
        if self.evaluations < fewest {
            let most = self.evaluations;
            let what = format!("{most} are too few: the first, coarse search takes {fewest}");
            return Err(InputError::at("evaluations", what, "give 1000 or more"));
        }
        Ok(())
    }
}

impl Sizes {
    fn check(&self, scenario: &Scenario) -> Result<(), InputError> {
        let mut taken = vec![None; scenario.chain.beads];
        if self.beads.is_empty() {
            let advice = "name at least one, or leave the sizes out";
            return Err(InputError::at("sizes", "names no bead", advice));
        }
        for &bead in &self.beads {
            TableCheck::of("").claim("sizes", bead, 0, &mut taken)?;
        }
        let [low, high] = self.radius;
        for radius in self.radius {
            TableCheck::of("").check("sizes", radius, ValueRange::Positive("m, such as 0.019"))?;
        }
        if low >= high {
            let what = format!("{low} to {high} m is not a range to search");
            let advice = "give two radii in m, the lesser first";
            return Err(InputError::at("sizes", what, advice));
        }
        Ok(())
    }
}

/// Points of the coarse grid in mass, stiffness, damping.
pub(super) const COARSE: [usize; 3] = [2, 9, 7];

/// The host of least mass and its mass, kg, each at its least radius.
fn lightest(scenario: &Scenario, hosts: &[usize], sizes: Option<&Sizes>) -> (usize, f64) {
    let beads = scenario.spheres();
    let masses = hosts.iter().map(|&bead| {
        let mut sphere = beads[bead - 1];
        let sizes = sizes.filter(|sizes| sizes.beads.contains(&bead));
        sphere.radius = sizes.map_or(sphere.radius, |sizes| sizes.radius[0]);
        (bead, sphere.mass())
    });
    let least = masses.min_by(|a, b| a.1.total_cmp(&b.1));
    least.expect("hosts have been checked to be there")
}

/// Refuses hosts that cannot be searched, and a total mass, kg, that they cannot hold.
fn check_hosts(scenario: &Scenario, hosts: &[usize], total: f64) -> Result<(), InputError> {
    let beads = scenario.chain.beads;
    if hosts.is_empty() {
        let advice = format!("name at least one bead from 1 to {beads}, such as 7-16");
        return Err(InputError::at("hosts", "names no bead", advice));
    }
    let (count, most) = (hosts.len(), Search::HOSTS_MOST);
    if count > most {
        let what = format!("{count} beads are more than a search can vary");
        return Err(InputError::at("hosts", what, format!("name at most {most}")));
    }
    let mut taken = vec![None; beads];
    for &host in hosts {
        TableCheck::of("").claim("hosts", host, 0, &mut taken)?;
    }
    TableCheck::of("").check("total_mass", total, ValueRange::Positive("kg, such as 0.037"))?;
    let (bead, host) = lightest(scenario, hosts, None);
    let most = host * count as f64;
    if total >= most {
        let what =
            format!("{total} kg in {count} hosts leaves bead {bead}, of {host:.3e} kg, nothing but intruder");
        let advice = format!("give less than {most:.3} kg");
        return Err(InputError::at("total_mass", what, advice));
    }
    Ok(())
}
