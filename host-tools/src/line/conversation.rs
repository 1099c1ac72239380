//! Asking a bead, and hearing what it answers among all else that it says.
//!
//! # Design
//! A request that gets no reply in time is sent again under the same number, as a line may lose either: every
//! request may be repeated (`docs/protocol.md`). Numbers start anywhere, so that a reply to who asked before is not taken for
//! ours.

use std::collections::VecDeque;
use std::process;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bead_wire::{MAX_REQUEST, Outcome, Request, encode_request};

use crate::cli::failure::{Blame, Failure};
use crate::line::port::{Address, Port};
use crate::recording::frames::{Frame, Item, Message, Reader, Reply};

/// How often a request is sent before the bead is given up.
const ATTEMPTS: u32 = 3;

/// A line on which a bead is asked.
pub struct Conversation {
    address: Address,
    port: Port,
    reader: Reader,
    /// Frames that came behind the last one that was wanted.
    behind: VecDeque<Frame>,
    next: u16,
    patience: Duration,
}

/// What a bead answered.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Everything that it said after the request was sent first, the reply not among it.
    pub frames: Vec<Frame>,
    /// The reply.
    pub reply: Reply,
}

impl Answer {
    /// The last of the frames that is wanted.
    ///
    /// # Errors
    /// There is none: the frame was lost.
    pub fn last<T>(&self, what: &str, wanted: impl Fn(&Frame) -> Option<T>) -> Result<T, Failure> {
        self.frames.iter().rev().find_map(wanted).ok_or_else(|| {
            Failure::device(format!(
                "the bead replied, but its {what} was lost on the way; ask again"
            ))
        })
    }
}

impl Conversation {
    /// Opens the line. `patience` is how long a reply may take.
    ///
    /// # Errors
    /// The port does not open.
    pub fn open(address: &Address, baud: u32, patience: Duration) -> Result<Self, Failure> {
        let port = address.open(baud).map_err(Failure::device)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            address: address.clone(),
            port,
            reader: Reader::new(),
            behind: VecDeque::new(),
            next: (since.subsec_micros() ^ process::id()) as u16,
            patience,
        })
    }

    /// Asks, and gives what the bead answers, done or refused.
    ///
    /// # Errors
    /// The request is none that fits a frame, the port goes away, or no reply comes.
    pub fn ask(&mut self, request: &Request<'_>) -> Result<Answer, Failure> {
        let number = self.next;
        self.next = self.next.wrapping_add(1);
        let mut buffer = [0; MAX_REQUEST];
        let bytes = encode_request(number, request, &mut buffer)
            .or_input(|| "this cannot be sent to a bead")?
            .to_vec();
        let mut frames = Vec::new();
        for _ in 0..ATTEMPTS {
            self.port
                .write(&bytes)
                .or_device(|| format!("cannot send to {}", self.address))?;
            let reply = self.listen(self.patience, |frame| match &frame.message {
                Message::Reply(reply) if reply.request == number => Some(reply.clone()),
                _ => {
                    frames.push(frame);
                    None
                }
            })?;
            if let Some(reply) = reply {
                return Ok(Answer { frames, reply });
            }
        }
        Err(self.silence())
    }

    /// Asks, and gives what the bead answers if it does what it was asked for.
    ///
    /// # Errors
    /// As [`ask`](Self::ask), and [`Failure::Verdict`] with the bead's reason if it refuses.
    pub fn command(&mut self, request: &Request<'_>) -> Result<Answer, Failure> {
        let answer = self.ask(request)?;
        match answer.reply.outcome {
            Outcome::Done => Ok(answer),
            _ => Err(refused(&answer.reply)),
        }
    }

    /// Resets the bead, and waits until it is there again; gives the number of its boot.
    ///
    /// # Errors
    /// As [`command`](Self::command), or it does not come back within 10 s.
    pub fn reboot(&mut self) -> Result<u32, Failure> {
        /// Four seconds for a sector that is erased, and as much again.
        const START: Duration = Duration::from_secs(10);
        self.command(&Request::Reboot)?;
        let boot = self.listen(START, |frame| match &frame.message {
            // The first frame of a boot.
            Message::Identity(identity) if frame.header.sequence == 0 => Some(identity.boot),
            _ => None,
        })?;
        boot.ok_or_else(|| {
            Failure::device(format!(
                "the bead at {} said that it would reset, and did not come back within 10 s; is it powered?",
                self.address
            ))
        })
    }

    /// Hears the bead until something wanted comes, or for so long.
    ///
    /// # Errors
    /// The port has gone away.
    pub fn listen<T>(
        &mut self,
        patience: Duration,
        mut wanted: impl FnMut(Frame) -> Option<T>,
    ) -> Result<Option<T>, Failure> {
        let deadline = Instant::now() + patience;
        let mut buffer = vec![0; 64 * 1024];
        loop {
            while let Some(frame) = self.behind.pop_front() {
                if let Some(found) = wanted(frame) {
                    return Ok(Some(found));
                }
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
            let length = self
                .port
                .read(&mut buffer)
                .or_device(|| format!("{} went away", self.address))?;
            self.reader.feed(&buffer[..length], |item| {
                if let Item::Frame(frame) = item {
                    self.behind.push_back(frame);
                }
            });
        }
    }

    /// Why there is no reply, as far as what came tells.
    fn silence(&self) -> Failure {
        let seconds = self.patience.as_secs_f64() * f64::from(ATTEMPTS);
        let counters = self.reader.counters();
        let why = match (counters.bytes, counters.frames) {
            (0, _) => "nothing came at all: is it powered, and its PA9 wired to the adapter's receive pin?",
            (_, 0) => "bytes came, but no frame among them: does --baud match?",
            _ => {
                "it sends frames: is its PA10 wired to the adapter's transmit pin, and its image one that can be asked?"
            }
        };
        Failure::device(format!(
            "no reply from {} within {seconds:.1} s; {why}",
            self.address
        ))
    }
}

/// What the bead said no to, and why.
pub fn refused(reply: &Reply) -> Failure {
    let name = reply.outcome.name().replace('_', " ");
    Failure::Verdict(match reply.detail.is_empty() {
        true => format!("the bead refused: {name}"),
        false => format!("the bead refused: {name}; {}", reply.detail),
    })
}
