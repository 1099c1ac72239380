//! The requests of a host, and what the bead does for each.
//!
//! # Design
//! One request is done at a time, at the lowest priority. The frames that it asks for are queued first, then
//! the reply. A request waits until the outbox has room, so a host that sends requests without end cannot
//! take the room that strikes need. A reply other than *done* means that nothing has changed. Every request
//! may be repeated.

use bead_store::{Pace, Secret, StoreError};
use bead_wire::{
    AHEAD, ANY, Cause, Detail, Heard, KEY, Key, Lock, Moment, Outcome, Reply, Request, Standing,
};
use cortex_m::peripheral::SCB;
use embassy_time::{Duration, Instant, Timer};

use crate::keep::{self, Again, Sent};
use crate::sample_clock::SAMPLE_RATE_HZ;
use crate::settings::{self, Loaded, Refusal};
use crate::storage;
use crate::trace::{self, Boot};
use crate::{counters, estimate, load, outbox, raw, report, self_test, supply};

/// Longest wait for the frames that are queued when the host asks for a reboot.
const DRAIN: Duration = Duration::from_millis(500);

/// A strike is sent again within this time, or not: other requests wait meanwhile.
const FETCH: Duration = Duration::from_millis(500);

/// Scans of a minute: a window that is asked for comes within it.
const MINUTE: u64 = 60 * SAMPLE_RATE_HZ as u64;

/// Counters of signed requests that one write to flash covers.
const COUNTERS: u64 = 64;

/// The parts of the bead that commands act on.
pub(crate) struct Commands {
    pub(crate) boot: &'static Boot,
    pub(crate) store: storage::SettingsStore,
    /// Of the writes to it.
    pub(crate) pace: Pace,
    /// The lock that admits requests.
    pub(crate) lock: Lock,
    /// Room for the window of a self-test.
    pub(crate) window: &'static mut bead_model::WindowRecord,
}

/// The lock with the key that flash holds.
pub(crate) fn lock(store: &storage::SettingsStore) -> Lock {
    let secret = store.secret();
    let key = secret.and_then(|secret| Key::new(secret.key));
    let counter = secret.map_or(0, |secret| secret.counter);
    counters::update_guard(|guard| {
        guard.keyed = key.is_some();
        guard.counter = counter;
    });
    Lock::new(embassy_stm32::uid::uid(), key, counter)
}

/// The outcome of a request, and a line about it.
struct Answer(Outcome, Detail);

impl Answer {
    fn done() -> Self {
        Self(Outcome::Done, Detail::default())
    }
}

/// The remaining step of a request that was begun. It is small, because the waiting task keeps it.
enum Step {
    /// Its answer.
    Answer(Answer),
    /// Settings were offered. Once they are in force, the answer has this line.
    InForce(&'static str),
    SelfTest,
    /// A strike is to be sent again.
    Fetch(Again),
    Reboot,
}

impl Commands {
    /// Does what a request asks for, and replies. Requests for other beads get no reply.
    pub(crate) async fn answer(&mut self, heard: Heard) {
        if heard.address != ANY && heard.address != outbox::address() {
            return;
        }
        outbox::calm().await;
        let number = heard.number;
        let answer = match self.begin(heard) {
            Step::Answer(answer) => answer,
            Step::InForce(line) => {
                if settings::taken().await {
                    Answer(Outcome::Done, line.into())
                } else {
                    Answer(Outcome::Done, "stored; in force as soon as samples come".into())
                }
            }
            Step::SelfTest => {
                let (failed, checks) = self_test::run(&mut self.store, self.window).await;
                let passed = checks - failed;
                Answer(
                    Outcome::Done,
                    Detail::new(format_args!("{passed} of {checks} checks passed")),
                )
            }
            Step::Fetch(again) => fetch(again).await,
            Step::Reboot => {
                reply(number, Answer::done());
                reboot().await
            }
        };
        reply(number, answer);
    }

    /// Does what a request asks for, as far as nothing has to be waited for.
    fn begin(&mut self, heard: Heard) -> Step {
        let done = heard
            .request
            .map_err(not_understood)
            .and_then(|request| self.admit(heard.address, heard.number, request))
            .and_then(|request| self.execute(request));
        done.unwrap_or_else(Step::Answer)
    }

    /// Lets a request through that changes nothing, or that is signed if the bead has a key.
    ///
    /// A counter must not be used again after a power cut, so flash keeps one that is not below it:
    /// [`COUNTERS`] ahead, which saves writes. If flash cannot keep it, because it is full, the supply low or
    /// too much was written lately, what does not write flash itself is done all the same: a bead can always
    /// be disarmed and reset by its owner.
    fn admit(&mut self, address: u8, number: u16, request: Request) -> Result<Request, Answer> {
        if self.store.is_unreadable() && request.changes_state() {
            return without_owner(request);
        }
        let signed = matches!(request, Request::Signed { .. });
        let now = Moment {
            boot: self.boot.number,
            index: counters::snapshot().newest_index,
        };
        let request = match self.lock.admit(address, number, request, now) {
            Ok(request) => request,
            Err(outcome) => return Err(self.not_let_through(outcome)),
        };
        if !signed {
            return Ok(request);
        }
        let counter = self.lock.counter();
        counters::update_guard(|guard| {
            guard.signed += 1;
            guard.counter = counter;
        });
        if let Some(secret) = self.store.secret().filter(|secret| counter > secret.counter) {
            let ahead = Secret {
                counter: counter.saturating_add(COUNTERS),
                ..secret
            };
            let kept = self.write(|store| store.keep(Some(ahead)));
            let writes = matches!(
                request,
                Request::WriteSettings { .. } | Request::EraseSettings | Request::SetKey { .. }
            );
            if writes {
                kept?;
            }
        }
        Ok(request)
    }

    fn not_let_through(&self, outcome: Outcome) -> Answer {
        counters::update_guard(|guard| match outcome {
            Outcome::Unsigned => guard.refused_unsigned += 1,
            Outcome::Forged => guard.refused_forged += 1,
            Outcome::Replayed => guard.refused_replayed += 1,
            Outcome::Late => guard.refused_late += 1,
            _ => {}
        });
        let detail = match outcome {
            Outcome::Unsigned => "this bead has a key: sign the request with it".into(),
            Outcome::Forged => "signed with another key, for another bead, or changed on the way".into(),
            Outcome::Replayed => Detail::new(format_args!(
                "the last counter was {}; the next is above it by {AHEAD} at most",
                self.lock.counter()
            )),
            Outcome::Late => "signed for another boot, or its last sample is over".into(),
            Outcome::NoKey => "this bead has no key".into(),
            _ => "it carries no request".into(),
        };
        Answer(outcome, detail)
    }

    /// Keeps another key, or none.
    fn set_key(&mut self, bytes: [u8; KEY]) -> Result<(), Answer> {
        let key = Key::new(bytes);
        let counter = self.store.secret().map_or(0, |secret| secret.counter);
        let secret = key.as_ref().map(|key| Secret {
            key: *key.bytes(),
            counter: counter.max(self.lock.counter()),
        });
        self.write(|store| store.keep(secret))?;
        counters::update_guard(|guard| guard.keyed = key.is_some());
        self.lock.set(key);
        Ok(())
    }

    fn execute(&mut self, request: Request) -> Result<Step, Answer> {
        match request {
            Request::Identity => report::tell_identity(self.boot),
            Request::Status => {
                report::tell_status();
                load::tell();
            }
            Request::ReadSettings => settings::tell(),
            Request::WriteSettings { block } => return self.write_settings(block.bytes()),
            Request::EraseSettings => return self.erase_settings(),
            Request::Arm => estimate::arm(true),
            Request::Disarm => estimate::arm(false),
            Request::SelfTest => return Ok(Step::SelfTest),
            Request::Raw { duration_ms } => {
                if duration_ms > raw::MAX_MS {
                    return Err(Answer(
                        Outcome::OutOfRange,
                        Detail::new(format_args!("a raw stream lasts {} ms at most", raw::MAX_MS)),
                    ));
                }
                raw::start(duration_ms);
                if duration_ms == 0 {
                    report::tell_link();
                }
            }
            Request::ResetCounters => counters::reset(),
            Request::SetKey { key } => self.set_key(key)?,
            Request::ListKept => {
                let kept = keep::tell();
                let detail = Detail::new(format_args!("{kept} strikes are kept"));
                return Ok(Step::Answer(Answer(Outcome::Done, detail)));
            }
            Request::Fetch { boot, strike } => {
                return keep::find(boot, strike).map(Step::Fetch).ok_or_else(not_kept);
            }
            Request::Keep { index } => {
                let now = counters::snapshot();
                if now.health.standing.has(Standing::CRYSTAL_FAILED) {
                    return Err(Answer(
                        Outcome::OutOfRange,
                        "no scan comes: the crystal does not run".into(),
                    ));
                }
                let ahead = index.saturating_sub(now.newest_index);
                if !(1..=MINUTE).contains(&ahead) {
                    return Err(Answer(
                        Outcome::OutOfRange,
                        "its scan has to come within a minute from now".into(),
                    ));
                }
                estimate::keep_around(index);
            }
            // None is left: the lock has taken out what it carries.
            Request::Signed { .. } => return Err(not_understood(Cause::Body)),
            Request::Reboot => return Ok(Step::Reboot),
        }
        Ok(Step::Answer(Answer::done()))
    }

    /// Checks new settings, stores them, reads them back and offers them.
    fn write_settings(&mut self, block: &[u8]) -> Result<Step, Answer> {
        let loaded = settings::judge(block).map_err(|refusal| match refusal {
            Refusal::Invalid(why) => Answer(Outcome::SettingsInvalid, why),
            Refusal::SampleRate(why) => Answer(Outcome::SampleRate, why),
        })?;
        self.write(|store| store.write(block))?;
        offer(loaded);
        Ok(Step::InForce(""))
    }

    /// Erases the stored settings and offers the next ones. The reply says where those come from.
    fn erase_settings(&mut self) -> Result<Step, Answer> {
        self.write(storage::SettingsStore::clear)?;
        let loaded = settings::beneath(None);
        let origin = loaded.origin();
        offer(loaded);
        Ok(Step::InForce(origin))
    }

    /// Writes to the store, if it may be written now. Flash that is written while the supply is low may keep
    /// something else.
    fn write(
        &mut self,
        change: impl FnOnce(&mut storage::SettingsStore) -> Result<(), StoreError>,
    ) -> Result<(), NotWritten> {
        if supply::is_low() {
            return Err(NotWritten::SupplyLow);
        }
        let written = self
            .pace
            .write(Instant::now().as_millis())
            .map_err(NotWritten::TooSoon)?;
        trace::keep_written(written);
        change(&mut self.store).map_err(NotWritten::Store)
    }
}

/// Why flash was not written.
enum NotWritten {
    SupplyLow,
    /// It may be after so many ms.
    TooSoon(u64),
    Store(StoreError),
}

/// The answer to a request that is refused for it.
impl From<NotWritten> for Answer {
    // Once in the image: an answer is long to build.
    #[inline(never)]
    fn from(why: NotWritten) -> Self {
        let line = match why {
            NotWritten::SupplyLow => {
                "the supply is below 2.93 V: nothing was written; try again when it is good"
            }
            NotWritten::TooSoon(wait_ms) => {
                counters::update_guard(|guard| guard.refused_too_soon += 1);
                let wait_s = wait_ms.div_ceil(1000);
                let why = format_args!("flash is written every 10 s in the long run; again in {wait_s} s");
                return Self(Outcome::TooSoon, Detail::new(why));
            }
            NotWritten::Store(StoreError::Full) => {
                let why = "no room in flash for another block; the next boot makes some";
                return Self(Outcome::StoreFull, why.into());
            }
            NotWritten::Store(StoreError::TooLong | StoreError::Flash) => {
                "what was written cannot be read back; the settings are what they were"
            }
        };
        Self(Outcome::FlashFailed, line.into())
    }
}

/// Offers settings to the estimators. A bead that its old settings kept from looking for strikes begins to,
/// and the other way round.
fn offer(loaded: Loaded) {
    let arm = loaded.arm();
    if arm != settings::arm() {
        estimate::arm(arm);
    }
    defmt::info!("settings: {=str}", loaded.origin());
    settings::offer(loaded);
}

fn reply(request: u16, Answer(outcome, detail): Answer) {
    outbox::tell(Reply {
        request,
        outcome,
        detail,
    });
}

fn not_understood(cause: Cause) -> Answer {
    let outcome = match cause {
        Cause::Version(_) => Outcome::Version,
        Cause::Kind(_) => Outcome::Kind,
        _ => Outcome::Body,
    };
    Answer(outcome, Detail::new(format_args!("{cause}")))
}

/// Sends a strike again, frame by frame, while there is room.
async fn fetch(mut again: Again) -> Answer {
    let deadline = Instant::now() + FETCH;
    loop {
        if !outbox::has_spare(deadline).await {
            return Answer(Outcome::Busy, "strikes come and take the line: ask again".into());
        }
        match again.push_next() {
            Sent::Some => {}
            Sent::All => return Answer::done(),
            Sent::Gone => return not_kept(),
        }
    }
}

fn not_kept() -> Answer {
    Answer(
        Outcome::NotKept,
        "this strike gave way to newer ones, was never measured, or is not yet complete".into(),
    )
}

/// While the store cannot be read, nobody knows whether there is a key. So a bead does what changes nothing,
/// and a reboot, which may bring the store back: signed or not, as there is nothing to check a signature
/// with.
fn without_owner(request: Request) -> Result<Request, Answer> {
    match request {
        Request::Reboot => Ok(request),
        Request::Signed { kind, .. } if kind == Request::Reboot.number() => Ok(Request::Reboot),
        _ if supply::is_low() => Err(NotWritten::SupplyLow.into()),
        _ => Err(Answer(
            Outcome::FlashFailed,
            "the store cannot be read, nor whether there is a key: reboot the bead".into(),
        )),
    }
}

/// Resets the bead when all frames that wait have left, or after [`DRAIN`].
async fn reboot() -> ! {
    // Or strikes would go on to fill the outbox.
    estimate::arm(false);
    let deadline = Instant::now() + DRAIN;
    while counters::snapshot().frames_waiting > 0 && Instant::now() < deadline {
        Timer::after(Duration::from_millis(1)).await;
    }
    // When the DMA is done, the last two bytes are still being sent: 10 µs.
    Timer::after(Duration::from_millis(1)).await;
    defmt::info!("reboot, as asked");
    SCB::sys_reset()
}
