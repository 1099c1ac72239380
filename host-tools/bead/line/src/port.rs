//! The way to a bead and from it: a serial port, a pseudo-terminal, or a socket.

use std::fmt;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use serialport::{ErrorKind, SerialPort, SerialPortType};

/// How long a read waits for bytes. A request to stop is noticed within this time.
const PATIENCE: Duration = Duration::from_millis(100);
/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(5);

/// Why nothing more will come.
const GONE: &str = "unplugged, or closed at the other end";

/// Address of a port, as `--port` names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A serial port or pseudo-terminal, by its path.
    Serial(String),
    /// `tcp:HOST:PORT`, where a server has the bead's line.
    Tcp(String),
    /// `unix:PATH`, a socket where a server has it.
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

/// Why a port does not open: what, why, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// There is no such path.
    #[error("there is no {path}; {}", Ports)]
    Missing {
        /// The port.
        path: String,
    },
    /// The user may not open it.
    #[error(
        "{path}: permission denied; serial ports belong to the group dialout (on some systems uucp): `sudo usermod \
         -aG dialout $USER`, then log in again"
    )]
    Denied {
        /// The port.
        path: String,
    },
    /// Another program has it.
    #[error(
        "{path} is in use by another program, which `fuser -v {path}` names; end that one; {}",
        Ports
    )]
    Busy {
        /// The port.
        path: String,
    },
    /// It is something else, or there is nothing behind it.
    #[error("{path} is no serial port that works ({reason}); {}", Ports)]
    Unusable {
        /// The port.
        path: String,
        /// Error of the system.
        reason: String,
    },
    /// The adapter runs at another rate.
    #[error(
        "{path} runs at {actual} baud where {asked} were asked for: its adapter cannot; take one that can, or \
         give the --baud that the bead sends at"
    )]
    Baud {
        /// The port.
        path: String,
        /// Bits a second that were asked for.
        asked: u32,
        /// Bits a second that the driver says.
        actual: u32,
    },
    /// No server answers at the address.
    #[error(
        "cannot connect to {address}: {source}; start the server that has the bead's line, or correct the address"
    )]
    Unconnected {
        /// The address.
        address: Address,
        /// Error of the system.
        source: io::Error,
    },
}

/// The serial ports of this computer, as advice.
struct Ports;

impl fmt::Display for Ports {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = port_names();
        if names.is_empty() {
            write!(f, "this computer has no serial port: plug the adapter in")
        } else {
            write!(f, "serial ports here: {}", names.join(", "))
        }
    }
}

/// The serial ports of this computer.
fn ports() -> Vec<serialport::SerialPortInfo> {
    // Where the kernel shows no terminals, as in some containers, serialport would panic.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let mut ports = serialport::available_ports().unwrap_or_default();
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    ports
}

/// The serial ports of this computer that an adapter may be at: those at USB, if there are any.
pub fn all_serial() -> Vec<Address> {
    let ports = ports();
    let is_usb = |port: &serialport::SerialPortInfo| matches!(port.port_type, SerialPortType::UsbPort(_));
    let any_usb = ports.iter().any(is_usb);
    let ports = ports.into_iter().filter(|port| is_usb(port) || !any_usb);
    ports.map(|port| Address::Serial(port.port_name)).collect()
}

fn port_names() -> Vec<String> {
    let name = |port: serialport::SerialPortInfo| match port.port_type {
        SerialPortType::UsbPort(usb) => match usb.product {
            Some(product) => format!("{} ({product})", port.port_name),
            None => format!("{} (USB)", port.port_name),
        },
        _ => port.port_name,
    };
    ports().into_iter().map(name).collect()
}

impl Address {
    /// Opens the address for both directions. `baud` is for serial ports; no other program can open a serial
    /// port meanwhile.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn open(&self, baud: u32) -> Result<Port, PortError> {
        let line: Box<dyn Line> = match self {
            Self::Serial(path) => Box::new(open_serial(path, baud)?),
            Self::Tcp(server) => Box::new(connect(server).map_err(|source| self.unconnected(source))?),
            Self::Unix(path) => {
                let stream = UnixStream::connect(path).and_then(|stream| {
                    stream.set_read_timeout(Some(PATIENCE))?;
                    stream.set_write_timeout(Some(CONNECT))?;
                    Ok(stream)
                });
                Box::new(stream.map_err(|source| self.unconnected(source))?)
            }
        };
        Ok(Port { line })
    }

    /// Returns `true` if both are one port: a serial port may have several names.
    pub fn is_same(&self, other: &Self) -> bool {
        let file = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        match (self, other) {
            (Self::Serial(one), Self::Serial(other)) => file(Path::new(one)) == file(Path::new(other)),
            (Self::Unix(one), Self::Unix(other)) => file(one) == file(other),
            _ => self == other,
        }
    }

    fn unconnected(&self, source: io::Error) -> PortError {
        PortError::Unconnected {
            address: self.clone(),
            source,
        }
    }
}

fn open_serial(path: &str, baud: u32) -> Result<serialport::TTYPort, PortError> {
    let path = path.to_owned();
    // 8 data bits, no parity, 1 stop bit, no flow control are what serialport begins with.
    let port = match serialport::new(&path, baud).timeout(PATIENCE).open_native() {
        Ok(port) => port,
        Err(error) => {
            return Err(match error.kind() {
                ErrorKind::Io(io::ErrorKind::NotFound) => PortError::Missing { path },
                ErrorKind::Io(io::ErrorKind::PermissionDenied) => PortError::Denied { path },
                // serialport gives this error for a locked port.
                ErrorKind::NoDevice => PortError::Busy { path },
                _ => PortError::Unusable {
                    path,
                    reason: error.to_string(),
                },
            });
        }
    };
    match port.baud_rate() {
        Ok(actual) if !is_near(baud, actual) => Err(PortError::Baud {
            path,
            asked: baud,
            actual,
        }),
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
trait Line: Read + Write + Send {}

impl<T: Read + Write + Send> Line for T {}

/// An open port.
pub struct Port {
    line: Box<dyn Line>,
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
    fn an_address_is_read_back_as_it_is_written() {
        let cases = [
            ("/dev/ttyUSB0", Address::Serial("/dev/ttyUSB0".into())),
            ("tcp:localhost:4000", Address::Tcp("localhost:4000".into())),
            ("tcp:[::1]:4000", Address::Tcp("[::1]:4000".into())),
            ("unix:/run/bead.sock", Address::Unix("/run/bead.sock".into())),
        ];
        for (text, address) in cases {
            assert_eq!(text.parse(), Ok(address.clone()));
            assert_eq!(address.to_string(), text);
        }
    }

    #[test]
    fn an_address_that_lacks_a_part_is_refused() {
        for text in [
            "",
            "tcp:",
            "tcp:localhost",
            "tcp::4000",
            "tcp:localhost:65536",
            "unix:",
        ] {
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
