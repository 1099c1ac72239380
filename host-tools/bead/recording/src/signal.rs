//! The signals of a strike in SI units, as its bead made them of the codes.
//!
//! # Design
//! The bead's own code ([`bead_model::sensor`]) makes one signal of the codes of both gains, with the filter
//! removed. It runs here again, so from the sample before the end of the baseline onwards every value has the
//! bits that the estimators used. Earlier samples, which the bead only averages, get their values with the
//! same zeros. The value of the last sample needs a code after it, and uses its own instead.

use bead_model::layout::{BASELINE, PIECE};
use bead_model::quantity::{SensedAcceleration, SensedForce, Step};
use bead_model::reduced_chain::ReducedChainState;
use bead_model::sensor::{Sensor, SensorState};
use bead_model::{Pair, Scan, Settings};
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;

use crate::strike::{RecordedStrike, ScanCodes};

/// The signals of a window, a value for each of its scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Force at the incoming contact, N: multiples of 2^-16.
    pub force: Vec<f64>,
    /// Acceleration of the intruder, m/s²: multiples of 2^-12.
    pub acceleration: Vec<f64>,
}

impl Signal {
    /// The signals of a window that begins with these scans. `None` if the baseline is not complete.
    pub fn of(scans: &[ScanCodes], settings: &Settings) -> Option<Self> {
        let scans: Vec<Scan> = scans.iter().map(ScanCodes::scan).collect();
        let pairs = |of: fn(&Scan) -> Pair| -> Vec<Pair> { scans.iter().map(of).collect() };
        Some(Self {
            force: values(&settings.force, &pairs(|scan| scan.force), SensedForce::ZERO)?,
            acceleration: values(
                &settings.acceleration,
                &pairs(|scan| scan.acceleration),
                SensedAcceleration::ZERO,
            )?,
        })
    }
}

impl RecordedStrike {
    /// Its signals, up to the first gap. `None` without settings or a complete baseline.
    pub fn signal(&self) -> Option<Signal> {
        Signal::of(&self.scans, self.settings.as_ref()?)
    }
}

impl Signal {
    /// The measured acceleration at the time of the force, less the one that the reduced chain predicts from
    /// the force, m/s²: a value for each scan but the last, and 0 before the bead compares them. Empty at a
    /// sample rate at which the bead does not.
    ///
    /// Chain and filter are the bead's own ([`bead_model::waveform`]); only its gate, which silences the
    /// chain in noise, is not.
    pub fn residual(&self, settings: &Settings) -> Vec<f64> {
        let taps = settings.waveform.taps.map(|tap| tap.to_num::<f64>());
        let rate = f64::from(settings.sample_rate_hz);
        // m/s² of a bit of a twelfth of a µm/sample², the unit of the chain.
        let unit = 12e-6 * rate * rate * Step::DELTA.to_num::<f64>();
        let bits = SensedAcceleration::DELTA.to_num::<f64>();
        let begin = usize::from(settings.window.noise_end());
        if taps == [0.0; 3] || self.force.len() <= begin {
            return Vec::new();
        }
        let mut state = ReducedChainState::default();
        let mut residual = vec![0.0; self.force.len() - 1];
        for (piece, first) in self.force[begin..].chunks(PIECE).zip((begin..).step_by(PIECE)) {
            let mut forces = [SensedForce::ZERO; PIECE];
            let mut predicted = [0; PIECE];
            let forces = &mut forces[..piece.len()];
            for (force, newtons) in forces.iter_mut().zip(piece) {
                *force = SensedForce::saturating_from_num(*newtons);
            }
            let predicted = &mut predicted[..piece.len()];
            let (scale, company) = (&settings.scale, &settings.company);
            settings
                .chain
                .process(scale, company, &mut state, forces, predicted);
            for (sample, predicted) in (first..).zip(&*predicted) {
                if let Some([before, now, after]) = self.acceleration.get(sample - 1..sample + 2) {
                    let measured = (taps[0] * after + taps[1] * now + taps[2] * before) / bits;
                    residual[sample] = (measured - f64::from(*predicted)) * unit;
                }
            }
        }
        residual
    }
}

fn values<F: LeEqU32, V: LeEqU32>(sensor: &Sensor<F>, codes: &[Pair], zero: FixedI32<V>) -> Option<Vec<f64>> {
    let baseline = usize::from(BASELINE);
    let (quiet, rest) = codes.split_at_checked(baseline)?;
    let mut settled = SensorState::default();
    quiet.iter().for_each(|codes| settled.settle(*codes));
    let run = |mut state: SensorState, codes: &[Pair]| {
        let mut values = Vec::with_capacity(codes.len());
        for piece in codes.chunks(PIECE) {
            let mut made = [zero; PIECE];
            let made = &mut made[..piece.len()];
            sensor.process(&mut state, piece.iter().copied(), made);
            values.extend(made.iter().map(|value| value.to_num::<f64>()));
        }
        values
    };
    // A value is that of the sample before.
    let before = run(settled, quiet);
    let mut rest = rest.to_vec();
    rest.extend(codes.last());
    let mut values = before[1..].to_vec();
    values.extend(run(settled, &rest));
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::{Shape, Strike, Window, WindowRecord};
    use bead_testing::paper_settings;

    /// A pulse of `peak` newtons behind the reference front end, and an intruder that rings.
    fn scans(peak: f64) -> Vec<ScanCodes> {
        let code = |value: f64, per_code: f64, zero: f64| {
            (zero + value / per_code).round().clamp(0.0, 4095.0) as u16
        };
        let scan = |sample: usize| {
            let at = sample as f64 - 200.0;
            let force = peak * (-(at / 20.0).powi(2)).exp();
            let ring = 100.0 * (at / 9.0).sin() * (-at / 80.0).exp();
            let acceleration = if at > 0.0 { ring } else { 0.0 };
            ScanCodes {
                sensitive: [
                    code(force, 16.0 / 4096.0, 128.0) + (sample % 2) as u16,
                    code(acceleration, 500.0 / 4096.0, 2048.0),
                ],
                wide: Some([
                    code(force, 256.0 / 4096.0, 128.0),
                    code(acceleration, 8000.0 / 4096.0, 2048.0),
                ]),
            }
        };
        (0..672).map(scan).collect()
    }

    /// The bead's own report of these scans.
    fn reported(scans: &[ScanCodes], settings: &Settings) -> (Strike, Shape) {
        let (mut window, mut record) = (Window::open(0, 0), WindowRecord::new());
        record.clear();
        for scan in scans {
            window.process(settings, &[scan.scan()], &mut record);
        }
        window.report(settings, &record)
    }

    #[test]
    fn the_signals_have_the_bits_that_the_bead_reports_peaks_and_momentum_of() {
        let settings = paper_settings();
        for peak in [6.0, 100.0] {
            let scans = scans(peak);
            let signal = Signal::of(&scans, &settings).unwrap();
            let (report, shape) = reported(&scans, &settings);
            let peak_force = report.peak_force.newtons();
            assert_eq!(signal.force[report.peak_index as usize], peak_force);
            assert!((peak_force / peak - 1.0).abs() < 0.02, "{peak_force}");
            let highest = signal.acceleration.iter().copied().fold(f64::MIN, f64::max);
            assert_eq!(highest, report.acceleration_max.metres_per_second_squared());
            // The record begins with the last sample of the baseline and lacks the last of the window.
            let momentum: f64 = signal.force[63..671].iter().sum();
            assert_eq!(momentum, shape.impulse.newton_samples());
            assert_eq!(signal.force.len(), scans.len());
            // The quiet start is at zero, but for the noise of half a code.
            assert!(signal.force[..63].iter().all(|force| force.abs() < 16.0 / 4096.0));
        }
    }

    #[test]
    fn the_residual_is_the_share_of_the_acceleration_that_the_bead_reports_as_unexplained() {
        let settings = paper_settings();
        let scans = scans(6.0);
        let signal = Signal::of(&scans, &settings).unwrap();
        // The force does not explain this ring, so most of it is left.
        let (_, shape) = reported(&scans, &settings);
        let said = shape.waveform.unwrap().residual.ratio();
        let rms = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
        let residual = signal.residual(&settings);
        let begin = usize::from(settings.window.noise_end());
        let share = rms(&residual) / rms(&signal.acceleration[begin..]);
        assert!((share / said - 1.0).abs() < 0.05, "{share} {said}");
        assert_eq!(residual.len(), scans.len() - 1);
    }

    #[test]
    fn a_window_without_its_baseline_has_no_signal() {
        let settings = paper_settings();
        assert_eq!(Signal::of(&scans(6.0)[..63], &settings), None);
    }
}
