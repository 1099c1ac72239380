use crate::body::body;
use crate::quantity::{Decay, Energy, Fraction, Frequency, Impulse, Samples, Temperature, Voltage};

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
        /// Energy that the intruder still held at the end of the window, as a part of both estimates.
        pub left: Option<LeftEnergy>,
        /// Match of the predicted acceleration with the measured one.
        pub waveform: Option<WaveformMatch>,
        /// Supply and temperature next to the strike, at their last measurement; absent before the first.
        pub conditions: Option<Conditions>,
        /// Standard uncertainties of the energies, if the settings state those of the calibration.
        pub uncertainty: Option<EnergyUncertainty>,
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

body! {
    /// Energy that the intruder still held at the end of a window: ½μv² + ½kx² with μ = m(M - m)/M, which its
    /// damper takes up after the window. It is part of a shape frame, and of the energies of the strike
    /// frame.
    pub struct LeftEnergy: Copy {
        /// From the acceleration, in `absorbed_measured`.
        pub measured: Energy,
        /// From the force, in `absorbed_predicted`.
        pub predicted: Energy,
    }
}

body! {
    /// Match of the acceleration that the reduced chain predicts from the force with the measured one, over
    /// the samples of a window. It is part of a shape frame.
    pub struct WaveformMatch: Copy {
        /// Rms of the difference, without the part that noise explains, over the rms of the measured
        /// acceleration.
        pub residual: Fraction,
        /// The part that noise explains, over the rms of the measured acceleration.
        pub noise: Fraction,
    }
}

body! {
    /// Supply and temperature, measured while no strike was. It is part of a shape frame, and 0.15 s old at
    /// most unless strikes follow each other without a pause.
    pub struct Conditions: Copy {
        /// Supply of the converter, by the reference voltage of the part as its factory measured it.
        pub supply: Voltage,
        /// Temperature of the die, by the factory's two points.
        pub die_temperature: Temperature,
    }
}

body! {
    /// Relative standard uncertainties of the energies of a strike (JCGM 100). It is part of a shape frame.
    pub struct EnergyUncertainty: Copy {
        /// Of `absorbed_measured`.
        pub measured: Fraction,
        /// Of `absorbed_predicted`.
        pub predicted: Fraction,
        /// Of their difference, in which shared parts cancel, over the greater of both.
        pub difference: Fraction,
    }
}

impl Shape {
    /// Fields at the end that the first images did not send, each a byte of 0 if it is absent.
    pub(crate) const GAINED: usize = 4;

    /// Sample index of the highest force, with its fraction; `None` if it was not found.
    pub fn arrival_index(&self) -> Option<f64> {
        (self.arrival.bits() != 0).then(|| self.first_index as f64 + self.arrival.samples())
    }
}
