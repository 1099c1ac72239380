//! Connections of the USARTs: lines of the output, and streams in and out.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};

use regex::Regex;
use serialport::{SerialPort, TTYPort};
use stm32f405_qemu::{RunError, Uart, UartInput};

const PORTS: [&str; 6] = ["USART1", "USART2", "USART3", "UART4", "UART5", "USART6"];

/// A UART and its connection.
#[derive(Debug, Clone)]
pub(crate) struct Way {
    port: String,
    to: Where,
}

#[derive(Debug, Clone)]
enum Where {
    Stdout,
    Pty,
    Tcp(String),
    File(PathBuf),
}

impl Way {
    /// Returns `true` if the connection can have input.
    pub(crate) fn has_input(&self) -> bool {
        matches!(self.to, Where::Pty | Where::Tcp(_))
    }

    /// The file to which the UART's output goes.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match &self.to {
            Where::File(path) => Some(path),
            _ => None,
        }
    }
}

/// Parses `USART2=stdout` and the like.
pub(crate) fn way(text: &str) -> Result<Way, String> {
    let (port, to) = text
        .split_once('=')
        .ok_or("give a UART and what to connect it to: USART2=stdout")?;
    let port = port.to_ascii_uppercase();
    if !PORTS.contains(&&*port) {
        return Err(format!("{port} is not a UART; give one of {}", PORTS.join(", ")));
    }
    let to = match to.split_once(':') {
        None if to == "stdout" => Where::Stdout,
        None if to == "pty" => Where::Pty,
        Some(("tcp", address)) => Where::Tcp(address.into()),
        Some(("file", path)) if !path.is_empty() => Where::File(path.into()),
        _ => {
            return Err(format!(
                "{to:?} is not a connection; give stdout, pty, tcp:HOST:PORT or file:PATH"
            ));
        }
    };
    Ok(Way { port, to })
}

/// An open connection.
struct Open {
    port: String,
    out: Box<dyn Write>,
    input: Option<Receiver<Vec<u8>>>,
}

/// The connections other than to standard output.
pub(crate) struct Ways(Vec<Open>);

impl Ways {
    /// Opens the connections. A TCP port waits for its first client.
    ///
    /// # Errors
    /// One line: the connection that cannot be opened.
    pub(crate) fn open(ways: &[Way]) -> Result<Self, RunError> {
        let ways = ways.iter().filter(|way| !matches!(way.to, Where::Stdout));
        ways.map(open).collect::<Result<_, _>>().map(Self)
    }

    /// Returns `true` if input may arrive, at the pace of real time.
    pub(crate) fn have_input(&self) -> bool {
        self.0.iter().any(|way| way.input.is_some())
    }

    /// Passes on the bytes that a USART sent. A connection whose other end is closed drops them.
    pub(crate) fn send(&mut self, uart: &Uart) {
        for way in self.0.iter_mut().filter(|way| way.port == uart.port) {
            if way
                .out
                .write_all(&uart.bytes)
                .and_then(|()| way.out.flush())
                .is_err()
            {
                way.out = Box::new(io::sink());
            }
        }
    }

    /// The bytes received so far, for the receivers at this time.
    pub(crate) fn received(&mut self, at_ns: u64) -> Vec<UartInput> {
        let mut all = Vec::new();
        for way in &mut self.0 {
            let mut bytes = Vec::new();
            while let Some(input) = &way.input {
                match input.try_recv() {
                    Ok(more) => bytes.extend(more),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => way.input = None,
                }
            }
            if !bytes.is_empty() {
                let port = way.port.clone();
                all.push(UartInput { port, at_ns, bytes });
            }
        }
        all
    }
}

fn open(way: &Way) -> Result<Open, RunError> {
    let port = way.port.clone();
    let failed = |what: String, error: &dyn std::fmt::Display| {
        RunError::Input(format!(
            "{port} cannot connect to {what}: {error}; give another place"
        ))
    };
    let (out, input): (Box<dyn Write>, _) = match &way.to {
        Where::File(path) => {
            let file = File::create(path).map_err(|e| failed(path.display().to_string(), &e))?;
            (Box::new(file), None)
        }
        Where::Tcp(address) => {
            let listener = TcpListener::bind(address).map_err(|e| failed(address.clone(), &e))?;
            let at = listener
                .local_addr()
                .map_or_else(|_| address.clone(), |at| at.to_string());
            eprintln!("stm32-emu: {port} waits for a connection at {at}");
            let accepted = listener.accept().map_err(|e| failed(address.clone(), &e))?;
            let stream = accepted.0.try_clone().map_err(|e| failed(address.clone(), &e))?;
            (Box::new(accepted.0), Some(reader(stream)))
        }
        _ => {
            let pty = || "a pseudo-terminal".to_owned();
            let (mut master, slave) = TTYPort::pair().map_err(|e| failed(pty(), &e))?;
            let name = slave.name().unwrap_or_default();
            eprintln!("stm32-emu: {port} is at {name}");
            // While the slave is open here, programs may connect and disconnect.
            master
                .set_timeout(std::time::Duration::from_secs(3600))
                .map_err(|e| failed(pty(), &e))?;
            let from = master.try_clone_native().map_err(|e| failed(pty(), &e))?;
            (Box::new(Terminal(master, slave)), Some(reader(from)))
        }
    };
    Ok(Open { port, out, input })
}

/// A pseudo-terminal with its slave, which keeps the terminal open.
struct Terminal(TTYPort, #[expect(dead_code, reason = "it is kept open")] TTYPort);

impl Write for Terminal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Reads in a separate thread, a few pieces ahead.
fn reader(mut from: impl Read + Send + 'static) -> Receiver<Vec<u8>> {
    let (sender, pieces) = sync_channel(64);
    std::thread::spawn(move || {
        let mut piece = [0; 1024];
        loop {
            match from.read(&mut piece) {
                Ok(0) => return,
                Ok(n) if sender.send(piece[..n].to_vec()).is_err() => return,
                Ok(_) => {}
                Err(e) if matches!(e.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => {}
                Err(_) => return,
            }
        }
    });
    pieces
}

/// Length at which a line without an end is shown and searched, in bytes.
const LONGEST_LINE: usize = 1 << 16;

/// The lines of the output, and the search in them.
pub(crate) struct Lines {
    shown: Vec<String>,
    until: Option<Regex>,
    pub(crate) found: bool,
    /// Beginnings of lines, by their source.
    begun: BTreeMap<String, Vec<u8>>,
    /// Lines, for a report of a test case. `None` to show them at once.
    pub(crate) kept: Option<Vec<String>>,
    /// True once nobody reads the output any more.
    pub(crate) closed: bool,
    /// Bytes that each USART sent.
    pub(crate) sent: BTreeMap<String, usize>,
}

impl Lines {
    /// Lines of the UARTs connected to standard output, and a search for `until` in them.
    pub(crate) fn new(ways: &[Way], until: Option<&Regex>) -> Self {
        let to_output = ways.iter().filter(|way| matches!(way.to, Where::Stdout));
        Self {
            shown: to_output.map(|way| way.port.clone()).collect(),
            until: until.cloned(),
            found: false,
            begun: BTreeMap::new(),
            kept: None,
            closed: false,
            sent: BTreeMap::new(),
        }
    }

    /// Shows a line at once.
    pub(crate) fn line(&mut self, line: &str) {
        self.search(line);
        match &mut self.kept {
            Some(kept) => kept.push(line.into()),
            None => {
                let mut stdout = io::stdout().lock();
                self.closed |= writeln!(stdout, "{line}").and_then(|()| stdout.flush()).is_err();
            }
        }
    }

    fn search(&mut self, line: &str) {
        self.found |= self.until.as_ref().is_some_and(|until| until.is_match(line));
    }

    /// Takes bytes that a USART sent.
    pub(crate) fn uart(&mut self, uart: &Uart) {
        *self.sent.entry(uart.port.clone()).or_default() += uart.bytes.len();
        let shown = self.shown.contains(&uart.port);
        self.text(&uart.port, &uart.bytes, shown.then(|| format!("{}: ", uart.port)));
    }

    /// Takes bytes of text: shows whole lines behind a prefix, or only searches them.
    pub(crate) fn text(&mut self, from: &str, bytes: &[u8], prefix: Option<String>) {
        let mut begun = self.begun.remove(from).unwrap_or_default();
        begun.extend(bytes);
        while let Some(end) = begun.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = begun.drain(..=end).collect();
            self.whole(&line, prefix.as_deref());
        }
        if begun.len() > LONGEST_LINE {
            self.whole(&std::mem::take(&mut begun), prefix.as_deref());
        }
        // A prompt has no end of line.
        self.search(&String::from_utf8_lossy(&begun));
        self.begun.insert(from.into(), begun);
    }

    fn whole(&mut self, line: &[u8], prefix: Option<&str>) {
        let text = String::from_utf8_lossy(line);
        let text = text.trim_end_matches(['\r', '\n']);
        match prefix {
            Some(prefix) => self.line(&format!("{prefix}{text}")),
            None => self.search(text),
        }
    }

    /// Shows beginnings of lines whose end never came.
    pub(crate) fn finish(&mut self) {
        for (from, begun) in std::mem::take(&mut self.begun) {
            let shown = from == SEMIHOSTING || self.shown.contains(&from);
            if !begun.is_empty() && shown {
                let prefix = if from == SEMIHOSTING {
                    String::new()
                } else {
                    format!("{from}: ")
                };
                self.whole(&begun, Some(&prefix));
            }
        }
    }
}

/// Name of semihosting as a source of text, beside the USARTs.
pub(crate) const SEMIHOSTING: &str = "semihosting";
