//! Sensors of a chain whose tangents are wanted, and a measured force that drives it.

/// Place of a sensor in a chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorPlace {
    /// Force of a contact beyond its static load, N.
    Force(usize),
    /// Absolute acceleration of the intruder in a bead, m/s²; 0 in a bead without one.
    Acceleration(usize),
}

/// A sensor behind a low-pass of one pole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// Its place.
    pub place: SensorPlace,
    /// Frequency of the pole, Hz; 0 for none.
    pub pole: f64,
    /// Mass of the bead behind a contact that is in front of the sensor's crystal, kg: the sensor shows the
    /// force less what accelerates this mass. Used only with a pole.
    pub front_mass: f64,
}

/// A measured force in place of the bodies before a bead: the chain begins with this bead, at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Push {
    /// The bead.
    pub bead: usize,
    /// Time of the first value, s.
    pub start: f64,
    /// Values per second.
    pub rate: f64,
    /// Force on the bead, N. Before the first and after the last value it is 0; a cubic joins the values.
    pub force: Vec<f64>,
}

impl Push {
    /// The force at a time, N.
    pub(super) fn at(&self, t: f64) -> f64 {
        cubic(&self.force, (t - self.start) * self.rate, 0.0).0
    }
}

/// The cubic through four values around a place in a row of equidistant values, and its slope; `outside`
/// replaces values beyond the ends.
pub(super) fn cubic<T>(values: &[T], at: f64, outside: T) -> (T, T)
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    let before = at.floor();
    let value = |n: f64| {
        let place = before + n;
        if place >= 0.0 && place < values.len() as f64 {
            values[place as usize]
        } else {
            outside
        }
    };
    let p = at - before;
    // Lagrange's form at the nodes -1, 0, 1, 2.
    let weights = [
        -p * (1.0 - p) * (2.0 - p) / 6.0,
        (1.0 - p) * (1.0 + p) * (2.0 - p) / 2.0,
        p * (1.0 + p) * (2.0 - p) / 2.0,
        -p * (1.0 + p) * (1.0 - p) / 6.0,
    ];
    let slopes = [
        -(2.0 - 6.0 * p + 3.0 * p * p) / 6.0,
        (-1.0 - 4.0 * p + 3.0 * p * p) / 2.0,
        (2.0 + 2.0 * p - 3.0 * p * p) / 2.0,
        (3.0 * p * p - 1.0) / 6.0,
    ];
    let around = [-1.0, 0.0, 1.0, 2.0].map(value);
    let sum = |weights: [f64; 4]| {
        let [a, b, c, d] = weights;
        let [w, x, y, z] = around;
        w * a + x * b + y * c + z * d
    };
    (sum(weights), sum(slopes))
}
