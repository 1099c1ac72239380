use crate::body::body;
use crate::names::bits;
use crate::quantity::{Acceleration, Energy, Force, Fraction};

body! {
    /// The result of one strike. It comes after the waveform frames of its window.
    pub struct Strike: Copy {
        /// Number of the strike since the last reset, from 0.
        pub strike: u32,
        /// Sample index of the first scan of the window.
        pub first_index: u64,
        /// Sample index of the scan that triggered the detector.
        pub trigger_index: u64,
        /// Number of scans in the window.
        pub samples: u16,
        /// Highest force.
        pub peak_force: Force,
        /// Sample index of the highest force.
        pub peak_index: u64,
        /// Highest acceleration; 32 768 m/s² stands for all above.
        pub acceleration_max: Acceleration,
        /// Lowest acceleration; -32 768 m/s² stands for all below.
        pub acceleration_min: Acceleration,
        /// Absorbed energy, estimated from the acceleration alone. `noise_energy` is already subtracted.
        pub absorbed_measured: Energy,
        /// Absorbed energy, estimated from the force alone by the reduced chain.
        pub absorbed_predicted: Energy,
        /// Energy of the incoming wave, estimated from the peak force.
        pub incident_energy: Energy,
        /// `absorbed_measured` divided by `incident_energy`.
        pub absorbed_fraction: Fraction,
        /// Energy of the noise, which is subtracted in `absorbed_measured`.
        pub noise_energy: Energy,
        /// Standard deviation of the force before the strike.
        pub force_noise: Force,
        /// Doubts about the result, and the cause of its window.
        pub flags: StrikeFlags,
    }
}

bits! {
    /// Doubts about the result of a strike, and the cause of its window.
    pub struct StrikeFlags(u16) {
        /// The force at the low gain reached a rail of the converter: peak and prediction are too low.
        0 "force_railed" FORCE_RAILED,
        /// The acceleration at the low gain reached a rail of the converter: the measured energy is too low.
        1 "acceleration_railed" ACCELERATION_RAILED,
        /// A state of the reduced chain exceeded half the range of its format.
        3 "chain_range" CHAIN_RANGE,
        /// The two estimates differ by more than the settings allow, and no other flag says why.
        4 "estimates_differ" ESTIMATES_DIFFER,
        /// The frequency or the decay of the intruder's ringing is not what the settings say.
        5 "intruder_drifted" INTRUDER_DRIFTED,
        /// The two gains of a sensor differ by more than noise explains.
        6 "gains_differ" GAINS_DIFFER,
        /// Another bead found a strike: it opened this window by the trigger line. The force here rose by
        /// less than the threshold until then.
        10 "triggered_by_line" TRIGGERED_BY_LINE,
        /// A host asked for this window.
        11 "triggered_on_request" TRIGGERED_ON_REQUEST,
        /// The code of a sensor stood still in the window for much longer than before the trigger: the sensor
        /// or its wire may have failed.
        12 "sensor_still" SENSOR_STILL,
        /// The strike was measured with the built-in settings, because flash has none or the bead refused
        /// them. They are not the owner's.
        13 "settings_not_owners" SETTINGS_NOT_OWNERS,
        /// A sensor or the supply was at fault at the end of the window; `standing` of the health frame says
        /// which.
        14 "sensor_fault" SENSOR_FAULT,
    }
}

impl StrikeFlags {
    /// Flags that depend on the state of the bead outside the window. A replay of the window cannot set them.
    pub const OF_THE_BEAD: Self = Self::SETTINGS_NOT_OWNERS
        .with(Self::SENSOR_FAULT)
        .with(Self::SENSOR_STILL)
        .with(Self::FROM_OUTSIDE);
    /// Flags of a window that the force did not open. They are no doubts.
    pub const FROM_OUTSIDE: Self = Self::TRIGGERED_BY_LINE.with(Self::TRIGGERED_ON_REQUEST);
}
