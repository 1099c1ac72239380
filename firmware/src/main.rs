//! The image of the sensing absorber bead: the wiring. See `docs/firmware.md`.
//!
//! ```text
//! TIM3 ─┬─> ADC1 ─> DMA2 ─> acquire ─blocks─> estimate ─strikes─┬─> outbox ─> transmit ─> USART1
//!       └─> TIM2 ─> sync ───────────────────────────────edges───┤
//!                   report, health ────────────status, faults───┤
//!         USART1 ─> receive ─> commands ──────────────replies───┘
//! ```
#![no_std]
#![no_main]

mod acquire;
mod block;
mod built_in;
mod clocks;
mod commands;
mod converter;
mod counters;
mod estimate;
mod handover;
mod health;
mod heartbeat;
mod keep;
mod known_answer;
mod line;
mod load;
mod outbox;
mod port;
mod priorities;
mod raw;
mod receive;
mod report;
mod sample_clock;
mod self_test;
mod settings;
mod stack;
mod storage;
mod supply;
mod sync;
mod trace;
mod transmit;
mod watchdog;

use bead_model::Meter;
use bead_store::Pace;
use bead_wire::{FaultCause, MAX_FRAME, Standing};
use commands::Commands;
use converter::Converter;
use defmt_rtt as _;
use line::TriggerLine;
use priorities::Spawners;
use sample_clock::SampleClock;
use static_cell::{ConstStaticCell, StaticCell};
use sync::SyncInput;
use trace::Boot;

#[cortex_m_rt::entry]
fn main() -> ! {
    static BOOT: StaticCell<Boot> = StaticCell::new();
    static METER: ConstStaticCell<Meter> = ConstStaticCell::new(Meter::new());
    static WINDOW: ConstStaticCell<bead_model::WindowRecord> =
        ConstStaticCell::new(bead_model::WindowRecord::new());
    static FRAME: ConstStaticCell<[u8; MAX_FRAME]> = ConstStaticCell::new([0; _]);

    let boot = BOOT.init(trace::begin());
    watchdog::begin();
    clocks::freeze_while_halted();
    let mut core = cortex_m::Peripherals::take().expect("main runs once");
    stack::close_fence(&mut core.MPU);
    load::begin(&mut core.DCB, &mut core.DWT);
    let supply_is_good = supply::wait();
    let sampling = clocks::start_crystal();
    let p = embassy_stm32::init(clocks::config(sampling));
    supply::watch();
    if sampling {
        clocks::guard_crystal();
    }
    defmt::info!(
        "bead {=str} ({=str}), boot {=u32}, reset cause {=u8:#04x}",
        env!("CARGO_PKG_VERSION"),
        env!("BEAD_GIT"),
        boot.number,
        boot.reset_cause
    );
    if let Some(left) = &boot.left {
        defmt::error!(
            "boot {=u32} ended in a fault: {=str}",
            left.boot,
            left.detail.as_str()
        );
    }
    let (mut store, opened) = storage::open(p.FLASH, supply_is_good);
    clocks::accelerate();
    let loaded = settings::load(&mut store, opened, boot.failed);
    let (settings, refused) = (loaded.settings, loaded.refused);
    estimate::arm(loaded.arm());
    defmt::info!("settings: {=str}", loaded.origin());
    settings::begin(loaded);

    keep::begin();

    let converter = Converter::new(p.ADC1, p.DMA2_CH0, p.PA0, p.PA1, p.PA2, p.PA3);
    let clock = SampleClock::new(p.TIM3);
    let edges = SyncInput::new(p.TIM2, p.PA15);
    let line = TriggerLine::new(p.PB10, p.PB11);
    let (transmitter, receiver) = port::open(p.USART1, p.PA9, p.PA10, p.DMA2_CH7, p.DMA2_CH2);
    let lock = commands::lock(&store);
    let commands = Commands {
        boot,
        store,
        pace: Pace::new(trace::written()),
        lock,
        window: WINDOW.take(),
    };
    handover::begin();

    let found = [
        (!supply_is_good).then_some((
            FaultCause::SupplyLow,
            "the supply was not good for 20 ms within 5 s: the bead started all the same",
        )),
        (!sampling).then_some((
            FaultCause::CrystalFailed,
            "the crystal does not start: the bead answers, and takes no samples",
        )),
    ];
    if !sampling {
        counters::update(|c| c.health.standing = c.health.standing.with(Standing::CRYSTAL_FAILED));
    }

    const ONCE: &str = "each task is spawned once";
    let Spawners {
        acquire,
        estimate,
        rest,
    } = priorities::start();
    rest.spawn(transmit::transmit(transmitter, FRAME.take()).expect(ONCE));
    rest.spawn(report::report(boot, refused, found.into_iter().flatten().collect()).expect(ONCE));
    rest.spawn(receive::receive(receiver, commands).expect(ONCE));
    rest.spawn(keep::seal().expect(ONCE));
    rest.spawn(heartbeat::heartbeat(p.PC13, boot.left.is_some()).expect(ONCE));
    if sampling {
        estimate.spawn(estimate::estimate(settings, METER.take(), line).expect(ONCE));
        acquire.spawn(acquire::acquire(converter, clock).expect(ONCE));
        rest.spawn(sync::sync(edges).expect(ONCE));
    } else {
        estimate.spawn(estimate::idle().expect(ONCE));
    }
    rest.spawn(watchdog::watch(p.IWDG, sampling).expect(ONCE));
    loop {
        cortex_m::asm::wfi();
    }
}
