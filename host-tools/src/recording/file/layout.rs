//! The layout of a recording in MCAP: names of channels and records, and sizes.

use std::time::Duration;

pub(super) const TOPIC: &str = "frames";
pub(super) const ENCODING: &str = "bead-wire";
pub(super) const RECEIVED: &str = "received";
pub(super) const RECEIVED_ENCODING: &str = "bead-received";
/// The number of the first channel that the library gives.
pub(super) const FIRST_CHANNEL: u16 = 1;
pub(super) const METADATA: &str = "recording";
/// Bytes after which a chunk is closed: few, so that little is lost in a crash, and many more than a frame
/// has.
pub(super) const CHUNK: u64 = 16 * 1024;
/// Longest time for which received bytes wait before they go to the system.
pub(super) const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Bytes without a delimiter after which they are written as a run, so that a dead line cannot fill the
/// memory.
pub(super) const LONGEST_RUN: usize = 64 * 1024;
