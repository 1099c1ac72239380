//! Three executors, one above the other.
//!
//! # Design
//! Every task runs in an interrupt handler, and `main` sleeps in WFI: the core wakes for interrupts only.
//! (The executor of thread mode sleeps in WFE, which emulators take for a busy wait.) Each executor uses an
//! interrupt that nothing else can raise: the part with 64 pins has no FSMC, and the two of endpoint 1 are
//! for a USB driver that is not used. A task is interrupted only by tasks of a level above it:
//!
//! | priority | runs | because |
//! |---|---|---|
//! | 0 | DMA and timer handlers | they only note what happened and wake a task |
//! | 2 | [`ACQUIRE`] | a block that is not taken within 2 ms is overwritten |
//! | 4 | [`ESTIMATE`] | a delay here can cost a block, which is counted, but the DMA misses no sample |
//! | 6 | [`REST`] | telemetry, housekeeping and light may wait |

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};

use crate::{converter, port};

static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
static ESTIMATE: InterruptExecutor = InterruptExecutor::new();
static REST: InterruptExecutor = InterruptExecutor::new();

/// One spawner for each executor.
pub(crate) struct Spawners {
    pub(crate) acquire: SendSpawner,
    pub(crate) estimate: SendSpawner,
    pub(crate) rest: SendSpawner,
}

/// Starts the executors. A second call panics.
pub(crate) fn start() -> Spawners {
    interrupt::OTG_HS_EP1_OUT.set_priority(Priority::P2);
    interrupt::OTG_HS_EP1_IN.set_priority(Priority::P4);
    interrupt::FSMC.set_priority(Priority::P6);
    Spawners {
        acquire: ACQUIRE.start(interrupt::OTG_HS_EP1_OUT),
        estimate: ESTIMATE.start(interrupt::OTG_HS_EP1_IN),
        rest: REST.start(interrupt::FSMC),
    }
}

#[interrupt]
fn DMA2_STREAM0() {
    converter::on_interrupt();
}

#[interrupt]
fn DMA2_STREAM2() {
    port::on_interrupt();
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn OTG_HS_EP1_OUT() {
    // SAFETY: this is the handler of the interrupt that `start` gave this executor. `start` unmasks the
    // interrupt after the executor is initialised.
    unsafe { ACQUIRE.on_interrupt() }
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn OTG_HS_EP1_IN() {
    // SAFETY: as above.
    unsafe { ESTIMATE.on_interrupt() }
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn FSMC() {
    // SAFETY: as above.
    unsafe { REST.on_interrupt() }
}
