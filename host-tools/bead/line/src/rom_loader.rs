//! The loader in the part's ROM, over its serial line: the subset of ST's protocol AN3155 that flashing
//! needs.
//!
//! # Design
//! The loader measures the bit rate on a first byte, 0x7F, and then takes commands. A command is a byte
//! and its complement; addresses and data follow with a checksum each, and each part is answered with
//! ACK or NACK. A refused command is sent again, since a line may flip a bit; that is harmless, as a
//! repeated write writes the same bytes. After silence nothing is sent again: the loader may be waiting for
//! any byte, and would take it for another one.

use std::fmt;
use std::time::{Duration, Instant};

use serialport::Parity;

use crate::port::{Address, Port, PortError};

/// Greatest number of bytes of a read or a write.
pub const MOST: usize = 256;

const INIT: u8 = 0x7f;
const ACK: u8 = 0x79;
const NACK: u8 = 0x1f;

/// Time for an answer that needs no erase: 256 bytes at 1200 baud take 2.4 s.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time for the erase of a sector: 4 s at most of 128 KiB (DocID022152, flash memory characteristics).
const ERASE: Duration = Duration::from_secs(6);
/// Number of times that a command is sent.
const TRIES: usize = 3;

/// A command of the loader (AN3155 table 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    GetId = 0x02,
    Read = 0x11,
    Go = 0x21,
    Write = 0x31,
    ExtendedErase = 0x44,
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::GetId => "Get ID",
            Self::Read => "Read Memory",
            Self::Go => "Go",
            Self::Write => "Write Memory",
            Self::ExtendedErase => "Extended Erase",
        })
    }
}

/// Error of the loader or its line. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum RomError {
    /// The port does not open.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Nothing answers the first byte.
    #[error(
        "no loader answers at {0}: connect BOOT0 to 3.3 V, reset the board, and try again at once; the loader \
         listens on PA9 and PA10 and on PB10 and PB11, and until the next reset it keeps to the pair that \
         receives first"
    )]
    Silent(Address),
    /// Something else answers.
    #[error(
        "received {0:#04x}, but the loader answers 0x79 or 0x1f: the line is disturbed, or the board runs its \
         image; connect BOOT0 to 3.3 V, reset the board, and try again"
    )]
    Stranger(u8),
    /// The loader refuses a command at its first bytes. It does so with all commands that touch the flash of
    /// a locked part.
    #[error(
        "the loader refuses {0}: the part is locked (read protection); unlocking it erases all of its flash, with \
         settings and strikes: `STM32_Programmer_CLI -c port=SWD -rdu`"
    )]
    Locked(String),
    /// The loader refuses a part of a command, each time.
    #[error(
        "the loader refuses {0} at {1:#010x}, three times: the line flips bits, or there is no such memory"
    )]
    Refused(String, u32),
    /// The loader has answered before, and now is silent.
    #[error(
        "the line was cut, or the loader has stopped, during {0} at {1:#010x}: check the wires, reset the \
         board with BOOT0 at 3.3 V, and run the same command again"
    )]
    Cut(String, u32),
    /// The port has gone away.
    #[error(
        "the port has gone away ({0}): plug it in, reset the board with BOOT0 at 3.3 V, and run the same command again"
    )]
    Gone(std::io::Error),
}

/// A loader that has answered.
pub struct RomLoader {
    port: Port,
}

impl RomLoader {
    /// Opens the port with the loader's parity and lets the loader measure the bit rate.
    ///
    /// # Errors
    /// The port does not open, or no loader answers.
    pub fn open(address: &Address, baud: u32) -> Result<Self, RomError> {
        let mut loader = Self {
            port: address.open_with(baud, Parity::Even)?,
        };
        // Bytes from before the port was opened are no answer.
        loader.settle()?;
        // A loader that already knows the rate takes the first byte for a command, waits for its complement,
        // and refuses the second.
        for _ in 0..2 {
            loader.send(&[INIT])?;
            if loader.answer(Duration::from_secs(1))?.is_some() {
                return Ok(loader);
            }
        }
        Err(RomError::Silent(address.clone()))
    }

    /// Reads the part's device number.
    ///
    /// # Errors
    /// [`RomError`].
    pub fn part(&mut self) -> Result<u16, RomError> {
        self.begin(Command::GetId, 0)?;
        let mut answer = [0; 3];
        self.receive(&mut answer, Command::GetId, 0)?;
        if !self.is_taken(PATIENCE, Command::GetId, 0)? {
            return Err(RomError::Refused(Command::GetId.to_string(), 0));
        }
        Ok(u16::from_be_bytes([answer[1], answer[2]]))
    }

    /// Reads up to [`MOST`] bytes of memory.
    ///
    /// # Errors
    /// [`RomError::Locked`] of a part with read protection.
    pub fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), RomError> {
        let count = count(bytes);
        self.again(Command::Read, address, |loader| {
            if !loader.address(address)? {
                return Ok(false);
            }
            loader.send(&[count, !count])?;
            let is_taken = loader.is_taken(PATIENCE, Command::Read, address)?;
            if is_taken {
                loader.receive(bytes, Command::Read, address)?;
            }
            Ok(is_taken)
        })
    }

    /// Writes up to [`MOST`] bytes, four or a multiple, to RAM or to flash that is erased.
    ///
    /// # Errors
    /// [`RomError`].
    pub fn write(&mut self, address: u32, bytes: &[u8]) -> Result<(), RomError> {
        let mut data = vec![count(bytes)];
        data.extend(bytes);
        self.again(Command::Write, address, |loader| {
            Ok(loader.address(address)? && loader.checked(&data, PATIENCE, Command::Write, address)?)
        })
    }

    /// Erases a sector. Its first address is for messages.
    ///
    /// # Errors
    /// [`RomError`].
    pub fn erase(&mut self, sector: u8, address: u32) -> Result<(), RomError> {
        self.again(Command::ExtendedErase, address, |loader| {
            // The number of sectors less one, and the sector, 16 bits each.
            loader.checked(&[0, 0, 0, sector], ERASE, Command::ExtendedErase, address)
        })
    }

    /// Starts the program at an address, which holds its stack pointer and the address of its first
    /// instruction.
    ///
    /// # Errors
    /// [`RomError`].
    pub fn go(&mut self, address: u32) -> Result<(), RomError> {
        self.again(Command::Go, address, |loader| loader.address(address))
    }

    /// Sends a command, and the parts that `rest` sends, again until the loader accepts all of it.
    fn again(
        &mut self,
        command: Command,
        address: u32,
        mut rest: impl FnMut(&mut Self) -> Result<bool, RomError>,
    ) -> Result<(), RomError> {
        for _ in 0..TRIES {
            self.begin(command, address)?;
            if rest(self)? {
                return Ok(());
            }
            self.settle()?;
        }
        Err(RomError::Refused(command.to_string(), address))
    }

    /// Sends a command's byte and its complement.
    fn begin(&mut self, command: Command, address: u32) -> Result<(), RomError> {
        for _ in 0..TRIES {
            self.send(&[command as u8, !(command as u8)])?;
            if self.is_taken(PATIENCE, command, address)? {
                return Ok(());
            }
            self.settle()?;
        }
        Err(RomError::Locked(command.to_string()))
    }

    /// Sends an address; false if the loader refuses it.
    fn address(&mut self, address: u32) -> Result<bool, RomError> {
        self.send(&with_checksum(&address.to_be_bytes()))?;
        self.is_taken(PATIENCE, "an address", address)
    }

    /// Sends bytes with their checksum; false if the loader refuses them.
    fn checked(&mut self, bytes: &[u8], time: Duration, command: Command, at: u32) -> Result<bool, RomError> {
        self.send(&with_checksum(bytes))?;
        self.is_taken(time, command, at)
    }

    /// Waits for the answer to a part of `what`; false if the loader refuses it.
    fn is_taken(&mut self, time: Duration, what: impl fmt::Display, at: u32) -> Result<bool, RomError> {
        let answer = self.answer(time)?;
        answer.ok_or_else(|| RomError::Cut(what.to_string(), at))
    }

    /// Waits for a quiet line: the loader refuses the rest of a part that it took for a shorter one.
    fn settle(&mut self) -> Result<(), RomError> {
        let (mut rest, started) = ([0; MOST], Instant::now());
        // If the line is never quiet, the next answer fails.
        while started.elapsed() < PATIENCE && self.port.read(&mut rest).map_err(RomError::Gone)? > 0 {}
        Ok(())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), RomError> {
        self.port.write(bytes).map_err(RomError::Gone)
    }

    /// Waits for the next answer: true for ACK, false for NACK, `None` for silence.
    fn answer(&mut self, time: Duration) -> Result<Option<bool>, RomError> {
        let mut byte = [0];
        match (self.receive_within(&mut byte, time)?, byte[0]) {
            (0, _) => Ok(None),
            (_, ACK) => Ok(Some(true)),
            (_, NACK) => Ok(Some(false)),
            (_, other) => Err(RomError::Stranger(other)),
        }
    }

    fn receive(&mut self, bytes: &mut [u8], command: Command, address: u32) -> Result<(), RomError> {
        let whole = bytes.len();
        if self.receive_within(bytes, PATIENCE)? == whole {
            return Ok(());
        }
        Err(RomError::Cut(command.to_string(), address))
    }

    /// Reads bytes until all have come or none has come for `time`. Returns their number.
    fn receive_within(&mut self, bytes: &mut [u8], time: Duration) -> Result<usize, RomError> {
        let (mut received, mut last) = (0, Instant::now());
        while received < bytes.len() && last.elapsed() < time {
            let came = self.port.read(&mut bytes[received..]).map_err(RomError::Gone)?;
            if came > 0 {
                received += came;
                last = Instant::now();
            }
        }
        Ok(received)
    }
}

/// The number of bytes less one, as the loader expects it.
///
/// # Panics
/// There are no bytes, or more than [`MOST`].
fn count(bytes: &[u8]) -> u8 {
    assert!((1..=MOST).contains(&bytes.len()), "a command has 1 to 256 bytes");
    (bytes.len() - 1) as u8
}

/// Bytes, and the exclusive or of all of them.
fn with_checksum(bytes: &[u8]) -> Vec<u8> {
    let sum = bytes.iter().fold(0, |sum, byte| sum ^ byte);
    [bytes, &[sum]].concat()
}
