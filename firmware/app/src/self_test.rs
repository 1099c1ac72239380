//! Checks that the bead runs on itself.

use bead_model::WindowRecord;
use bead_model::settings::Settings;
use bead_store::Vault;
use bead_wire::{Check, SelfTest, Standing};

use crate::bead::BeadState;
use crate::device::{Device, MS};
use crate::{built_in, known_answer, settings};

/// Range of a good supply, in mV: from the threshold of the voltage detector to the most that the part
/// allows.
const SUPPLY: core::ops::RangeInclusive<u32> = 2930..=3600;
/// Least stack that must never have been used, in bytes.
const STACK: u32 = 4096;
/// Time for which samples are counted: ten blocks.
const SAMPLES: u64 = 20 * MS;
/// Least number of blocks in that time: two may be late.
const BLOCKS: u32 = 8;

/// The verdict of a self-test.
pub(crate) struct Verdict {
    /// Number of checks that failed.
    pub(crate) failed: usize,
    /// Number of checks.
    pub(crate) checks: usize,
    /// The first one that failed through a fault of the image itself, not of the sensors or the supply.
    pub(crate) image_failed: Option<Check>,
}

/// Runs every check, and sends its result. `window` is room to work in.
pub(crate) async fn run<D: Device>(
    bead: &BeadState<D>,
    store: &mut Vault<D::Flash>,
    window: &mut WindowRecord,
) -> Verdict {
    let before = bead.snapshot();
    bead.device.sleep(SAMPLES).await;
    let now = bead.snapshot();
    let standing = |bits: Standing| u32::from(now.health.standing.bits() & bits.bits());

    let supply = u32::from(now.health.supply_mv);
    let force = standing(Standing::FORCE_STUCK.with(Standing::FORCE_RAILED));
    let acceleration = standing(Standing::ACCELERATION_STUCK.with(Standing::ACCELERATION_RAILED));
    let blocks = now.blocks_handed_on.wrapping_sub(before.blocks_handed_on);
    let block = bead.settings.block();
    let stack = bead.device.stack_never_used();
    let differing = differing_results(window);
    let stored = store.read();

    let checks = [
        (
            Check::Supply,
            SUPPLY.contains(&supply) && standing(Standing::SUPPLY_LOW) == 0,
            supply,
        ),
        (Check::Force, force == 0, force),
        (Check::Acceleration, acceleration == 0, acceleration),
        (Check::Acquisition, blocks >= BLOCKS, blocks),
        (
            Check::Settings,
            holds_settings(block.bytes()),
            block.bytes().len() as u32,
        ),
        (Check::Stack, stack >= STACK, stack),
        (Check::Estimators, differing == 0, differing as u32),
        (
            Check::Store,
            stored.is_ok(),
            stored.ok().flatten().map_or(0, |block| block.len() as u32),
        ),
    ];
    for (check, passed, value) in checks {
        bead.send(SelfTest { check, passed, value });
    }
    let failed = checks.iter().filter(|(_, passed, _)| !passed);
    let of_the_hardware = [Check::Supply, Check::Force, Check::Acceleration];
    let mut of_the_image = failed
        .clone()
        .filter(|(check, ..)| !of_the_hardware.contains(check));
    Verdict {
        failed: failed.clone().count(),
        checks: checks.len(),
        image_failed: of_the_image.next().map(|&(check, ..)| check),
    }
}

/// Counts the estimators' results for the made-up window that are wrong. Never inlined: a window would be in
/// the frame of a task.
#[inline(never)]
fn differing_results(window: &mut WindowRecord) -> usize {
    known_answer::results(&settings::of_known_answer(), window)
        .iter()
        .zip(built_in::EXPECTED)
        .filter(|&(result, expected)| *result != expected)
        .count()
}

/// Returns `true` if the bead could measure with these settings. Never inlined, like the function above.
#[inline(never)]
fn holds_settings(block: &[u8]) -> bool {
    Settings::decode(block).is_ok()
}
