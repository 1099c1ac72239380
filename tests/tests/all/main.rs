//! The end-to-end tests: one program, linked once.

mod boards;
mod budget;
mod chain;
mod company;
mod faults;
mod kept;
mod key;
mod live;
mod loopback;
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
mod update;
mod within_reach;
mod wraps;
