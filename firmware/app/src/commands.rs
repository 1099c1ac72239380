//! The requests of a host, and what the bead does for each.
//!
//! # Design
//! One request is done at a time, at the lowest priority. The frames that it asks for are queued first, then
//! the reply. A request waits until the outbox has room, so a host that sends requests without end cannot
//! take the room that strikes need. A reply other than *done* means that nothing has changed. Every request
//! may be repeated.

use bead_model::WindowRecord;
use bead_store::{Pace, Secret, StoreError, Vault};
use bead_update::swap::Images;
use bead_wire::{
    AHEAD, ANY, Cause, Detail, KEY, Key, Lock, Moment, Outcome, ReceivedRequest, Reply, Request, UpdateStage,
};

use crate::answer::{Answer, done, supply_low};
use crate::bead::BeadState;
use crate::block::SAMPLE_RATE_HZ;
use crate::boot::ThisBoot;
use crate::device::{Device, MS};
use crate::keep::{Refetch, RefetchStep};
use crate::played::{self, Play};
use crate::self_test::Verdict;
use crate::settings::Loaded;
use crate::update::Updates;
use crate::{raw, self_test, settings};

/// Longest wait for the frames that are queued when the host asks for a reboot.
const DRAIN: u64 = 500 * MS;

/// Time limit for sending a strike again, since other requests wait meanwhile.
const FETCH: u64 = 500 * MS;

/// Time after the start at which an image on trial checks itself: the second in which a boot proves itself,
/// and a margin for the checks of sensors and supply.
const TRIAL: u64 = 1200 * MS;

/// Scans in a minute, within which the scan of a requested window has to come.
const MINUTE: u64 = 60 * SAMPLE_RATE_HZ as u64;

/// Counters of signed requests that one write to flash covers.
const COUNTERS: u64 = 64;

/// The commands of a bead, and the parts that only they act on.
pub struct Commands<D: Device> {
    bead: &'static BeadState<D>,
    boot: &'static ThisBoot,
    store: Vault<D::Flash>,
    /// Pace of the writes to `store`.
    pace: Pace,
    /// The lock that admits requests.
    lock: Lock,
    /// Room for the window of a self-test.
    window: &'static mut WindowRecord,
    updates: Updates<D::ImageFlash>,
}

/// The remaining step of a request that was begun. It is small, because the waiting task keeps it.
enum RequestStep {
    /// Its answer.
    Reply(Answer),
    /// Settings were offered. The answer follows once they are in force, with this line.
    InForce(&'static str),
    SelfTest,
    /// A strike is to be sent again.
    Fetch(Refetch),
    Image,
    Play(Play),
    Reboot,
    Hang,
}

impl<D: Device> Commands<D> {
    /// Commands with the key that `store` holds.
    pub fn new(
        bead: &'static BeadState<D>,
        boot: &'static ThisBoot,
        store: Vault<D::Flash>,
        window: &'static mut WindowRecord,
        images: Images<D::ImageFlash>,
    ) -> Self {
        let secret = store.secret();
        let key = secret.and_then(|secret| Key::new(secret.key));
        let counter = secret.map_or(0, |secret| secret.counter);
        bead.guard.update(|guard| {
            guard.keyed = key.is_some();
            guard.counter = counter;
        });
        Self {
            bead,
            boot,
            store,
            pace: Pace::new(boot.settings_written),
            lock: Lock::new(bead.device.uid(), key, counter),
            window,
            updates: Updates::new(images),
        }
    }

    /// Does what a request asks for, and replies. Requests for other beads get no reply.
    pub async fn answer(&mut self, heard: ReceivedRequest) {
        let bead = self.bead;
        if heard.address != ANY && heard.address != bead.outbox.address() {
            return;
        }
        bead.wait_for_room().await;
        let number = heard.number;
        let answer = match self.begin(heard) {
            RequestStep::Reply(answer) => answer,
            RequestStep::InForce(line) => {
                let taken = bead.settings_taken().await;
                let later = "stored; in force as soon as samples come";
                (Outcome::Done, if taken { line } else { later }.into())
            }
            RequestStep::SelfTest => {
                let Verdict { failed, checks, .. } = self_test::run(bead, &mut self.store, self.window).await;
                let passed = checks - failed;
                (
                    Outcome::Done,
                    Detail::new(format_args!("{passed} of {checks} checks passed")),
                )
            }
            RequestStep::Fetch(refetch) => fetch(bead, refetch).await,
            RequestStep::Image => {
                played::send_image(bead).await;
                done()
            }
            RequestStep::Play(play) => {
                play.carry_out(bead).await;
                done()
            }
            RequestStep::Reboot => {
                reply(bead, number, done());
                reboot(bead).await
            }
            RequestStep::Hang => {
                reply(bead, number, done());
                drain(bead).await;
                bead.device.hang()
            }
        };
        reply(bead, number, answer);
    }

    /// Ends an update without recent requests: a bead that waits for an image resets, and measures again.
    /// Called every second.
    pub async fn end_idle_update(&mut self) {
        if self.updates.is_idle(&self.bead.device) {
            reboot(self.bead).await
        }
    }

    /// Checks the image if it is on trial, and confirms it or gives it up; a reset follows.
    ///
    /// # Panics
    /// The image failed its self-test: the loader returns to the previous image, which sends the message.
    pub async fn end_trial(&mut self) {
        let device = &self.bead.device;
        if device.update_stage() != UpdateStage::OnTrial {
            return;
        }
        device.sleep(TRIAL).await;
        let verdict = self_test::run(self.bead, &mut self.store, self.window).await;
        if let Some(check) = verdict.image_failed {
            panic!("the image on trial failed its self-test: {check}");
        }
        // Flash written at a low supply may read back differently.
        while device.supply_is_low() {
            device.sleep(MS).await;
        }
        self.updates.confirm();
        reboot(self.bead).await
    }

    /// Carries out a request as far as that needs no waiting.
    fn begin(&mut self, heard: ReceivedRequest) -> RequestStep {
        let done = heard
            .request
            .map_err(not_understood)
            .and_then(|request| self.admit(heard.address, heard.number, request))
            .and_then(|request| self.execute(request));
        if let Err((Outcome::TooSoon, _)) = &done {
            self.bead.guard.update(|guard| guard.refused_too_soon += 1);
        }
        done.unwrap_or_else(RequestStep::Reply)
    }

    /// Admits a request that changes nothing, or that is signed if the bead has a key.
    ///
    /// A counter must not be used again after a power cut, so flash holds one at least as high: [`COUNTERS`]
    /// ahead, which saves writes. If flash cannot be written, because it is full, the supply is low or too
    /// much was written lately, requests that do not write flash themselves are carried out all the same: the
    /// owner can always disarm and reset the bead.
    fn admit(&mut self, address: u8, number: u16, request: Request) -> Result<Request, Answer> {
        if self.store.is_unreadable() && request.changes_state() {
            return self.admit_without_store(request);
        }
        let signed = matches!(request, Request::Signed { .. });
        let now = Moment {
            boot: self.boot.number,
            index: self.bead.snapshot().newest_index,
        };
        let request = match self.lock.admit(address, number, request, now) {
            Ok(request) => request,
            Err(outcome) => return Err(self.not_let_through(outcome)),
        };
        if !signed {
            return Ok(request);
        }
        let counter = self.lock.counter();
        self.bead.guard.update(|guard| {
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
        self.bead.guard.update(|guard| match outcome {
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
                "the last counter was {}; the next may exceed it by at most {AHEAD}",
                self.lock.counter()
            )),
            Outcome::Late => "signed for another boot, or its last sample has passed".into(),
            Outcome::NoKey => "this bead has no key".into(),
            _ => "the signed frame holds no request".into(),
        };
        (outcome, detail)
    }

    /// Stores another key, or removes it.
    fn set_key(&mut self, bytes: [u8; KEY]) -> Result<(), Answer> {
        let key = Key::new(bytes);
        let counter = self.store.secret().map_or(0, |secret| secret.counter);
        let secret = key.as_ref().map(|key| Secret {
            key: *key.bytes(),
            counter: counter.max(self.lock.counter()),
        });
        self.write(|store| store.keep(secret))?;
        self.bead.guard.update(|guard| guard.keyed = key.is_some());
        self.lock.set(key);
        Ok(())
    }

    fn execute(&mut self, request: Request) -> Result<RequestStep, Answer> {
        match request {
            Request::Identity => self.bead.send_identity(self.boot),
            Request::Status => {
                self.bead.send_status();
                self.bead.send_load();
            }
            Request::ReadSettings => self.bead.send_settings(),
            Request::WriteSettings { block } => return self.write_settings(block.bytes()),
            Request::EraseSettings => return self.erase_settings(),
            Request::Arm => self.bead.arm(true),
            Request::Disarm => self.bead.arm(false),
            Request::SelfTest => return Ok(RequestStep::SelfTest),
            Request::Raw { duration_ms } if duration_ms > raw::MAX_MS => {
                let why = format_args!("a raw stream lasts {} ms at most", raw::MAX_MS);
                return Err((Outcome::OutOfRange, Detail::new(why)));
            }
            Request::Raw { duration_ms } => self.bead.start_raw(duration_ms),
            Request::ResetCounters => self.bead.reset_counters(),
            Request::SetKey { key } => self.set_key(key)?,
            Request::ListKept => {
                let kept = self.bead.send_kept();
                let detail = Detail::new(format_args!("{kept} strikes are kept"));
                return Ok(RequestStep::Reply((Outcome::Done, detail)));
            }
            Request::Fetch { boot, strike } => {
                let found = self.bead.find_kept(boot, strike);
                return found.map(RequestStep::Fetch).ok_or_else(not_kept);
            }
            Request::Keep { index } => {
                self.scans_come()?;
                let now = self.bead.snapshot();
                let ahead = index.saturating_sub(now.newest_index);
                if !(1..=MINUTE).contains(&ahead) {
                    let why = "the requested scan must come within the next minute";
                    return Err((Outcome::OutOfRange, why.into()));
                }
                self.bead.wanted_scan.signal(index);
            }
            // Unreachable: the lock has already unwrapped signed requests.
            Request::Signed { .. } => return Err(not_understood(Cause::Body)),
            Request::Image => return Ok(RequestStep::Image),
            Request::Hold {
                force,
                acceleration,
                duration_ms,
            } => return self.play(Play::hold([force, acceleration], duration_ms)),
            Request::Play { strikes, interval_ms } => return self.play(Play::strikes(strikes, interval_ms)),
            Request::Reboot => return Ok(RequestStep::Reboot),
            Request::Hang => return Ok(RequestStep::Hang),
            Request::BeginUpdate { manifest, older } => {
                if self.updates.begin(self.bead, manifest.bytes(), older)? {
                    return Ok(RequestStep::Reboot);
                }
            }
            Request::UpdateData { offset, bytes } => {
                self.updates.take(&self.bead.device, offset, bytes.bytes())?;
            }
            Request::FinishUpdate => {
                self.updates.finish(&self.bead.device)?;
                return Ok(RequestStep::Reboot);
            }
        }
        Ok(RequestStep::Reply(done()))
    }

    fn play(&self, play: Option<Play>) -> Result<RequestStep, Answer> {
        self.scans_come()?;
        let why = "codes are 0 to 4095, strikes at least 5 ms apart, and the whole lasts at most 400 ms";
        play.map(RequestStep::Play)
            .ok_or_else(|| (Outcome::OutOfRange, why.into()))
    }

    /// Refuses a request that needs scans if the bead makes none.
    fn scans_come(&self) -> Result<(), Answer> {
        if self.bead.has_scans() {
            return Ok(());
        }
        let why = "no scans come: the crystal does not run, or this is the wrong part";
        Err((Outcome::OutOfRange, why.into()))
    }

    /// Checks new settings, stores them, reads them back and offers them. They are derived twice, which keeps
    /// them off the stack while the store is written.
    fn write_settings(&mut self, block: &[u8]) -> Result<RequestStep, Answer> {
        check_settings(block)?;
        self.write(|store| store.write(block))?;
        self.offer_stored(block);
        Ok(RequestStep::InForce(""))
    }

    /// Offers settings that were checked. Never inlined: they would be in the frame of a task.
    #[inline(never)]
    fn offer_stored(&self, block: &[u8]) {
        if let Ok(loaded) = settings::judge(block) {
            self.bead.offer_settings(loaded);
        }
    }

    /// Erases the stored settings and offers the next ones. The reply names their source. Never inlined, like
    /// `offer_stored`.
    #[inline(never)]
    fn erase_settings(&mut self) -> Result<RequestStep, Answer> {
        self.write(Vault::clear)?;
        let loaded = Loaded::beneath(self.bead.device.probe_settings(), None);
        let origin = loaded.origin();
        self.bead.offer_settings(loaded);
        Ok(RequestStep::InForce(origin))
    }

    /// Writes to the store, if it may be written now.
    fn write(
        &mut self,
        change: impl FnOnce(&mut Vault<D::Flash>) -> Result<(), StoreError>,
    ) -> Result<(), Answer> {
        self.count_write()?;
        change(&mut self.store).map_err(not_stored)
    }

    /// Counts a write to flash, if one is allowed now. Data written at a low supply may read back
    /// differently.
    #[inline(never)]
    fn count_write(&mut self) -> Result<(), Answer> {
        let device = &self.bead.device;
        if device.supply_is_low() {
            return Err(supply_low());
        }
        let written = self.pace.write(device.now() / MS).map_err(too_soon)?;
        device.keep_settings_written(written);
        Ok(())
    }

    /// Admits only a reboot, signed or not, while the store cannot be read: nobody knows whether there is a
    /// key to check a signature with, and a reboot may bring the store back.
    fn admit_without_store(&self, request: Request) -> Result<Request, Answer> {
        match request {
            Request::Reboot => Ok(request),
            Request::Signed { kind, .. } if kind == Request::Reboot.number() => Ok(Request::Reboot),
            _ if self.bead.device.supply_is_low() => Err(supply_low()),
            _ => {
                let why = "the store cannot be read, so the bead does not know whether it has a key: reboot the bead";
                Err((Outcome::FlashFailed, why.into()))
            }
        }
    }
}

/// Refuses settings that the bead cannot work with. Never inlined: they would be in the frame of a task.
#[inline(never)]
fn check_settings(block: &[u8]) -> Result<(), Answer> {
    settings::judge(block).map(drop)
}

fn too_soon(wait_ms: u64) -> Answer {
    let wait_s = wait_ms.div_ceil(1000);
    let why = format_args!("flash is written at most every 10 s in the long run; try again in {wait_s} s");
    (Outcome::TooSoon, Detail::new(why))
}

#[inline(never)]
fn not_stored(error: StoreError) -> Answer {
    let (outcome, why) = match error {
        StoreError::Full => (
            Outcome::StoreFull,
            "no room in flash for another block; reboot the bead to make room",
        ),
        StoreError::TooLong | StoreError::Flash => (
            Outcome::FlashFailed,
            "what was written cannot be read back; the settings are unchanged",
        ),
    };
    (outcome, why.into())
}

fn reply<D: Device>(bead: &BeadState<D>, request: u16, (outcome, detail): Answer) {
    bead.send(Reply {
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
    (outcome, Detail::new(format_args!("{cause}")))
}

/// Sends a strike again, frame by frame, while there is room.
async fn fetch<D: Device>(bead: &BeadState<D>, mut refetch: Refetch) -> Answer {
    let deadline = bead.device.now() + FETCH;
    loop {
        if !bead.wait_for_spare(deadline).await {
            return (Outcome::Busy, "new strikes occupy the line: ask again".into());
        }
        match bead.push_next(&mut refetch) {
            RefetchStep::Sent => {}
            RefetchStep::Complete => return done(),
            RefetchStep::Gone => return not_kept(),
        }
    }
}

fn not_kept() -> Answer {
    let why = "this strike gave way to newer ones, was never measured, or is not yet complete";
    (Outcome::NotKept, why.into())
}

/// Resets the bead when all frames that wait have left, or after [`DRAIN`].
async fn reboot<D: Device>(bead: &BeadState<D>) -> ! {
    drain(bead).await;
    bead.device.reset()
}

/// Waits until all frames have left, before a reset, or for [`DRAIN`].
async fn drain<D: Device>(bead: &BeadState<D>) {
    // Otherwise further strikes would keep filling the outbox.
    bead.arm(false);
    let deadline = bead.device.now() + DRAIN;
    while bead.snapshot().frames_waiting > 0 && bead.device.now() < deadline {
        bead.device.sleep(MS).await;
    }
    // When the DMA is done, the last two bytes are still being sent: 10 µs.
    bead.device.sleep(MS).await;
    #[cfg(feature = "defmt")]
    defmt::info!("reset, as asked");
}
