//! The end-to-end tests: one program, linked once.

mod budget;
mod chain;
mod company;
mod faults;
mod kept;
mod key;
mod live;
mod requests;
mod requests_at_a_socket;
mod settings;
mod soak;
mod stack;
mod start;
mod store;
mod strikes;
mod time;
mod trigger_line;
mod within_reach;
mod wraps;
