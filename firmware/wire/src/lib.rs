#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod codes;
mod decoder;
mod deframer;
mod edge;
mod frame;
mod message;
mod request;
mod sequence;

pub use codes::{CodeError, Codes, MAX_CODE, MAX_SCANS};
pub use decoder::{Counters, Decoder, Rejected};
pub use edge::unwrapped;
pub use frame::{Cause, EncodeError, Frame, Header, MAX_FRAME, Reject, VERSION, encode};
pub use message::{
    ACCELERATION_UNIT_MPS2, Check, ENERGY_UNIT_J, FINE_UNIT, FORCE_UNIT_N, Fault, FaultCause, Health,
    IMPULSE_UNIT_N_SAMPLES, Identity, Kind, Link, MAX_BLOCK, MAX_DETAIL, MAX_FIRMWARE, MAX_GIT, Message,
    Outcome, Raw, Reply, SelfTest, Settings, SettingsSource, Shape, Status, Strike, Sync, Waveform,
};
pub use request::{
    MAX_REQUEST, Numbered, RejectedRequest, Request, RequestCounters, RequestDecoder, encode_request,
};
pub use sequence::{Arrival, REORDER};
