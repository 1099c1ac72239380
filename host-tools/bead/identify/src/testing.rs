//! Taps at a free bead for tests: a separate integration, with filters, noise and codes.

use bead_model::converter::CONVERSION;
use bead_recording::strikes::{RecordedStrike, ScanCodes};
use bead_testing::{paper_settings, xorshift};
use bead_wire::{Body, Strike, StrikeFlags};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::noise::Noise;
use crate::series::{StrikeSeries, noises};

/// A tap and the bead that it hits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TestTap {
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    /// Relative increase of the spring's force at 1 µm.
    pub(crate) hardening: f64,
    /// Peak of the force, N, and its duration, s.
    pub(crate) peak: f64,
    pub(crate) duration: f64,
    /// Factors of the gains.
    pub(crate) gains: [f64; 2],
    /// Force of friction at the intruder, N.
    pub(crate) friction: f64,
    pub(crate) seed: u64,
}

impl Default for TestTap {
    fn default() -> Self {
        Self {
            stiffness: 3.95e5,
            damping: 12.0,
            hardening: 0.0,
            peak: 5.0,
            duration: 0.4e-3,
            gains: [1.0; 2],
            friction: 0.0,
            seed: 1,
        }
    }
}

const MASS: f64 = 0.050_997;
const INTRUDER: f64 = 3.7e-3;
const RATE: f64 = 1e5;
/// Steps in a sample.
const FINE: usize = 20;
/// Sample before which nothing happens, and samples of a window.
const TRIGGER: usize = 160;
const LENGTH: usize = 672;
const POLE: f64 = 40e3 * std::f64::consts::TAU;

impl TestTap {
    fn force(&self, t: f64) -> f64 {
        if (0.0..self.duration).contains(&t) {
            self.peak * (std::f64::consts::PI * t / self.duration).sin().powi(2)
        } else {
            0.0
        }
    }

    /// Rates of host and intruder (places, then velocities), and of both low-passes.
    fn rates(&self, t: f64, y: [f64; 6]) -> [f64; 6] {
        let (way, rate) = (y[1] - y[0], y[3] - y[2]);
        let harder = 1.0 + self.hardening * (way / 1e-6).powi(2);
        let friction = self.friction * (rate / 1e-5).tanh();
        let pull = self.stiffness * way * harder + self.damping * rate + friction;
        let force = self.force(t);
        let acceleration = -pull / INTRUDER;
        [
            y[2],
            y[3],
            (force + pull) / (MASS - INTRUDER),
            acceleration,
            POLE * (force - y[4]),
            POLE * (acceleration - y[5]),
        ]
    }

    /// Filtered force and acceleration at times of 0.5 µs.
    fn signals(&self) -> Vec<[f64; 2]> {
        let step = 1.0 / RATE / FINE as f64;
        let plus = |y: [f64; 6], scale: f64, rate: [f64; 6]| -> [f64; 6] {
            std::array::from_fn(|at| y[at] + scale * rate[at])
        };
        let mut y = [0.0; 6];
        (0..LENGTH * FINE)
            .map(|n| {
                let t = n as f64 * step;
                let before = [y[4], y[5]];
                let a = self.rates(t, y);
                let b = self.rates(t + 0.5 * step, plus(y, 0.5 * step, a));
                let c = self.rates(t + 0.5 * step, plus(y, 0.5 * step, b));
                let d = self.rates(t + step, plus(y, step, c));
                y = std::array::from_fn(|at| {
                    y[at] + step / 6.0 * (a[at] + 2.0 * b[at] + 2.0 * c[at] + d[at])
                });
                before
            })
            .collect()
    }

    /// The tap as recorded.
    pub(crate) fn recorded(&self) -> RecordedStrike {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let signals = self.signals();
        let mut draw = |deviation: f64| Normal::new(0.0, deviation).unwrap().sample(&mut random);
        let phase = (self.seed as f64 * 0.618).fract();
        let at = |sample: usize, channel: usize, sensor: usize| {
            let time = (sample as f64 - TRIGGER as f64 + phase) / RATE + channel as f64 * CONVERSION;
            let place = time * RATE * FINE as f64;
            if place < 0.0 {
                return 0.0;
            }
            let (n, part) = (place as usize, place.fract());
            let near = signals.get(n).map_or(0.0, |signal| signal[sensor]);
            near + part * (signals.get(n + 1).map_or(0.0, |signal| signal[sensor]) - near)
        };
        let code = |value: f64, per_code: f64, zero: f64| {
            (zero + value / per_code).round().clamp(0.0, 4095.0) as u16
        };
        let scans = (0..LENGTH)
            .map(|sample| {
                let [force, acceleration] = [0, 1].map(|sensor| {
                    [2 * sensor, 2 * sensor + 1]
                        .map(|channel| at(sample, channel, sensor) / self.gains[sensor])
                });
                ScanCodes {
                    sensitive: [
                        code(force[0] + draw(5e-3), 16.0 / 4096.0, 128.3),
                        code(acceleration[0] + draw(0.05), 500.0 / 4096.0, 2048.2),
                    ],
                    wide: Some([
                        code(force[1] + draw(0.05), 256.0 / 4096.0, 128.1),
                        code(acceleration[1] + draw(1.5), 8000.0 / 4096.0, 2048.4),
                    ]),
                }
            })
            .collect();
        let said = Strike {
            strike: 0,
            first_index: 1000,
            trigger_index: 1000 + TRIGGER as u64,
            samples: LENGTH as u16,
            flags: StrikeFlags::NONE,
            ..Strike::draw(&mut xorshift(7))
        };
        let mut strike = RecordedStrike::new(8, said);
        strike.settings = Some(paper_settings());
        strike.scans = scans;
        strike
    }
}

/// Series of taps, and the noise of their channels.
pub(crate) fn series(taps: &[TestTap]) -> (Vec<StrikeSeries>, [Option<Noise>; 4]) {
    let series: Vec<StrikeSeries> = taps
        .iter()
        .map(|tap| StrikeSeries::of(&tap.recorded()).unwrap())
        .collect();
    let noises = noises(&series);
    (series, noises)
}
