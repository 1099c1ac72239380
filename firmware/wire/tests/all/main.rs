//! Tests of the wire, one program. Miri, which is slow, looks at the code and not at the page.

mod common;
mod frames;
#[cfg(not(miri))]
mod golden;
#[cfg(not(miri))]
mod page;
mod requests;
mod streams;
