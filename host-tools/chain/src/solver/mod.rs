//! Integration of a chain: a Runge-Kutta method of order 9 on vectors of eight beads.
//!
//! # Design
//!
//! Order 9 pays because the accuracy asked for lies near rounding ([`method`]). What would spoil it, contacts
//! that open and close, is integrated exactly ([`crossing`]). Bodies are lanes of vectors ([`lanes`]), and a
//! step works in room that was allotted once ([`work`]). Only blocks of beads that move are computed
//! ([`stepper`]), and blocks that a wave has left in touch take longer steps ([`multirate`]).
//!
//! A step's dense output is not stored. It follows from where the step started and how long it was, so
//! [`Dense`] repeats the step when somebody looks inside it. Memory is one state a step, and a run that
//! nobody looks into pays nothing.

#[cfg(test)]
mod against;
mod aligned;
mod attempt;
mod crossing;
mod dense;
#[cfg(test)]
#[path = "../../tests/dop853/mod.rs"]
mod dop853;
mod glimpse;
mod kernel;
mod lanes;
mod method;
mod multirate;
mod overlap;
mod parting;
mod rest;
#[cfg(test)]
mod small;
mod stepper;
mod verner;
#[cfg(test)]
mod window;
mod work;

pub(crate) use dense::Dense;
pub(crate) use glimpse::Glimpse;
pub(crate) use lanes::{BLOCK, Lanes};
pub(crate) use method::step;
pub(crate) use stepper::Stepper;
