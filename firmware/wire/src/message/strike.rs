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
    pub struct StrikeFlags(u32) {
        /// The force at the low gain reached a rail of the converter: peak and prediction are too low.
        0 "force_railed" FORCE_RAILED,
        /// The acceleration at the low gain reached a rail of the converter: the measured energy is too low.
        1 "acceleration_railed" ACCELERATION_RAILED,
        /// Another wave came within the window: the energies end before it if `window_cut` is set, and have a
        /// part of it if not.
        2 "another_wave" ANOTHER_WAVE,
        /// A state of the reduced chain exceeded half the range of its format.
        3 "chain_range" CHAIN_RANGE,
        /// The two estimates differ by more than three times the uncertainty of their difference, or, where
        /// that is unknown, by more than the settings allow, and no other flag says why.
        4 "estimates_differ" ESTIMATES_DIFFER,
        /// The frequency or the decay of the intruder's ringing is not what the settings say.
        5 "intruder_drifted" INTRUDER_DRIFTED,
        /// The two gains of a sensor differ by more than noise explains.
        6 "gains_differ" GAINS_DIFFER,
        /// The energies do not cover the whole window: they end before another wave, which has a window of
        /// its own or is counted in `strikes_in_dead_time`.
        7 "window_cut" WINDOW_CUT,
        /// At the end of the window the intruder still held more than half a percent of the absorbed energy.
        /// It is in both energies, by a closed form that is wrong if another wave follows.
        8 "ringing_left" RINGING_LEFT,
        /// The supply next to the strike, in `conditions` of the shape frame, differs by more than 0.3 % from
        /// that of the calibration in the settings, or was not measured yet: 1 % of it is 2 % of both
        /// energies.
        9 "supply_off" SUPPLY_OFF,
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
        /// The acceleration that the reduced chain predicts from the force differs from the measured one by
        /// more than noise, the chain's own error and the stated uncertainties explain: spring, damper, a
        /// mass, a contact or a gain is not what the settings say. It is set only if no flag names the cause.
        15 "model_differs" MODEL_DIFFERS,
        /// A sensor reached its own end, as the settings state it, before the converter reached a rail.
        16 "sensor_end" SENSOR_END,
        /// The intruder was not at rest before the strike, or the quiet was louder than the settings say.
        17 "not_at_rest" NOT_AT_REST,
        /// Over the strikes so far, k, c, a gain or the ratio of both energies is off the settings by more
        /// than three standard errors. A bead does not set it; `bead replay` does, from the strikes of a
        /// recording.
        18 "drifting" DRIFTING,
        /// The predicted acceleration agrees with the measured one until an echo from beyond the sixth bead
        /// behind can have returned, but not at the end of the window: later waves of a train, or echoes, are
        /// not in the reduced chain. Estimate B is off, by up to 6 %; estimate A is not.
        19 "wave_train" WAVE_TRAIN,
        /// On a bench, the bead's own outputs were on within the window: nothing struck it.
        20 "played" PLAYED,
    }
}

impl StrikeFlags {
    /// Flags that depend on the state of the bead outside the window. A replay of the window cannot set them.
    pub const OF_THE_BEAD: Self = Self::SETTINGS_NOT_OWNERS
        .with(Self::SENSOR_FAULT)
        .with(Self::SENSOR_STILL)
        .with(Self::PLAYED)
        .with(Self::FROM_OUTSIDE);
    /// Flags of a window that the force did not open. They are no doubts.
    pub const FROM_OUTSIDE: Self = Self::TRIGGERED_BY_LINE.with(Self::TRIGGERED_ON_REQUEST);
}
