//! Tests of the model, one program: the simulator beside them is linked once.

mod accuracy;
mod around;
mod meter;
mod noise;
mod settings;
mod shape;
mod spheres;
