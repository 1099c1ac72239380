//! Three executors, one above the other.
//!
//! # Design
//! Every task runs in an interrupt handler, and `main` sleeps in WFI: the core wakes for interrupts only.
//! (The executor of thread mode sleeps in WFE, which emulators take for a busy wait.) Each executor uses the
//! interrupt of a peripheral that this board does not need. A task is interrupted only by tasks of a level
//! above it:
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

use crate::converter;

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
    interrupt::CAN1_TX.set_priority(Priority::P2);
    interrupt::CAN1_RX0.set_priority(Priority::P4);
    interrupt::CAN1_RX1.set_priority(Priority::P6);
    Spawners {
        acquire: ACQUIRE.start(interrupt::CAN1_TX),
        estimate: ESTIMATE.start(interrupt::CAN1_RX0),
        rest: REST.start(interrupt::CAN1_RX1),
    }
}

#[interrupt]
fn DMA2_STREAM0() {
    converter::on_interrupt();
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn CAN1_TX() {
    // SAFETY: this is the handler of the interrupt that `start` gave this executor. `start` unmasks the
    // interrupt after the executor is initialised.
    unsafe { ACQUIRE.on_interrupt() }
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn CAN1_RX0() {
    // SAFETY: as above.
    unsafe { ESTIMATE.on_interrupt() }
}

#[interrupt]
#[allow(unsafe_code, reason = "the executor asks for it")]
fn CAN1_RX1() {
    // SAFETY: as above.
    unsafe { REST.on_interrupt() }
}
