//! The judge of a strike: compares the measured acceleration of the intruder with the one that the force
//! predicts.
//!
//! # Design
//!
//! Both estimates of the energy share k, c, m and the gains, so where one of these is wrong they agree on a
//! wrong value. Their wave forms do not agree: at each sample the reduced chain of estimate B predicts the
//! acceleration `(k x + c ẋ)/m` of the intruder by its springs, and the accelerometer measures it.
//!
//! ```text
//! residual² = (Σ (a - a_B)² - noise) / (Σ a² - noise)
//! ```
//!
//! **One time.** The acceleration is converted two conversions after the force. For an intruder of 1.7 kHz
//! this alone would leave a residual of 2.7 %, so a filter of three taps shifts the measured acceleration
//! back to the time of the force (`Correction`). It is exact at the frequency of the ringing.
//!
//! **Samples compared.** Whole pieces from the end of the noise are compared, in the units of the reduced
//! chain. A piece in which the acceleration was at a rail is left out. Nothing is compared once the force was
//! at a rail, since all predictions are wrong after that. The residual covers the samples before an echo from
//! behind the last follower can return to the host, since the reduced chain knows nothing of the beads there.
//! After the paper's strike that is 3 ms, five times as long as its ringing takes to fall to 1/e. If the
//! forms agree until then, but not over the whole window, later waves are beyond the model: those of a train
//! among heavy intruders, or echoes. The settings are right, and estimate B is off.
//!
//! **Noise.** The mean square of the acceleration's noise is that of the same filter over the samples before
//! the strike. It is at least the square of half a code: without noise to move it, a zero can be off by this
//! much. Noise of the force is about the same part of the prediction as it is of the highest force. A
//! residual counts as a doubt only beyond the tolerance and beyond the part that noise explains.
//!
//! **Tolerance.** 1.2 % is below the residual of a bead that hangs 10° askew (1.5 %) or whose k is 1 % off
//! (1.6 %), and above that of a good one (up to 0.3 %, 0.7 % where a train of waves meets a row of
//! intruders). The step of the reduced chain has an error that grows with the third power of the inverse
//! width of a pulse. The tolerance is a fifth more than that error, as measured on chains of spheres (`cargo
//! test --release -p bead-model spheres -- --nocapture`): it matters below 9 samples. What the stated
//! uncertainties explain comes on top ([`UncertaintyTerms`](crate::energy_uncertainty::UncertaintyTerms)).

use crate::converter::CONVERSION;
use crate::correction::Correction;
use crate::physics::Bead;
use crate::quantity::{SensedAcceleration, Step, high_rounded, nearest, square};
use bead_wire::{Fraction, WaveformMatch};
use fixed::types::{I0F32, I16F16};
use serde::Serialize;

/// Least residual that flags a strike.
const LEAST_TOLERANCE: f32 = 0.012;
/// Least residual over the whole window that flags a strike: estimate B is up to 1 % off there, and up to 6 %
/// above.
const LATER_TOLERANCE: f32 = 0.05;
/// Tolerance over the error of the reduced chain.
const MARGIN: f32 = 1.2;
/// Width of a pulse at which the error of the reduced chain would be 1, samples: it is 5.5 % at 5 samples.
const UNSAMPLED: f32 = 1.9;
/// Width of the pulse of a weak strike over that of a wave of 1 m/s.
const WIDER: f64 = 1.28;

/// Coefficients of the comparison. All zeros where the sample rate is so low that the formats do not hold
/// them, below 28 kHz: then nothing is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WaveformJudge {
    /// Weights of the newest acceleration and of the two before it: from [`SensedAcceleration`] to twelfths
    /// of a µm/sample², the unit of the reduced chain, at the time of the force.
    pub taps: [I0F32; 3],
    /// Least mean square of the noise, in bits of that unit.
    pub floor: f32,
    /// Width of the pulse of a weak strike, samples.
    pub width: f32,
}

/// Sums of squares, in bits of the unit of the reduced chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Squares {
    signal: u64,
    difference: u64,
    samples: u16,
}

/// State of the comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WaveformState {
    /// The last two accelerations.
    accelerations: [i32; 2],
    /// The last prediction.
    predicted: i32,
    /// The piece that is not complete.
    piece: Squares,
    /// The pieces before the strike, which have noise only.
    quiet: Squares,
    /// The counted pieces before an echo from behind the last follower can arrive, and those after.
    before: Squares,
    after: Squares,
}

impl WaveformJudge {
    /// Coefficients for a bead whose accelerometer has `per_code` m/s² at the high gain, sampled every `dt`
    /// seconds. The intruder rings with `phase` rad a sample.
    pub(crate) fn new(bead: &Bead, per_code: f64, dt: f64, phase: f64) -> Self {
        // m/s² of a bit of a twelfth of a µm/sample².
        let unit = 12e-6 / (dt * dt) * Step::DELTA.to_num::<f64>();
        // The acceleration is converted after both conversions of the force.
        let Correction { slope, curve } = Correction::new(0.0, 2.0 * CONVERSION / dt, phase);
        let bits = SensedAcceleration::DELTA.to_num::<f64>() / unit;
        let taps = [curve + slope, 1.0 - 2.0 * curve, curve - slope].map(|tap| tap * bits);
        if taps.iter().any(|tap| tap.abs() >= 0.499) {
            return Self::default();
        }
        let half = 0.5 * per_code / unit;
        Self {
            taps: taps.map(nearest),
            floor: (half * half) as f32,
            width: (WIDER * bead.pulse_width(1.0) / dt) as f32,
        }
    }

    /// Residual above which a strike is flagged. Its pulse is `width` samples wide; 0 if that is unknown.
    pub fn tolerance(&self, width: f32) -> f32 {
        let samples = UNSAMPLED / width.min(self.width);
        (MARGIN * samples * samples * samples).max(LEAST_TOLERANCE)
    }

    /// True if the wave forms differ by more than the tolerance, by more than noise explains, and by more
    /// than the stated uncertainties do: `explained` is the square of that part.
    pub(crate) fn differs(&self, waveform: WaveformMatch, width: f32, explained: f32) -> bool {
        is_beyond(waveform, self.tolerance(width), explained)
    }

    /// Like [`Self::differs`], over the `whole` window: true if later waves are beyond the model.
    pub(crate) fn differs_later(&self, whole: WaveformMatch, width: f32, explained: f32) -> bool {
        is_beyond(whole, self.tolerance(width).max(LATER_TOLERANCE), explained)
    }

    /// Takes the measured accelerations of the next samples, at most [`PIECE`](crate::layout::PIECE), and
    /// those that the reduced chain predicts by the push of the springs. Never inlined, so that its
    /// instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(
        &self,
        state: &mut WaveformState,
        accelerations: &[SensedAcceleration],
        predicted: &[i32],
    ) {
        let [newest, middle, oldest] = self.taps.map(I0F32::to_bits);
        let [mut last, mut before] = state.accelerations;
        let mut expected = state.predicted;
        let (mut signal, mut difference) = (0, 0);
        for (acceleration, predicted) in accelerations.iter().zip(predicted) {
            let acceleration = acceleration.to_bits();
            // Accelerations are below 2^28 and the weights together below 3/4, so all sums are below 2^29.
            let measured = high_rounded(newest, acceleration)
                + high_rounded(middle, last)
                + high_rounded(oldest, before);
            signal += square(measured);
            difference += square(measured - expected);
            (before, last, expected) = (last, acceleration, *predicted);
        }
        (state.accelerations, state.predicted) = ([last, before], expected);
        state.piece.signal += signal;
        state.piece.difference += difference;
        state.piece.samples += accelerations.len() as u16;
    }

    /// The match before any echo; `None` if there is hardly more than noise. `force` is the noise of the
    /// force over the highest force.
    pub fn result(&self, state: &WaveformState, force: f32) -> Option<WaveformMatch> {
        self.matches(state, &state.before, force)
    }

    /// The match of the whole window.
    pub(crate) fn whole(&self, state: &WaveformState, force: f32) -> Option<WaveformMatch> {
        let mut whole = state.before;
        whole.add(state.after);
        self.matches(state, &whole, force)
    }

    fn matches(&self, state: &WaveformState, whole: &Squares, force: f32) -> Option<WaveformMatch> {
        let quiet = &state.quiet;
        let noise = (quiet.signal as f32 / f32::from(quiet.samples.max(1))).max(self.floor);
        let noise = noise * f32::from(whole.samples);
        let signal = whole.signal as f32 - noise;
        if self.taps == [I0F32::ZERO; 3] || signal <= noise {
            return None;
        }
        let noise = noise + force * force * signal;
        let difference = whole.difference as f32 - noise;
        let part = |squares: f32| {
            let part = libm::sqrtf(squares.max(0.0) / signal);
            Fraction::from_bits(I16F16::saturating_from_num(part).to_bits())
        };
        Some(WaveformMatch {
            residual: part(difference),
            noise: part(noise),
        })
    }
}

/// True if a residual is beyond a tolerance, the part of noise and the square that is `explained`.
fn is_beyond(waveform: WaveformMatch, tolerance: f32, explained: f32) -> bool {
    let [residual, noise] = [waveform.residual, waveform.noise].map(|part| part.ratio() as f32);
    let most = tolerance.max(noise);
    residual * residual > most * most + explained
}

impl WaveformState {
    /// Closes a piece of noise.
    pub(crate) fn close_noise(&mut self) {
        self.quiet.add(core::mem::take(&mut self.piece));
    }

    /// Closes a piece. It counts if all its samples are `known`; with `echoes`, among those after an echo.
    pub(crate) fn close_piece(&mut self, known: bool, echoes: bool) {
        let piece = core::mem::take(&mut self.piece);
        if known {
            let squares = if echoes { &mut self.after } else { &mut self.before };
            squares.add(piece);
        }
    }
}

impl Squares {
    fn add(&mut self, piece: Self) {
        self.signal = self.signal.saturating_add(piece.signal);
        self.difference = self.difference.saturating_add(piece.difference);
        self.samples += piece.samples;
    }
}
