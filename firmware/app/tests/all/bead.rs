//! A bead whose hardware is faked: its time goes on block by block, and its line carries 400 bytes a block.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::pin;
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::task::{Context, Poll, Waker};

use bead_app::{
    BeadState, BlockCodes, BootRecord, CLOCKS_PER_SAMPLE, Commands, Device, Estimation, FactoryCodes,
    FramesWaiting, InternalChannel, LineTimer, Loaded, MS, SCANS_PER_BLOCK, ScanBlock, ThisBoot,
};
use bead_model::design::Description;
use bead_model::{Meter, WindowRecord};
use bead_store::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use bead_store::{Opened, Store, Vault, WindowMemory, Windows};
use bead_testing::{FlashFailure, PowerCutFlash, block, bodies, paper_settings};
use bead_update::layout::{Layout, PAGE};
use bead_update::manifest::DEVELOPMENT_KEY;
use bead_update::swap::{Images, Running, prepare};
use bead_wire::{
    ANY, Board, Decoder, Fault, FaultCause, Guard, Header, Health, Key, Link, MAX_FRAME, MAX_REQUEST,
    Message, Outcome, Packed, Reply, Request, RequestDecoder, Status, Strike, Ticket, UpdateStage,
    encode_request,
};

pub(crate) const SECTOR: usize = 16 * 1024;
pub(crate) const UID: [u8; 12] = *b"a fake bead!";

/// Codes of a typical part: 1.21 V, and 0.76 V at 25 °C with 2.5 mV/°C.
const TYPICAL: FactoryCodes = FactoryCodes {
    reference: 1502,
    temperatures: [959, 1207],
};

/// First scan of a strike that [`TestBead::strike`] makes, counted from the call.
const STRUCK: u64 = 250;

/// Flash that outlives a reset.
#[derive(Clone)]
pub(crate) struct SharedFlash(pub(crate) Rc<RefCell<PowerCutFlash<SECTOR>>>);

impl ErrorType for SharedFlash {
    type Error = FlashFailure;
}

impl ReadNorFlash for SharedFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailure> {
        self.0.borrow_mut().read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl NorFlash for SharedFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailure> {
        self.0.borrow_mut().erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailure> {
        self.0.borrow_mut().write(offset, bytes)
    }
}

/// Hardware that a test watches and changes.
#[derive(Default)]
pub(crate) struct Hardware {
    now: Cell<u64>,
    pub(crate) supply_is_low: Cell<bool>,
    /// Supply, V, and temperature of the die, °C.
    pub(crate) supply: Cell<[f64; 2]>,
    pub(crate) factory: Cell<FactoryCodes>,
    pub(crate) conversions: Cell<u32>,
    converted: Cell<u16>,
    pub(crate) probe: Cell<&'static [u8]>,
    settings_written: Cell<u32>,
    frames_waiting: Cell<u32>,
    /// The stage of an update, and whether the next start waits for an image.
    stage: Cell<u8>,
    pub(crate) receives_next: Cell<bool>,
    /// The line's level, the count at its last edge, and the counts at which the bead pulled it.
    pub(crate) line_is_low: Cell<bool>,
    pub(crate) line_edge: Cell<u32>,
    pub(crate) line_pulls: RefCell<Vec<u32>>,
    pub(crate) outputs: RefCell<FakeOutputs>,
}

/// The codes that the outputs hold, and those that they play from an index on.
#[derive(Default)]
pub(crate) struct FakeOutputs {
    hold: Option<[u16; 2]>,
    playing: Option<(u64, Vec<[u16; 2]>)>,
}

impl FakeOutputs {
    /// The codes at a scan.
    pub(crate) fn at(&self, index: u64) -> Option<[u16; 2]> {
        let hold = self.hold?;
        let Some((first, codes)) = &self.playing else {
            return Some(hold);
        };
        let played = index
            .checked_sub(*first)
            .and_then(|place| codes.get(place as usize));
        Some(played.copied().unwrap_or(hold))
    }
}

impl Hardware {
    pub(crate) fn line_count(&self) -> u32 {
        (self.now.get() as u32)
            .wrapping_sub(1)
            .wrapping_mul(CLOCKS_PER_SAMPLE.into())
    }
}

pub(crate) struct FakeBoard(&'static Hardware);

impl Device for FakeBoard {
    type Flash = SharedFlash;
    type Line = FakeLineTimer;
    type ImageFlash = SharedFlash;

    const UPDATE_KEY: [u8; 32] = DEVELOPMENT_KEY;
    const FIRMWARE: &'static str = "1.2.3";
    const GIT: &'static str = "0123456789ab";
    const CORE_MHZ: u32 = 168;

    fn board(&self) -> Board {
        Board {
            name: "fake".into(),
            crystal_mhz: 8,
            part: 0x413,
            revision: 0x1001,
            brown_out_level: 3,
            read_protection: 0,
        }
    }

    fn uid(&self) -> [u8; 12] {
        UID
    }

    fn update_stage(&self) -> UpdateStage {
        UpdateStage::from_number(self.0.stage.get())
    }

    fn receive_after_reset(&self) {
        self.0.receives_next.set(true);
    }

    fn now(&self) -> u64 {
        self.0.now.get()
    }

    fn sleep(&self, periods: u64) -> impl Future<Output = ()> {
        let end = self.now() + periods;
        std::future::poll_fn(move |_| {
            if self.now() >= end {
                Poll::Ready(())
            } else {
                Poll::Pending
            }
        })
    }

    fn core_clocks(&self) -> u32 {
        self.now() as u32
    }

    fn take_longest_mask(&self) -> u32 {
        0
    }

    fn factory_codes(&self) -> FactoryCodes {
        self.0.factory.get()
    }

    fn convert(&self, channel: InternalChannel) {
        self.0.conversions.set(self.0.conversions.get() + 1);
        let [supply, celsius] = self.0.supply.get();
        let FactoryCodes {
            reference,
            temperatures: [cold, hot],
        } = TYPICAL;
        let at_factory = match channel {
            InternalChannel::Reference => f64::from(reference),
            InternalChannel::Temperature => f64::from(cold) + (celsius - 30.0) / 80.0 * f64::from(hot - cold),
        };
        self.0.converted.set((at_factory * 3.3 / supply).round() as u16);
    }

    fn converted(&self) -> Option<u16> {
        Some(self.0.converted.get())
    }

    fn supply_is_low(&self) -> bool {
        self.0.supply_is_low.get()
    }

    fn stack_never_used(&self) -> u32 {
        40_000
    }

    fn probe_settings(&self) -> &'static [u8] {
        self.0.probe.get()
    }

    fn hold(&self, codes: Option<[u16; 2]>) {
        self.0.outputs.borrow_mut().hold = codes;
    }

    fn play(&self, codes: impl Iterator<Item = [u16; 2]>, _: u64) -> u64 {
        let first = self.now() + 2;
        let mut outputs = self.0.outputs.borrow_mut();
        outputs.playing = Some((first, codes.collect()));
        first
    }

    fn end_play(&self) -> bool {
        self.0.outputs.borrow_mut().playing.take().is_some()
    }

    fn image(&self) -> &'static [u8] {
        b"an image"
    }

    fn hang(&self) -> ! {
        panic!("hang")
    }

    fn keep_frames_waiting(&self, frames: u32) {
        self.0.frames_waiting.set(frames);
    }

    fn keep_settings_written(&self, written: u32) {
        self.0.settings_written.set(written);
    }

    fn reset(&self) -> ! {
        panic!("reset")
    }
}

pub(crate) struct FakeLineTimer(&'static Hardware);

impl LineTimer for FakeLineTimer {
    fn count(&self) -> u32 {
        self.0.line_count()
    }

    fn last_edge(&self) -> u32 {
        self.0.line_edge.get()
    }

    fn is_low(&self) -> bool {
        self.0.line_is_low.get()
    }

    fn pull_at(&mut self, count: u32) {
        self.0.line_pulls.borrow_mut().push(count);
    }

    fn release(&mut self) {}
}

/// State before a start.
pub(crate) struct StartState {
    pub(crate) flash: SharedFlash,
    pub(crate) probe: Vec<u8>,
    /// The record that the boot before left, and the cause of the reset.
    pub(crate) record: Option<BootRecord>,
    pub(crate) reset_cause: u8,
    pub(crate) supply_is_good: bool,
    /// Flash that images lie in, and whether this start waits for one.
    pub(crate) images: SharedFlash,
    pub(crate) receives: bool,
}

impl Default for StartState {
    fn default() -> Self {
        Self {
            flash: SharedFlash(Rc::new(RefCell::new(PowerCutFlash::blank(2)))),
            probe: block(&paper_settings()),
            record: None,
            reset_cause: 1 << 3,
            supply_is_good: true,
            images: SharedFlash(Rc::new(RefCell::new(PowerCutFlash::blank(48)))),
            receives: false,
        }
    }
}

/// The paper's settings with a change.
fn settings_with(change: impl FnOnce(&mut Description)) -> Vec<u8> {
    block(&paper_settings().with(change).expect("it is valid"))
}

/// The paper's settings with windows of this many samples.
pub(crate) fn windows_of(length: u16) -> Vec<u8> {
    settings_with(|bead| bead.capture.length = f64::from(length) * 1e-5)
}

/// A bead that runs.
pub(crate) struct TestBead {
    commands: Commands<FakeBoard>,
    decoder: RequestDecoder,
    next_number: u16,
    pub(crate) flash: SharedFlash,
    pub(crate) images: SharedFlash,
    pub(crate) running: RunningBead,
}

/// Everything but the task of requests.
pub(crate) struct RunningBead {
    pub(crate) bead: &'static BeadState<FakeBoard>,
    pub(crate) hardware: &'static Hardware,
    pub(crate) boot: &'static ThisBoot,
    pub(crate) record: BootRecord,
    estimation: Estimation<FakeBoard>,
    codes: &'static BlockCodes,
    /// Codes of a scan.
    pub(crate) signal: Box<dyn FnMut(u64) -> [u16; 4]>,
    pub(crate) index: u64,
    pub(crate) epoch: u32,
    /// False for a bead whose acquisition has stopped.
    pub(crate) acquires: bool,
    /// False for a line that carries nothing.
    pub(crate) line_is_free: bool,
    /// Bytes of the last frame that have not left.
    sending: usize,
    stream: Decoder,
    pub(crate) frames: Vec<(Header, Message)>,
}

fn leak<T>(value: T) -> &'static mut T {
    Box::leak(Box::new(value))
}

impl TestBead {
    pub(crate) fn new() -> Self {
        Self::start(StartState::default())
    }

    /// A bead with these bytes in the sector of the probe.
    pub(crate) fn probed(probe: Vec<u8>) -> Self {
        Self::start(StartState {
            probe,
            ..StartState::default()
        })
    }

    /// A bead that has the paper's settings with a change.
    pub(crate) fn with(change: impl FnOnce(&mut Description)) -> Self {
        Self::probed(settings_with(change))
    }

    pub(crate) fn start(start: StartState) -> Self {
        let hardware: &'static Hardware = leak(Hardware::default());
        hardware.supply.set([3.3, 25.0]);
        hardware.factory.set(TYPICAL);
        hardware.supply_is_low.set(!start.supply_is_good);
        hardware.probe.set(start.probe.leak());
        // The loader.
        prepare::<_, PAGE>(start.images.clone(), &Layout::BEAD).expect("the power stays");
        let images = Images::new(start.images.clone(), Layout::BEAD);
        let stage = match images.running() {
            Running::Trial => UpdateStage::OnTrial,
            _ if start.receives => UpdateStage::Receiving,
            Running::CameBack => UpdateStage::CameBack,
            Running::Settled => UpdateStage::Settled,
        };
        hardware.stage.set(stage.number());
        let (boot, record) = BootRecord::begin(start.record, FramesWaiting::new(0), start.reset_cause);
        let boot = leak(boot);
        let range = 0..2 * SECTOR as u32;
        let (store, opened) = if start.supply_is_good {
            Store::open(start.flash.clone(), range)
        } else {
            (
                Store::open_as_it_is(start.flash.clone(), range),
                Opened::default(),
            )
        };
        let mut store = Vault::new(store);
        let loaded = Loaded::find(&mut store, opened, hardware.probe.get(), boot.failed);
        let (settings, refused) = (loaded.settings, loaded.refused);
        let bead: &'static BeadState<FakeBoard> = leak(BeadState::new(FakeBoard(hardware)));
        bead.begin(boot, loaded, Windows::new(leak(WindowMemory::new()), false));
        bead.report_boot(boot, refused, []);
        let line = FakeLineTimer(hardware);
        Self {
            commands: Commands::new(bead, boot, store, leak(WindowRecord::new()), images),
            images: start.images,
            decoder: RequestDecoder::new(),
            next_number: 0,
            flash: start.flash,
            running: RunningBead {
                bead,
                hardware,
                boot,
                record,
                estimation: Estimation::new(bead, settings, leak(Meter::new()), line),
                codes: leak(BlockCodes::new()),
                signal: Box::new(quiet),
                index: 1,
                epoch: 0,
                acquires: true,
                line_is_free: true,
                sending: 0,
                stream: Decoder::new(),
                frames: Vec::new(),
            },
        }
    }

    /// The start after a reset with this cause.
    pub(crate) fn restart(self, reset_cause: u8) -> Self {
        let mut record = self.running.record;
        record.settings_written = self.running.hardware.settings_written.get();
        Self::start(StartState {
            flash: self.flash,
            probe: self.running.hardware.probe.get().to_vec(),
            record: Some(record),
            reset_cause,
            supply_is_good: true,
            images: self.images,
            receives: self.running.hardware.receives_next.get(),
        })
    }

    pub(crate) fn run(&mut self, seconds: f64) {
        self.running.run(seconds);
    }

    /// Takes bytes from the line, and does what they ask for.
    pub(crate) fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if let Some(Ok(request)) = self.decoder.push(byte) {
                let mut answer = pin!(self.commands.answer(request));
                while answer
                    .as_mut()
                    .poll(&mut Context::from_waker(Waker::noop()))
                    .is_pending()
                {
                    self.running.take_block();
                }
            }
        }
        self.running.bead.count_received(&self.decoder.take_counters());
    }

    /// Sends a request, and returns the messages before its reply, and the reply, which comes within 0.3 s.
    pub(crate) fn ask(&mut self, request: &Request) -> (Vec<Message>, Reply) {
        let number = self.next_number;
        self.next_number += 1;
        let before = self.running.frames.len();
        let mut buffer = [0; MAX_REQUEST];
        let bytes = encode_request(ANY, number, request, &mut buffer).expect("it fits");
        self.receive(bytes);
        for _ in 0..150 {
            let mut told: Vec<Message> = self.running.messages().skip(before).cloned().collect();
            if let Some(at) = told
                .iter()
                .position(|message| matches!(message, Message::Reply(_)))
                && let Message::Reply(reply) = told.swap_remove(at)
            {
                assert_eq!(reply.request, number);
                told.truncate(at);
                return (told, reply);
            }
            self.running.take_block();
        }
        panic!("{request:?} has no reply");
    }

    /// The outcome of a request, and the line about it.
    pub(crate) fn answer(&mut self, request: &Request) -> (Outcome, String) {
        let (_, reply) = self.ask(request);
        (reply.outcome, reply.detail.as_str().to_owned())
    }

    pub(crate) fn outcome(&mut self, request: &Request) -> Outcome {
        self.answer(request).0
    }

    /// The outcome of a request that is signed with a key made of this byte.
    pub(crate) fn signed(&mut self, request: &Request, key: u8, ticket: Ticket) -> Outcome {
        let key = Key::new([key; 16]).expect("it is not zero");
        self.outcome(&request.signed(&key, &UID, ANY, self.next_number, ticket))
    }

    /// Lets the image on trial check itself. Returns the text of the reset or panic that ends it.
    pub(crate) fn end_trial(&mut self) -> Option<String> {
        Self::ended(self.commands.end_trial(), &mut self.running)
    }

    /// Lets the bead check for an idle update. Returns the text of the reset that ends it, if any.
    pub(crate) fn end_idle_update(&mut self) -> Option<String> {
        Self::ended(self.commands.end_idle_update(), &mut self.running)
    }

    /// The text of the panic in which `act` ends, if it does.
    fn ended(act: impl Future, running: &mut RunningBead) -> Option<String> {
        let mut act = pin!(act);
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let mut context = Context::from_waker(Waker::noop());
            while act.as_mut().poll(&mut context).is_pending() {
                running.take_block();
            }
        }));
        let panic = ended.err()?;
        let text = panic.downcast_ref::<String>().cloned();
        text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()))
    }

    /// Asks for a reboot, and starts again after it.
    pub(crate) fn reboot(mut self, request: &Request) -> Self {
        let asked = catch_unwind(AssertUnwindSafe(|| self.ask(request)));
        assert!(
            asked.is_err(),
            "it was not reset: {:?}",
            asked.map(|(_, reply)| reply)
        );
        self.restart(1 << 4 | 1 << 2)
    }

    /// Strikes the bead, and runs until the window is over. Returns the results.
    pub(crate) fn strike(&mut self) -> Vec<Strike> {
        self.running.strike()
    }
}

impl RunningBead {
    /// Goes on for 2 ms.
    pub(crate) fn take_block(&mut self) {
        let first_index = self.index;
        for words in &self.codes.0 {
            let [force, force_wide, acceleration, acceleration_wide] =
                (self.signal)(self.index).map(u32::from);
            words[0].store(force | force_wide << 16, Ordering::Relaxed);
            words[1].store(acceleration | acceleration_wide << 16, Ordering::Relaxed);
            self.index += 1;
        }
        self.hardware.now.set(self.index);
        self.bead.update(|c| {
            c.newest_index = self.index - 1;
            c.samples += SCANS_PER_BLOCK as u64;
            c.blocks_handed_on += u32::from(self.acquires);
        });
        self.estimation.take(&ScanBlock {
            epoch: self.epoch,
            first_index,
            codes: self.codes,
        });
        self.estimation.count_block();
        if self.index / (1000 * MS) != first_index / (1000 * MS) {
            self.bead.report(self.boot);
        }
        if self.line_is_free {
            self.send();
        }
    }

    /// Sends the bytes that leave in the time of a block.
    fn send(&mut self) {
        let mut room = 400;
        loop {
            let sent = self.sending.min(room);
            (self.sending, room) = (self.sending - sent, room - sent);
            let mut packed = Packed::new();
            if room == 0 {
                return;
            }
            let mut context = Context::from_waker(Waker::noop());
            if pin!(self.bead.next_frame(&mut packed))
                .poll(&mut context)
                .is_pending()
            {
                return;
            }
            let mut buffer = [0; MAX_FRAME];
            let bytes = packed.seal(&mut buffer).expect("a frame fits");
            self.sending = bytes.len();
            self.bead.update(|c| c.frames_sent += 1);
            self.bead.count_frame_done();
            let frames = &mut self.frames;
            self.stream.feed(bytes, |frame| {
                let frame = frame.expect("the line has no noise");
                frames.push((frame.header, frame.message));
            });
        }
    }

    pub(crate) fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 500.0) as u32 {
            self.take_block();
        }
    }

    pub(crate) fn strike(&mut self) -> Vec<Strike> {
        let (before, start) = (self.strikes().len(), self.index + STRUCK);
        self.signal = Box::new(move |index| struck(index, start));
        self.run(0.04);
        self.signal = Box::new(quiet);
        self.strikes().split_off(before)
    }

    /// The messages that the bead sent.
    pub(crate) fn messages(&self) -> impl Iterator<Item = &Message> {
        self.frames.iter().map(|(_, message)| message)
    }

    /// The bodies of the messages of one kind.
    pub(crate) fn all<'a, B: 'a>(&'a self) -> impl Iterator<Item = &'a B>
    where
        &'a B: TryFrom<&'a Message>,
    {
        bodies(self.messages())
    }

    pub(crate) fn strikes(&self) -> Vec<Strike> {
        self.all().copied().collect()
    }

    /// Number and outcome of each reply.
    pub(crate) fn replies(&self) -> Vec<(u16, Outcome)> {
        let replies = self.all::<Reply>();
        replies.map(|reply| (reply.request, reply.outcome)).collect()
    }

    /// Causes and details of the faults that the bead reported.
    pub(crate) fn faults(&self) -> Vec<(FaultCause, String)> {
        let faults = self.all::<Fault>();
        faults
            .map(|fault| (fault.cause, fault.detail.as_str().to_owned()))
            .collect()
    }

    pub(crate) fn causes(&self) -> Vec<FaultCause> {
        self.all::<Fault>().map(|fault| fault.cause).collect()
    }

    /// The blocks of settings that the bead sent, without repeats in a row.
    pub(crate) fn blocks(&self) -> Vec<Vec<u8>> {
        let settings = self.all::<bead_wire::Settings>();
        let mut blocks: Vec<_> = settings.map(|sent| sent.block.bytes().to_vec()).collect();
        blocks.dedup();
        blocks
    }

    /// Number of frames that the bead made and that never arrived.
    pub(crate) fn lost(&self) -> u64 {
        self.stream.counters().lost
    }
}

/// Status, health, link and guard in a reply to a request for the status.
pub(crate) fn status(bead: &mut TestBead) -> (Status, Health, Link, Guard) {
    let (messages, _) = bead.ask(&Request::Status);
    let [
        ..,
        Message::Status(status),
        Message::Health(health),
        Message::Link(link),
        Message::Guard(guard),
        Message::Load(_),
    ] = messages[..]
    else {
        panic!("{messages:?}");
    };
    (status, health, link, guard)
}

/// Code of a channel at rest.
pub(crate) const REST: u16 = 1024;

/// A chain at rest: codes with noise of one code.
pub(crate) fn quiet(index: u64) -> [u16; 4] {
    let noise = |shift: u32| REST + ((index.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> shift) & 1) as u16;
    [noise(63), noise(62), noise(61), noise(60)]
}

/// A strike at the scan `start`: a parabola of 1500 codes, 40 samples wide, and an intruder that rings.
pub(crate) fn struck(index: u64, start: u64) -> [u16; 4] {
    let mut codes = quiet(index);
    let since = index.wrapping_sub(start) as i64;
    if (0..40).contains(&since) {
        let force = 1500 * (400 - (since - 20).pow(2)) / 400;
        codes[0] += force as u16;
        codes[1] += (force / 16) as u16;
    }
    if (0..600).contains(&since) {
        let ring = 400.0 * (-since as f64 / 120.0).exp() * (since as f64 * 0.35).sin();
        codes[2] = codes[2].wrapping_add_signed(ring as i16);
        codes[3] = codes[3].wrapping_add_signed((ring / 16.0) as i16);
    }
    codes
}
