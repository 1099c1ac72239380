//! Tests of the model, one program: the simulator beside them is linked once. Those that simulate chains take
//! Miri, which looks at the model alone, hours.

use bead_model::converter::CONVERSION;

/// A pole whose lag is the delay of the wide channel: that channel then has no slope.
#[cfg(not(miri))]
const UNDELAYED: f64 = 1.0 / (std::f64::consts::TAU * CONVERSION);

#[cfg(not(miri))]
mod accuracy;
mod around;
mod loudness;
mod meter;
#[cfg(not(miri))]
mod noise;
mod settings;
#[cfg(not(miri))]
mod shape;
#[cfg(not(miri))]
mod spheres;
