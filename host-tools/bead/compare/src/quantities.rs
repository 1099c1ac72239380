//! The quantities of a strike, as tables show them: values by four sources, and how far the device is off.

use crate::report::EnergyUnit;
use crate::strike::{ShapeValues, StrikeComparison};
use crate::values::StrikeValues;

/// Places of the values of a quantity: by the device, by replay, by f64 from the same samples, and by the
/// full chain. Each adds one source of error to the one after it.
pub(super) const DEVICE: usize = 0;
const F64_CHAIN: usize = 3;

#[derive(Debug, Clone, Copy)]
enum ValueField {
    OfAll(fn(&StrikeValues) -> f64),
    /// A value that replay and f64 from the same samples do not have.
    OfShape(fn(&ShapeValues) -> f64),
}
use ValueField::{OfAll, OfShape};

#[derive(Debug, Clone, Copy)]
pub(super) struct StrikeQuantity {
    name: &'static str,
    /// J for an energy, which is shown in a unit of its size.
    unit: &'static str,
    /// Number of the unit in the SI unit.
    scale: f64,
    pub(super) digits: usize,
    field: ValueField,
    /// Greatest known error that is not noise, as a part of the value. It adds to the ± of the value.
    pub(super) bias: Option<f64>,
}

const fn quantity(
    name: &'static str,
    (unit, scale, digits): (&'static str, f64, usize),
    field: ValueField,
) -> StrikeQuantity {
    StrikeQuantity {
        name,
        unit,
        scale,
        digits,
        field,
        bias: None,
    }
}

/// Bounds of the errors of k and c from the ringing that are not noise: the fit takes the bead for one that
/// flies free, and the beads around it still touch it. In the paper's chain at 0.1 to 5 m/s k is off by -0.6
/// to +1.9 %, c by -3.0 to +2.3 %.
const RING_BIAS: [f64; 2] = [2.2e-2, 3.5e-2];

const fn biased(bias: f64, quantity: StrikeQuantity) -> StrikeQuantity {
    let bias = Some(bias);
    StrikeQuantity { bias, ..quantity }
}

const J: &str = "J";

/// All quantities: the two estimates first.
pub(super) const QUANTITIES: [StrikeQuantity; 9] = [
    quantity("A, measured", (J, 1.0, 3), OfAll(|all| all.absorbed_measured)),
    quantity("B, predicted", (J, 1.0, 3), OfAll(|all| all.absorbed_predicted)),
    quantity("peak force", ("N", 1.0, 5), OfAll(|all| all.peak_force)),
    quantity("width at half height", ("µs", 1e6, 2), OfShape(|of| of.width)),
    quantity("impulse", ("mN·s", 1e3, 4), OfShape(|of| of.impulse)),
    quantity("ringing", ("Hz", 1.0, 1), OfShape(|of| of.ring_frequency)),
    quantity(
        "decay of the ringing",
        ("1/s", 1.0, 1),
        OfShape(|of| of.ring_decay),
    ),
    biased(
        RING_BIAS[0],
        quantity(
            "k from the ringing",
            ("kN/m", 1e-3, 1),
            OfShape(|of| of.stiffness.unwrap_or(0.0)),
        ),
    ),
    biased(
        RING_BIAS[1],
        quantity(
            "c from the ringing",
            ("N·s/m", 1.0, 2),
            OfShape(|of| of.damping.unwrap_or(0.0)),
        ),
    ),
];

impl StrikeQuantity {
    /// The values by the four sources, SI units. `None` where a source does not give it, or found no ringing.
    pub(super) fn values(&self, strike: &StrikeComparison) -> [Option<f64>; 4] {
        let (device, chain) = (Some(strike.device), Some(strike.f64_chain));
        let known = [device, strike.replay, strike.f64_samples, chain];
        match self.field {
            OfAll(of) => known.map(|values| values.as_ref().map(of)),
            OfShape(of) => {
                let [device, chain] = match strike.shape {
                    Some(shape) => [shape.device, shape.f64_chain].map(|side| Some(of(&side))),
                    None => [None; 2],
                };
                // A frequency or decay of 0 means that no ringing was found, or that there is none.
                [device, None, None, chain].map(|value| value.filter(|value| *value != 0.0))
            }
        }
    }

    /// True if replay and f64 from the same samples compute it too.
    pub(super) fn has_four_sources(&self) -> bool {
        matches!(self.field, OfAll(_))
    }

    /// The device's deviation, as a part of the full chain's value.
    pub(super) fn off(&self, strike: &StrikeComparison) -> Option<f64> {
        let values = self.values(strike);
        Some(values[DEVICE]? / values[F64_CHAIN]? - 1.0)
    }

    /// The name with the unit, and the number of this unit in the SI unit. Energies are shown in `energies`.
    pub(super) fn shown_in(&self, energies: EnergyUnit) -> (String, f64) {
        let (unit, scale) = match self.unit {
            J => (energies.symbol, energies.scale),
            unit => (unit, self.scale),
        };
        (format!("{} ({unit})", self.name), scale)
    }
}

pub(super) fn energy_unit(strikes: &[StrikeComparison]) -> EnergyUnit {
    let sides = strikes
        .iter()
        .flat_map(|strike| [strike.device, strike.f64_chain]);
    EnergyUnit::of(sides.flat_map(|values| [values.absorbed_measured, values.absorbed_predicted]))
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
        let (value, off) = (ringing.values(&strike)[DEVICE], ringing.off(&strike));
        assert_eq!((value, off), (None, None));
        // An intruder nearby changes the ringing, and the fit of one alone would be off by a quarter.
        let mut scenario = Scenario::paper();
        scenario.intruders[0].beads.push(9);
        let strike = FullChain::run(&scenario, 8).unwrap().compare(&recorded_strike());
        for (place, quantity) in QUANTITIES.iter().enumerate() {
            assert_eq!(quantity.values(&strike)[DEVICE].is_none(), place > 6);
            assert!(quantity.values(&strike)[F64_CHAIN].is_some());
        }
    }
}
