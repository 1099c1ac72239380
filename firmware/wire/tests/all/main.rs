//! Tests of the wire, one program.

mod common;
mod frames;
mod page;
mod requests;
mod streams;
