//! The line to a bead: options that `bead settings` and `bead command` share.

use std::time::Duration;

use clap::Args;

use crate::cli::failure::Failure;
use crate::line::conversation::Conversation;
use crate::line::port::Address;

/// The line to the bead.
#[derive(Debug, Args)]
pub(crate) struct LineOptions {
    /// A serial port or pty, tcp:HOST:PORT or unix:PATH.
    #[arg(long, value_name = "P")]
    port: Address,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// How long a reply may take, s. A request is sent three times.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = crate::cli::output::seconds)]
    timeout: Duration,
}

impl LineOptions {
    pub(crate) fn open(&self) -> Result<Conversation, Failure> {
        Ok(Conversation::open(&self.port, self.baud, self.timeout)?)
    }
}
