//! Signals that drive the first body of a chain: a sine, a chirp, a record.
//!
//! # Design
//!
//! Between two knots a signal has all the derivatives that the order of the integrator needs, and steps end
//! at knots. Knots are the ends of a ramp and of a sweep, and the samples of a record, which a natural cubic
//! spline joins. A displacement enters the motion by its second derivative. Each step begins at the exact
//! place and velocity, so errors do not add up over a long run.

use std::f64::consts::TAU;

use crate::scenario::{Drive, DriveQuantity};

/// A value with its first and second derivative by time.
type Jet = [f64; 3];

fn product(a: Jet, b: Jet) -> Jet {
    [
        a[0] * b[0],
        a[0] * b[1] + a[1] * b[0],
        a[0] * b[2] + 2.0 * a[1] * b[1] + a[2] * b[0],
    ]
}

/// A number over time.
#[derive(Debug, Clone, PartialEq)]
enum Signal {
    Sine(Sine),
    Record(Record),
}

/// A sin(2π (f t + r t²/2)) behind a ramp. The frequency grows by r a second until the end of the sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sine {
    amplitude: f64,
    /// Hz at t = 0, Hz/s, and s.
    frequency: f64,
    growth: f64,
    sweep: f64,
    /// Time until the full amplitude, s.
    ramp: f64,
}

impl Sine {
    fn phase(&self, t: f64) -> Jet {
        let inside = t.min(self.sweep);
        let frequency = self.frequency + self.growth * inside;
        let swept = inside * (self.frequency + 0.5 * self.growth * inside);
        let rate = if t < self.sweep { self.growth } else { 0.0 };
        [swept + (t - inside) * frequency, frequency, rate].map(|value| TAU * value)
    }

    /// Part of the amplitude: a polynomial of degree 9 from 0 to 1, with four derivatives zero at both ends.
    fn ramp(&self, t: f64) -> Jet {
        if t >= self.ramp {
            return [1.0, 0.0, 0.0];
        }
        let s = t / self.ramp;
        let (cube, rest) = (s * s * s, 1.0 - s);
        let value = cube * s * s * (126.0 + s * (-420.0 + s * (540.0 + s * (-315.0 + 70.0 * s))));
        let rate = 630.0 * cube * s * rest.powi(4);
        let bend = 2520.0 * cube * rest.powi(3) * (1.0 - 2.0 * s);
        [value, rate / self.ramp, bend / (self.ramp * self.ramp)]
    }

    fn at(&self, t: f64) -> Jet {
        let [phase, rate, bend] = self.phase(t);
        let (sine, cosine) = (libm::sin(phase), libm::cos(phase));
        let wave = [sine, cosine * rate, cosine * bend - sine * rate * rate];
        product(self.ramp(t), wave.map(|value| self.amplitude * value))
    }

    fn highest_frequency(&self) -> f64 {
        let last = self.frequency
            + if self.growth == 0.0 {
                0.0
            } else {
                self.growth * self.sweep
            };
        self.frequency.max(last)
    }
}

/// Samples joined by a natural cubic spline.
#[derive(Debug, Clone, PartialEq)]
struct Record {
    times: Vec<f64>,
    values: Vec<f64>,
    /// Second derivatives at the samples.
    bends: Vec<f64>,
}

impl Record {
    /// The spline with second derivatives of zero at both ends, by elimination in the tridiagonal system.
    fn new(samples: &[[f64; 2]], factor: f64) -> Self {
        let times: Vec<f64> = samples.iter().map(|sample| sample[0]).collect();
        let values: Vec<f64> = samples.iter().map(|sample| factor * sample[1]).collect();
        let last = times.len() - 1;
        let width = |n: usize| times[n + 1] - times[n];
        let slope = |n: usize| (values[n + 1] - values[n]) / width(n);
        let (mut bends, mut above) = (vec![0.0; last + 1], vec![0.0; last + 1]);
        for n in 1..last {
            let pivot = 2.0 * (width(n - 1) + width(n)) - width(n - 1) * above[n - 1];
            above[n] = width(n) / pivot;
            bends[n] = (6.0 * (slope(n) - slope(n - 1)) - width(n - 1) * bends[n - 1]) / pivot;
        }
        for n in (1..last).rev() {
            bends[n] -= above[n] * bends[n + 1];
        }
        Self { times, values, bends }
    }

    fn end(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    fn at(&self, t: f64) -> Jet {
        let piece = self.times.partition_point(|&time| time <= t);
        let piece = piece.clamp(1, self.times.len() - 1);
        let (from, to) = (self.times[piece - 1], self.times[piece]);
        let width = to - from;
        let (left, right) = ((to - t) / width, (t - from) / width);
        let (low, high) = (self.bends[piece - 1], self.bends[piece]);
        let (start, end) = (self.values[piece - 1], self.values[piece]);
        let part = width * width / 6.0;
        let cubes = left * (left * left - 1.0) * low + right * (right * right - 1.0) * high;
        let squares = (1.0 - 3.0 * left * left) * low + (3.0 * right * right - 1.0) * high;
        [
            left * start + right * end + part * cubes,
            (end - start) / width + width / 6.0 * squares,
            left * low + right * high,
        ]
    }
}

impl Signal {
    fn of(drive: &Drive) -> Self {
        match drive.frequency {
            None => Self::Record(Record::new(&drive.samples, drive.amplitude)),
            Some(frequency) => {
                let sweep = drive.sweep.unwrap_or(f64::INFINITY);
                let to = drive.frequency_end.unwrap_or(frequency);
                Self::Sine(Sine {
                    amplitude: drive.amplitude,
                    frequency,
                    growth: (to - frequency) / sweep,
                    sweep,
                    ramp: drive.ramp,
                })
            }
        }
    }

    fn at(&self, t: f64) -> Jet {
        match self {
            Self::Sine(sine) => sine.at(t),
            Self::Record(record) => record.at(t),
        }
    }

    fn next_knot(&self, t: f64) -> f64 {
        match self {
            Self::Sine(sine) => {
                let knots = [sine.ramp, sine.sweep].into_iter().filter(|&knot| knot > t);
                knots.fold(f64::INFINITY, f64::min)
            }
            Self::Record(record) => {
                let next = record.times.partition_point(|&time| time <= t);
                record.times.get(next).copied().unwrap_or(f64::INFINITY)
            }
        }
    }

    /// Upper bounds of value and rate over all times; for a record, from its samples and the midpoints.
    fn bounds(&self) -> [f64; 2] {
        match self {
            Self::Sine(sine) => {
                // 2.47 is the greatest rate of the ramp times its length.
                let ramp = if sine.ramp > 0.0 { 2.47 / sine.ramp } else { 0.0 };
                let amplitude = sine.amplitude.abs();
                [amplitude, amplitude * (TAU * sine.highest_frequency() + ramp)]
            }
            Self::Record(record) => {
                let middles = record.times.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
                let times = record.times.iter().copied().chain(middles);
                times.map(|t| record.at(t)).fold([0.0; 2], |most, jet| {
                    [most[0].max(jet[0].abs()), most[1].max(jet[1].abs())]
                })
            }
        }
    }
}

/// Forces on body 0 other than that of its contact, or its motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EndDrive {
    signal: Option<Signal>,
    /// True if the body follows the signal whatever force it takes, false if the signal is a force.
    pub(crate) prescribed: bool,
    /// A constant force, N, and the mass of the body, kg.
    weight: f64,
    mass: f64,
}

impl EndDrive {
    /// The drive of a scenario on a body of `mass`, kg, that also falls by its own `weight`, N. `None` if
    /// neither acts.
    pub(crate) fn new(drive: Option<&Drive>, weight: f64, mass: f64) -> Option<Self> {
        if drive.is_none() && weight == 0.0 {
            return None;
        }
        Some(Self {
            signal: drive.map(Signal::of),
            prescribed: drive.is_some_and(|drive| drive.quantity == DriveQuantity::Displacement),
            weight,
            mass,
        })
    }

    /// Place, m, and velocity, m/s, of a body that follows the signal.
    pub(crate) fn motion(&self, t: f64) -> Option<(f64, f64)> {
        let signal = self.signal.as_ref().filter(|_| self.prescribed)?;
        let [place, velocity, _] = signal.at(t);
        Some((place, velocity))
    }

    /// Force on the body other than that of its contact, N; zero if the body follows the signal.
    pub(crate) fn force(&self, t: f64) -> f64 {
        match &self.signal {
            Some(signal) if !self.prescribed => self.weight + signal.at(t)[0],
            Some(_) => 0.0,
            None => self.weight,
        }
    }

    /// Acceleration of the body without the part of its contact, m/s².
    pub(crate) fn acceleration(&self, t: f64) -> f64 {
        match &self.signal {
            Some(signal) if self.prescribed => signal.at(t)[2],
            _ => self.force(t) / self.mass,
        }
    }

    /// The first time after `t`, s, at which a step has to end; infinite if there is none.
    pub(crate) fn next_knot(&self, t: f64) -> f64 {
        self.signal
            .as_ref()
            .map_or(f64::INFINITY, |signal| signal.next_knot(t))
    }

    /// End of a record, s; `None` for any other drive.
    pub(crate) fn end(&self) -> Option<f64> {
        match &self.signal {
            Some(Signal::Record(record)) => Some(record.end()),
            _ => None,
        }
    }

    /// The shortest period, s; infinite for a record, whose knots limit the steps.
    pub(crate) fn period(&self) -> f64 {
        match &self.signal {
            Some(Signal::Sine(sine)) => 1.0 / sine.highest_frequency(),
            _ => f64::INFINITY,
        }
    }

    /// The greatest velocity of a body that follows the signal, m/s, or else the greatest force, N.
    pub(crate) fn greatest(&self) -> f64 {
        let bounds = self.signal.as_ref().map_or([0.0; 2], Signal::bounds);
        bounds[usize::from(self.prescribed)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest differences of the derivatives of a signal from central differences, between two times.
    fn derivatives_agree(signal: &Signal, (from, to): (f64, f64), step: f64) {
        let [most, fastest] = signal.bounds();
        for n in 0..200 {
            let t = from + (to - from) * (f64::from(n) + 0.37) / 200.0;
            let (before, now, after) = (signal.at(t - step), signal.at(t), signal.at(t + step));
            for order in 1..3 {
                let difference = (after[order - 1] - before[order - 1]) / (2.0 * step);
                let scale = [fastest, fastest * fastest / most][order - 1];
                let error = (difference - now[order]).abs() / scale;
                assert!(
                    error < 1e-5,
                    "derivative {order} at {t}: {} {difference}",
                    now[order]
                );
            }
            assert!(now[0].abs() <= most && now[1].abs() <= fastest * (1.0 + 1e-12));
        }
    }

    #[test]
    fn derivatives_of_sines_chirps_and_ramps_are_those_of_their_values() {
        let mut drive = Drive::sine(DriveQuantity::Displacement, 2e-6, 1500.0);
        derivatives_agree(&Signal::of(&drive), (0.0, 0.01), 1e-8);
        drive.ramp = 4e-3;
        derivatives_agree(&Signal::of(&drive), (0.0, 0.004), 1e-8);
        (drive.frequency_end, drive.sweep) = (Some(300.0), Some(8e-3));
        let signal = Signal::of(&drive);
        derivatives_agree(&signal, (1e-5, 0.0079), 1e-8);
        derivatives_agree(&signal, (8.1e-3, 0.02), 1e-8);
        assert_eq!(signal.next_knot(0.0), 4e-3);
        assert_eq!(signal.next_knot(4e-3), 8e-3);
        assert_eq!(signal.next_knot(8e-3), f64::INFINITY);
        // The frequency at the end of the sweep: the phase grows by 300 turns a second.
        let Signal::Sine(sine) = signal else {
            unreachable!()
        };
        let turns = (sine.phase(0.019)[0] - sine.phase(0.009)[0]) / TAU;
        assert!((turns - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_spline_passes_through_its_samples_and_is_smooth_at_them() {
        let samples: Vec<[f64; 2]> = (0..40)
            .map(|n| {
                let t = 1e-4 * (f64::from(n) + 0.3 * f64::from(n % 3));
                [t, (TAU * 600.0 * t).sin()]
            })
            .collect();
        let record = Record::new(&samples, 3.0);
        for sample in &samples[1..39] {
            let [t, value] = *sample;
            let (before, now, after) = (record.at(t - 1e-12), record.at(t), record.at(t + 1e-12));
            assert!((now[0] - 3.0 * value).abs() < 1e-14);
            for order in 0..3 {
                let scale = 3.0 * (TAU * 600.0).powi(order as i32);
                assert!((before[order] - after[order]).abs() < 1e-7 * scale, "{order} {t}");
            }
        }
        // Far from its ends the spline of a sine is the sine to the fourth order.
        let middle = record.at(0.00205)[0];
        assert!((middle - 3.0 * (TAU * 600.0 * 0.00205_f64).sin()).abs() < 1e-3);
        derivatives_agree(&Signal::Record(record.clone()), (1e-6, 9e-5), 1e-8);
        assert_eq!((record.bends[0], record.bends[39]), (0.0, 0.0));
    }
}
