//! A host on a shaker: the experiment of Appendix A1, integrated.

use std::f64::consts::{PI, TAU};

use realfft::num_complex::Complex64;

use crate::dop853::{Stepper, System};
use crate::oscillator::Oscillator;
use crate::signal::Signal;
use crate::spectrum::{Spectrum, Taper};

/// A sine of rising frequency that moves the host. It swells and fades over a twentieth of the sweep at
/// either end.
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

/// The outcome of a sweep: both displacements, m, at the same times, until the mass has come to rest.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ShakerResponse {
    /// Of the host.
    pub host: Signal,
    /// Of the mass.
    pub mass: Signal,
}

impl FrequencySweep {
    /// Displacement of the host and its rate at time `t`.
    fn motion(&self, t: f64) -> (f64, f64) {
        if !(0.0..self.duration).contains(&t) {
            return (0.0, 0.0);
        }
        let chirp = (self.to - self.from) / self.duration;
        let (sin, cos) = (TAU * (self.from + 0.5 * chirp * t) * t).sin_cos();
        let omega = TAU * (self.from + chirp * t);
        let ramp = 0.05 * self.duration;
        let rising = t < 0.5 * self.duration;
        let (edge, sign) = if rising {
            (t, 1.0)
        } else {
            (self.duration - t, -1.0)
        };
        let (size, swell) = if edge < ramp {
            let x = 0.5 * PI * edge / ramp;
            (x.sin().powi(2), sign * 0.5 * PI / ramp * (2.0 * x).sin())
        } else {
            (1.0, 0.0)
        };
        (
            self.amplitude * size * sin,
            self.amplitude * (size * omega * cos + swell * sin),
        )
    }
}

/// State: displacement and velocity of the mass, and the time.
struct Driven {
    oscillator: Oscillator,
    sweep: FrequencySweep,
}

impl System for Driven {
    fn rate(&self, y: &[f64], rate: &mut [f64]) {
        let (host, host_rate) = self.sweep.motion(y[2]);
        rate[0] = y[1];
        rate[1] = self.oscillator.pull(host - y[0], host_rate - y[1]) / self.oscillator.mass;
        rate[2] = 1.0;
    }
}

impl Oscillator {
    /// Shakes the host through a sweep and lets the mass ring down to some 1e-12 of its motion, by its
    /// damper. The motion is sampled at twenty times the sweep's last frequency.
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
        // The slower of the two decays, if there are two.
        let beta = 0.5 * self.damping / self.mass;
        let square = self.stiffness / self.mass;
        let slowest = if beta * beta > square {
            square / (beta + (beta * beta - square).sqrt())
        } else {
            beta
        };
        let count = ((sweep.duration + 28.0 / slowest) / interval).ceil() as usize;

        let (oscillator, sweep) = (*self, *sweep);
        let driven = Driven { oscillator, sweep };
        let speed = TAU * sweep.to * sweep.amplitude;
        let floor = vec![1e-14 * sweep.amplitude, 1e-14 * speed, 1.0];
        let mut stepper = Stepper::new(&driven, vec![0.0; 3], 1e-13, floor, interval);
        let (mut host, mut mass) = (vec![0.0], vec![0.0]);
        for i in 1..=count {
            let t = interval * i as f64;
            while stepper.time < t {
                stepper
                    .advance(&driven, t)
                    .expect("the equation is linear and its values are finite");
            }
            host.push(sweep.motion(t).0);
            mass.push(stepper.state[0]);
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
    /// h = û/Û at some frequencies in Hz. The sweep should have gone through them.
    pub fn response(&self, frequencies: &[f64]) -> Vec<(f64, Complex64)> {
        let [host, mass] = [&self.host, &self.mass].map(|signal| Spectrum::of(signal, Taper::None));
        let h = |&f: &f64| (f, mass.at(f) / host.at(f));
        frequencies.iter().map(h).collect()
    }
}
