//! The quantities of a strike, as tables show them: values by four sources, and how far the device is off.

use crate::report::EnergyUnit;
use crate::strike::{ShapeValues, StrikeComparison, Values};

/// Who gives a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// The bead.
    Device,
    /// The bead's code on this computer.
    Replay,
    /// f64 estimates from the same samples.
    F64Samples,
    /// The full simulation.
    F64Chain,
}

impl Source {
    /// In the order of the columns of a table: each adds one source of error to the one on its right.
    pub(super) const ALL: [Self; 4] = [Self::Device, Self::Replay, Self::F64Samples, Self::F64Chain];
}

#[derive(Debug, Clone, Copy)]
enum Field {
    /// An energy, J.
    Energy(fn(&Values) -> f64),
    Force(fn(&Values) -> f64),
    /// A value of the shape, with the number of its unit in the SI unit.
    Shape(fn(&ShapeValues) -> f64, f64),
}

/// A quantity of a strike.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quantity {
    name: &'static str,
    /// Empty for an energy, whose unit depends on its size.
    unit: &'static str,
    digits: usize,
    field: Field,
}

const fn shape(
    name: &'static str,
    unit: &'static str,
    scale: f64,
    digits: usize,
    of: fn(&ShapeValues) -> f64,
) -> Quantity {
    Quantity {
        name,
        unit,
        digits,
        field: Field::Shape(of, scale),
    }
}

const fn energy(name: &'static str, of: fn(&Values) -> f64) -> Quantity {
    Quantity {
        name,
        unit: "",
        digits: 3,
        field: Field::Energy(of),
    }
}

/// All quantities: the two estimates first.
pub(super) const QUANTITIES: [Quantity; 9] = [
    energy("A, measured", |values| values.absorbed_measured),
    energy("B, predicted", |values| values.absorbed_predicted),
    Quantity {
        name: "peak force",
        unit: "N",
        digits: 5,
        field: Field::Force(|values| values.peak_force),
    },
    shape("width at half height", "µs", 1e6, 2, |shape| shape.width),
    shape("impulse", "mN·s", 1e3, 4, |shape| shape.impulse),
    shape("ringing", "Hz", 1.0, 1, |shape| shape.ring_frequency),
    shape("decay of the ringing", "1/s", 1.0, 1, |shape| shape.ring_decay),
    shape("k from the ringing", "kN/m", 1e-3, 1, |shape| shape.stiffness),
    shape("c from the ringing", "N·s/m", 1.0, 2, |shape| shape.damping),
];

impl Quantity {
    /// The value in SI units. `None` where the source does not give it, or found no ringing.
    pub(super) fn value(&self, strike: &StrikeComparison, source: Source) -> Option<f64> {
        let values = match source {
            Source::Device => Some(strike.device),
            Source::Replay => strike.replay,
            Source::F64Samples => strike.f64_samples,
            Source::F64Chain => Some(strike.f64_chain),
        };
        match self.field {
            Field::Energy(of) | Field::Force(of) => values.map(|values| of(&values)),
            Field::Shape(of, _) => {
                let shape = strike.shape?;
                let shape = match source {
                    Source::Device => shape.device,
                    Source::F64Chain => shape.f64_chain,
                    Source::Replay | Source::F64Samples => return None,
                };
                // A bead that found no ringing, or none there is, says 0.
                Some(of(&shape)).filter(|value| *value != 0.0)
            }
        }
    }

    /// True if replay and f64 from the same samples compute it too.
    pub(super) fn has_four_sources(&self) -> bool {
        !matches!(self.field, Field::Shape(..))
    }

    /// The device's deviation, as a part of the full chain's value.
    pub(super) fn off(&self, strike: &StrikeComparison) -> Option<f64> {
        let device = self.value(strike, Source::Device)?;
        Some(device / self.value(strike, Source::F64Chain)? - 1.0)
    }

    /// The name with the unit, and the number of this unit in the SI unit. Energies are shown in `energies`.
    pub(super) fn shown_in(&self, energies: EnergyUnit) -> (String, f64) {
        let (unit, scale) = match self.field {
            Field::Energy(_) => (energies.symbol, energies.scale),
            Field::Force(_) => (self.unit, 1.0),
            Field::Shape(_, scale) => (self.unit, scale),
        };
        (format!("{} ({unit})", self.name), scale)
    }

    /// Digits behind the point.
    pub(super) fn digits(&self) -> usize {
        self.digits
    }
}

/// The unit of the energies of these strikes.
pub(super) fn energy_unit(strikes: &[StrikeComparison]) -> EnergyUnit {
    EnergyUnit::of(strikes.iter().flat_map(|strike| {
        let sides = [strike.device, strike.f64_chain];
        sides
            .into_iter()
            .flat_map(|values| [values.absorbed_measured, values.absorbed_predicted])
    }))
}

#[cfg(test)]
mod tests {
    use hertz_chain::Scenario;

    use super::*;
    use crate::strike::FullChain;
    use crate::testing::recorded_strike;

    #[test]
    fn ringing_that_was_not_found_has_no_value() {
        let chain = FullChain::run(&Scenario::paper(), 8).unwrap();
        let mut strike = chain.compare(&recorded_strike());
        let [width, ringing] = [3, 5].map(|place| QUANTITIES[place]);
        assert!(width.off(&strike).unwrap().abs() < 0.01);
        let shape = strike.shape.as_mut().unwrap();
        (shape.device.ring_frequency, shape.f64_chain.ring_frequency) = (0.0, 0.0);
        assert_eq!(ringing.shown_in(energy_unit(&[strike.clone()])).0, "ringing (Hz)");
        assert_eq!(
            (ringing.value(&strike, Source::Device), ringing.off(&strike)),
            (None, None)
        );
    }
}
