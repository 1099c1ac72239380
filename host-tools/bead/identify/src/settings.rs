//! Identified values as settings of a bead.

use bead_model::design::{Description, Relative, Uncertainty};

use crate::chain::ChainOfScenario;
use crate::identified::Identified;
use crate::quantity::{COUNT, QUANTITIES, Quantity, Values, ungained};

/// Range of a relative standard uncertainty in settings.
const RANGE: std::ops::RangeInclusive<f64> = 1e-6..=0.5;
/// Correlations are below this, so that rounding leaves them possible.
const MOST_CORRELATED: f64 = 0.9999;

/// The settings in force, with the identified values in place of theirs. `chain` is the chain of the strikes,
/// if the contacts were fitted.
///
/// # Errors
/// No chain has the values: one line.
pub fn identified(
    before: &Description,
    found: &Identified<'_>,
    chain: Option<&ChainOfScenario>,
    known: impl Fn(Quantity) -> bool,
) -> Result<Description, String> {
    let best = &found.best;
    let (free, values): (_, &Values) = (&best.free, &best.values);
    let mut after = *before;
    let mut stated = before.uncertainty.unwrap_or_default();
    let value = |quantity: Quantity| values[quantity.place()];
    for &quantity in free {
        match quantity {
            Quantity::Stiffness => after.intruder.stiffness = value(quantity),
            Quantity::Damping => after.intruder.damping = value(quantity),
            Quantity::IntruderMass => after.intruder.mass = value(quantity),
            Quantity::BeadMass => after.bead.mass = value(quantity),
            Quantity::Young => {
                if let Some(chain) = chain {
                    after.contact.stiffness = chain.contact(values)?.stiffness;
                }
            }
            // The relaxation time of a contact with an unlike bead differs from that of the chain's
            // material.
            Quantity::Relaxation => {
                let time = |chain: &ChainOfScenario| Ok::<_, String>(chain.contact(values)?.relaxation);
                after.contact.relaxation = chain.map_or(Ok(value(quantity)), time)?;
            }
            Quantity::ForceGain => {
                after.force.per_code *= value(quantity);
                after.force.wide_per_code *= value(quantity);
            }
            Quantity::AccelerationGain => {
                after.acceleration.per_code *= value(quantity);
                after.acceleration.wide_per_code *= value(quantity);
            }
        }
        let variance = found.combined[(quantity.place(), quantity.place())];
        let part = Some(variance.sqrt()).filter(|part| known(quantity) && RANGE.contains(part));
        *uncertainty_of(&mut stated, quantity) = part.map(Relative::new);
    }
    let correlation = |one: Quantity, other: Quantity| {
        let of = |a: Quantity, b: Quantity| found.combined[(a.place(), b.place())];
        let both = (of(one, one) * of(other, other)).sqrt();
        let part = if both > 0.0 { of(one, other) / both } else { 0.0 };
        Relative::new(part.clamp(-MOST_CORRELATED, MOST_CORRELATED))
    };
    if [Quantity::Stiffness, Quantity::Damping]
        .iter()
        .any(|one| free.contains(one))
    {
        stated.stiffness_with_damping = correlation(Quantity::Stiffness, Quantity::Damping);
        stated.stiffness_with_mass = correlation(Quantity::Stiffness, Quantity::IntruderMass);
        stated.damping_with_mass = correlation(Quantity::Damping, Quantity::IntruderMass);
    }
    after.uncertainty = Some(stated);
    Ok(after)
}

/// The uncertainty of a quantity in settings.
fn uncertainty_of(stated: &mut Uncertainty, quantity: Quantity) -> &mut Option<Relative> {
    match quantity {
        Quantity::Stiffness => &mut stated.stiffness,
        Quantity::Damping => &mut stated.damping,
        Quantity::IntruderMass => &mut stated.intruder_mass,
        Quantity::BeadMass => &mut stated.bead_mass,
        // κ is proportional to the modulus in a chain of like beads.
        Quantity::Young => &mut stated.contact_stiffness,
        Quantity::Relaxation => &mut stated.relaxation,
        Quantity::ForceGain => &mut stated.force_gain,
        Quantity::AccelerationGain => &mut stated.acceleration_gain,
    }
}

/// Relative standard uncertainties of the quantities, as settings state them.
pub fn stated(uncertainty: Option<&Uncertainty>) -> [Option<f64>; COUNT] {
    let Some(uncertainty) = uncertainty else {
        return [None; COUNT];
    };
    let mut stated = *uncertainty;
    QUANTITIES.map(|quantity| uncertainty_of(&mut stated, quantity).map(Relative::part))
}

/// The values in settings, with gains of 1. Settings have no modulus: `young` gives it.
pub fn values(description: &Description, young: f64) -> Values {
    let (intruder, bead) = (&description.intruder, &description.bead);
    let springs = [intruder.stiffness, intruder.damping, intruder.mass];
    ungained(springs, [bead.mass, young, description.contact.relaxation])
}
