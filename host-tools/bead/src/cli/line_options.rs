//! The line to a bead: options that `bead settings` and `bead command` share.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bead_wire::ANY;
use clap::Args;

use bead_console::failure::Failure;
use bead_line::conversation::Conversation;
use bead_line::key;
use bead_line::port::Address;

/// The line to the bead.
#[derive(Debug, Args)]
pub(crate) struct LineOptions {
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH.
    #[arg(long, value_name = "P")]
    port: Address,
    /// Ask only the bead with this address, 0 to 254 [default: every bead on the line].
    ///
    /// Needed where several beads share a line: their replies would collide.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(..i64::from(ANY)))]
    address: Option<u8>,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Time-out of a reply, s. A request is sent three times.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = bead_console::output::seconds_of_a_day)]
    timeout: Duration,
    /// Sign requests that change the bead's state with the key in this file. A bead that has a key refuses
    /// unsigned ones.
    #[arg(long, value_name = "F.key")]
    key: Option<PathBuf>,
}

impl LineOptions {
    pub(crate) fn port(&self) -> &Address {
        &self.port
    }

    pub(crate) fn open(&self) -> Result<Conversation, Failure> {
        let key = self.key.as_deref();
        open(&self.port, self.baud, self.address, key, self.timeout)
    }
}

/// The usual time-out of a reply.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(1);

/// Opens the line to a bead.
pub(crate) fn open(
    port: &Address,
    baud: u32,
    address: Option<u8>,
    key: Option<&Path>,
    timeout: Duration,
) -> Result<Conversation, Failure> {
    let key = key.map(key::read).transpose()?;
    let mut bead = Conversation::open(port, baud, address.unwrap_or(ANY), timeout)?;
    bead.sign_with(key);
    Ok(bead)
}
