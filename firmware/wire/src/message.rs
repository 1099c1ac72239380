//! What the bead tells its host: the table of all messages.
//!
//! # Design
//! One row makes a kind: its number, its name, which is the name of its file too, and its body. Everything else
//! follows from the table: parsing, encoding, the longest frame, and the page in `docs/protocol.md`.
//!
//! **A body never changes.** Postcard has no field names and no lengths to skip by, so another field is another layout:
//! give it a new number and a file of its own. Hosts that do not know a number say so and go on.
//!
//! Kinds below 64 are the bead's, from 64 up the host's: see [`Request`](crate::Request).

pub(crate) mod fault;
pub(crate) mod health;
pub(crate) mod identity;
pub(crate) mod link;
pub(crate) mod raw;
pub(crate) mod reply;
pub(crate) mod self_test;
pub(crate) mod settings;
pub(crate) mod shape;
pub(crate) mod status;
pub(crate) mod strike;
pub(crate) mod sync;
pub(crate) mod waveform;

use crate::body::{Body, FieldDoc, Fields, Value};
use crate::table::messages;

messages! {
    1 identity Identity,
    2 status Status,
    3 strike Strike,
    8 shape Shape,
    4 waveform Waveform,
    5 fault Fault,
    6 settings Settings,
    7 health Health,
    9 sync Sync,
    16 reply Reply,
    17 raw Raw,
    18 link Link,
    19 self_test SelfTest,
}
