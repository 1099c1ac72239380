//! The way to a bead and from it: a serial port, a pseudo-terminal, or a socket.

use std::fmt;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use serialport::{ErrorKind, Parity, SerialPort, SerialPortInfo, SerialPortType};

/// Longest wait of a read for bytes. A request to stop is noticed within this time.
const PATIENCE: Duration = Duration::from_millis(100);
const CONNECT: Duration = Duration::from_secs(5);

/// Reason why a port has gone away.
const GONE: &str = "unplugged, or closed at the other end";

/// Address of a port, as `--port` names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A serial port or pseudo-terminal, by its path.
    Serial(String),
    /// `tcp:HOST:PORT`, where a server offers the bead's line.
    Tcp(String),
    /// `unix:PATH`, a socket where a server offers the bead's line.
    Unix(PathBuf),
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(server) = text.strip_prefix("tcp:") {
            return match server.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => {
                    Ok(Self::Tcp(server.to_owned()))
                }
                _ => {
                    Err("give host and port number, as in tcp:192.168.1.7:4000 or tcp:[::1]:4000".to_owned())
                }
            };
        }
        match text.strip_prefix("unix:") {
            Some("") => Err("give the socket's path, as in unix:/run/bead.sock".to_owned()),
            Some(path) => Ok(Self::Unix(path.into())),
            None if text.is_empty() => Err("give a path such as /dev/ttyUSB0".to_owned()),
            None => Ok(Self::Serial(text.to_owned())),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(path) => write!(f, "{path}"),
            Self::Tcp(server) => write!(f, "tcp:{server}"),
            Self::Unix(path) => write!(f, "unix:{}", path.display()),
        }
    }
}

/// A port does not open. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PortError(String);

fn ports() -> Vec<SerialPortInfo> {
    // In a container whose kernel shows no terminals, serialport would panic.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut ports = serialport::available_ports().unwrap_or_default();
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    ports
}

/// The serial ports of this computer that may be adapters: those on USB, if there are any.
fn all_serial() -> Vec<Address> {
    let ports = ports();
    let is_usb = |port: &SerialPortInfo| matches!(port.port_type, SerialPortType::UsbPort(_));
    let any_usb = ports.iter().any(is_usb);
    let ports = ports.into_iter().filter(|port| is_usb(port) || !any_usb);
    ports.map(|port| Address::Serial(port.port_name)).collect()
}

/// The serial ports of this computer, as advice.
fn advice() -> String {
    let name = |port: SerialPortInfo| match port.port_type {
        SerialPortType::UsbPort(usb) => match usb.product {
            Some(product) => format!("{} ({product})", port.port_name),
            None => format!("{} (USB)", port.port_name),
        },
        _ => port.port_name,
    };
    let names: Vec<_> = ports().into_iter().map(name).collect();
    if names.is_empty() {
        return "this computer has no serial port: plug the adapter in".to_owned();
    }
    format!("serial ports here: {}", names.join(", "))
}

/// Opens ports; `None` stands for every serial port of this computer, or only those on USB if there are any.
/// A port that is named twice is opened once. Of several ports, those that do not open are left out, with a
/// line to `note` for each.
///
/// # Errors
/// No port opens.
pub fn open_all(
    wanted: &[Option<Address>],
    baud: u32,
    note: impl Fn(String),
) -> Result<Vec<(Address, Port)>, PortError> {
    let mut addresses: Vec<Address> = Vec::new();
    for choice in wanted {
        let found = choice
            .as_ref()
            .map_or_else(all_serial, |address| vec![address.clone()]);
        for address in found {
            if !addresses.iter().any(|other| other.is_same(&address)) {
                addresses.push(address);
            } else if wanted.contains(&Some(address.clone())) {
                note(format!("{address} is named twice; it is recorded once"));
            }
        }
    }
    let one = addresses.len() == 1;
    let none = match addresses.len() {
        0 => "this computer has no serial port: plug the adapters in, or name a port",
        _ => "none of the ports could be opened",
    };
    let mut open = Vec::new();
    for address in addresses {
        match address.open(baud) {
            Ok(port) => open.push((address, port)),
            Err(error) if one => return Err(error),
            Err(error) => note(format!("{error}; the others are recorded")),
        }
    }
    if open.is_empty() {
        return Err(PortError(none.to_owned()));
    }
    Ok(open)
}

impl Address {
    /// Opens the address for both directions. `baud` is for serial ports; no other program can open a serial
    /// port meanwhile.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn open(&self, baud: u32) -> Result<Port, PortError> {
        self.open_with(baud, Parity::None)
    }

    pub(crate) fn open_with(&self, baud: u32, parity: Parity) -> Result<Port, PortError> {
        let unconnected = |source: io::Error| {
            PortError(format!(
                "cannot connect to {self}: {source}; start the server that has the bead's line, or correct the address"
            ))
        };
        let line: Box<dyn DuplexStream> = match self {
            Self::Serial(path) => Box::new(open_serial(path, baud, parity)?),
            Self::Tcp(server) => Box::new(connect(server).map_err(unconnected)?),
            Self::Unix(path) => {
                let stream = UnixStream::connect(path).and_then(|stream| {
                    stream.set_read_timeout(Some(PATIENCE))?;
                    stream.set_write_timeout(Some(CONNECT))?;
                    Ok(stream)
                });
                Box::new(stream.map_err(unconnected)?)
            }
        };
        Ok(Port { line })
    }

    /// Returns `true` if both name the same port: a serial port may have several names.
    pub fn is_same(&self, other: &Self) -> bool {
        let file = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        match (self, other) {
            (Self::Serial(one), Self::Serial(other)) => file(Path::new(one)) == file(Path::new(other)),
            (Self::Unix(one), Self::Unix(other)) => file(one) == file(other),
            _ => self == other,
        }
    }
}

fn open_serial(path: &str, baud: u32, parity: Parity) -> Result<serialport::TTYPort, PortError> {
    // 8 data bits, 1 stop bit and no flow control are serialport's defaults.
    let port = serialport::new(path, baud).parity(parity).timeout(PATIENCE);
    let opened = port.open_native();
    let port = opened.map_err(|error| {
        PortError(match error.kind() {
            ErrorKind::Io(io::ErrorKind::NotFound) => format!("there is no {path}; {}", advice()),
            ErrorKind::Io(io::ErrorKind::PermissionDenied) => format!(
                "{path}: permission denied; serial ports belong to the group dialout (on some systems uucp): \
                 `sudo usermod -aG dialout $USER`, then log in again"
            ),
            // serialport gives this error for a locked port.
            ErrorKind::NoDevice => format!(
                "{path} is in use by another program, which `fuser -v {path}` names; end that program; {}",
                advice()
            ),
            _ => format!("{path} is not a working serial port ({error}); {}", advice()),
        })
    })?;
    match port.baud_rate() {
        Ok(actual) if !is_near(baud, actual) => Err(PortError(format!(
            "{path} runs at {actual} baud instead of the requested {baud}: its adapter does not support that \
             rate; use one that does, or give --baud the rate at which the bead sends"
        ))),
        _ => Ok(port),
    }
}

/// Returns `true` if a receiver at one rate understands a sender at the other. At 2 % the last of ten bits is
/// sampled a fifth of a bit off its middle, which leaves room for the sender's own error.
fn is_near(asked: u32, actual: u32) -> bool {
    u64::from(asked.abs_diff(actual)) * 50 <= u64::from(asked)
}

fn connect(server: &str) -> io::Result<TcpStream> {
    let mut failure = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    for address in server.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Ok(stream) => {
                stream.set_read_timeout(Some(PATIENCE))?;
                stream.set_write_timeout(Some(CONNECT))?;
                return Ok(stream);
            }
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

/// Bytes both ways.
trait DuplexStream: Read + Write + Send {}

impl<T: Read + Write + Send> DuplexStream for T {}

/// An open port.
pub struct Port {
    line: Box<dyn DuplexStream>,
}

impl Port {
    /// Reads what has come, at once or within a tenth of a second; 0 if nothing has.
    ///
    /// # Errors
    /// The port has gone away: nothing more will come.
    pub fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        use io::ErrorKind::{BrokenPipe, Interrupted, TimedOut, UnexpectedEof, WouldBlock};
        match self.line.read(buffer) {
            Ok(0) => Err(io::Error::new(UnexpectedEof, GONE)),
            // serialport reports a line that hung up like this.
            Err(error) if error.kind() == BrokenPipe => Err(io::Error::new(BrokenPipe, GONE)),
            Err(error) if matches!(error.kind(), Interrupted | TimedOut | WouldBlock) => Ok(0),
            other => other,
        }
    }

    /// Sends all bytes.
    ///
    /// # Errors
    /// The port has gone away, or takes nothing.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.write_all(bytes)?;
        self.line.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_back_as_it_is_written_and_one_that_lacks_a_part_is_refused() {
        for (text, address) in [
            ("/dev/ttyUSB0", Address::Serial("/dev/ttyUSB0".into())),
            ("tcp:localhost:4000", Address::Tcp("localhost:4000".into())),
            ("tcp:[::1]:4000", Address::Tcp("[::1]:4000".into())),
            ("unix:/run/bead.sock", Address::Unix("/run/bead.sock".into())),
        ] {
            assert_eq!(text.parse(), Ok(address.clone()));
            assert_eq!(address.to_string(), text);
        }
        for text in "|tcp:|tcp:localhost|tcp::4000|tcp:localhost:65536|unix:".split('|') {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_rate_is_near_within_two_percent() {
        for actual in [1_960_000, 2_000_000, 2_040_000] {
            assert!(is_near(2_000_000, actual), "{actual}");
        }
        for actual in [0, 921_600, 1_959_999, 2_040_001, u32::MAX] {
            assert!(!is_near(2_000_000, actual), "{actual}");
        }
    }
}
