use crate::body::body;
use crate::quantity::{Decay, Fraction, Frequency, Impulse, Samples};

body! {
    /// The shape of one strike. It follows the strike frame. A value that could not be found is 0.
    pub struct Shape: Copy, Default {
        /// Number of the strike since the last reset, from 0.
        pub strike: u32,
        /// Sample index of the first scan of the window.
        pub first_index: u64,
        /// Time from `first_index` to the highest force.
        pub arrival: Samples,
        /// Full width of the force pulse at half its height.
        pub width: Samples,
        /// Momentum that came in during the window.
        pub impulse: Impulse,
        /// Frequency of the intruder's ringing after the pulse had passed.
        pub ring_frequency: Frequency,
        /// Rate at which the amplitude of this ringing decays.
        pub ring_decay: Decay,
        /// Match of the two gains of the force, if the strike shows it.
        pub force_gains: Option<GainMatch>,
        /// Match of the two gains of the acceleration, if the strike shows it.
        pub acceleration_gains: Option<GainMatch>,
    }
}

body! {
    /// Deviation of the two gains of a sensor from their settings. It is part of a shape frame.
    pub struct GainMatch: Copy {
        /// By how much the channel at the low gain reads higher than the one at the high gain, as a part of
        /// the signal.
        pub deviation: Fraction,
        /// Standard deviation of `deviation`.
        pub uncertainty: Fraction,
    }
}

impl Shape {
    /// Sample index of the highest force, with its fraction; `None` if it was not found.
    pub fn arrival_index(&self) -> Option<f64> {
        (self.arrival.bits() != 0).then(|| self.first_index as f64 + self.arrival.samples())
    }
}
