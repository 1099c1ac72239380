#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod body;
mod cause;
mod codes;
mod decoder;
mod deframer;
mod edge;
mod frame;
#[cfg(test)]
mod golden;
mod message;
mod names;
mod payload;
mod request;
mod sequence;
mod table;
mod text;
mod units;

pub use body::{Body, Field, FieldDoc, Fields, Named, Parts, Value};
pub use cause::{Cause, Reject, Rejected};
pub use codes::{CodeError, Codes, MAX_CODE, MAX_SCANS, unpacked};
pub use decoder::{Counters, Decoder};
pub use edge::unwrapped;
pub use frame::{Frame, Header, MAX_FRAME, encode};
pub use message::fault::{Detail, Fault, FaultCause, MAX_DETAIL};
pub use message::health::{Health, Standing};
pub use message::identity::{Identity, MAX_FIRMWARE, MAX_GIT, ResetCauses};
pub use message::link::Link;
pub use message::raw::Raw;
pub use message::reply::{Outcome, Reply};
pub use message::self_test::{Check, SelfTest};
pub use message::settings::Settings;
pub use message::shape::{GainMatch, Shape};
pub use message::status::{SettingsSource, Status};
pub use message::strike::{Strike, StrikeFlags};
pub use message::sync::Sync;
pub use message::waveform::Waveform;
pub use message::{Kind, Message};
pub use names::named;
pub use payload::{BufferTooSmall, VERSION};
pub use request::{ANY, Heard, MAX_REQUEST, Request, RequestCounters, RequestDecoder, encode_request};
pub use sequence::{Arrival, REORDER};
pub use text::{Block, BlockTooLong, MAX_BLOCK, Text};
pub use units::{Acceleration, Decay, Energy, Force, Fraction, Frequency, Impulse, Samples, Unit};
