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
mod message;
mod names;
mod payload;
mod quantity;
mod queue;
mod request;
mod sequence;
mod signed;
mod stuffing;
mod table;
mod text;
mod unit;
mod version;

pub use body::{Body, Field, FieldDoc, FieldKind, Fields, Named, Value};
pub use cause::{Cause, Reject, Rejected};
pub use codes::{CodeError, Codes, MAX_CODE, MAX_SCANS, unpacked};
pub use decoder::{Counters, Decoder};
pub use edge::unwrapped;
pub use frame::{Frame, Header, MAX_FRAME, Packed, encode};
// Every body with its lists, and `Kind` and `Message`: a new row of the table is public without a line here.
pub use message::*;
pub use names::named;
pub use payload::BufferTooSmall;
pub use quantity::{
    Acceleration, Decay, Energy, Force, Fraction, Frequency, Impulse, Samples, Temperature, Voltage,
};
pub use queue::{KEPT, OUTBOX, Queue, room_for_window, taken};
pub use request::{
    ANY, MAX_REQUEST, ReceivedRequest, Request, RequestCounters, RequestDecoder, encode_request,
};
pub use sequence::{Arrival, REORDER};
pub use signed::{AHEAD, KEY, Key, Lock, Moment, Ticket};
pub use text::{Block, BlockTooLong, BoundedBytes, Inner, MAX_BLOCK, MAX_PIECE, Manifest, Piece, Text};
pub use unit::Unit;
pub use version::{VERSION, reader};
