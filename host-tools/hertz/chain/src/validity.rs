//! Checks that the contacts of a run were as the model assumes: elastic, small, and slow.

use std::f64::consts::{PI, TAU};

use serde::Serialize;

use crate::model::Model;
use crate::scenario::{InputError, Material, Scenario};
use crate::summary::ContactPeak;

/// The suppositions of Hertz' theory, at the greatest force of one contact (Johnson, *Contact Mechanics*,
/// 1985, chapters 4 and 6).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct Validity {
    /// The contact.
    pub contact: usize,
    /// Highest pressure p₀ = 3 F / (2 π a²), Pa. Ductile bodies yield below the surface from 1.6 times their
    /// strength on.
    pub pressure: f64,
    /// Radius a of the contact over that of the smaller body. Hertz' law is for small ones.
    pub radius_ratio: f64,
    /// Width of the pulse at half its height over the period of the slower body's lowest vibration. Below
    /// some 1 the bodies ring, which the model leaves out. None where the width is not known.
    pub periods: Option<f64>,
    /// Young's modulus of the softer body, Pa.
    pub softer: f64,
}

/// A strong material of each kind, in place of the strength that a scenario does not state: Young's moduli of
/// its kind are below this, Pa; its name; its yield stress in simple tension or compression, Pa. Many of the
/// same modulus are weaker: soft steel has a sixth of this strength.
const STRONG: [(f64, &str, f64); 3] = [
    (20e9, "Bakelite", 200e6),
    (150e9, "hard brass", 350e6),
    (f64::INFINITY, "hardened bearing steel", 2e9),
];
/// p₀ at which yield begins, over the strength in simple tension (Johnson, section 6.1, of von Mises and of
/// Tresca alike).
const YIELDS: f64 = 1.6;
/// Beyond this Hertz' parabolas differ from spheres by some per cent.
const LARGE: f64 = 0.1;
const SHORT: f64 = 1.0;

impl Validity {
    /// Checks each of these contacts. Returns none if a contact law sets the stiffness, since the width of a
    /// contact does not follow from it.
    ///
    /// # Errors
    /// [`InputError`]: the scenario is out of range.
    pub fn of(scenario: &Scenario, peaks: &[ContactPeak]) -> Result<Vec<Self>, InputError> {
        let model = Model::of(scenario)?;
        if scenario
            .contact
            .as_ref()
            .is_some_and(|law| law.stiffness.is_some())
        {
            return Ok(Vec::new());
        }
        let striker = &scenario.striker;
        let mut bodies = vec![Some((striker.radius, striker.material()))];
        let beads = scenario.spheres().into_iter();
        bodies.extend(beads.map(|bead| Some((bead.radius, bead.material))));
        let wall = scenario.wall.as_ref().map(|wall| {
            // The wall does not move, so its vibration does not count: density zero makes the period zero.
            let material = Material::new(0.0, wall.young, wall.poisson);
            (wall.radius.unwrap_or(f64::INFINITY), material)
        });
        bodies.push(wall);
        let of = |peak: &ContactPeak| {
            let (near, far) = (bodies[peak.contact - 1]?, bodies[peak.contact]?);
            let contact = model.contact(peak.contact);
            let overlap = (peak.force / contact.stiffness).powf(2.0 / 3.0);
            let area = PI * overlap / (1.0 / near.0 + 1.0 / far.0);
            let slowest = period(near).max(period(far));
            Some(Self {
                contact: peak.contact,
                pressure: 1.5 * peak.force / area,
                radius_ratio: (area / PI).sqrt() / near.0.min(far.0),
                periods: peak.fwhm.map(|width| width / slowest),
                softer: near.1.young.min(far.1.young),
            })
        };
        Ok(peaks.iter().filter_map(of).collect())
    }

    /// Limits of the theory that are exceeded here, in a few words each.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let contact = self.contact;
        let material = STRONG.into_iter().find(|(below, ..)| self.softer < *below);
        if let Some((_, name, strength)) = material.filter(|(.., strength)| self.pressure > YIELDS * strength)
        {
            remarks.push(format!(
                "contact {contact} is pressed with {:.0} MPa: {name} yields from {:.0} MPa on ({YIELDS} times its strength), and \
                 the law of elastic contact no longer applies",
                1e-6 * self.pressure,
                1e-6 * YIELDS * strength,
            ));
        }
        if self.radius_ratio > LARGE {
            remarks.push(format!(
                "contact {contact} is {:.2} of a sphere's radius wide: Hertz' law is for small contacts",
                self.radius_ratio,
            ));
        }
        if let Some(periods) = self.periods.filter(|periods| *periods < SHORT) {
            remarks.push(format!(
                "the pulse at contact {contact} lasts {periods:.2} of a sphere's own period: the sphere rings, which the model leaves out",
            ));
        }
        remarks
    }
}

/// Period of a sphere's lowest vibration, in which it becomes long and flat by turns: 2 π R / (2.65 √(G/ρ)).
/// The factor goes from 2.6 to 2.7 with Poisson's ratio (Lamb, 1882).
fn period((radius, material): (f64, Material)) -> f64 {
    if material.density == 0.0 {
        return 0.0;
    }
    let shear = 0.5 * material.young / (1.0 + material.poisson);
    TAU * radius / (2.65 * (shear / material.density).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lamb's equation for the spheroidal mode l = 2, solved for three Poisson's ratios: ω R / √(G/ρ).
    #[test]
    fn the_period_of_a_sphere_is_within_a_hundredth_of_lambs() {
        for (poisson, root) in [(0.25, 2.63987), (0.27, 2.64250), (0.44, 2.66062)] {
            let young = 2.0 * (1.0 + poisson);
            let unit = Material {
                young,
                poisson,
                density: 1.0,
            };
            let off = period((1.0, unit)) * root / TAU - 1.0;
            assert!(off.abs() < 0.01, "{poisson}: {off}");
        }
    }
}
