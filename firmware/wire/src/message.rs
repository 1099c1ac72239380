//! The bead's messages to its host: the table of all of them.
//!
//! # Design
//! A row defines a kind: its number, its name (also that of its file), and its body. Parsing, encoding, the
//! longest frame and the tables of `docs/protocol.md` follow from the table.
//!
//! **A body never changes.** Postcard writes neither names nor lengths of fields, so an added field changes
//! the layout. The new layout gets a new number and a file of its own. A host that does not know a number
//! says so and continues. Fields that may be absent can follow at the end: a body without them is read as if
//! they were absent.
//!
//! Kinds below 64 are the bead's. Kinds from 64 up are the host's: see [`Request`](crate::Request).

pub(crate) mod board;
pub(crate) mod fault;
pub(crate) mod fetched;
pub(crate) mod gap;
pub(crate) mod guard;
pub(crate) mod health;
pub(crate) mod identity;
pub(crate) mod image;
pub(crate) mod kept;
pub(crate) mod last_fault;
pub(crate) mod link;
pub(crate) mod load;
pub(crate) mod played;
pub(crate) mod raw;
pub(crate) mod reply;
pub(crate) mod self_test;
pub(crate) mod settings;
pub(crate) mod shape;
pub(crate) mod status;
pub(crate) mod strike;
pub(crate) mod sync;
pub(crate) mod update;
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
    20 load Load,
    21 gap Gap,
    22 last_fault LastFault,
    23 guard Guard,
    24 fetched Fetched,
    25 kept Kept,
    26 board Board,
    27 update Update,
    32 played Played,
    33 image Image,
}
