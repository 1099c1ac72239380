//! The layout of a recording in MCAP: names of channels and records, and sizes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::time::Duration;

/// A file that is being written.
pub(super) type Mcap = mcap::Writer<BufWriter<File>>;

pub(super) const TOPIC: &str = "frames";
pub(super) const ENCODING: &str = "bead-wire";
pub(super) const RECEIVED: &str = "received";
pub(super) const RECEIVED_ENCODING: &str = "bead-received";
pub(super) const METADATA: &str = "recording";
pub(super) const NOTE: &str = "note";
/// Bytes after which a chunk is closed. The writer keeps some 800 bytes of each for the index at the end:
/// many short chunks would fill the memory. Nothing more is lost in a crash, as each flush closes one too.
pub(super) const CHUNK: u64 = 256 * 1024;
/// Longest time that received bytes wait before they go to the system.
pub(super) const FLUSH_EVERY: Duration = Duration::from_secs(1);
/// Longest record that is read, in bytes: a damaged length must not fill the memory. Chunks have 256 KiB here
/// and some MB from other programs; attachments are much shorter than this.
pub(super) const RECORD_MOST: usize = 32 << 20;
/// Bytes without a delimiter after which they are written as a run, so that a dead line cannot fill the
/// memory.
pub(super) const LONGEST_RUN: usize = 64 * 1024;

/// Prefix of the address of a bead in the names of its channels and attachments.
const BEAD: &str = "bead/";

/// The name of a channel or an attachment: of one bead among several, by its address, or of the whole
/// recording.
pub(super) fn name_of(bead: Option<u8>, name: &str) -> Cow<'_, str> {
    match bead {
        Some(address) => format!("{BEAD}{address}/{name}").into(),
        None => name.into(),
    }
}

/// The entries of a metadata record whose values are known.
pub(super) fn known<const N: usize>(entries: [(&str, Option<String>); N]) -> BTreeMap<String, String> {
    let known = entries.into_iter();
    let known = known.filter_map(|(name, value)| Some((name.to_owned(), value?)));
    known.collect()
}

/// The address of the bead whose channel or attachment this is, and the name without it.
pub(super) fn bead_of(name: &str) -> (Option<u8>, &str) {
    let of_bead = || {
        let (address, rest) = name.strip_prefix(BEAD)?.split_once('/')?;
        Some((Some(address.parse().ok()?), rest))
    };
    of_bead().unwrap_or((None, name))
}
