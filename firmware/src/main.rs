//! The image of the sensing absorber bead: the wiring. See `docs/firmware.md`.
//!
//! ```text
//! TIM3 ─┬─> ADC3 ─> DMA2 ─> acquire ─blocks─> estimate ─strikes─┬─> outbox ─> transmit ─> USART1
//!       └─> TIM2 ─> sync ───────────────────────────────edges───┤
//!                   report, health ────────────status, faults───┤
//!         USART1 ─> receive ─> commands ──────────────replies───┘
//! ```
#![no_std]
#![no_main]

mod acquire;
mod board;
mod clocks;
mod converter;
mod coupled;
mod estimate;
mod handover;
mod heartbeat;
mod image_name;
mod line;
mod loader;
mod masked;
mod outputs;
mod port;
mod priorities;
mod receive;
mod report;
mod sample_clock;
mod stack;
mod storage;
mod supply;
mod sync;
mod trace;
mod transmit;
mod update;
mod watch;
mod watchdog;
mod wiring;

use bead_app::Device as _;
use bead_app::{Commands, Estimation, Loaded, ThisBoot};
use bead_model::WindowRecord;
use bead_wire::{FaultCause, MAX_FRAME, Standing, UpdateStage};
use board::{BEAD, Stm32Board};
use clocks::NoClock;
use converter::Converter;
use defmt_rtt as _;
use line::LinePins;
use priorities::Spawners;
use sample_clock::SampleClock;
use static_cell::{ConstStaticCell, StaticCell};
use sync::SyncInput;

#[cortex_m_rt::entry]
fn main() -> ! {
    start();
    loop {
        cortex_m::asm::wfi();
    }
}

/// Starts the tasks. Not inlined, so that its frame is no longer on the stack when they run.
#[inline(never)]
fn start() {
    static BOOT: StaticCell<ThisBoot> = StaticCell::new();
    static WINDOW: ConstStaticCell<WindowRecord> = ConstStaticCell::new(WindowRecord::new());
    static COMMANDS: StaticCell<Commands<Stm32Board>> = StaticCell::new();
    static ESTIMATION: StaticCell<Estimation<Stm32Board>> = StaticCell::new();
    static FRAME: ConstStaticCell<[u8; MAX_FRAME]> = ConstStaticCell::new([0; _]);

    let boot = BOOT.init(trace::begin());
    watchdog::begin();
    clocks::freeze_while_halted();
    let mut core = cortex_m::Peripherals::take().expect("main runs once");
    stack::close_fence(&mut core.MPU);
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let supply_is_good = supply::wait();
    let source = clocks::source();
    let p = embassy_stm32::init(clocks::config(source.as_ref().ok().copied()));
    supply::watch();
    if source.is_ok() {
        clocks::guard_crystal();
    }
    let images = update::begin(trace::take_receive());
    let sampling = source.is_ok() && update::stage() != UpdateStage::Receiving;
    defmt::info!(
        "bead {=str} ({=str}), boot {=u32}, reset cause {=u8:#04x}",
        env!("CARGO_PKG_VERSION"),
        env!("BEAD_GIT"),
        boot.number,
        boot.reset_cause
    );
    if let Some(left) = &boot.ended_by {
        defmt::error!(
            "boot {=u32} ended in a fault: {=str}",
            left.boot,
            left.detail.as_str()
        );
    }
    let (mut store, opened) = storage::open(p.FLASH, supply_is_good);
    clocks::accelerate();
    let loaded = Loaded::find(&mut store, opened, BEAD.device().probe_settings(), boot.failed);
    let (settings, refused) = (loaded.settings, loaded.refused);
    defmt::info!("settings: {=str}", loaded.origin());
    BEAD.begin(boot, loaded, trace::windows());

    let converter = Converter::new(p.ADC3, p.DMA2_CH0, p.PA0, p.PA1, p.PA2, p.PA3);
    outputs::claim(p.DAC1, p.TIM6, p.DMA1_CH5, p.PA4, p.PA5);
    let clock = SampleClock::new(p.TIM3);
    let ((transmits, receives), sync, (pulls, listens), light) = wiring::pins!(p);
    let edges = SyncInput::new(p.TIM2, sync);
    let line = LinePins::new(pulls, listens);
    let (transmitter, receiver) = port::open(p.USART1, transmits, receives, p.DMA2_CH7, p.DMA2_CH2);
    let commands = COMMANDS.init(Commands::new(&BEAD, boot, store, WINDOW.take(), images));
    handover::begin();

    let found = [
        (!supply_is_good).then_some((
            FaultCause::SupplyLow,
            "the supply was not good for 20 ms within 5 s: the bead started all the same".into(),
        )),
        source.as_ref().err().map(NoClock::fault),
    ];
    if let Err(why) = &source {
        let stands = match why {
            NoClock::Part(_) => Standing::PART_WRONG,
            _ => Standing::CRYSTAL_FAILED,
        };
        BEAD.update(|c| c.health.standing = c.health.standing.with(stands));
    }

    const ONCE: &str = "each task is spawned once";
    let Spawners {
        acquire,
        estimate,
        rest,
    } = priorities::start();
    rest.spawn(transmit::transmit(transmitter, FRAME.take()).expect(ONCE));
    rest.spawn(report::report(boot, refused, found).expect(ONCE));
    rest.spawn(receive::receive(receiver, commands).expect(ONCE));
    rest.spawn(estimate::seal().expect(ONCE));
    rest.spawn(heartbeat::heartbeat(light.into(), boot.ended_by.is_some()).expect(ONCE));
    if sampling {
        supply::begin(p.ADC1);
        let estimation = ESTIMATION.init(Estimation::new(&BEAD, settings, coupled::meter(), line));
        estimate.spawn(estimate::estimate(estimation).expect(ONCE));
        acquire.spawn(acquire::acquire(converter, clock).expect(ONCE));
        rest.spawn(sync::sync(edges).expect(ONCE));
    } else {
        estimate.spawn(estimate::idle(matches!(source, Err(NoClock::Silent))).expect(ONCE));
    }
    rest.spawn(watch::watch(p.IWDG, sampling).expect(ONCE));
}
