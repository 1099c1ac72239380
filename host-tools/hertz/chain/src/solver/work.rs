//! One step of a chain: its stages, its end, and its effects.

use std::ops::Range;

use super::aligned::CacheAligned;
use super::crossing::Crossing;
use super::lanes::{BLOCK, Lanes, first};
use super::method::{LATE_STAGES, NODES, ROWS};
use super::overlap::Ends;
use super::verner::{MAIN, STAGES};
use crate::drive::EndDrive;
use crate::model::StateLayout;

/// Times of the stages, as parts of the step.
const MAIN_NODES: [f64; MAIN] = *NODES.first_chunk().expect("the stages of a step come first");

/// The last of these times before the end of the step.
const LAST: f64 = {
    let (mut last, mut stage) = (0.0, 0);
    while stage < MAIN {
        if MAIN_NODES[stage] > last && MAIN_NODES[stage] < 1.0 - 1e-9 {
            last = MAIN_NODES[stage];
        }
        stage += 1;
    }
    last
};

/// Displacements and velocities, lane by lane: of the bodies, and of the intruders relative to their hosts.
#[derive(Debug, Clone, Default)]
pub(super) struct Motion {
    pub(super) u: CacheAligned,
    pub(super) v: CacheAligned,
}

impl Motion {
    pub(super) fn zeros(lanes: &Lanes) -> Self {
        Self {
            u: CacheAligned::zeros(lanes.len()),
            v: CacheAligned::zeros(lanes.len()),
        }
    }

    /// Copies these lanes of another motion.
    pub(super) fn copy(&mut self, lanes: Range<usize>, from: &Self) {
        self.u[lanes.clone()].copy_from_slice(&from.u[lanes.clone()]);
        self.v[lanes.clone()].copy_from_slice(&from.v[lanes]);
    }
}

/// Memory of a step: the motion at its start, at its stages and at its end.
#[derive(Debug, Clone, Default)]
pub(super) struct Work {
    /// Runs of moving blocks.
    pub(super) active: Vec<Range<usize>>,
    /// Blocks among these that another step moves; they are computed for their neighbours only.
    pub(super) shared: Vec<usize>,
    /// Blocks of an array with moving intruders.
    pub(super) active_guests: Vec<usize>,
    pub(super) start: Motion,
    pub(super) end: Motion,
    /// The motion at the time of [`Work::interpolate`].
    pub(super) stage: Motion,
    /// Weights of the stages in the change of velocities up to that time, s.
    pub(super) weights: [f64; STAGES],
    /// Accelerations, block by block and stage by stage.
    pub(super) rates: CacheAligned,
    /// Error of each block, if it was asked for.
    pub(super) errors: Vec<f64>,
    /// Contribution of exactly integrated contacts to a stage of the dense output.
    pub(super) added: Option<Box<Motion>>,
    /// Force of each intruder's spring and damper on its host at a stage.
    pub(super) pulls: CacheAligned,
    /// Energy dissipated in each contact and intruder, J, and momentum given to the wall, kg·m/s.
    pub(super) lost: CacheAligned,
    pub(super) wall_impulse: f64,
    /// Energy dissipated on the ground, J.
    pub(super) ground_lost: f64,
    /// Contacts that open or close in the step.
    pub(super) crossings: Vec<Crossing>,
    /// Part of the step at which it should end for the next to see a contact close that it misses.
    pub(super) sooner: Option<f64>,
    /// Powers at the stages, if the losses inside a step are wanted.
    pub(super) powers: Option<Box<StagePowers>>,
    /// Drive of body 0 in the step; none without a drive.
    pub(super) driven: Option<Box<DrivenStep>>,
    /// 1 for contacts that are closed in the step, 0 for others, if they have other powers than Hertz'.
    pub(super) closed: CacheAligned,
    /// Lanes of contacts that only touch at the start of the step.
    pub(super) touching: Vec<usize>,
}

/// Drive of body 0 at the stages of a step, and its work.
#[derive(Debug, Clone)]
pub(super) struct DrivenStep {
    /// Start and length of the step, s.
    start: f64,
    length: f64,
    /// True if the body follows the drive.
    pub(super) prescribed: bool,
    /// Accelerations, m/s², and forces, N, beside those of the contact.
    pub(super) accelerations: [f64; STAGES],
    pub(super) forces: [f64; STAGES],
    /// Power at the stages, W, and work in the step, J.
    pub(super) powers: [f64; STAGES],
    pub(super) work: f64,
}

impl DrivenStep {
    /// Speed of a body that follows the drive, at the part `x` of the step, m/s.
    fn speed(&self, drive: &EndDrive, x: f64) -> f64 {
        drive
            .motion(self.start + x * self.length)
            .map_or(0.0, |motion| motion.1)
    }

    /// Takes the power at a stage with this weight in the work: body 0 has this speed, m/s, and its contact
    /// this force beyond the static load, N.
    #[inline(always)]
    pub(super) fn take_power(&mut self, stage: usize, weight: f64, contact: f64, speed: f64) {
        let push = if self.prescribed {
            contact
        } else {
            self.forces[stage]
        };
        self.powers[stage] = push * speed;
        self.work += weight * push * speed;
    }
}

/// Lane of the contact of body 0.
const FIRST_CONTACT: usize = BLOCK + 1;

/// Power dissipated in all contacts, force on the wall, power dissipated on the ground, and power dissipated
/// in each intruder, at each stage.
#[derive(Debug, Clone)]
pub(super) struct StagePowers {
    pub(super) contacts: [f64; STAGES],
    pub(super) wall: [f64; STAGES],
    pub(super) ground: [f64; STAGES],
    pub(super) guests: CacheAligned,
}

/// Index of a lane's acceleration at a stage: block by block, stage by stage.
pub(super) const fn place(lane: usize, stage: usize) -> usize {
    (lane / BLOCK * STAGES + stage) * BLOCK + lane % BLOCK
}

impl Work {
    /// Memory for the steps of a chain at rest.
    pub(super) fn new(lanes: &Lanes) -> Self {
        let guests = lanes.guests.blocks.len() * BLOCK;
        Self {
            start: Motion::zeros(lanes),
            end: Motion::zeros(lanes),
            stage: Motion::zeros(lanes),
            rates: CacheAligned::zeros(lanes.len() * STAGES),
            pulls: CacheAligned::zeros(guests),
            closed: CacheAligned::zeros(if lanes.powers.is_some() { lanes.len() } else { 0 }),
            lost: CacheAligned::zeros(lanes.len()),
            ..Self::default()
        }
    }

    /// Allocates memory for the motion inside a step.
    pub(super) fn keep_inside(&mut self, lanes: &Lanes) {
        if self.added.is_none() {
            self.added = Some(Box::new(Motion::zeros(lanes)));
        }
    }

    /// Keeps the powers at each stage, for [`Work::lost_inside`].
    pub(super) fn keep_powers(&mut self, lanes: &Lanes) {
        self.powers = Some(Box::new(StagePowers {
            contacts: [0.0; STAGES],
            wall: [0.0; STAGES],
            ground: [0.0; STAGES],
            guests: CacheAligned::zeros(lanes.guests.blocks.len() * BLOCK * STAGES),
        }));
    }

    /// Computes the drive at the stages of a step that begins at `start`, s.
    pub(super) fn drive(&mut self, lanes: &Lanes, start: f64, length: f64) {
        let Some(drive) = &lanes.drive else { return };
        let times = NODES.map(|node| start + node * length);
        self.driven = Some(Box::new(DrivenStep {
            start,
            length,
            prescribed: drive.prescribed,
            accelerations: times.map(|t| drive.acceleration(t)),
            forces: times.map(|t| drive.force(t)),
            powers: [0.0; STAGES],
            work: 0.0,
        }));
    }

    /// Sets the start of the next step at `time`, s, to the exact motion of a body that follows a drive.
    pub(super) fn lead(&mut self, lanes: &Lanes, time: f64) {
        let motion = lanes.drive.as_ref().and_then(|drive| drive.motion(time));
        if let Some((place, velocity)) = motion {
            (self.start.u[BLOCK], self.start.v[BLOCK]) = (place, velocity);
        }
    }

    /// Work of the drive in the step, J.
    pub(super) fn drive_work(&self) -> f64 {
        self.driven.as_ref().map_or(0.0, |driven| driven.work)
    }

    /// Makes the end of the step the start of the next.
    pub(super) fn accept(&mut self, lanes: &Lanes) {
        let all_guests = self.active_guests.len() == lanes.guests.blocks.len();
        if self.active.first() == Some(&(0..lanes.blocks)) && all_guests {
            std::mem::swap(&mut self.start, &mut self.end);
            return;
        }
        for run in &self.active {
            self.start.copy(first(run.start)..first(run.end), &self.end);
        }
        for block in &self.active_guests {
            self.start.copy(block * BLOCK..(block + 1) * BLOCK, &self.end);
        }
    }

    /// Energy that the step dissipates in all contacts, J.
    pub(super) fn lost_in_contacts(&self, lanes: &Lanes) -> f64 {
        let end = BLOCK + lanes.bodies + 1;
        let lost = |from: usize, to: usize| self.lost[from..to].iter().sum::<f64>();
        let runs = self.active.iter();
        let runs = runs.map(|run| lost(first(run.start), first(run.end).min(end)));
        let shared = self.shared.iter();
        let shared = shared.map(|&block| lost(first(block), first(block + 1)));
        runs.sum::<f64>() - shared.sum::<f64>()
    }

    /// Energy that the step dissipates in an intruder, J.
    pub(super) fn lost_in_guest(&self, lanes: &Lanes, guest: usize) -> f64 {
        let lane = lanes.guests.lane(guest);
        let moves = self.active_guests.contains(&(lane / BLOCK));
        if moves { self.lost[lane] } else { 0.0 }
    }

    /// Clears the accelerations of a block that is no longer computed.
    pub(super) fn still(&mut self, block: usize) {
        let from = place(first(block), 0);
        self.rates[from..from + BLOCK * STAGES].fill(0.0);
    }

    /// Integrates contacts that open or close exactly, and takes their polynomial force out of the stages.
    #[inline(always)]
    pub(super) fn find_crossings(&mut self, lanes: &Lanes, length: f64, tolerance: f64) {
        for run in 0..self.active.len() {
            self.fly_beside(self.active[run].clone(), length);
            // The contact with a block at rest is open: otherwise the block would not rest.
            for lane in first(self.active[run].start) + 1..first(self.active[run].end) {
                let is_closed = |motion: &Motion| overlap(lanes, motion, lane).0 > 0.0;
                let crosses = is_closed(&self.start) != is_closed(&self.end);
                let cut = lanes.clipped && self.stays_cut_off(lanes, lane);
                if (crosses || cut) && lanes.stiffness[lane] > 0.0 {
                    self.cross(lanes, lane, length, tolerance, cut);
                }
            }
        }
    }

    /// Moves the two bodies beside a run of blocks to the end of the step. They fly freely, so no stage does.
    #[inline(always)]
    fn fly_beside(&mut self, run: Range<usize>, length: f64) {
        for lane in [first(run.start) - 1, first(run.end)] {
            self.end.u[lane] = self.start.u[lane] + length * self.start.v[lane];
            self.end.v[lane] = self.start.v[lane];
        }
    }

    /// Returns true if the force of a contact is clipped at zero for all of the step.
    #[inline(always)]
    fn stays_cut_off(&self, lanes: &Lanes, lane: usize) -> bool {
        let force = |motion: &Motion| {
            let (overlap, rate) = overlap(lanes, motion, lane);
            (overlap, overlap + lanes.viscosity[lane] * rate)
        };
        let ((from, start), (to, end)) = (force(&self.start), force(&self.end));
        // A step begins where the force is first zero, except for rounding.
        from > 0.0 && start < 1e-9 * from && (to <= 0.0 || end <= 0.0)
    }

    #[inline(always)]
    fn cross(&mut self, lanes: &Lanes, lane: usize, length: f64, tolerance: f64, cut: bool) {
        // A force that causes a smaller acceleration cannot harm a velocity.
        let least = 1e-4 * tolerance * lanes.speed / length;
        let pushes = self.driven.as_ref().map_or([0.0; 2], |driven| {
            [driven.accelerations[0], driven.accelerations[MAIN]]
        });
        let start = bend(lanes, lane, &self.start, pushes[0]);
        let end = bend(lanes, lane, &self.end, pushes[1]);
        let (stiffness, viscosity) = (lanes.stiffness[lane], lanes.viscosity[lane]);
        let (deepest, fastest) = (start[0].max(end[0]), start[1].abs().max(end[1].abs()));
        let force = stiffness * deepest.sqrt() * (deepest + viscosity * fastest);
        if force * lanes.inverse[lane - 1].max(lanes.inverse[lane]) < least {
            return;
        }
        // A clipped contact has no force that could move its bodies.
        let inverse = lanes.inverse[lane - 1] + lanes.inverse[lane];
        let compliance = if cut { 0.0 } else { inverse };
        let mut crossing = Crossing::new(lane, (stiffness, viscosity), compliance, length, start, end);
        if cut {
            crossing = crossing.cut_off();
        } else if crossing.unseen(LAST) * compliance * length > tolerance * lanes.speed {
            // The step ends before the root, because an overlap missed at its start would be as bad.
            self.sooner = Some(0.97 * crossing.root());
        }
        let exact = crossing.integrals(1.0);
        let (mut once, mut twice, mut power) = (exact.once, exact.twice, exact.power);
        let (forces, lost) = crossing.forces(&MAIN_NODES);
        for (weight, (force, lost)) in ROWS[MAIN].iter().zip(forces.iter().zip(&lost)) {
            once -= weight.velocity * force;
            twice -= weight.displacement * force;
            power -= weight.velocity * lost;
        }
        self.take(lanes, lane, 0, &forces, &lost);
        self.lost[lane] += length * power;
        if Some(lane) == lanes.wall {
            self.wall_impulse += length * once;
        }
        if lane == FIRST_CONTACT && lanes.drive.is_some() {
            self.add_crossing_work(lanes, &crossing, &forces);
        }
        let change = (length * length * twice, length * once);
        give(lanes, &mut self.end, lane, change);
        self.crossings.push(crossing);
    }

    /// Subtracts parts of a contact's force and dissipated power from the stages that begin with `from`.
    #[inline(always)]
    pub(super) fn take(&mut self, lanes: &Lanes, lane: usize, from: usize, forces: &[f64], powers: &[f64]) {
        for (body, sign) in [(lane - 1, 1.0), (lane, -1.0)] {
            let inverse = sign * lanes.inverse[body];
            let rates = &mut self.rates[place(body, from)..];
            for (rate, force) in rates.iter_mut().step_by(BLOCK).zip(forces) {
                *rate += force * inverse;
            }
            for guest in lanes.guests.of(body) {
                let rates = &mut self.rates[place(lanes.guests.lane(guest), from)..];
                for (rate, force) in rates.iter_mut().step_by(BLOCK).zip(forces) {
                    *rate -= force * inverse;
                }
            }
        }
        if lane == FIRST_CONTACT && lanes.drive.is_some() {
            self.take_drive_powers(lanes, from, forces);
        }
        if let Some(kept) = &mut self.powers {
            for ((stage, force), power) in (from..).zip(forces).zip(powers) {
                kept.contacts[stage] -= power;
                if Some(lane) == lanes.wall {
                    kept.wall[stage] -= force;
                }
            }
        }
    }

    /// Work of a drive that body 0 follows against the exactly integrated part of its contact's force, up to
    /// the part `x` of the step and over the step's length.
    fn crossing_work(&self, lanes: &Lanes, crossing: &Crossing, x: f64) -> f64 {
        let (Some(drive), Some(driven)) = (&lanes.drive, &self.driven) else {
            return 0.0;
        };
        if !driven.prescribed {
            return 0.0;
        }
        crossing.work(x, |x| driven.speed(drive, x))
    }

    /// Adds [`Work::crossing_work`] of the whole step, less what the stages have of it already.
    #[cold]
    fn add_crossing_work(&mut self, lanes: &Lanes, crossing: &Crossing, forces: &[f64; MAIN]) {
        let mut work = self.crossing_work(lanes, crossing, 1.0);
        let (Some(drive), Some(driven)) = (&lanes.drive, &mut self.driven) else {
            return;
        };
        if driven.prescribed {
            for (weight, (force, node)) in ROWS[MAIN].iter().zip(forces.iter().zip(MAIN_NODES)) {
                work -= weight.velocity * force * driven.speed(drive, node);
            }
            driven.work += driven.length * work;
        }
    }

    /// Subtracts the powers of these forces of the first contact from the stages that begin with `from`.
    #[cold]
    fn take_drive_powers(&mut self, lanes: &Lanes, from: usize, forces: &[f64]) {
        let (Some(drive), Some(driven)) = (&lanes.drive, &mut self.driven) else {
            return;
        };
        if driven.prescribed {
            for (stage, force) in (from..).zip(forces) {
                driven.powers[stage] -= force * driven.speed(drive, NODES[stage]);
            }
        }
    }

    /// Returns the losses and the wall's momentum from the start of the step to its part `x`, which is that
    /// of the last [`Work::interpolate`], and adds the energy dissipated in each intruder, J, to `guests`.
    pub(super) fn lost_inside(&self, lanes: &Lanes, length: f64, x: f64, guests: &mut [f64]) -> Losses {
        let powers = self.powers.as_ref().expect("the powers were kept");
        let sum = |stride: usize, powers: &[f64]| {
            let part = |stage: usize| self.weights[stage] * powers[stage * stride];
            let (even, odd) = (LATE_STAGES.step_by(2), LATE_STAGES.skip(1).step_by(2));
            part(0) + even.map(part).sum::<f64>() + odd.map(part).sum::<f64>()
        };
        for (guest, lost) in guests.iter_mut().enumerate() {
            if self.active_guests.contains(&(lanes.guests.lane(guest) / BLOCK)) {
                let seat = lanes.guests.seat(guest);
                *lost += sum(BLOCK, &powers.guests[place(seat, 0)..]);
            }
        }
        let mut inside = Losses {
            contacts: if lanes.viscous {
                sum(1, &powers.contacts)
            } else {
                0.0
            },
            wall: lanes.wall.map_or(0.0, |_| sum(1, &powers.wall)),
            ground: lanes.drag.as_ref().map_or(0.0, |_| sum(1, &powers.ground)),
            drive: self.driven.as_ref().map_or(0.0, |driven| sum(1, &driven.powers)),
        };
        for crossing in &self.crossings {
            let integrals = crossing.integrals(x);
            inside.contacts += length * integrals.power;
            if Some(crossing.lane) == lanes.wall {
                inside.wall += length * integrals.once;
            }
            if crossing.lane == FIRST_CONTACT {
                inside.drive += length * self.crossing_work(lanes, crossing, x);
            }
        }
        inside
    }
}

/// Losses over some time: in contacts and on the ground, J, and to the wall, kg·m/s; and the work of the
/// drive, J.
#[derive(Debug, Clone, Copy)]
pub(super) struct Losses {
    pub(super) contacts: f64,
    pub(super) wall: f64,
    pub(super) ground: f64,
    pub(super) drive: f64,
}

impl Losses {
    /// The losses until this state.
    pub(super) fn of(layout: StateLayout, state: &[f64]) -> Self {
        let at = |index: Option<usize>| index.map_or(0.0, |index| state[index]);
        Self {
            contacts: state[layout.contact_loss()],
            wall: at(layout.wall_impulse()),
            ground: at(layout.ground_loss()),
            drive: at(layout.drive_work()),
        }
    }

    /// Adds the losses to those in a state.
    pub(super) fn add_to(self, layout: StateLayout, state: &mut [f64]) {
        state[layout.contact_loss()] += self.contacts;
        for (index, lost) in [
            (layout.wall_impulse(), self.wall),
            (layout.ground_loss(), self.ground),
            (layout.drive_work(), self.drive),
        ] {
            if let Some(index) = index {
                state[index] += lost;
            }
        }
    }
}

/// Overlap of a contact, m, and its rate, m/s.
#[inline(always)]
pub(super) fn overlap(lanes: &Lanes, motion: &Motion, lane: usize) -> (f64, f64) {
    let (u, v) = (&motion.u[..], &motion.v[..]);
    (u[lane - 1] - u[lane] + lanes.rest[lane], v[lane - 1] - v[lane])
}

/// Moves the bodies of a contact apart, each of mass M by `shift` / M, and their velocities by `kick` / M.
#[inline(always)]
pub(super) fn give(lanes: &Lanes, motion: &mut Motion, lane: usize, (shift, kick): (f64, f64)) {
    for (body, sign) in [(lane - 1, -1.0), (lane, 1.0)] {
        let part = sign * lanes.inverse[body];
        motion.u[body] += shift * part;
        motion.v[body] += kick * part;
        for guest in lanes.guests.of(body) {
            let lane = lanes.guests.lane(guest);
            motion.u[lane] -= shift * part;
            motion.v[lane] -= kick * part;
        }
    }
}

/// Clears what [`give`] has added for a contact at rest.
pub(super) fn clear(lanes: &Lanes, motion: &mut Motion, lane: usize) {
    for body in [lane - 1, lane] {
        (motion.u[body], motion.v[body]) = (0.0, 0.0);
        for guest in lanes.guests.of(body) {
            let lane = lanes.guests.lane(guest);
            (motion.u[lane], motion.v[lane]) = (0.0, 0.0);
        }
    }
}

/// Force of a contact beyond its static load, N.
#[inline(always)]
pub(super) fn force(lanes: &Lanes, lane: usize, motion: &Motion) -> f64 {
    let (overlap, rate) = overlap(lanes, motion, lane);
    if overlap <= 0.0 {
        return -lanes.load[lane];
    }
    let stiff = lanes.stiffness[lane] * overlap.sqrt();
    let force = stiff * (overlap + lanes.viscosity[lane] * rate);
    (if lanes.clipped { force.max(0.0) } else { force }) - lanes.load[lane]
}

/// Overlap of a contact, m, its rate, m/s, and its acceleration, m/s². The drive adds `driven`, m/s², to that
/// of body 0.
#[inline(always)]
fn bend(lanes: &Lanes, lane: usize, motion: &Motion, driven: f64) -> Ends {
    let (u, v) = (&motion.u[..], &motion.v[..]);
    let force = |lane: usize| force(lanes, lane, motion);
    let rate = |body: usize| {
        let guests = &lanes.guests;
        let pulls = guests.of(body).map(|guest| {
            let (seat, lane) = (guests.seat(guest), guests.lane(guest));
            let stiffness = guests.stiffness[seat] + guests.cubic(seat) * u[lane] * u[lane];
            stiffness * u[lane] + guests.damping[seat] * v[lane]
        });
        let drag = lanes.drag.as_ref().map_or(0.0, |drag| drag[body] * v[body]);
        (force(body) - force(body + 1) + pulls.sum::<f64>() - drag) * lanes.inverse[body]
    };
    let mut acceleration = rate(lane - 1) - rate(lane);
    if lane == FIRST_CONTACT && lanes.drive.is_some() {
        acceleration += driven;
    }
    let (overlap, rate) = overlap(lanes, motion, lane);
    [overlap, rate, acceleration]
}

#[cfg(test)]
mod tests;
