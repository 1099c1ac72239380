//! Arguments of `bead flash`.

use crate::cli::commands::prelude::*;
use bead_line::port::Address;

const AFTER_HELP: &str = "\
Settings and kept strikes stay: only the sectors that the image covers are erased.

--port without --rom sends the image over the bead's own line, with the bead in place. The image must be \
signed, as `cargo xtask build` does. Meanwhile the bead takes no samples. It tries the new image, and returns \
to the old one unless the new one passes its self-test. If the line is cut, run the same command again.

--probe checks the part and its option bytes, flashes the image, compares it, and resets the part. It needs \
probe-rs (`cargo install probe-rs-tools --locked`).

--rom uses the loader that ST has put into the part, over the bead's serial line: it rescues a bead that does \
not start. Connect BOOT0 to 3.3 V and reset the board first: docs/hardware.md#flashing.

Exit status 2 if the image or the board is the wrong one, 3 if probe, part or line fails.

Examples:
  bead flash --port /dev/ttyUSB0
  bead flash --probe --dry-run
  bead flash --probe --board weact-f405 --brownout
  bead flash --probe my-image.elf --serial 0670FF343631
  bead flash --rom --port /dev/ttyUSB0";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The image, an ELF file [default: the board's, else as `cargo xtask build` leaves it, else the one
    /// inside this program].
    pub(crate) image: Option<PathBuf>,
    /// Flash through a debug probe, with probe-rs.
    #[arg(long, required_unless_present = "port", conflicts_with_all = ["rom", "port"])]
    pub(crate) probe: bool,
    /// Flash over the serial line, with the part's own loader.
    #[arg(long, requires = "port")]
    pub(crate) rom: bool,
    /// The board, a row of firmware/boards.txt. If given, even the image for another board is replaced.
    #[arg(long, value_name = "NAME")]
    pub(crate) board: Option<String>,
    /// Use the probe with this serial number if there are several.
    #[arg(long, value_name = "S", requires = "probe")]
    pub(crate) serial: Option<String>,
    /// Hold the part in reset while the probe connects: for a part whose image cuts the probe off. Needs
    /// NRST.
    #[arg(long, requires = "probe")]
    pub(crate) under_reset: bool,
    /// Set the part's brown-out reset to level 3, as a bead needs it. It stays set.
    #[arg(long, requires = "probe")]
    pub(crate) brownout: bool,
    /// Print the commands of probe-rs without running them.
    #[arg(long, requires = "probe", conflicts_with = "format")]
    pub(crate) dry_run: bool,
    /// The bead's serial port, or the loader's: a port or pty, tcp:HOST:PORT or unix:PATH.
    #[arg(long, value_name = "P")]
    pub(crate) port: Option<Address>,
    /// Bits a second of a serial port [default: 2000000, or 115200 with --rom, the fastest of the loader].
    #[arg(long, requires = "port", value_parser = clap::value_parser!(u32).range(1200..))]
    pub(crate) baud: Option<u32>,
    /// Send the image to the bead with this address only, 0 to 254 [default: the bead on the line].
    #[arg(long, value_name = "N", requires = "port", conflicts_with = "rom", value_parser = clap::value_parser!(u8).range(..i64::from(bead_wire::ANY)))]
    pub(crate) address: Option<u8>,
    /// Sign the requests with the key in this file, as a bead with a key requires.
    #[arg(long, value_name = "F.key", requires = "port", conflicts_with = "rom")]
    pub(crate) key: Option<PathBuf>,
    /// Let the bead take an image that is older than the one it runs.
    #[arg(long, requires = "port", conflicts_with = "rom")]
    pub(crate) older: bool,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
