//! Arithmetic of a step, on the widest vectors of the processor.
//!
//! # Design
//!
//! A stage is one pass over the blocks: sums over earlier stages, forces of the contacts, accelerations.
//! Values of neighbouring lanes are shifted in registers, because reading them back from memory just after
//! they were written would stall. Numbers are added and multiplied one by one, in the same order on every
//! processor, so results have the same bits everywhere.

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce, Simd, f64x8};

use super::lanes::{
    BLOCK, Guests, LaneBlock, Lanes, before, behind, blocks, blocks_mut, first, push, select,
};
use super::method::{ERROR, LATE_STAGES, NODES, POWERS, ROWS, TERMS, quadrature};
use super::verner::{MAIN, STAGES};
use super::work::{Motion, Work};

/// Part of a step to compute.
#[derive(Debug, Clone, Copy)]
pub(super) enum Task {
    /// All stages of a step and its end. Returns the number of blocks with contacts that open or close.
    Step,
    /// The contacts that open or close in the step; after `Step`.
    Cross { tolerance: f64 },
    /// One stage of the dense output; after `Cross`.
    Inner { stage: usize },
    /// The motion at the part `x` of the step; after all stages of the dense output.
    Interpolate { x: f64 },
    /// Returns the greatest error of a velocity, over step length and allowed error; NaN if one is NaN.
    Error { tolerance: f64 },
    /// Computes this error for each block, into [`Work::errors`].
    Errors { tolerance: f64 },
}

/// One kind of task on one kind of vectors: a function of its own, with its own allocation of registers.
struct KernelCall<'a, S, const KIND: u8> {
    simd: S,
    work: &'a mut Work,
    lanes: &'a Lanes,
    task: Task,
    length: f64,
}

/// Runs a task on the widest vectors of this processor.
pub(super) fn dispatch(work: &mut Work, lanes: &Lanes, task: Task, length: f64) -> f64 {
    let general = lanes.general;
    match task {
        Task::Step if lanes.powers.is_some() => of_kind::<STEP_OF_POWERS>(work, lanes, task, length),
        Task::Inner { .. } if lanes.powers.is_some() => of_kind::<INNER_OF_POWERS>(work, lanes, task, length),
        Task::Step if general => of_kind::<STEP_OF_ANY>(work, lanes, task, length),
        Task::Step => of_kind::<STEP>(work, lanes, task, length),
        Task::Cross { .. } => of_kind::<CROSS>(work, lanes, task, length),
        Task::Inner { .. } if general => of_kind::<INNER_OF_ANY>(work, lanes, task, length),
        Task::Inner { .. } => of_kind::<INNER>(work, lanes, task, length),
        Task::Interpolate { .. } => of_kind::<INTERPOLATE>(work, lanes, task, length),
        Task::Error { .. } => of_kind::<ERRS>(work, lanes, task, length),
        Task::Errors { .. } => of_kind::<EACH>(work, lanes, task, length),
    }
}

const STEP: u8 = 0;
const INNER: u8 = 1;
const INTERPOLATE: u8 = 2;
const ERRS: u8 = 3;
const CROSS: u8 = 4;
/// For chains with a static load, clipped forces, a drive, drag or springs that harden too.
const STEP_OF_ANY: u8 = 5;
const INNER_OF_ANY: u8 = 6;
const EACH: u8 = 7;
/// For contacts with other powers than Hertz'.
const STEP_OF_POWERS: u8 = 8;
const INNER_OF_POWERS: u8 = 9;

fn of_kind<const KIND: u8>(work: &mut Work, lanes: &Lanes, task: Task, length: f64) -> f64 {
    macro_rules! call {
        ($simd:expr) => {
            KernelCall::<_, KIND> {
                simd: $simd,
                work,
                lanes,
                task,
                length,
            }
        };
    }
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => simd.vectorize(call!(simd)),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => simd.vectorize(call!(pulp::x86::V3_512b(simd))),
        _ => call!(pulp::Scalar512b).call(),
    }
}

impl<S: Simd<f64s = f64x8>, const KIND: u8> NullaryFnOnce for KernelCall<'_, S, KIND> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let Self {
            simd,
            work,
            lanes,
            task,
            length,
        } = self;
        match (KIND, task) {
            (STEP_OF_POWERS, _) => step::<S, true, true>(simd, work, lanes, length),
            (STEP_OF_ANY, _) => step::<S, true, false>(simd, work, lanes, length),
            (STEP, _) => step::<S, false, false>(simd, work, lanes, length),
            (INNER_OF_POWERS, Task::Inner { stage: number }) => {
                any_stage::<S, true>(simd, work, lanes, number, length);
                0.0
            }
            (INNER_OF_ANY, Task::Inner { stage: number }) => {
                any_stage::<S, false>(simd, work, lanes, number, length);
                0.0
            }
            (INNER, Task::Inner { stage: number }) => {
                stage::<S, false, false>(simd, work, lanes, number, length);
                0.0
            }
            (CROSS, Task::Cross { tolerance }) => {
                work.find_crossings(lanes, length, tolerance);
                0.0
            }
            (INTERPOLATE, Task::Interpolate { x }) => {
                interpolate(simd, work, lanes, length, x);
                0.0
            }
            (ERRS, Task::Error { tolerance }) => error(simd, work, lanes, tolerance),
            (EACH, Task::Errors { tolerance }) => {
                error_of_each(simd, work, lanes, tolerance);
                0.0
            }
            _ => unreachable!("dispatch chose the kind"),
        }
    }
}

/// The stages of a block, eight lanes each.
type Rates = [LaneBlock; STAGES];

/// Divides an array of accelerations into blocks.
#[inline(always)]
fn all_rates(rates: &[f64]) -> &[Rates] {
    blocks(rates).as_chunks().0
}

#[inline(always)]
fn step<S: Simd<f64s = f64x8>, const GENERAL: bool, const POWERS_TOO: bool>(
    simd: S,
    work: &mut Work,
    lanes: &Lanes,
    length: f64,
) -> f64 {
    for run in &work.active {
        work.lost[first(run.start)..first(run.end)].fill(0.0);
    }
    for &at in &work.active_guests {
        work.lost[at * BLOCK..(at + 1) * BLOCK].fill(0.0);
    }
    for number in 0..MAIN {
        if GENERAL {
            any_stage::<S, POWERS_TOO>(simd, work, lanes, number, length);
        } else {
            stage::<S, false, false>(simd, work, lanes, number, length);
        }
    }
    finish(simd, work, lanes, length)
}

/// Stages with a weight only in the displacements of a row.
const BENDS: [Range<usize>; STAGES] = terms(true);
/// Stages after the first with a weight in a row's velocities.
const WEIGHS: [Range<usize>; STAGES] = terms(false);

/// Stages after the first with a weight in a row. `bends` selects those before the first that has a weight in
/// velocities too, which act on displacements alone; otherwise the others.
const fn terms(bends: bool) -> [Range<usize>; STAGES] {
    let mut ranges = [const { 0..0 }; STAGES];
    let mut row = 0;
    while row < STAGES {
        let (mut from, mut split, mut end) = (STAGES, STAGES, 1);
        let mut stage = 1;
        while stage < STAGES {
            let weight = ROWS[row][stage];
            let (speeds, bends) = (weight.velocity != 0.0, weight.displacement != 0.0);
            if speeds || bends {
                if from == STAGES {
                    from = stage;
                }
                if speeds && split == STAGES {
                    split = stage;
                }
                end = stage + 1;
            }
            stage += 1;
        }
        if from < end {
            ranges[row] = if bends { from..split } else { split..end };
        }
        row += 1;
    }
    ranges
}

/// Returns displacements and velocities of eight lanes at a stage, from those at the start.
#[inline(always)]
fn moved<S: Simd<f64s = f64x8>>(
    simd: S,
    (u, v): (LaneBlock, LaneBlock),
    rates: &Rates,
    row: usize,
    length: f64,
) -> (f64x8, f64x8) {
    let (u, v): (f64x8, f64x8) = (pulp::cast(u), pulp::cast(v));
    let weights = &ROWS[row];
    let (once, twice) = (
        simd.splat_f64s(weights[0].velocity),
        simd.splat_f64s(weights[0].displacement),
    );
    let rate: f64x8 = pulp::cast(rates[0]);
    let (mut once, mut twice) = (simd.mul_f64s(once, rate), simd.mul_f64s(twice, rate));
    // Two early stages have no weight in the velocities of later ones.
    for stage in BENDS[row].clone() {
        let bend = simd.mul_f64s(
            simd.splat_f64s(weights[stage].displacement),
            pulp::cast(rates[stage]),
        );
        twice = simd.add_f64s(twice, bend);
    }
    let terms = WEIGHS[row].clone();
    for (weight, rate) in weights[terms.clone()].iter().zip(&rates[terms]) {
        let rate: f64x8 = pulp::cast(*rate);
        once = simd.add_f64s(once, simd.mul_f64s(simd.splat_f64s(weight.velocity), rate));
        twice = simd.add_f64s(twice, simd.mul_f64s(simd.splat_f64s(weight.displacement), rate));
    }
    let time = simd.splat_f64s(NODES[row] * length);
    let bent = simd.mul_f64s(simd.splat_f64s(length * length), twice);
    let way = simd.add_f64s(simd.mul_f64s(time, v), bent);
    let change = simd.mul_f64s(simd.splat_f64s(length), once);
    (simd.add_f64s(u, way), simd.add_f64s(v, change))
}

/// Blocks with 1 in one lane and 0 in all others.
const ONE: [LaneBlock; BLOCK] = {
    let mut one = [[0.0; BLOCK]; BLOCK];
    let mut lane = 0;
    while lane < BLOCK {
        one[lane][lane] = 1.0;
        lane += 1;
    }
    one
};

#[inline(always)]
fn sum_into<S: Simd<f64s = f64x8>>(simd: S, sum: &mut LaneBlock, factor: f64, part: f64x8) {
    let part = simd.mul_f64s(simd.splat_f64s(factor), part);
    *sum = pulp::cast(simd.add_f64s(pulp::cast(*sum), part));
}

/// Stiffness k + k₃ x² of the springs of a block over their strokes.
#[inline(always)]
fn hardened<S: Simd<f64s = f64x8>>(
    simd: S,
    stiffness: LaneBlock,
    (cubic, seat): (Option<&[LaneBlock]>, usize),
    x: f64x8,
) -> f64x8 {
    let stiffness = pulp::cast(stiffness);
    let Some(cubic) = cubic else { return stiffness };
    let square = simd.mul_f64s(simd.mul_f64s(pulp::cast(cubic[seat]), x), x);
    simd.add_f64s(stiffness, square)
}

/// Adds the contribution of exactly integrated contacts to the motion of a block.
#[inline(always)]
fn add<S: Simd<f64s = f64x8>>(simd: S, added: &Motion, at: usize, u: &mut f64x8, v: &mut f64x8) {
    *u = simd.add_f64s(*u, pulp::cast(blocks(&added.u)[at]));
    *v = simd.add_f64s(*v, pulp::cast(blocks(&added.v)[at]));
}

#[inline(always)]
fn stage<S: Simd<f64s = f64x8>, const GENERAL: bool, const POWERS_TOO: bool>(
    simd: S,
    work: &mut Work,
    lanes: &Lanes,
    number: usize,
    length: f64,
) {
    let zero = simd.splat_f64s(0.0);
    let guests = &lanes.guests;
    let counts = number < MAIN;
    let weight = if counts { length * quadrature(number) } else { 0.0 };
    let added = work.added.as_deref().filter(|_| !counts);
    let mut powers = work.powers.as_deref_mut();
    let keeps_powers = powers.is_some();
    let length_of = lanes.len() / BLOCK;
    let u_start = &blocks(&work.start.u)[..length_of];
    let v_start = &blocks(&work.start.v)[..length_of];
    let rates = &mut blocks_mut(&mut work.rates).as_chunks_mut::<STAGES>().0[..length_of];
    let lost = &mut blocks_mut(&mut work.lost)[..length_of];
    let seats = guests.blocks.len();
    let pulls = &mut blocks_mut(&mut work.pulls)[..seats];
    let stiffness = &blocks(&guests.stiffness)[..seats];
    let damping = &blocks(&guests.damping)[..seats];
    let cubic = guests.cubic.as_deref().filter(|_| GENERAL).map(blocks);
    // The block shared by bodies and intruders, and its motion.
    let mut shared = (0, zero, zero);
    for &at in &work.active_guests {
        let seat = at - guests.blocks.start;
        let (mut x, mut w) = moved(simd, (u_start[at], v_start[at]), &rates[at], number, length);
        if let Some(added) = added {
            add(simd, added, at, &mut x, &mut w);
        }
        if guests.home.is_some() {
            shared = (at, x, w);
        }
        let damped = simd.mul_f64s(pulp::cast(damping[seat]), w);
        let stiff = hardened(simd, stiffness[seat], (cubic, seat), x);
        let pull = simd.add_f64s(simd.mul_f64s(stiff, x), damped);
        pulls[seat] = pulp::cast(pull);
        let power = simd.mul_f64s(damped, w);
        if weight != 0.0 {
            sum_into(simd, &mut lost[at], weight, power);
        }
        if let Some(powers) = &mut powers {
            blocks_mut(&mut powers.guests)[seat * STAGES + number] = pulp::cast(power);
        }
    }

    pull_carriers(guests, &work.active, pulls);
    let contacts = lanes.contacts(length_of, &work.closed);
    let inverse = &blocks(&lanes.inverse)[..length_of];
    let mut power_sum = zero;
    let mut wall_force = 0.0;
    for run in &work.active {
        assert!(run.end < length_of - 1, "blocks of this chain");
        let edge = run.start;
        // The body before the run flies freely.
        let mut v_before: f64x8 = pulp::cast(v_start[edge]);
        let way = simd.mul_f64s(simd.splat_f64s(NODES[number] * length), v_before);
        let mut u_before = simd.add_f64s(pulp::cast(u_start[edge]), way);
        let mut force_before = zero;
        for at in run.start + 1..run.end + 2 {
            let mut force = zero;
            if at < run.end + 1 {
                let (mut u, mut v) = (shared.1, shared.2);
                if at != shared.0 {
                    (u, v) = moved(simd, (u_start[at], v_start[at]), &rates[at], number, length);
                    if let Some(added) = added {
                        add(simd, added, at, &mut u, &mut v);
                    }
                }
                let near = (before(u_before, u), before(v_before, v));
                let power;
                (force, power) = push::<S, GENERAL, POWERS_TOO>(simd, contacts, at, near, (u, v));
                if lanes.viscous {
                    if weight != 0.0 {
                        sum_into(simd, &mut lost[at], weight, power);
                    }
                    if keeps_powers && !work.shared.contains(&(at - 1)) {
                        power_sum = simd.add_f64s(power_sum, power);
                    }
                }
                (u_before, v_before) = (u, v);
                if lanes.wall.is_some_and(|wall| wall / BLOCK == at) {
                    let forces: LaneBlock = pulp::cast(force);
                    wall_force = forces[lanes.bodies % BLOCK];
                }
            }
            if at > run.start + 1 {
                let mut total = simd.sub_f64s(force_before, behind(force_before, force));
                total = pulled(simd, guests, pulls, at - 2, total);
                let rate = simd.mul_f64s(total, pulp::cast(inverse[at - 1]));
                rates[at - 1][number] = pulp::cast(rate);
            }
            force_before = force;
        }
    }

    for &at in &work.active_guests {
        let pull = pulp::cast(pulls[at - guests.blocks.start]);
        accelerate_guests(simd, guests, rates, number, (at, at == shared.0), pull);
    }
    accelerate_carried(guests, &work.active, rates, number, pulls);
    work.wall_impulse += weight * wall_force;
    if let Some(powers) = powers {
        powers.contacts[number] = pulp::cast::<f64x8, LaneBlock>(power_sum).iter().sum();
        powers.wall[number] = wall_force;
    }
}

/// A stage of a chain of any kind, with the drive of body 0 and the drag of the ground.
#[inline(always)]
fn any_stage<S: Simd<f64s = f64x8>, const POWERS_TOO: bool>(
    simd: S,
    work: &mut Work,
    lanes: &Lanes,
    number: usize,
    length: f64,
) {
    stage::<S, true, POWERS_TOO>(simd, work, lanes, number, length);
    if let Some(drag) = &lanes.drag {
        drag_stage(simd, work, lanes, blocks(drag), number, length);
    }
    if work.driven.is_some() {
        drive_stage::<S, POWERS_TOO>(simd, work, lanes, number, length);
    }
}

/// Takes the drag of the ground from the accelerations of the beads at a stage, and adds up its power. Each
/// velocity is computed once more for that.
#[inline(always)]
fn drag_stage<S: Simd<f64s = f64x8>>(
    simd: S,
    work: &mut Work,
    lanes: &Lanes,
    drag: &[LaneBlock],
    number: usize,
    length: f64,
) {
    let counts = number < MAIN;
    let weight = if counts { length * quadrature(number) } else { 0.0 };
    let count = lanes.len() / BLOCK;
    let (guests, inverse) = (&lanes.guests, blocks(&lanes.inverse));
    let rates = &mut blocks_mut(&mut work.rates).as_chunks_mut::<STAGES>().0[..count];
    let mut powers = simd.splat_f64s(0.0);
    for at in work.active.iter().flat_map(|run| run.start + 1..run.end + 1) {
        let start = (blocks(&work.start.u)[at], blocks(&work.start.v)[at]);
        let (mut u, mut v) = moved(simd, start, &rates[at], number, length);
        if let Some(added) = work.added.as_deref().filter(|_| !counts) {
            add(simd, added, at, &mut u, &mut v);
        }
        let pull = simd.mul_f64s(pulp::cast(drag[at]), v);
        powers = simd.add_f64s(powers, simd.mul_f64s(pull, v));
        let slowed = simd.mul_f64s(pull, pulp::cast(inverse[at]));
        rates[at][number] = pulp::cast(simd.sub_f64s(pulp::cast(rates[at][number]), slowed));
        let slowed: LaneBlock = pulp::cast(slowed);
        // An intruder that the bead carries moves relative to it.
        for guest in guests.of_block[at - 1].clone() {
            if guests.carriers[guest].is_none() {
                let lane = guests.lane(guest);
                rates[lane / BLOCK][number][lane % BLOCK] += slowed[guests.hosts[guest] % BLOCK];
            }
        }
    }
    let power: f64 = pulp::cast::<f64x8, LaneBlock>(powers).iter().sum();
    work.ground_lost += weight * power;
    if let Some(powers) = &mut work.powers {
        powers.ground[number] = power;
    }
}

/// Adds the drive to the acceleration of body 0 at a stage, and takes its power. The force of the first
/// contact is computed once more for that. No other body has an acceleration that depends on it at this
/// stage.
#[inline(always)]
fn drive_stage<S: Simd<f64s = f64x8>, const POWERS_TOO: bool>(
    simd: S,
    work: &mut Work,
    lanes: &Lanes,
    number: usize,
    length: f64,
) {
    let counts = number < MAIN;
    let weight = if counts { length * quadrature(number) } else { 0.0 };
    let count = lanes.len() / BLOCK;
    let start = (blocks(&work.start.u)[1], blocks(&work.start.v)[1]);
    let rates = &mut blocks_mut(&mut work.rates).as_chunks_mut::<STAGES>().0[..count];
    let (mut u, mut v) = moved(simd, start, &rates[1], number, length);
    if let Some(added) = work.added.as_deref().filter(|_| !counts) {
        add(simd, added, 1, &mut u, &mut v);
    }
    let zero = simd.splat_f64s(0.0);
    let contacts = lanes.contacts(count, &work.closed);
    let near = (before(zero, u), before(zero, v));
    let (force, _) = push::<S, true, POWERS_TOO>(simd, contacts, 1, near, (u, v));
    let (forces, speeds): (LaneBlock, LaneBlock) = (pulp::cast(force), pulp::cast(v));
    if let Some(driven) = &mut work.driven {
        driven.take_power(number, weight, forces[1], speeds[0]);
        rates[1][number][0] += driven.accelerations[number];
    }
}

/// Adds the pulls of all intruders in a block of bodies to the forces on these. The pull of a carrier is less
/// the pulls of what it carries, so the sum is the pull of those that the bodies carry themselves.
#[inline(always)]
fn pulled<S: Simd<f64s = f64x8>>(
    simd: S,
    guests: &Guests,
    pulls: &[LaneBlock],
    block: usize,
    mut total: f64x8,
) -> f64x8 {
    for guest in guests.of_block[block].clone() {
        let seat = guests.seat(guest);
        let pull = simd.splat_f64s(pulls[seat / BLOCK][seat % BLOCK]);
        let one: f64x8 = pulp::cast(ONE[guests.hosts[guest] % BLOCK]);
        total = simd.add_f64s(total, simd.mul_f64s(pull, one));
    }
    total
}

/// Subtracts the pull of each carried intruder in a moving body from that of its carrier. A carrier comes
/// before what it carries, so each pull is still whole when it is subtracted.
#[inline(always)]
fn pull_carriers(guests: &Guests, active: &[Range<usize>], pulls: &mut [LaneBlock]) {
    for (guest, carrier) in guests.carried_in(active) {
        let (seat, of_carrier) = (guests.seat(guest), guests.seat(carrier));
        pulls[of_carrier / BLOCK][of_carrier % BLOCK] -= pulls[seat / BLOCK][seat % BLOCK];
    }
}

/// Writes the accelerations of carried intruders in moving bodies relative to their carriers.
#[inline(always)]
fn accelerate_carried(
    guests: &Guests,
    active: &[Range<usize>],
    rates: &mut [Rates],
    number: usize,
    pulls: &[LaneBlock],
) {
    for (guest, carrier) in guests.carried_in(active) {
        let [own, of_carrier] = [guest, carrier].map(|guest| guests.acceleration(guest, pulls));
        let lane = guests.lane(guest);
        rates[lane / BLOCK][number][lane % BLOCK] = own - of_carrier;
    }
}

/// Adds the accelerations of a block of intruders relative to their hosts. A shared block has those of its
/// bodies.
#[inline(always)]
fn accelerate_guests<S: Simd<f64s = f64x8>>(
    simd: S,
    guests: &Guests,
    rates: &mut [Rates],
    number: usize,
    (at, is_shared): (usize, bool),
    pull: f64x8,
) {
    let inverse = blocks(&guests.inverse)[at - guests.blocks.start];
    let pulled = simd.mul_f64s(pull, pulp::cast(inverse));
    let of_bodies = if is_shared {
        pulp::cast(rates[at][number])
    } else {
        simd.splat_f64s(0.0)
    };
    let mut rate = simd.sub_f64s(of_bodies, pulled);
    for guest in guests.within(at) {
        let host = guests.hosts[guest];
        let of_host = simd.splat_f64s(rates[host / BLOCK][number][host % BLOCK]);
        let lane = guests.lane(guest) % BLOCK;
        rate = simd.sub_f64s(rate, simd.mul_f64s(of_host, pulp::cast(ONE[lane])));
    }
    rates[at][number] = pulp::cast(rate);
}

/// Returns 1 in lanes whose contact is closed, 0 in others.
#[inline(always)]
fn closed<S: Simd<f64s = f64x8>>(simd: S, near: f64x8, far: f64x8, rest: f64x8) -> f64x8 {
    let overlap = simd.add_f64s(simd.sub_f64s(near, far), rest);
    let zero = simd.splat_f64s(0.0);
    select(
        simd,
        simd.greater_than_f64s(overlap, zero),
        simd.splat_f64s(1.0),
        zero,
    )
}

/// Computes the end of the step. Returns the number of blocks with contacts that open or close.
#[inline(always)]
fn finish<S: Simd<f64s = f64x8>>(simd: S, work: &mut Work, lanes: &Lanes, length: f64) -> f64 {
    let count = lanes.len() / BLOCK;
    let (start, end) = (&work.start, &mut work.end);
    let (u_start, v_start) = (&blocks(&start.u)[..count], &blocks(&start.v)[..count]);
    let u_end = &mut blocks_mut(&mut end.u)[..count];
    let v_end = &mut blocks_mut(&mut end.v)[..count];
    let rest = &blocks(&lanes.rest)[..count];
    let rates = &all_rates(&work.rates)[..count];
    let mut crossed = simd.splat_f64s(0.0);
    for run in &work.active {
        assert!(run.end < count - 1, "blocks of this chain");
        let mut from_before: f64x8 = pulp::cast(u_start[run.start]);
        let way = simd.mul_f64s(simd.splat_f64s(length), pulp::cast(v_start[run.start]));
        let mut to_before = simd.add_f64s(from_before, way);
        for at in run.start + 1..run.end + 1 {
            let (u, v) = moved(simd, (u_start[at], v_start[at]), &rates[at], MAIN, length);
            (u_end[at], v_end[at]) = (pulp::cast(u), pulp::cast(v));
            let (from, rest) = (pulp::cast(u_start[at]), pulp::cast(rest[at]));
            let first = closed(simd, before(from_before, from), from, rest);
            let last = closed(simd, before(to_before, u), u, rest);
            let turned = simd.sub_f64s(first, last);
            crossed = simd.add_f64s(crossed, simd.mul_f64s(turned, turned));
            (from_before, to_before) = (from, u);
        }
    }
    for &at in work.active_guests.iter().filter(|_| lanes.guests.home.is_none()) {
        let (x, w) = moved(simd, (u_start[at], v_start[at]), &rates[at], MAIN, length);
        (u_end[at], v_end[at]) = (pulp::cast(x), pulp::cast(w));
    }
    let crossed: LaneBlock = pulp::cast(crossed);
    crossed.iter().sum()
}

#[inline(always)]
fn size<S: Simd<f64s = f64x8>>(simd: S, lanes: f64x8) -> f64x8 {
    simd.max_f64s(lanes, simd.sub_f64s(simd.splat_f64s(0.0), lanes))
}

/// Returns the errors of eight velocities over the allowed error.
#[inline(always)]
fn errors<S: Simd<f64s = f64x8>>(
    simd: S,
    rates: &Rates,
    (from, to): (f64x8, f64x8),
    (floor, part): (f64x8, f64x8),
) -> f64x8 {
    let mut error = simd.splat_f64s(0.0);
    for &(stage, weight) in ERROR {
        let part = simd.mul_f64s(simd.splat_f64s(weight), pulp::cast(rates[stage]));
        error = simd.add_f64s(error, part);
    }
    let scale = simd.max_f64s(size(simd, from), size(simd, to));
    let allowed = simd.add_f64s(floor, simd.mul_f64s(part, scale));
    simd.div_f64s(size(simd, error), allowed)
}

#[inline(always)]
fn error<S: Simd<f64s = f64x8>>(simd: S, work: &Work, lanes: &Lanes, tolerance: f64) -> f64 {
    let zero = simd.splat_f64s(0.0);
    let allowed = (
        simd.splat_f64s(0.01 * tolerance * lanes.speed),
        simd.splat_f64s(tolerance),
    );
    let (mut greatest, mut trace) = (zero, zero);
    let (start, end) = (&work.start, &work.end);
    let rates = all_rates(&work.rates);
    for at in moving(work, lanes) {
        let (from, to) = (pulp::cast(blocks(&start.v)[at]), pulp::cast(blocks(&end.v)[at]));
        let error = errors(simd, &rates[at], (from, to), allowed);
        greatest = simd.max_f64s(greatest, error);
        trace = simd.add_f64s(trace, simd.mul_f64s(zero, simd.add_f64s(error, to)));
    }
    let greatest: LaneBlock = pulp::cast(greatest);
    let trace: LaneBlock = pulp::cast(trace);
    // A maximum may ignore a NaN; this sum of zeros does not.
    greatest.into_iter().fold(0.0, f64::max) + trace.iter().sum::<f64>()
}

#[inline(always)]
fn error_of_each<S: Simd<f64s = f64x8>>(simd: S, work: &mut Work, lanes: &Lanes, tolerance: f64) {
    let allowed = (
        simd.splat_f64s(0.01 * tolerance * lanes.speed),
        simd.splat_f64s(tolerance),
    );
    let rates = all_rates(&work.rates);
    work.errors.resize(lanes.blocks, 0.0);
    for at in work.active.iter().flat_map(|run| run.start + 1..run.end + 1) {
        let (from, to) = (blocks(&work.start.v)[at], blocks(&work.end.v)[at]);
        let ends = (pulp::cast(from), pulp::cast(to));
        let errors: LaneBlock = pulp::cast(errors(simd, &rates[at], ends, allowed));
        let worst = |worst: f64, error: f64| if error < worst { worst } else { error };
        work.errors[at - 1] = errors.into_iter().fold(0.0, worst);
    }
}

/// Moving blocks of an array.
#[inline(always)]
pub(super) fn moving<'a>(work: &'a Work, lanes: &Lanes) -> impl Iterator<Item = usize> + use<'a> {
    let shared = lanes.guests.home.is_some();
    let bodies = work.active.iter().flat_map(|run| run.start + 1..run.end + 1);
    let guests = work.active_guests.iter().copied();
    bodies.chain(guests.filter(move |_| !shared))
}

/// [`POWERS`] power by power: the weights of all stages in velocities, then in displacements.
static INSIDE_WEIGHTS: [[LaneBlock; 2 * WIDE]; TERMS] = {
    let mut weights = [[[0.0; BLOCK]; 2 * WIDE]; TERMS];
    let mut stage = 0;
    while stage < STAGES {
        let (block, lane) = (stage / BLOCK, stage % BLOCK);
        let mut power = 0;
        while power < TERMS {
            weights[power][block][lane] = POWERS[stage][power].velocity;
            weights[power][WIDE + block][lane] = POWERS[stage][power].displacement;
            power += 1;
        }
        stage += 1;
    }
    weights
};
/// Blocks needed to hold a number for each stage.
const WIDE: usize = STAGES.div_ceil(BLOCK);

/// Computes the weights at one part of the step, then one sum over the stages for each block. For the few
/// times looked at in a step, this is less work than converting each lane's motion into powers first.
#[inline(always)]
fn interpolate<S: Simd<f64s = f64x8>>(simd: S, work: &mut Work, lanes: &Lanes, length: f64, x: f64) {
    let mut weights = [simd.splat_f64s(0.0); 2 * WIDE];
    let s = simd.splat_f64s(x - 0.5);
    for powers in INSIDE_WEIGHTS.iter().rev() {
        for (sum, power) in weights.iter_mut().zip(powers) {
            *sum = simd.add_f64s(simd.mul_f64s(*sum, s), pulp::cast(*power));
        }
    }
    let (once, twice) = (simd.splat_f64s(x * length), simd.splat_f64s(x * length * length));
    let (mut of_speed, mut of_place) = ([[0.0; BLOCK]; WIDE], [[0.0; BLOCK]; WIDE]);
    for at in 0..WIDE {
        of_speed[at] = pulp::cast(simd.mul_f64s(once, weights[at]));
        of_place[at] = pulp::cast(simd.mul_f64s(twice, weights[WIDE + at]));
    }
    let (of_speed, of_place) = (of_speed.as_flattened(), of_place.as_flattened());
    work.weights.copy_from_slice(&of_speed[..STAGES]);

    let mut stage = std::mem::take(&mut work.stage);
    let rates = all_rates(&work.rates);
    let (u_start, v_start) = (blocks(&work.start.u), blocks(&work.start.v));
    let (u_to, v_to) = (blocks_mut(&mut stage.u), blocks_mut(&mut stage.v));
    let time = simd.splat_f64s(x * length);
    for at in moving(work, lanes) {
        let rates = &rates[at];
        let rate: f64x8 = pulp::cast(rates[0]);
        let mut change = simd.mul_f64s(simd.splat_f64s(of_speed[0]), rate);
        let mut bent = simd.mul_f64s(simd.splat_f64s(of_place[0]), rate);
        for stage in LATE_STAGES {
            let rate: f64x8 = pulp::cast(rates[stage]);
            change = simd.add_f64s(change, simd.mul_f64s(simd.splat_f64s(of_speed[stage]), rate));
            bent = simd.add_f64s(bent, simd.mul_f64s(simd.splat_f64s(of_place[stage]), rate));
        }
        let (u, v): (f64x8, f64x8) = (pulp::cast(u_start[at]), pulp::cast(v_start[at]));
        let way = simd.add_f64s(simd.mul_f64s(time, v), bent);
        u_to[at] = pulp::cast(simd.add_f64s(u, way));
        v_to[at] = pulp::cast(simd.add_f64s(v, change));
    }
    work.stage = stage;
}
