//! Simulates a host on a shaker, the experiment of Appendix A1 of the paper.

use std::f64::consts::{PI, TAU};

use realfft::num_complex::Complex64;

use crate::oscillator::Oscillator;
use crate::signal::Signal;
use crate::solver;
use crate::spectrum::Spectrum;

/// A sine of rising frequency that moves the host. Its amplitude rises from zero and returns to zero over a
/// twentieth of the sweep at either end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrequencySweep {
    /// First frequency, Hz.
    pub from: f64,
    /// Last frequency, Hz. The frequency rises in proportion to time.
    pub to: f64,
    /// Length, s.
    pub duration: f64,
    /// Amplitude of the host's motion, m.
    pub amplitude: f64,
}

/// Displacements of host and mass in a sweep, m, at the same times, until the mass is at rest.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ShakerResponse {
    /// Displacement of the host, m.
    pub host: Signal,
    /// Displacement of the mass, m.
    pub mass: Signal,
}

/// Length of an amplitude ramp, as a part of the sweep.
const RAMP: f64 = 0.05;

impl FrequencySweep {
    /// Displacement of the host, m, and its rate, m/s, at time `t`, s.
    fn motion(&self, t: f64) -> (f64, f64) {
        if !(0.0..self.duration).contains(&t) {
            return (0.0, 0.0);
        }
        let chirp = (self.to - self.from) / self.duration;
        let (sin, cos) = (TAU * (self.from + 0.5 * chirp * t) * t).sin_cos();
        let omega = TAU * (self.from + chirp * t);
        let ramp = RAMP * self.duration;
        let falls = self.duration - t;
        let (edge, sign) = if t < 0.5 * self.duration {
            (t, 1.0)
        } else {
            (falls, -1.0)
        };
        let (size, swell) = if edge < ramp {
            let x = 0.5 * PI * edge / ramp;
            (x.sin().powi(2), sign * 0.5 * PI / ramp * (2.0 * x).sin())
        } else {
            (1.0, 0.0)
        };
        let rate = self.amplitude * (size * omega * cos + swell * sin);
        (self.amplitude * size * sin, rate)
    }
}

/// Longest step times the fastest rate: the error of a step of order 9 is then below rounding.
const STEP: f64 = 0.15;

impl Oscillator {
    /// Shakes the host through a sweep, then lets the damper bring the mass to some 1e-12 of its motion. The
    /// motion is sampled at twenty times the sweep's last frequency, and integrated by the method of the
    /// chains in steps of equal length.
    ///
    /// # Panics
    /// If a value of the oscillator or the sweep is not positive, or if the sweep is not upwards.
    pub fn shake(&self, sweep: &FrequencySweep) -> ShakerResponse {
        let values = [
            self.mass,
            self.stiffness,
            self.damping,
            sweep.from,
            sweep.to - sweep.from,
            sweep.duration,
            sweep.amplitude,
        ];
        assert!(
            values.iter().all(|value| value.is_finite() && *value > 0.0),
            "a sweep takes positive values and goes upwards: {self:?} {sweep:?}"
        );
        let interval = 1.0 / (20.0 * sweep.to);
        // Rate of the slower decay, if the oscillator is overdamped.
        let beta = 0.5 * self.damping / self.mass;
        let square = self.stiffness / self.mass;
        let slowest = if beta * beta > square {
            square / (beta + (beta * beta - square).sqrt())
        } else {
            beta
        };
        let count = ((sweep.duration + 28.0 / slowest) / interval).ceil() as usize;

        let rate = |t: f64, [place, velocity]: [f64; 2]| {
            let (host, host_rate) = sweep.motion(t);
            let pull = self.pull(host - place, host_rate - velocity);
            [velocity, pull / self.mass]
        };
        let fastest = (TAU * sweep.to).max(square.sqrt()).max(self.damping / self.mass);
        // The amplitude has kinks at these times, so a step ends at each.
        let kinks = [RAMP, 1.0 - RAMP, 1.0].map(|part| part * sweep.duration);
        let (mut time, mut state) = (0.0, [0.0; 2]);
        let (mut host, mut mass) = (vec![0.0], vec![0.0]);
        for i in 1..=count {
            let sample = interval * i as f64;
            for stop in kinks.into_iter().filter(|kink| *kink < sample).chain([sample]) {
                if stop <= time {
                    continue;
                }
                let steps = ((stop - time) * fastest / STEP).ceil();
                let h = (stop - time) / steps;
                for step in 0..steps as usize {
                    state = solver::step(rate, time + h * step as f64, state, h);
                }
                time = stop;
            }
            host.push(sweep.motion(sample).0);
            mass.push(state[0]);
        }
        let signal = |values| Signal {
            start: 0.0,
            interval,
            values,
        };
        ShakerResponse {
            host: signal(host),
            mass: signal(mass),
        }
    }
}

impl ShakerResponse {
    /// Transmissibility h = û/Û as pairs of frequency in Hz and h. The sweep should cover the frequencies.
    pub fn response(&self, frequencies: &[f64]) -> Vec<(f64, Complex64)> {
        let [host, mass] = [&self.host, &self.mass].map(Spectrum::of);
        let h = |&f: &f64| (f, mass.at(f) / host.at(f));
        frequencies.iter().map(h).collect()
    }
}
