//! Tests of the model, one program: the simulator beside them is linked once. Those that simulate chains take
//! Miri, which looks at the model alone, hours.

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
