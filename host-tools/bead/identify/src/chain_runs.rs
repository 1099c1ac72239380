//! A chain's signals at any speed of the striker, from runs at speeds on a grid.
//!
//! # Design
//! Strikes of one chain differ in the striker's speed and in little else, so a thousand strikes need no
//! thousand runs. The chain is simulated with its tangents at speeds V₀ exp(n H) for whole n, each when a
//! strike first needs it. Between two of them a signal is Hermite's cubic in the logarithm of the speed,
//! since the runs have its derivative; the other tangents are interpolated linearly. Signals are aligned at
//! the arrival of the wave, which goes as V^(-1/5), before interpolation; otherwise a pulse would be mixed
//! with its own shifted copy.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use hertz_chain::tangents::{Dual, Sensor, SignalTangents, tangents};

use crate::chain::{ChainOfScenario, DIRECTIONS};
use crate::quantity::Values;

/// Difference of the logarithms of neighbouring speeds.
const SPACING: f64 = 0.02;
/// Time by which a run is longer than the first strike that uses it needs, s.
const MARGIN: f64 = 0.2e-3;
/// Number of sets of values whose runs are kept: those of the last good step and of the one being tried.
const KEPT: usize = 2;

type RunResult = Result<SignalTangents<DIRECTIONS>, String>;

/// A run at a speed of the grid, made when a strike first needs it.
#[derive(Debug)]
struct GridRun {
    sensors: Vec<Sensor>,
    node: i32,
    duration: f64,
    run: OnceLock<RunResult>,
}

/// A chain with its runs at speeds on a grid, for the values of the quantities that were used last.
#[derive(Debug)]
pub struct ChainRuns {
    pub(crate) chain: ChainOfScenario,
    runs: Mutex<Vec<(Values, Vec<Arc<GridRun>>)>>,
}

impl ChainRuns {
    /// The chain without runs, to be shared by its strikes.
    pub fn new(chain: ChainOfScenario) -> Arc<Self> {
        let runs = Mutex::default();
        Arc::new(Self { chain, runs })
    }

    fn run_at(
        &self,
        values: &Values,
        sensors: &[Sensor],
        (node, duration): (i32, f64),
    ) -> Result<Arc<GridRun>, String> {
        let run = {
            // A thread that panicked cannot have left a partial run.
            let mut kept = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
            let at = kept.iter().position(|(of, _)| of == values).unwrap_or_else(|| {
                if kept.len() == KEPT {
                    kept.remove(0);
                }
                kept.push((*values, Vec::new()));
                kept.len() - 1
            });
            let runs = &mut kept[at].1;
            let is_enough =
                |run: &&Arc<GridRun>| run.node == node && run.duration >= duration && run.sensors == sensors;
            let found = runs.iter().find(is_enough).cloned();
            found.unwrap_or_else(|| {
                let run = Arc::new(GridRun {
                    sensors: sensors.to_vec(),
                    node,
                    duration: duration + MARGIN,
                    run: OnceLock::new(),
                });
                runs.push(Arc::clone(&run));
                run
            })
        };
        let made = run.run.get_or_init(|| {
            let chain = &self.chain;
            let scenario = chain.with(values, speed_of(node).exp());
            let span = (run.duration, chain.step);
            tangents(&scenario, &chain.directions(), sensors, None, span).map_err(|error| error.to_string())
        });
        match made {
            Ok(_) => Ok(run),
            Err(why) => Err(why.clone()),
        }
    }

    /// The peak of the first sensor's signal at the scenario's striker speed: time, s, and value.
    ///
    /// # Errors
    /// The chain cannot be simulated, as the end of a sentence.
    pub(crate) fn highest(
        &self,
        values: &Values,
        sensors: &[Sensor],
        duration: f64,
    ) -> Result<(f64, f64), String> {
        let run = self.run_at(values, sensors, (0, duration))?;
        let signal = signals(&run).steps(0).iter().enumerate();
        let highest = signal.max_by(|a, b| a.1.value.total_cmp(&b.1.value));
        let (step, value) = highest.map_or((0, 0.0), |(step, signal)| (step, signal.value));
        Ok((step as f64 * self.chain.step, value))
    }

    /// The signals of `sensors` for `duration` s. `speed` is the logarithm of the striker's speed over that
    /// of the scenario; `arrival` is the time of the wave at the scenario's speed, s.
    ///
    /// # Errors
    /// The chain cannot be simulated, as the end of a sentence.
    pub(crate) fn signals(
        &self,
        values: &Values,
        sensors: &[Sensor],
        (speed, arrival, duration): (f64, f64, f64),
    ) -> Result<SpeedSignals, String> {
        let slower = (speed / SPACING).floor() as i32;
        // A slower striker's wave comes later than this one.
        let later = arrival * ((-0.2 * speed_of(slower)).exp() - (-0.2 * speed).exp());
        let at = |node: i32| self.run_at(values, sensors, (node, duration + later));
        Ok(SpeedSignals {
            runs: [at(slower)?, at(slower + 1)?],
            part: speed / SPACING - f64::from(slower),
            speed,
            arrival,
            velocity: self.chain.scenario.striker.velocity,
        })
    }
}

/// Logarithm of a speed of the runs.
fn speed_of(node: i32) -> f64 {
    f64::from(node) * SPACING
}

fn signals(run: &GridRun) -> &SignalTangents<DIRECTIONS> {
    match run.run.get() {
        Some(Ok(signals)) => signals,
        _ => unreachable!("`run_at` returns runs that were made"),
    }
}

/// Signals of a chain at a speed of its striker.
#[derive(Debug)]
pub(crate) struct SpeedSignals {
    runs: [Arc<GridRun>; 2],
    /// Position between the two runs, from 0 to 1.
    part: f64,
    speed: f64,
    arrival: f64,
    /// Velocity of the striker in the scenario, m/s.
    velocity: f64,
}

impl SpeedSignals {
    /// The signal of a sensor (by its number) at a time, and its time derivative. The first tangent of the
    /// signal is by the logarithm of the striker's speed.
    pub(crate) fn at(&self, sensor: usize, t: f64) -> (Dual<DIRECTIONS>, f64) {
        let arrival = |speed: f64| self.arrival * (-0.2 * speed).exp();
        let near = self.runs.each_ref().map(|run| {
            let speed = speed_of(run.node);
            let aligned = t + arrival(speed) - arrival(self.speed);
            let (signal, rate) = signals(run).at(sensor, aligned);
            // In aligned signals the time also depends on the speed.
            let by_speed = signal.by[0] * self.velocity * speed.exp() - 0.2 * arrival(speed) * rate;
            (signal, rate, by_speed)
        });
        let [(slow, slow_rate, slow_slope), (fast, fast_rate, fast_slope)] = near;
        let (p, q) = (self.part, 1.0 - self.part);
        let rise = fast.value - slow.value;
        let (slow_end, fast_end) = (SPACING * slow_slope - rise, rise - SPACING * fast_slope);
        let mut signal = slow;
        signal.value = q * slow.value + p * fast.value + p * q * (q * slow_end + p * fast_end);
        for (by, fast) in signal.by.iter_mut().zip(fast.by) {
            *by = q * *by + p * fast;
        }
        let rate = q * slow_rate + p * fast_rate;
        let bend = q * (q - 2.0 * p) * slow_end + p * (2.0 * q - p) * fast_end;
        signal.by[0] = (rise + bend) / SPACING + 0.2 * arrival(self.speed) * rate;
        (signal, rate)
    }
}

#[cfg(test)]
mod tests {
    use hertz_chain::tangents::SensorPlace;
    use hertz_chain::{Material, Scenario, Wall};

    use super::*;

    /// Between two speeds of the grid, signals and tangents agree with those of a run (rms over the window),
    /// for the paper's chain and for one with a wall, which reflects the wave.
    #[test]
    fn signals_between_speeds_are_those_of_a_run() {
        let mut walled = Scenario::paper();
        walled.chain.beads = 12;
        walled.wall = Some(Wall::flat(Material::STEEL));
        for scenario in [Scenario::paper(), walled] {
            let chain = ChainOfScenario::new(&scenario, 8).unwrap();
            let values = chain.values();
            let sensors = [SensorPlace::Force(8), SensorPlace::Acceleration(8)].map(|place| Sensor {
                place,
                pole: 40e3,
                front_mass: 0.0,
            });
            let runs = ChainRuns::new(chain.clone());
            let duration = 6e-3;
            let (arrival, _) = runs.highest(&values, &sensors, duration).unwrap();
            for speed in [0.25 * SPACING, 5.5 * SPACING, -7.6 * SPACING] {
                let between = runs
                    .signals(&values, &sensors, (speed, arrival, duration))
                    .unwrap();
                let exact = chain.with(&values, speed.exp());
                let span = (duration, chain.step);
                let exact =
                    tangents::<DIRECTIONS>(&exact, &chain.directions(), &sensors, None, span).unwrap();
                let factor = chain.scenario.striker.velocity * speed.exp();
                for sensor in [0, 1] {
                    let (mut off, mut most) = ([0.0; 1 + DIRECTIONS], [0.0; 1 + DIRECTIONS]);
                    for n in 0..1000 {
                        let t = n as f64 * 6e-6;
                        let (signal, _) = between.at(sensor, t);
                        let (mut run, _) = exact.at(sensor, t);
                        run.by[0] *= factor;
                        let ours = std::iter::once(signal.value).chain(signal.by);
                        let theirs = std::iter::once(run.value).chain(run.by);
                        for (at, (ours, theirs)) in ours.zip(theirs).enumerate() {
                            off[at] += (ours - theirs).powi(2);
                            most[at] += theirs.powi(2);
                        }
                    }
                    let parts: Vec<f64> = off
                        .iter()
                        .zip(most)
                        .map(|(off, most)| (off / most).sqrt())
                        .collect();
                    println!("speed {speed:+.3}, sensor {sensor}: {parts:?}");
                    assert!(parts[0] < 3e-6, "{parts:?}");
                    assert!(parts[1..].iter().all(|part| *part < 1e-2), "{parts:?}");
                }
            }
        }
    }
}
