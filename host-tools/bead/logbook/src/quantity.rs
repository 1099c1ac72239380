//! Quantities of a strike that are followed over days.

use crate::recording::LoggedStrike;

/// A quantity of a strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Absorbed energy by estimate A, J.
    Measured,
    /// Absorbed energy by estimate B, J.
    Predicted,
    /// A over B.
    Ratio,
    /// Highest force, N.
    PeakForce,
    /// Frequency of the intruder's ringing, Hz.
    RingFrequency,
    /// Part by which the force reads higher at the low gain than at the high one.
    ForceGains,
    /// Part by which the acceleration reads higher at the low gain than at the high one.
    AccelerationGains,
    /// Drift of the bead's clock against the host's, ppm.
    Clock,
}

impl Quantity {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 8] = [
        Self::Measured,
        Self::Predicted,
        Self::Ratio,
        Self::PeakForce,
        Self::RingFrequency,
        Self::ForceGains,
        Self::AccelerationGains,
        Self::Clock,
    ];

    /// Name, title and unit.
    fn words(self) -> [&'static str; 3] {
        match self {
            Self::Measured => ["absorbed_measured", "A, measured", "J"],
            Self::Predicted => ["absorbed_predicted", "B, predicted", "J"],
            Self::Ratio => ["ratio", "A/B", ""],
            Self::PeakForce => ["peak_force", "peak force", "N"],
            Self::RingFrequency => ["ring_frequency", "ring frequency", "Hz"],
            Self::ForceGains => ["force_gains", "force, low over high gain", ""],
            Self::AccelerationGains => ["acceleration_gains", "acceleration, low over high gain", ""],
            Self::Clock => ["clock", "clock", "ppm"],
        }
    }

    /// Its name on a command line and in JSON.
    pub fn name(self) -> &'static str {
        self.words()[0]
    }

    /// Its name for people.
    pub fn title(self) -> &'static str {
        self.words()[1]
    }

    /// Its unit in JSON; empty for a ratio.
    pub fn unit(self) -> &'static str {
        self.words()[2]
    }

    /// Its value and standard uncertainty of a strike; the latter is `None` where it is unknown.
    pub fn of(self, strike: &LoggedStrike) -> Option<(f64, Option<f64>)> {
        let number = |name| strike.number(name);
        let with = |value, u| Some((number(value)?, number(u)));
        match self {
            Self::Measured => with("absorbed_measured_j", "u_absorbed_measured_j"),
            Self::Predicted => with("absorbed_predicted_j", "u_absorbed_predicted_j"),
            Self::Ratio => {
                let (a, b) = (number("absorbed_measured_j")?, number("absorbed_predicted_j")?);
                // A/B is 1 + (A − B)/B, and what both share cancels in u(A − B).
                let ratio = (a / b, number("u_difference_j").map(|u| u / b));
                Some(ratio).filter(|(ratio, _)| b > 0.0 && ratio.is_finite())
            }
            Self::PeakForce => with("peak_force_n", "u_peak_force_n"),
            // The bead sends none of it.
            Self::RingFrequency => Some((number("ring_frequency_hz")?, None)),
            Self::ForceGains => with("force_gains_deviation", "force_gains_uncertainty"),
            Self::AccelerationGains => with("acceleration_gains_deviation", "acceleration_gains_uncertainty"),
            Self::Clock => strike.clock_ppm.map(|(ppm, u)| (ppm, Some(u))),
        }
    }
}
