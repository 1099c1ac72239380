//! Requests to a bead, and its replies among all else that it sends.
//!
//! # Design
//! A request without a timely reply is sent again under the same number, as the line may lose request or
//! reply. Every request may be repeated (`docs/protocol.md`). The first number is arbitrary, so that a reply
//! to an earlier program is not taken for ours.
//!
//! Without an address, a request goes to every bead on the line. Then only one bead may be there: the
//! replies of several would collide. With an address, a request goes only to that bead, and the frames of
//! others are ignored.
//!
//! Behind a hub the replies of several beads do not collide. So before a request without an address changes
//! a bead's state, all frames received must come from one bead: the reply of one bead says nothing of the
//! others.
//!
//! With a key, requests that change the bead's state are signed. First the bead is asked for what a
//! signature needs: its device id, boot, sample index and counter. Each copy of a signed request has its own
//! counter, since the bead accepts each only once.

use std::collections::VecDeque;
use std::process;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bead_wire::{
    ANY, Arrival, Counters, Identity, Key, MAX_REQUEST, Message, Outcome, Reply, Request, Ticket,
    encode_request,
};

use crate::port::{Address, Port, PortError};
use crate::silence::Evidence;
use bead_recording::frames::{Frame, FrameReader};

/// Number of times that a request is sent before the bead counts as silent.
const ATTEMPTS: u32 = 3;
/// Time to wait for replies of other beads to the same request. A busy line delays a reply by 20 ms; a
/// network may delay it, too.
const OTHERS: Duration = Duration::from_millis(200);
/// Additional validity of a signed request, for a slow clock or a busy host.
const MARGIN: Duration = Duration::from_secs(5);

/// An error of a conversation. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The port does not open or goes away, or no whole answer comes.
    #[error("{0}")]
    Failed(String),
    /// The bead refused.
    #[error("{0}")]
    Refused(String),
    /// Several beads are on the line, and no address was given.
    #[error("{0}")]
    Several(String),
}

impl From<PortError> for LineError {
    fn from(error: PortError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// A line for requests to a bead.
pub struct Conversation {
    line: Address,
    port: Port,
    reader: FrameReader,
    /// Address for requests, or [`ANY`].
    asked: u8,
    replied: Option<u8>,
    /// Frames that came after the last wanted one.
    behind: VecDeque<Frame>,
    next: u16,
    patience: Duration,
    key: Option<Key>,
    identity: Option<Identity>,
    evidence: Evidence,
}

/// The answer of a bead.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Frames of the bead after the first copy of the request, without the reply.
    pub frames: Vec<Frame>,
    /// The reply.
    pub reply: Reply,
    /// The address of the bead that replied.
    pub address: u8,
    /// True if a frame of the bead was lost before one of `frames` or before the reply. Losses before the
    /// first frame of a conversation are unknown.
    pub lost: bool,
    /// Number of times that the request was sent until the reply came.
    pub attempts: u32,
    /// True if the request had no address, and damaged bytes came: replies of several beads collide.
    collided: bool,
}

impl Answer {
    /// The last frame for which `wanted` returns `Some`.
    ///
    /// # Errors
    /// There is no such frame: it was lost.
    pub fn last<T>(&self, what: &str, wanted: impl Fn(&Frame) -> Option<T>) -> Result<T, LineError> {
        self.frames.iter().rev().find_map(wanted).ok_or_else(|| {
            let next = if self.collided {
                "ask again; if several beads share the line, name one of them with --address N"
            } else {
                "ask again"
            };
            LineError::Failed(format!(
                "the bead at address {} replied, but its {what} was lost on the way; {next}",
                self.address
            ))
        })
    }

    /// The refusal, with its reason.
    pub fn refusal(&self) -> LineError {
        refusal(&self.reply, self.address)
    }
}

/// The refusal of a request by the bead with this address.
fn refusal(Reply { outcome, detail, .. }: &Reply, address: u8) -> LineError {
    let name = outcome.to_string().replace('_', " ");
    let next = match outcome {
        Outcome::Unsigned => ", by --key F.key",
        _ => "",
    };
    let who = format!("the bead at address {address} refused: {name}");
    LineError::Refused(if detail.as_str().is_empty() {
        who
    } else {
        format!("{who}; {}{next}", detail.as_str())
    })
}

/// Signs requests to one bead, each copy with its own counter.
pub(crate) struct Signer {
    key: Key,
    uid: [u8; 12],
    ticket: Ticket,
}

impl Signer {
    fn sign(&mut self, request: &Request, asked: u8, number: u16) -> Request {
        self.ticket.counter = self.ticket.counter.saturating_add(1);
        request.signed(&self.key, &self.uid, asked, number, self.ticket)
    }
}

/// The bytes of a request to the bead with this address.
pub fn encoded(address: u8, number: u16, request: &Request) -> Vec<u8> {
    let mut buffer = [0; MAX_REQUEST];
    let bytes = encode_request(address, number, request, &mut buffer);
    bytes.expect("MAX_REQUEST bytes always suffice").to_vec()
}

impl Conversation {
    /// Opens the line to the bead with an address, or to the only one there: [`ANY`]. `patience` is how long
    /// a reply may take.
    ///
    /// # Errors
    /// The port does not open.
    pub fn open(line: &Address, baud: u32, asked: u8, patience: Duration) -> Result<Self, LineError> {
        let port = line.open(baud)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            line: line.clone(),
            port,
            reader: FrameReader::default(),
            asked,
            replied: None,
            behind: VecDeque::new(),
            next: (since.subsec_micros() ^ process::id()) as u16,
            patience,
            key: None,
            identity: None,
            evidence: Evidence::default(),
        })
    }

    /// Counts of frames received, refused and lost, of all that came over the line.
    pub fn counters(&self) -> &Counters {
        self.reader.counters()
    }

    /// From now on, signs requests that change the bead's state with this key; `None` signs nothing.
    pub fn sign_with(&mut self, key: Option<Key>) {
        self.key = key;
    }

    /// Sends a signed request that changes nothing. Returns true if this is the bead's key.
    ///
    /// # Errors
    /// The port goes away, no reply comes, the bead refuses for another reason than the key, or it refuses
    /// the key while several beads are on the line and no address was given.
    pub fn has_key(&mut self, key: &Key) -> Result<bool, LineError> {
        let answer = self.signed(&Request::Identity, key)?;
        match answer.reply.outcome {
            Outcome::Done => Ok(true),
            // The bead has another key or none, or its firmware has no keys.
            Outcome::Forged | Outcome::NoKey | Outcome::Kind | Outcome::Version => {
                self.is_alone().map(|()| false)
            }
            _ => Err(answer.refusal()),
        }
    }

    /// Sends a request and returns the bead's answer, done or refused.
    ///
    /// # Errors
    /// The port goes away, no reply comes, or the request changes state, several beads are on the line, and
    /// no address was given.
    pub fn request(&mut self, request: &Request) -> Result<Answer, LineError> {
        match self.key.clone().filter(|_| request.changes_state()) {
            Some(key) => self.signed(request, &key),
            None => self.ask(request, None),
        }
    }

    fn signed(&mut self, request: &Request, key: &Key) -> Result<Answer, LineError> {
        let mut answer = self.sign_and_ask(request, key)?;
        if matches!(answer.reply.outcome, Outcome::Replayed | Outcome::Late) {
            // Another host was faster, or the bead was reset meanwhile.
            self.identity = None;
            answer = self.sign_and_ask(request, key)?;
        }
        Ok(answer)
    }

    fn sign_and_ask(&mut self, request: &Request, key: &Key) -> Result<Answer, LineError> {
        let signer = self.signer(key, self.patience * ATTEMPTS + MARGIN)?;
        self.ask(request, Some(signer))
    }

    /// A signer of requests that are valid for a time. The bead is asked for what a signature needs.
    pub(crate) fn signer(&mut self, key: &Key, holds: Duration) -> Result<Signer, LineError> {
        let identity = match &self.identity {
            Some(identity) => identity.clone(),
            None => {
                let answer = self.ask(&Request::Identity, None)?;
                let identity = answer.last("identity frame", |frame| match &frame.message {
                    Message::Identity(identity) => Some(identity.clone()),
                    _ => None,
                })?;
                self.identity.insert(identity).clone()
            }
        };
        let status = self.ask(&Request::Status, None)?;
        let (index, guard) = status.last("guard frame", |frame| match &frame.message {
            Message::Guard(guard) => Some((frame.header.sample_index, *guard)),
            _ => None,
        })?;
        let scans = (holds.as_secs_f64() * f64::from(identity.sample_rate_hz)) as u64;
        Ok(Signer {
            key: key.clone(),
            uid: identity.uid,
            ticket: Ticket {
                counter: guard.counter,
                boot: identity.boot,
                until: index.saturating_add(scans),
            },
        })
    }

    /// Sends a request until a reply comes, signed if there is a signer.
    fn ask(&mut self, request: &Request, mut signer: Option<Signer>) -> Result<Answer, LineError> {
        let asked = self.asked;
        // These may give the bead another address, from which it replies. The number still identifies the
        // request.
        let moves = matches!(request, Request::WriteSettings { .. } | Request::EraseSettings);
        if request.changes_state() && asked == ANY && self.replied.is_some() {
            self.hear(OTHERS, |_| None::<()>)?;
            self.is_alone()?;
        }
        let number = self.next_number();
        self.evidence.begin();
        let rejected = self.reader.counters().rejected.total();
        let mut frames = Vec::new();
        for attempt in 0..ATTEMPTS {
            self.send(number, request, signer.as_mut())?;
            let found = self.hear(self.patience, |frame| {
                let is_asked = asked == ANY || moves || frame.header.address == asked;
                match &frame.message {
                    _ if !is_asked => None,
                    Message::Reply(reply) if reply.request == number => {
                        Some((frame.header.address, frame.arrival, reply.clone()))
                    }
                    _ => {
                        frames.push(frame);
                        None
                    }
                }
            })?;
            if let Some((address, arrival, reply)) = found {
                self.replied = Some(address);
                if asked != ANY {
                    self.asked = address;
                }
                if moves {
                    // Frames with the previous address are not another bead's.
                    self.evidence.note_alone(address);
                }
                frames.retain(|frame| frame.header.address == address);
                let mut arrivals = frames.iter().map(|frame| frame.arrival).chain([arrival]);
                return Ok(Answer {
                    lost: arrivals.any(|arrival| {
                        matches!(arrival, Arrival::Next { lost: 1.. } | Arrival::Restart { .. })
                    }),
                    frames,
                    reply,
                    address,
                    attempts: attempt + 1,
                    collided: asked == ANY && self.reader.counters().rejected.total() > rejected,
                });
            }
        }
        Err(self.silence())
    }

    /// Returns an error if no address was given and frames of several beads came.
    fn is_alone(&self) -> Result<(), LineError> {
        match self.evidence.several().filter(|_| self.asked == ANY) {
            Some(beads) => Err(LineError::Several(format!(
                "beads at the addresses {beads} are at {}, and this request is for one bead: name it with \
                 --address N",
                self.line
            ))),
            None => Ok(()),
        }
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

    /// Time that a reply may take.
    pub(crate) fn patience(&self) -> Duration {
        self.patience
    }

    /// The key that signs.
    pub(crate) fn key(&self) -> Option<Key> {
        self.key.clone()
    }

    /// The number of the next request.
    pub(crate) fn next_number(&mut self) -> u16 {
        let number = self.next;
        self.next = self.next.wrapping_add(1);
        number
    }

    /// Sends a copy of a request, signed if there is a signer.
    pub(crate) fn send(
        &mut self,
        number: u16,
        request: &Request,
        signer: Option<&mut Signer>,
    ) -> Result<(), LineError> {
        let signed = signer.map(|signer| signer.sign(request, self.asked, number));
        let bytes = encoded(self.asked, number, signed.as_ref().unwrap_or(request));
        let sent = self.port.write(&bytes);
        sent.map_err(|source| LineError::Failed(format!("cannot send to {}: {source}", self.line)))
    }

    /// Lets `talk` wait longer for replies.
    pub(crate) fn with_patience<T>(&mut self, patience: Duration, talk: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.patience;
        self.patience = patience.max(before);
        let said = talk(self);
        self.patience = before;
        said
    }

    /// Forgets the bead's identity, which a reset changes.
    pub(crate) fn forget_identity(&mut self) {
        self.identity = None;
    }

    /// The refusal of a request, with its reason.
    pub(crate) fn refused(&self, reply: &Reply) -> LineError {
        refusal(reply, self.replied.unwrap_or(self.asked))
    }

    /// Waits up to 10 s for the first frame of a boot, and returns its number.
    pub(crate) fn await_boot(&mut self) -> Result<Option<u32>, LineError> {
        /// Erasing a sector takes four seconds; the rest is margin.
        const START: Duration = Duration::from_secs(10);
        self.forget_identity();
        self.listen(START, |frame| match &frame.message {
            // The first frame of a boot.
            Message::Identity(identity) if frame.header.sequence == 0 => Some(identity.boot),
            _ => None,
        })
    }

    /// Resets the bead, waits until it is back, and returns the number of its boot.
    ///
    /// # Errors
    /// As [`request_done`](Self::request_done), or it does not come back within 10 s.
    pub fn reboot(&mut self) -> Result<u32, LineError> {
        self.request_done(&Request::Reboot)?;
        let boot = self.await_boot()?;
        boot.ok_or_else(|| {
            LineError::Failed(format!(
                "the bead{} at {} announced its reset, but did not come back within 10 s; is it powered?",
                self.addressed(),
                self.line
            ))
        })
    }

    /// Listens to the bead that replied last until `wanted` returns `Some`, or for `patience`.
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

    /// Listens to every bead on the line until `wanted` returns `Some`, or for `patience`.
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
                .map_err(|source| LineError::Failed(format!("{} went away: {source}", self.line)))?;
            let (behind, evidence, asked) = (&mut self.behind, &mut self.evidence, self.asked);
            self.reader.feed(&buffer[..length], None, |item| {
                behind.extend(item.frame().inspect(|frame| evidence.note(frame, asked)));
            });
        }
    }

    /// The error for a missing reply, with its reason as far as the received bytes show it.
    fn silence(&self) -> LineError {
        let seconds = self.patience.as_secs_f64() * f64::from(ATTEMPTS);
        let why = self.evidence.explain(self.asked, self.reader.counters());
        LineError::Failed(format!(
            "no reply{} at {} within {seconds:.1} s; {why}",
            match self.addressed() {
                named if named.is_empty() => named,
                named => format!(" from the bead{named}"),
            },
            self.line
        ))
    }

    fn addressed(&self) -> String {
        match self.asked {
            ANY => String::new(),
            address => format!(" with address {address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::os::unix::net::UnixListener;
    use std::sync::Mutex;
    use std::thread;

    use super::*;
    use bead_testing::Speaker;
    use bead_wire::ReceivedRequest;

    /// Longer than a busy computer takes.
    const LONG: Duration = Duration::from_secs(20);

    /// Lets `talk` converse with beads on a line. `answer` makes them answer each request.
    fn talk<T>(
        asked: u8,
        patience: Duration,
        mut answer: impl FnMut(&mut Speaker, &ReceivedRequest) + Send,
        talk: impl FnOnce(&mut Conversation) -> T,
    ) -> T {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("line.sock");
        let listener = UnixListener::bind(&path).unwrap();
        thread::scope(|scope| {
            scope.spawn(move || {
                let (mut stream, _) = listener.accept().unwrap();
                let (mut beads, mut buffer) = (Speaker::default(), [0; 4096]);
                while let Ok(length @ 1..) = stream.read(&mut buffer) {
                    // A program that hung up meanwhile reads no more.
                    let _ = stream.write_all(&beads.answer(&buffer[..length], &mut answer));
                }
            });
            talk(&mut Conversation::open(&Address::Unix(path), 0, asked, patience).unwrap())
        })
    }

    /// Replies to a request from the bead with this address.
    fn reply(line: &mut Speaker, address: u8, heard: &ReceivedRequest, outcome: Outcome) {
        line.address = address;
        line.reply(heard.number, outcome);
    }

    #[test]
    fn a_reply_of_another_bead_is_not_the_one_that_was_asked_for() {
        let error = talk(
            3,
            Duration::from_millis(50),
            |line, heard| reply(line, 5, heard, Outcome::Done),
            |bead| bead.request(&Request::Arm).unwrap_err(),
        );
        assert!(error.to_string().contains("no reply"), "{error}");
    }

    #[test]
    fn the_state_of_several_beads_is_not_changed_by_what_one_of_them_told() {
        let asked = Mutex::new(Vec::new());
        let error = talk(
            ANY,
            LONG,
            |line, heard| {
                asked.lock().unwrap().push(heard.request.clone().unwrap());
                for address in [3, 5] {
                    reply(line, address, heard, Outcome::Done);
                }
            },
            |bead| {
                assert_eq!(bead.request(&Request::ReadSettings).unwrap().address, 3);
                bead.request(&Request::EraseSettings).unwrap_err()
            },
        );
        assert!(error.to_string().contains("at the addresses 3, 5 are"), "{error}");
        assert_eq!(*asked.lock().unwrap(), [Request::ReadSettings]);
    }

    #[test]
    fn a_bead_without_the_key_among_others_does_not_say_that_none_has_it() {
        let error = talk(
            ANY,
            LONG,
            |line, heard| {
                let is_signed = matches!(heard.request, Ok(Request::Signed { .. }));
                let outcome = if is_signed { Outcome::Forged } else { Outcome::Done };
                for address in [5, 3] {
                    line.address = address;
                    line.say(0, line.identity());
                    line.say(0, bead_wire::Guard::default());
                    reply(line, address, heard, outcome);
                }
            },
            |bead| bead.has_key(&Key::new([7; 16]).unwrap()).unwrap_err(),
        );
        assert!(error.to_string().contains("at the addresses 3, 5 are"), "{error}");
    }
}
