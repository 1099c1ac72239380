//! The state of all beads that are monitored.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bead_line::recorder::RecorderObserver;
use bead_recording::assembly::{Assembly, Event};
use bead_recording::clock::Live;
use bead_recording::frames::{Frame, Item};
use bead_tables::printable::one_line;
use bead_wire::{Arrival, Body, Counters, Guard, Health, Identity, Message, Outcome, Reply, Status};
use schemars::JsonSchema;
use serde::Serialize;

use crate::strike::ShownStrike;

/// Number of strikes that are kept: some 4 MB with their samples.
pub const HISTORY: usize = 512;
/// Number of lines for people that are kept.
const MESSAGES: usize = 100;
/// Number of edges at a sync input that are kept for a bead: a strike may come that many edges late.
const EDGES: usize = 128;
/// Time after which a bead that sent nothing counts as silent. It sends its status every second.
const SILENT: Duration = Duration::from_secs(3);
/// Time-out of a reply.
const PATIENCE: Duration = Duration::from_secs(3);
/// Greatest half width of the interval of a clock's drift that is shown, ppm.
const DRIFT_KNOWN: f64 = 500.0;
/// Span over which the rate of bytes is measured.
const RATE_SPAN: Duration = Duration::from_secs(2);

/// A loss and its cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Loss {
    /// Its cause in words.
    pub cause: String,
    /// Number of frames, blocks or strikes that are lost.
    pub count: u64,
}

/// A bead as pages show it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct BeadView {
    /// Its address.
    pub bead: u8,
    /// The port or the file that it comes from.
    pub port: String,
    /// Time without a frame from it, s, if it counts as silent.
    pub silent_s: Option<u64>,
    /// Version and git description of its firmware.
    pub firmware: Option<String>,
    /// Number of its boot.
    pub boot: Option<u32>,
    /// Number of frames that came.
    pub frames: u64,
    /// Number of strikes that came.
    pub strikes: u64,
    /// True while it looks for strikes.
    pub armed: Option<bool>,
    /// Supply of its converter, V.
    pub supply_v: Option<f64>,
    /// Drift of its clock against this host's and the half width of its interval (95 %), ppm.
    pub clock_ppm: Option<[f64; 2]>,
    /// Faults that stand now, in words.
    pub standing: Vec<String>,
    /// The last fault that it reported.
    pub last_fault: Option<String>,
    /// Losses, by cause: those that there are.
    pub losses: Vec<Loss>,
}

/// A state of all beads, for one look.
#[derive(Clone, Debug, Serialize)]
pub struct MonitorView {
    /// The beads, by address.
    pub beads: Vec<BeadView>,
    /// Lines for people, the newest last.
    pub messages: Vec<String>,
    /// The recording.
    pub recording: String,
    /// Bytes a second.
    pub bytes_per_s: u64,
    /// Number of strikes so far.
    pub strikes: u64,
    /// Serial number of the newest strike.
    pub newest: u64,
}

#[derive(Default)]
pub(crate) struct BeadState {
    source: usize,
    heard: Option<Instant>,
    pub(crate) sample_index: u64,
    frames: u64,
    lost: u64,
    restarts: u64,
    strikes: u64,
    pub(crate) identity: Option<Identity>,
    status: Option<Status>,
    health: Option<Health>,
    pub(crate) guard: Option<Guard>,
    last_fault: Option<String>,
    /// Positions of the last edges at its sync input, in samples.
    edges: VecDeque<f64>,
}

/// The state of all beads.
pub struct Monitor {
    ports: Vec<String>,
    beads: BTreeMap<u8, BeadState>,
    /// Rejects of each port by cause.
    rejects: BTreeMap<(usize, String), u64>,
    assembly: Assembly,
    clocks: Live,
    strikes: VecDeque<Arc<ShownStrike>>,
    newest: u64,
    messages: VecDeque<String>,
    recording: String,
    file: Option<PathBuf>,
    bytes: u64,
    /// Time and count of bytes when the rate was measured last, and that rate in bytes a second.
    rate: (Instant, u64, u64),
    /// Requests that wait for their replies, by number: address, deed and time.
    asked: BTreeMap<u16, (u8, String, Instant)>,
    next_request: u16,
}

impl Monitor {
    /// A monitor of these ports, which has received nothing yet. `recording` names the recording for people.
    pub fn new(ports: Vec<String>, recording: String) -> Self {
        Self {
            ports: ports.iter().map(|port| one_line(port).into_owned()).collect(),
            beads: BTreeMap::new(),
            rejects: BTreeMap::new(),
            assembly: Assembly::default(),
            clocks: Live::default(),
            strikes: VecDeque::new(),
            newest: 0,
            messages: VecDeque::new(),
            recording: one_line(&recording).into_owned(),
            file: None,
            bytes: 0,
            rate: (Instant::now(), 0, 0),
            asked: BTreeMap::new(),
            // The numbers of the recorder's own requests begin elsewhere.
            next_request: 0xA000,
        }
    }

    /// Adds a line for people.
    pub fn tell(&mut self, line: &str) {
        if self.messages.len() == MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back(one_line(line).into_owned());
    }

    /// Names the recording after its file.
    pub fn record_to(&mut self, path: &Path) {
        self.recording = one_line(&path.display().to_string()).into_owned();
    }

    /// Names the file that a page may download.
    pub fn set_file(&mut self, file: &Path) {
        self.file = Some(file.to_owned());
    }

    /// The file that is being recorded.
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// Counts bytes that came.
    pub fn count_bytes(&mut self, bytes: u64) {
        self.bytes = bytes;
    }

    /// Takes the next frame or reject of the port with this index.
    pub fn push(&mut self, source: usize, item: &Item) {
        match item {
            Item::Frame(frame) => self.push_frame(source, frame),
            Item::Rejected(reject) => {
                let cause = format!("corrupt: {}", reject.cause);
                *self.rejects.entry((source, cause)).or_default() += 1;
            }
        }
    }

    fn push_frame(&mut self, source: usize, frame: &Frame) {
        let address = frame.header.address;
        let bead = self.beads.entry(address).or_default();
        (bead.source, bead.heard) = (source, Some(Instant::now()));
        match frame.arrival {
            Arrival::Duplicate => return,
            Arrival::First => {}
            Arrival::Next { lost } => bead.lost += u64::from(lost),
            Arrival::Late => bead.lost = bead.lost.saturating_sub(1),
            Arrival::Restart { lost } => {
                bead.lost += u64::from(lost);
                bead.restarts += 1;
                bead.edges.clear();
            }
        }
        bead.frames += 1;
        bead.sample_index = frame.header.sample_index;
        self.clocks.push(frame);
        match &frame.message {
            Message::Identity(identity) => bead.identity = Some(identity.clone()),
            Message::Status(status) => bead.status = Some(*status),
            Message::Health(health) => bead.health = Some(*health),
            Message::Guard(guard) => bead.guard = Some(*guard),
            Message::Sync(sync) => {
                if bead.edges.len() == EDGES {
                    bead.edges.pop_front();
                }
                bead.edges.push_back(sync.position());
            }
            Message::Fault(fault) => {
                let detail = one_line(fault.detail.as_str());
                let text = format!("{} {detail}", fault.cause).replace('_', " ");
                bead.last_fault = Some(text.trim_end().to_owned());
                let line = format!("bead {address}: fault in boot {}: {text}", fault.boot);
                self.tell(line.trim_end());
            }
            Message::Reply(reply) => self.push_reply(address, reply),
            _ => {}
        }
        for event in self.assembly.push(frame) {
            match event {
                Event::Restart(_) => self.tell(&format!("bead {address} restarted")),
                Event::Strike(strike) => {
                    // A fetched copy of a strike that is already here only adds samples.
                    let is_new = strike.fetched.is_none_or(|copy| !copy.before.result);
                    if is_new && let Some(bead) = self.beads.get_mut(&address) {
                        bead.strikes += 1;
                        self.newest += 1;
                        let strike = ShownStrike::new(self.newest, *strike, bead.edges.make_contiguous());
                        if self.strikes.len() == HISTORY {
                            self.strikes.pop_front();
                        }
                        self.strikes.push_back(Arc::new(strike));
                    }
                }
            }
        }
    }

    fn push_reply(&mut self, address: u8, reply: &Reply) {
        let Some((_, deed, _)) = self.asked.remove(&reply.request) else {
            return;
        };
        let line = match reply.outcome {
            Outcome::Done => format!("bead {address}: {deed}: done"),
            Outcome::Unsigned => format!("bead {address} refused ({deed}): it has a key; give --key F.key"),
            outcome => {
                let why = outcome.to_string().replace('_', " ");
                let detail = one_line(reply.detail.as_str());
                format!("bead {address} refused ({deed}): {why} {detail}")
            }
        };
        self.tell(line.trim_end());
    }

    /// Notes a request that is sent now, and returns its number.
    pub(crate) fn ask(&mut self, bead: u8, deed: &str) -> u16 {
        let number = self.next_request;
        self.next_request = number.checked_add(1).unwrap_or(0xA000);
        self.asked.insert(number, (bead, deed.to_owned(), Instant::now()));
        number
    }

    /// The last facts of a bead; `None` if no frame of it came.
    pub(crate) fn bead(&self, address: u8) -> Option<&BeadState> {
        self.beads.get(&address)
    }

    /// The strikes after the one with this serial number, the oldest first, and the number of those between
    /// that are no longer kept.
    pub fn strikes_after(&self, serial: u64) -> (Vec<Arc<ShownStrike>>, u64) {
        let first = self.strikes.front().map_or(self.newest + 1, |first| first.serial);
        let missed = first.saturating_sub(serial.saturating_add(1));
        let new = self.strikes.iter().filter(|strike| strike.serial > serial);
        (new.cloned().collect(), missed)
    }

    /// The strikes of a bead that are kept, the newest first.
    pub fn strikes_of(&self, bead: u8) -> Vec<Arc<ShownStrike>> {
        let of_bead = self.strikes.iter().rev().filter(|strike| strike.bead == bead);
        of_bead.cloned().collect()
    }

    /// The state now.
    pub fn view(&mut self) -> MonitorView {
        self.give_up_replies();
        let (since, before, _) = self.rate;
        if since.elapsed() >= RATE_SPAN {
            let rate = (self.bytes.saturating_sub(before) as f64 / since.elapsed().as_secs_f64()) as u64;
            self.rate = (Instant::now(), self.bytes, rate);
        }
        let clocks = self.clocks.segments().filter_map(|segment| {
            let fit = segment.fit().filter(|fit| fit.in_real_time())?;
            let within = fit.uncertainty_ppm.filter(|within| *within <= DRIFT_KNOWN)?;
            Some((segment.address, [fit.drift_ppm, within]))
        });
        let clocks: BTreeMap<u8, [f64; 2]> = clocks.collect();
        let beads = self.beads.iter().map(|(address, bead)| {
            let port = self.ports.get(bead.source).cloned().unwrap_or_default();
            let identity = bead.identity.as_ref();
            let firmware = identity.map(|identity| {
                let (firmware, git) = (identity.firmware.as_str(), identity.git.as_str());
                one_line(&format!("{firmware} {git}")).into_owned()
            });
            let silent = bead.heard.map(|heard| heard.elapsed());
            let health = bead.health.as_ref();
            let standing = health.map(|health| health.standing.names());
            BeadView {
                bead: *address,
                port,
                silent_s: silent
                    .filter(|silent| *silent >= SILENT)
                    .map(|silent| silent.as_secs()),
                firmware,
                boot: identity.map(|identity| identity.boot),
                frames: bead.frames,
                strikes: bead.strikes,
                armed: bead.status.map(|status| status.armed),
                supply_v: health
                    .map(|health| f64::from(health.supply_mv) * 1e-3)
                    .filter(|volts| *volts > 0.0),
                clock_ppm: clocks.get(address).copied(),
                standing: standing
                    .into_iter()
                    .flatten()
                    .map(|name| name.replace('_', " "))
                    .collect(),
                last_fault: bead.last_fault.clone(),
                losses: self.losses(bead),
            }
        });
        MonitorView {
            beads: beads.collect(),
            messages: self.messages.iter().cloned().collect(),
            recording: self.recording.clone(),
            bytes_per_s: self.rate.2,
            strikes: self.beads.values().map(|bead| bead.strikes).sum(),
            newest: self.newest,
        }
    }

    fn give_up_replies(&mut self) {
        let is_late = |_: &u16, asked: &mut (u8, String, Instant)| asked.2.elapsed() > PATIENCE;
        let late: Vec<_> = self.asked.extract_if(.., is_late).collect();
        for (_, (bead, deed, _)) in late {
            self.tell(&format!(
                "bead {bead} did not reply ({deed}): is its line wired both ways? Ask again"
            ));
        }
    }

    fn losses(&self, bead: &BeadState) -> Vec<Loss> {
        // The counts of a missing frame are zero.
        let status = bead.status.unwrap_or_else(|| Status::draw(&mut || 0));
        let (health, guard) = (bead.health.unwrap_or_default(), bead.guard.unwrap_or_default());
        let of_line = [("frames lost on the way", bead.lost), ("restarts", bead.restarts)];
        let of_bead = [
            ("frames dropped: queue full", status.frames_dropped_queue_full),
            ("frames dropped: too long", status.frames_dropped_too_long),
            ("frames lost by a reset", health.frames_lost_by_reset),
            ("converter overruns", status.overruns),
            ("blocks of samples lost", status.blocks_dropped),
            ("strikes cut", health.strikes_cut),
            ("strikes passed over", guard.strikes_passed_over),
            ("strikes in dead time", guard.strikes_in_dead_time),
        ];
        let of_bead = of_bead.map(|(cause, count)| (cause, count.into()));
        let known = of_line.into_iter().chain(of_bead);
        let known = known.map(|(cause, count)| (cause.to_owned(), count));
        let rejects = self
            .rejects
            .iter()
            .filter(|((source, _), _)| *source == bead.source);
        let rejects = rejects.map(|((_, cause), count)| (cause.clone(), *count));
        let all = known.chain(rejects).filter(|(_, count)| *count > 0);
        all.map(|(cause, count)| Loss { cause, count }).collect()
    }
}

/// A monitor that a recorder feeds and pages look at.
#[derive(Clone)]
pub struct SharedMonitor(Arc<Mutex<Monitor>>);

impl SharedMonitor {
    /// Shares a monitor.
    pub fn new(monitor: Monitor) -> Self {
        Self(Arc::new(Mutex::new(monitor)))
    }

    /// Locks the monitor; hold the lock only briefly. A panic of another thread leaves it usable: each
    /// change is whole.
    pub fn lock(&self) -> MutexGuard<'_, Monitor> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl RecorderObserver for SharedMonitor {
    fn item(&mut self, source: usize, item: &Item) {
        self.lock().push(source, item);
    }

    fn file(&mut self, partial: &Path) {
        self.lock().set_file(partial);
    }

    fn message(&mut self, _: &Frame, _: u64, _: bool) {}

    fn progress(&mut self, counters: &Counters, _: u64) {
        self.lock().count_bytes(counters.bytes);
    }
}
