//! Requests to a bead, and its replies among all else that it sends.
//!
//! # Design
//! A request that gets no reply in time is sent again under the same number, as the line may lose request or
//! reply. Every request may be repeated (`docs/protocol.md`). The first number is arbitrary, so that a reply
//! to an earlier program is not taken for ours.
//!
//! Without an address, every bead on the line is asked. Then one bead must be alone there: the replies of several
//! would collide. With an address, only that bead is asked, and what the others send meanwhile is passed over.
//!
//! With a key, what changes the bead's state is signed. The bead is asked first for what a signature needs: its
//! device id, boot, sample index and counter. Each copy of a signed request has a counter of its own, since the
//! bead takes each only once.

use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{io, process};

use bead_wire::{ANY, Identity, Key, MAX_REQUEST, Message, Outcome, Reply, Request, Ticket, encode_request};

use crate::line::port::{Address, Port, PortError};
use crate::line::seen::Seen;
use crate::recording::frames::{Frame, Reader};

/// How often a request is sent before the bead counts as silent.
const ATTEMPTS: u32 = 3;

/// Why a conversation fails. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The port does not open.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The port fails or goes away.
    #[error("{what}: {source}")]
    Gone {
        /// What was tried.
        what: String,
        /// What the system said.
        source: io::Error,
    },
    /// No answer comes, or not all of it.
    #[error("{0}")]
    Silent(String),
    /// The bead refused.
    #[error("{0}")]
    Refused(String),
}

/// A line on which a bead gets requests.
pub struct Conversation {
    line: Address,
    port: Port,
    reader: Reader,
    /// The bead that is asked, or [`ANY`].
    asked: u8,
    /// The bead that replied last.
    replied: Option<u8>,
    /// Frames that came after the last wanted one.
    behind: VecDeque<Frame>,
    next: u16,
    patience: Duration,
    key: Option<Key>,
    identity: Option<Identity>,
    seen: Seen,
}

/// What a bead answered.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Everything that the bead sent after the first copy of the request, without the reply.
    pub frames: Vec<Frame>,
    /// The reply.
    pub reply: Reply,
    /// The address of the bead that replied.
    pub address: u8,
    /// Whether every bead on the line was asked, and something came damaged: replies of several collide.
    collided: bool,
}

impl Answer {
    /// The last of the frames that is wanted.
    ///
    /// # Errors
    /// No frame is wanted: it was lost.
    pub fn last<T>(&self, what: &str, wanted: impl Fn(&Frame) -> Option<T>) -> Result<T, LineError> {
        self.frames.iter().rev().find_map(wanted).ok_or_else(|| {
            let next = match self.collided {
                true => "ask again, and if several beads share the line, one of them: --address N",
                false => "ask again",
            };
            LineError::Silent(format!(
                "the bead at address {} replied, but its {what} was lost on the way; {next}",
                self.address
            ))
        })
    }

    /// What the bead refused, and why.
    pub fn refusal(&self) -> LineError {
        let Reply { outcome, detail, .. } = &self.reply;
        let name = outcome.to_string().replace('_', " ");
        let next = match outcome {
            Outcome::Unsigned => ", by --key F.key",
            _ => "",
        };
        let who = format!("the bead at address {} refused: {name}", self.address);
        LineError::Refused(match detail.as_str().is_empty() {
            true => who,
            false => format!("{who}; {}{next}", detail.as_str()),
        })
    }
}

impl Conversation {
    /// Opens the line to the bead with an address, or to the only one there: [`ANY`]. `patience` is how long a
    /// reply may take.
    ///
    /// # Errors
    /// The port does not open.
    pub fn open(line: &Address, baud: u32, asked: u8, patience: Duration) -> Result<Self, LineError> {
        let port = line.open(baud)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            line: line.clone(),
            port,
            reader: Reader::default(),
            asked,
            replied: None,
            behind: VecDeque::new(),
            next: (since.subsec_micros() ^ process::id()) as u16,
            patience,
            key: None,
            identity: None,
            seen: Seen::default(),
        })
    }

    /// Signs what changes the bead's state with this key from now on, or nothing.
    pub fn sign_with(&mut self, key: Option<Key>) {
        self.key = key;
    }

    /// Whether this key is the bead's: asks it to do something that changes nothing, signed.
    ///
    /// # Errors
    /// The port goes away, or no reply comes.
    pub fn has_key(&mut self, key: &Key) -> Result<bool, LineError> {
        let answer = self.signed(&Request::Identity, key)?;
        Ok(answer.reply.outcome == Outcome::Done)
    }

    /// Sends a request and returns the bead's answer, done or refused.
    ///
    /// # Errors
    /// The port goes away, or no reply comes.
    pub fn request(&mut self, request: &Request) -> Result<Answer, LineError> {
        match self.key.clone().filter(|_| request.changes_state()) {
            Some(key) => self.signed(request, &key),
            None => self.ask(|_, _| request.clone()),
        }
    }

    /// Sends a signed request.
    fn signed(&mut self, request: &Request, key: &Key) -> Result<Answer, LineError> {
        /// A clock that runs slow, and a host that is busy.
        const MARGIN: Duration = Duration::from_secs(5);
        let mut answer = self.sign_and_ask(request, key, MARGIN)?;
        if matches!(answer.reply.outcome, Outcome::Replayed | Outcome::Late) {
            // Another host was faster, or the bead was reset meanwhile.
            self.identity = None;
            answer = self.sign_and_ask(request, key, MARGIN)?;
        }
        Ok(answer)
    }

    fn sign_and_ask(&mut self, request: &Request, key: &Key, margin: Duration) -> Result<Answer, LineError> {
        let identity = match &self.identity {
            Some(identity) => identity.clone(),
            None => {
                let answer = self.ask(|_, _| Request::Identity)?;
                let identity = answer.last("identity frame", |frame| match &frame.message {
                    Message::Identity(identity) => Some(identity.clone()),
                    _ => None,
                })?;
                self.identity.insert(identity).clone()
            }
        };
        let status = self.ask(|_, _| Request::Status)?;
        let (index, guard) = status.last("guard frame", |frame| match &frame.message {
            Message::Guard(guard) => Some((frame.header.sample_index, *guard)),
            _ => None,
        })?;
        let holds = self.patience * ATTEMPTS + margin;
        let scans = (holds.as_secs_f64() * f64::from(identity.sample_rate_hz)) as u64;
        let asked = self.asked;
        self.ask(|number, attempt| {
            let ticket = Ticket {
                counter: guard.counter.saturating_add(1 + u64::from(attempt)),
                boot: identity.boot,
                until: index.saturating_add(scans),
            };
            request.signed(key, &identity.uid, asked, number, ticket)
        })
    }

    /// Sends what `request` gives for its number and each attempt.
    fn ask(&mut self, request: impl Fn(u16, u32) -> Request) -> Result<Answer, LineError> {
        let number = self.next;
        self.next = self.next.wrapping_add(1);
        self.seen = Seen::default();
        let rejected = self.reader.counters().rejected.total();
        let mut frames = Vec::new();
        for attempt in 0..ATTEMPTS {
            let mut buffer = [0; MAX_REQUEST];
            let request = request(number, attempt);
            let bytes = encode_request(self.asked, number, &request, &mut buffer)
                .expect("MAX_REQUEST bytes always suffice");
            self.port
                .write(bytes)
                .map_err(|source| gone(format!("cannot send to {}", self.line), source))?;
            // A bead may get another address by what it is asked; the number of the request is its own all the same.
            let found = self.hear(self.patience, |frame| match &frame.message {
                Message::Reply(reply) if reply.request == number => {
                    Some((frame.header.address, reply.clone()))
                }
                _ => {
                    frames.push(frame);
                    None
                }
            })?;
            if let Some((address, reply)) = found {
                let asked = self.replied.replace(address).unwrap_or(self.asked);
                if self.asked != ANY {
                    self.asked = address;
                }
                frames.retain(|frame| [asked, address].contains(&frame.header.address));
                return Ok(Answer {
                    frames,
                    reply,
                    address,
                    collided: self.asked == ANY && self.reader.counters().rejected.total() > rejected,
                });
            }
        }
        Err(self.silence())
    }

    /// Sends a request and returns the bead's answer if the request was done.
    ///
    /// # Errors
    /// As [`request`](Self::request), and [`LineError::Refused`] with the bead's reason if it refuses.
    pub fn request_done(&mut self, request: &Request) -> Result<Answer, LineError> {
        let answer = self.request(request)?;
        match answer.reply.outcome {
            Outcome::Done => Ok(answer),
            _ => Err(answer.refusal()),
        }
    }

    /// Resets the bead, waits until it is back, and returns the number of its boot.
    ///
    /// # Errors
    /// As [`request_done`](Self::request_done), or it does not come back within 10 s.
    pub fn reboot(&mut self) -> Result<u32, LineError> {
        /// Erasing a sector takes four seconds; the rest is margin.
        const START: Duration = Duration::from_secs(10);
        self.request_done(&Request::Reboot)?;
        self.identity = None;
        let boot = self.listen(START, |frame| match &frame.message {
            // The first frame of a boot.
            Message::Identity(identity) if frame.header.sequence == 0 => Some(identity.boot),
            _ => None,
        })?;
        boot.ok_or_else(|| {
            LineError::Silent(format!(
                "the bead{} at {} said that it would reset, and did not come back within 10 s; is it powered?",
                self.addressed(),
                self.line
            ))
        })
    }

    /// Listens to the bead that replied last until `wanted` gives something, or for `patience`.
    ///
    /// # Errors
    /// The port has gone away.
    pub fn listen<T>(
        &mut self,
        patience: Duration,
        mut wanted: impl FnMut(Frame) -> Option<T>,
    ) -> Result<Option<T>, LineError> {
        let from = self.replied;
        self.hear(patience, |frame| {
            let its = from.is_none_or(|address| address == frame.header.address);
            its.then(|| wanted(frame)).flatten()
        })
    }

    /// Listens to every bead on the line until `wanted` gives something, or for `patience`.
    fn hear<T>(
        &mut self,
        patience: Duration,
        mut wanted: impl FnMut(Frame) -> Option<T>,
    ) -> Result<Option<T>, LineError> {
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
                .map_err(|source| gone(format!("{} went away", self.line), source))?;
            let (behind, seen, asked) = (&mut self.behind, &mut self.seen, self.asked);
            self.reader.feed(&buffer[..length], None, |item| {
                behind.extend(item.frame().inspect(|frame| seen.note(frame, asked)));
            });
        }
    }

    /// Why there is no reply, as far as the received bytes tell.
    fn silence(&self) -> LineError {
        let seconds = self.patience.as_secs_f64() * f64::from(ATTEMPTS);
        let why = self.seen.why(self.asked, self.reader.counters());
        LineError::Silent(format!(
            "no reply{} at {} within {seconds:.1} s; {why}",
            match self.addressed() {
                named if named.is_empty() => named,
                named => format!(" from the bead{named}"),
            },
            self.line
        ))
    }

    /// Which bead is asked, for a message.
    fn addressed(&self) -> String {
        match self.asked {
            ANY => String::new(),
            address => format!(" with address {address}"),
        }
    }
}

fn gone(what: String, source: io::Error) -> LineError {
    LineError::Gone { what, source }
}
