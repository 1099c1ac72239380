//! Integration of eight chains at once, each in steps of its own length.
//!
//! # Design
//!
//! All arithmetic is lane by lane, and no lane's steps depend on another's, so a chain has the same bits
//! whatever the other lanes hold. The set of computed contacts is common: those that carry a force, or might
//! in this step, in any of the chains. All others carry no force, so leaving them out changes nothing.

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce};

use super::chain::{ChainShape, Constants};
use super::crossing::{Changes, ContactBatch};
use super::eight::{Eight, LANES, Vector, Wide, all};
use super::kept::{KeptOverlap, KeptSteps};
use super::method::{DISPLACEMENT, END, ERROR, NODES, STAGES, VELOCITY};
use super::peak::{ForcePeaks, farthest};
use crate::model::Model;

/// Displacements and velocities of the bodies, and of the intruders relative to their hosts.
#[derive(Debug, Clone)]
pub(super) struct GroupMotion {
    pub(super) u: Vec<Eight>,
    pub(super) v: Vec<Eight>,
    pub(super) x: Vec<Eight>,
    pub(super) w: Vec<Eight>,
}

impl GroupMotion {
    pub(super) fn zeros(shape: &ChainShape) -> Self {
        let (places, guests) = (shape.places(), shape.hosts.len());
        Self {
            u: vec![Eight::ZERO; places],
            v: vec![Eight::ZERO; places],
            x: vec![Eight::ZERO; guests],
            w: vec![Eight::ZERO; guests],
        }
    }
}

pub(super) type StageRates = [Eight; STAGES];

/// Eight chains of one shape.
#[derive(Debug)]
pub(super) struct Group<'a> {
    pub(super) shape: &'a ChainShape,
    pub(super) constants: &'a Constants,
    pub(super) now: GroupMotion,
    pub(super) next: GroupMotion,
    pub(super) rates: Vec<StageRates>,
    pub(super) guest_rates: Vec<StageRates>,
    pulls: Vec<Eight>,
    /// Energy dissipated in each intruder, J: in this step, and in all steps before.
    lost: Vec<Eight>,
    pub(super) dissipated: Vec<Eight>,
    /// Error of the velocities in this step.
    errors: Vec<Eight>,
    guest_errors: Vec<Eight>,
    /// Time of each lane, s.
    pub(super) time: Eight,
    /// Length of the next step to try, and of the present step, s.
    step: Eight,
    pub(super) length: Eight,
    pub(super) tries: [u64; LANES],
    /// 1 in lanes whose last attempt failed.
    rejected: Eight,
    /// Computed contacts: as flags, and in runs of neighbours.
    active: Vec<bool>,
    pub(super) runs: Vec<Range<usize>>,
    pub(super) guests: Vec<usize>,
    /// Contacts that open or close in the step, by number and lane.
    crossings: Vec<(usize, usize)>,
    changes: Vec<Changes>,
    /// First of the bodies before whose push a lane stops, if wanted, and the stopped lanes.
    unpushed: Option<usize>,
    stopped: [Option<SavedChain>; LANES],
    /// Models of the lanes, for their contacts, and the contacts whose greatest force is wanted.
    pub(super) models: &'a [&'a Model],
    pub(super) peaks: Vec<ForcePeaks>,
    /// Greatest |x| of each intruder so far, m; empty if not wanted.
    pub(super) strokes: Vec<Eight>,
    /// The steps, if a backward pass will need them.
    pub(super) kept: Option<KeptSteps>,
}

/// State of one chain at the end of a step, with its intruders at rest.
#[derive(Debug, Clone)]
pub(super) struct SavedChain {
    u: Vec<f64>,
    v: Vec<f64>,
    time: f64,
    step: f64,
    rejected: f64,
    tries: u64,
    peaks: Vec<(f64, f64)>,
}

/// Lanes that do not reach their end.
pub(super) type StuckLanes = [bool; LANES];

impl<'a> Group<'a> {
    pub(super) fn new(
        shape: &'a ChainShape,
        constants: &'a Constants,
        models: &'a [&'a Model],
        start: GroupMotion,
        peaks: &[usize],
    ) -> Self {
        let (places, guests) = (shape.places(), shape.hosts.len());
        let greatest = [(0.0, 0.0); LANES];
        // Short, because the striker meets bead 1 at the first moment.
        let step = Eight(constants.longest.0.map(|longest| 0.02 * longest));
        Self {
            shape,
            constants,
            next: start.clone(),
            now: start,
            rates: vec![[Eight::ZERO; STAGES]; places],
            guest_rates: vec![[Eight::ZERO; STAGES]; guests],
            pulls: vec![Eight::ZERO; guests],
            lost: vec![Eight::ZERO; guests],
            dissipated: vec![Eight::ZERO; guests],
            errors: vec![Eight::ZERO; places],
            guest_errors: vec![Eight::ZERO; guests],
            time: Eight::ZERO,
            step,
            length: Eight::ZERO,
            tries: [0; LANES],
            rejected: Eight::ZERO,
            active: vec![false; places + 1],
            runs: Vec::new(),
            guests: Vec::new(),
            crossings: Vec::new(),
            changes: Vec::new(),
            unpushed: None,
            stopped: Default::default(),
            models,
            peaks: peaks
                .iter()
                .map(|&contact| ForcePeaks { contact, greatest })
                .collect(),
            strokes: Vec::new(),
            kept: None,
        }
    }

    /// Makes the run find the stroke of each intruder.
    pub(super) fn find_strokes(&mut self) {
        self.strokes = vec![Eight::ZERO; self.shape.hosts.len()];
    }

    /// Makes each lane stop before the step that pushes a body from `first` on.
    pub(super) fn stop_before_pushed(&mut self, first: usize) {
        self.unpushed = Some(first);
    }

    /// State of a lane when it stopped, or its present state.
    pub(super) fn lane(&self, lane: usize) -> SavedChain {
        if let Some(stopped) = &self.stopped[lane] {
            return stopped.clone();
        }
        let of = |motion: &[Eight]| motion.iter().map(|of| of.0[lane]).collect();
        SavedChain {
            u: of(&self.now.u),
            v: of(&self.now.v),
            time: self.time.0[lane],
            step: self.step.0[lane],
            rejected: self.rejected.0[lane],
            tries: self.tries[lane],
            peaks: self.peaks.iter().map(|peaks| peaks.greatest[lane]).collect(),
        }
    }

    pub(super) fn start_lane(&mut self, lane: usize, from: &SavedChain) {
        for (motion, from) in [(&mut self.now.u, &from.u), (&mut self.now.v, &from.v)] {
            let pairs = motion.iter_mut().zip(from);
            pairs.for_each(|(of, from)| of.0[lane] = *from);
        }
        self.time.0[lane] = from.time;
        self.step.0[lane] = from.step;
        self.rejected.0[lane] = from.rejected;
        self.tries[lane] = from.tries;
        for (peaks, from) in self.peaks.iter_mut().zip(&from.peaks) {
            peaks.greatest[lane] = *from;
        }
    }

    /// Runs all lanes to their ends, on the widest vectors of this processor.
    pub(super) fn run(&mut self) -> StuckLanes {
        match Arch::new() {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(simd) => simd.vectorize(GroupCall(simd, self)),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(simd) => simd.vectorize(GroupCall(pulp::x86::V3_512b(simd), self)),
            _ => GroupCall(pulp::Scalar512b, self).call(),
        }
    }
}

struct GroupCall<'a, 'b, S>(S, &'a mut Group<'b>);

impl<S: Wide> NullaryFnOnce for GroupCall<'_, '_, S> {
    type Output = StuckLanes;

    #[inline(always)]
    fn call(self) -> StuckLanes {
        let Self(simd, group) = self;
        let mut stuck = StuckLanes::default();
        while group.lengths(&mut stuck) {
            group.activate(simd);
            loop {
                group.stages(simd);
                if !group.missed(simd) {
                    break;
                }
            }
            group.cross(simd);
            group.stop_lanes();
            let before = group.time;
            let allowed = group.judge(simd);
            if !group.peaks.is_empty() {
                group.find_peaks(&before, &allowed);
            }
            if !group.strokes.is_empty() {
                group.lengthen_strokes(&allowed);
            }
            if group.kept.is_some() {
                group.keep(before, &allowed);
            }
            group.take(simd, &allowed);
        }
        stuck
    }
}

/// Steps have this part of the length that the error would allow, and change by these factors at most.
const SAFETY: f64 = 0.75;
const GROWTH: f64 = 5.0;
const SHRINKAGE: f64 = 0.2;

impl Group<'_> {
    /// Sets the length of each lane's step. Returns false once all lanes are at their ends. A lane is taken
    /// out if its steps no longer advance its clock or are far too many.
    fn lengths(&mut self, stuck: &mut StuckLanes) -> bool {
        let mut goes_on = false;
        for (lane, stuck) in stuck.iter_mut().enumerate() {
            let (time, end) = (self.time.0[lane], self.constants.end.0[lane]);
            let (left, step) = (end - time, self.step.0[lane]);
            let length = if step >= left * (1.0 - 1e-9) { left } else { step };
            let moves = left > 0.0 && !*stuck && self.stopped[lane].is_none();
            self.length.0[lane] = 0.0;
            let many = self.tries[lane] >= self.constants.most_tries[lane];
            if moves && (time + length <= time || step.is_nan() || many) {
                *stuck = true;
            } else if moves {
                self.length.0[lane] = length;
                self.tries[lane] += 1;
                goes_on = true;
            }
        }
        goes_on
    }

    /// Finds the contacts that may carry a force in this step, and the moving intruders.
    #[inline(always)]
    fn activate<S: Wide>(&mut self, simd: S) {
        let double = self.length.load(simd) * 2.0;
        let threshold = self.constants.threshold.load(simd);
        self.active.fill(false);
        for contact in 1..self.shape.places() {
            let approach = change(simd, &self.now.v, contact).positive();
            let reach = double.times_plus(approach, change(simd, &self.now.u, contact));
            if (reach - threshold).any_positive() {
                self.mark(contact);
            }
        }
        for guest in 0..self.shape.hosts.len() {
            let (x, w) = (self.now.x[guest].load(simd), self.now.w[guest].load(simd));
            if x.abs().max(w.abs()).any_positive() {
                let host = self.shape.hosts[guest];
                self.mark(host);
                self.mark((host + 1).min(self.shape.places() - 1));
            }
        }
        self.arrange();
    }

    /// Marks a contact for computation, and two on either side, which it may close within a step.
    #[inline(always)]
    fn mark(&mut self, contact: usize) {
        let last = self.shape.places() - 1;
        self.active[contact.saturating_sub(2).max(1)..=(contact + 2).min(last)].fill(true);
    }

    #[inline(always)]
    fn arrange(&mut self) {
        let last = self.shape.places() - 1;
        self.runs.clear();
        for contact in (1..=last).filter(|&contact| self.active[contact]) {
            match self.runs.last_mut() {
                Some(run) if run.end == contact => run.end += 1,
                _ => self.runs.push(contact..contact + 1),
            }
        }
        self.guests.clear();
        let moves = |host: usize| self.active[host] || (host < last && self.active[host + 1]);
        let hosts = self.shape.hosts.iter().enumerate();
        let moving = hosts.filter(|(_, host)| moves(**host));
        self.guests.extend(moving.map(|(guest, _)| guest));
    }

    /// Returns true if a contact that was not computed has closed. It is computed from now on.
    #[inline(always)]
    fn missed<S: Wide>(&mut self, simd: S) -> bool {
        let threshold = self.constants.threshold.load(simd);
        let mut missed = false;
        for contact in 1..self.shape.places() {
            if !self.active[contact] && (change(simd, &self.next.u, contact) - threshold).any_positive() {
                self.mark(contact);
                missed = true;
            }
        }
        if missed {
            self.arrange();
        }
        missed
    }

    #[inline(always)]
    pub(super) fn stages<S: Wide>(&mut self, simd: S) {
        // Bodies without a force move at constant velocity.
        let length = self.length.load(simd);
        for body in 0..self.shape.places() {
            let (u, v) = (self.now.u[body].load(simd), self.now.v[body].load(simd));
            self.next.v[body] = v.store();
            self.next.u[body] = length.times_plus(v, u).store();
        }
        for &guest in &self.guests {
            self.lost[guest] = Eight::ZERO;
        }
        self.stage::<S, 0>(simd);
        self.stage::<S, 1>(simd);
        self.stage::<S, 2>(simd);
        self.stage::<S, 3>(simd);
        self.stage::<S, 4>(simd);
        self.stage::<S, 5>(simd);
        self.stage::<S, 6>(simd);
        self.stage::<S, 7>(simd);
        self.stage::<S, 8>(simd);
    }

    #[inline(always)]
    fn stage<S: Wide, const STAGE: usize>(&mut self, simd: S) {
        let constants = self.constants;
        let length = self.length.load(simd);
        for &guest in &self.guests {
            let from = (self.now.x[guest].load(simd), self.now.w[guest].load(simd));
            let (x, w) = moved::<S, STAGE>(simd, from, &self.guest_rates[guest], length);
            let damped = constants.guest_damping[guest].load(simd) * w;
            let stiffness = constants.guest_stiffness[guest].load(simd);
            self.pulls[guest] = stiffness.times_plus(x, damped).store();
            if STAGE == END {
                (self.next.x[guest], self.next.w[guest]) = (x.store(), w.store());
            }
            if const { VELOCITY[END][STAGE] != 0.0 } {
                let weight = length * VELOCITY[END][STAGE];
                let lost = self.lost[guest].load(simd);
                self.lost[guest] = weight.times_plus(damped * w, lost).store();
            }
        }
        let threshold = constants.threshold.load(simd);
        for run in &self.runs {
            // Contact j and body j share a place; the run begins with the body before its first contact.
            let places = run.start - 1..run.end;
            let now_u = &self.now.u[places.clone()];
            let now_v = &self.now.v[places.clone()];
            let rates = &mut self.rates[places.clone()];
            let stiffness = &constants.stiffness[places.clone()];
            let viscosity = &constants.viscosity[places.clone()];
            let inverse = &constants.inverse[places.clone()];
            let next_u = &mut self.next.u[places.clone()];
            let next_v = &mut self.next.v[places.clone()];
            let count = places.len();
            let from = (now_u[0].load(simd), now_v[0].load(simd));
            let (mut u, mut v) = moved::<S, STAGE>(simd, from, &rates[0], length);
            let mut force_before = all(simd, 0.0);
            for at in 0..count {
                if STAGE == END {
                    (next_u[at], next_v[at]) = (u.store(), v.store());
                }
                let mut force = all(simd, 0.0);
                if at + 1 < count {
                    let from = (now_u[at + 1].load(simd), now_v[at + 1].load(simd));
                    let (u_behind, v_behind) = moved::<S, STAGE>(simd, from, &rates[at + 1], length);
                    let overlap = (u - u_behind - threshold).positive();
                    let pressed = viscosity[at + 1].load(simd).times_plus(v - v_behind, overlap);
                    force = stiffness[at + 1].load(simd) * overlap.sqrt() * pressed;
                    (u, v) = (u_behind, v_behind);
                }
                rates[at][STAGE] = ((force_before - force) * inverse[at].load(simd)).store();
                force_before = force;
            }
        }
        self.pull_carriers(simd);
        for &guest in &self.guests {
            let host = self.shape.hosts[guest];
            let pull = self.pulls[guest].load(simd);
            let pushed = self.rates[host][STAGE].load(simd);
            let rate = pull.times_plus(constants.inverse[host].load(simd), pushed);
            self.rates[host][STAGE] = rate.store();
        }
        // A host may have several intruders; its rate contains all their pulls by now.
        for &guest in &self.guests {
            let rate = self.rates[self.shape.hosts[guest]][STAGE].load(simd);
            let pull = self.pulls[guest].load(simd);
            let pulled = pull * constants.guest_inverse[guest].load(simd);
            self.guest_rates[guest][STAGE] = (all(simd, 0.0) - pulled - rate).store();
        }
        for &(guest, carrier) in self
            .shape
            .nested
            .iter()
            .filter(|(guest, _)| self.guests.contains(guest))
        {
            let [own, of_carrier] = [guest, carrier]
                .map(|guest| self.pulls[guest].load(simd) * constants.guest_inverse[guest].load(simd));
            self.guest_rates[guest][STAGE] = (of_carrier - own).store();
        }
    }

    /// Subtracts the pull of each carried intruder from that of its carrier. A carrier comes before what it
    /// carries, so each pull is still whole when it is subtracted. The pulls in a host then add up to those
    /// of the intruders that it carries itself.
    #[inline(always)]
    fn pull_carriers<S: Wide>(&mut self, simd: S) {
        for &(guest, carrier) in self
            .shape
            .nested
            .iter()
            .filter(|(guest, _)| self.guests.contains(guest))
        {
            let pull = self.pulls[carrier].load(simd) - self.pulls[guest].load(simd);
            self.pulls[carrier] = pull.store();
        }
    }

    /// Integrates exactly the contacts that open or close in the step.
    #[inline(always)]
    fn cross<S: Wide>(&mut self, simd: S) {
        for run in &self.runs {
            for body in run.start - 1..run.end {
                self.errors[body] = estimate(simd, &self.rates[body]);
            }
        }
        for &guest in &self.guests {
            self.guest_errors[guest] = estimate(simd, &self.guest_rates[guest]);
        }
        let threshold = self.constants.threshold.load(simd);
        self.crossings.clear();
        for run in &self.runs {
            for contact in run.clone() {
                let from = (change(simd, &self.now.u, contact) - threshold).is_positive();
                let to = (change(simd, &self.next.u, contact) - threshold).is_positive();
                let turned = (from - to).abs();
                if turned.any_positive() {
                    let lanes = (0..LANES).zip(turned.store().0);
                    let turned = lanes.filter(|(_, turned)| *turned > 0.0);
                    self.crossings.extend(turned.map(|(lane, _)| (contact, lane)));
                }
            }
        }
        let crossings = std::mem::take(&mut self.crossings);
        let mut changes = std::mem::take(&mut self.changes);
        changes.clear();
        // All changes are computed before any is applied. Otherwise a contact might see its neighbour's
        // change, depending on their order here.
        for some in crossings.chunks(LANES) {
            changes.push(self.gather(some).changes(simd));
            if self.kept.is_some() {
                self.keep_crossings(some, changes.last());
            }
        }
        for (some, changes) in crossings.chunks(LANES).zip(&changes) {
            for (index, &(contact, lane)) in some.iter().enumerate() {
                self.give(changes, index, contact, lane);
            }
        }
        self.changes = changes;
        self.crossings = crossings;
    }

    #[inline(always)]
    fn gather(&self, crossings: &[(usize, usize)]) -> ContactBatch {
        let mut contacts = ContactBatch::NONE;
        let threshold = &self.constants.threshold.0;
        for (index, &(contact, lane)) in crossings.iter().enumerate() {
            let between = |near: &Eight, far: &Eight| near.0[lane] - far.0[lane];
            let (near, far) = (contact - 1, contact);
            let ends = [
                (&self.now, 0, &mut contacts.start),
                (&self.next, END, &mut contacts.end),
            ];
            for (motion, stage, of) in ends {
                of[0].0[index] = between(&motion.u[near], &motion.u[far]) - threshold[lane];
                of[1].0[index] = between(&motion.v[near], &motion.v[far]);
                of[2].0[index] = between(&self.rates[near][stage], &self.rates[far][stage]);
            }
            contacts.stiffness.0[index] = self.constants.stiffness[contact].0[lane];
            contacts.viscosity.0[index] = self.constants.viscosity[contact].0[lane];
            contacts.length.0[index] = self.length.0[lane];
        }
        contacts
    }

    /// Applies the change of a contact to its bodies.
    #[inline(always)]
    fn give(&mut self, changes: &Changes, index: usize, contact: usize, lane: usize) {
        let shift = changes.displacement.0[index];
        let (kick, error) = (changes.velocity.0[index], changes.error.0[index]);
        for (body, sign) in [(contact - 1, -1.0), (contact, 1.0)] {
            let part = sign * self.constants.inverse[body].0[lane];
            self.next.u[body].0[lane] += shift * part;
            self.next.v[body].0[lane] += kick * part;
            self.errors[body].0[lane] -= error * part;
            for guest in self.shape.guests(body) {
                self.next.x[guest].0[lane] -= shift * part;
                self.next.w[guest].0[lane] -= kick * part;
                self.guest_errors[guest].0[lane] += error * part;
            }
        }
    }

    /// Stops the lanes in which this step pushes a body that must not move, and takes the step back.
    fn stop_lanes(&mut self) {
        let Some(first) = self.unpushed else { return };
        for lane in 0..LANES {
            let pushed = |body: usize| self.next.v[body].0[lane] != self.now.v[body].0[lane];
            if self.length.0[lane] > 0.0 && (first..self.shape.bodies).any(pushed) {
                self.tries[lane] -= 1;
                self.stopped[lane] = Some(self.lane(lane));
            }
        }
    }

    /// Returns 1 in lanes whose error is allowed. Sets their clocks, and the lengths of all next steps.
    #[inline(always)]
    fn judge<S: Wide>(&mut self, simd: S) -> Eight {
        let (zero, one) = (all(simd, 0.0), all(simd, 1.0));
        let (mut greatest, mut trace) = (zero, zero);
        for run in &self.runs {
            // The wall has no error.
            for body in run.start - 1..run.end.min(self.shape.bodies) {
                let error = self.errors[body].load(simd);
                greatest = greatest.max(error.abs() * self.constants.strictness[body].load(simd));
                trace = zero.times_plus(error + self.next.v[body].load(simd), trace);
            }
        }
        for &guest in &self.guests {
            let error = self.guest_errors[guest].load(simd);
            greatest = greatest.max(error.abs() * self.constants.guest_strictness.load(simd));
            trace = zero.times_plus(error + self.next.w[guest].load(simd), trace);
        }
        let length = self.length.load(simd);
        // A maximum may ignore a NaN; this sum of zeros does not.
        let error = greatest * length + trace;
        let allowed = error.at_most(one);

        // A step that reaches the end ends on it exactly.
        let (now, end) = (self.time.load(simd), self.constants.end.load(simd));
        let last = (end - now).at_most(length);
        let time = last.select(end, now + length);
        self.time = allowed.select(time, now).store();

        // About error^(-1/6), by roots, which are the same on every computer: 1/8 + 1/32 + 1/128.
        let eighth = error.max(all(simd, 1e-12)).sqrt().sqrt().sqrt();
        let next = eighth.sqrt().sqrt();
        let power = eighth * next * next.sqrt().sqrt();
        let was_rejected = self.rejected.load(simd).above(zero);
        let most = was_rejected.select(one, all(simd, GROWTH));
        // A NaN becomes the least change.
        let (change, least) = (all(simd, SAFETY) / power, all(simd, SHRINKAGE));
        let change = change.above(least).select(change, least);
        let change = change.min(allowed.select(most, one));
        self.step = (length * change).min(self.constants.longest.load(simd)).store();
        self.rejected = allowed.select(zero, one).store();
        allowed.number().store()
    }

    /// Accepts the step in these lanes.
    #[inline(always)]
    fn take<S: Wide>(&mut self, simd: S, allowed: &Eight) {
        let allowed = allowed.load(simd).above(all(simd, 0.0));
        for body in 0..self.shape.bodies {
            for (now, next) in [
                (&mut self.now.u[body], &self.next.u[body]),
                (&mut self.now.v[body], &self.next.v[body]),
            ] {
                *now = allowed.select(next.load(simd), now.load(simd)).store();
            }
        }
        for &guest in &self.guests {
            for (now, next) in [
                (&mut self.now.x[guest], &self.next.x[guest]),
                (&mut self.now.w[guest], &self.next.w[guest]),
            ] {
                *now = allowed.select(next.load(simd), now.load(simd)).store();
            }
            let before = self.dissipated[guest].load(simd);
            let after = before + self.lost[guest].load(simd);
            self.dissipated[guest] = allowed.select(after, before).store();
        }
    }

    /// Keeps what some contacts that open or close have changed.
    #[cold]
    fn keep_crossings(&mut self, some: &[(usize, usize)], changes: Option<&Changes>) {
        let contacts = self.gather(some);
        if let (Some(kept), Some(changes)) = (&mut self.kept, changes) {
            kept.crossed(some, &contacts, changes);
        }
    }

    /// Keeps the step.
    #[cold]
    fn keep(&mut self, time: Eight, allowed: &Eight) {
        let Some(kept) = &mut self.kept else { return };
        let mut length = self.length;
        length
            .0
            .iter_mut()
            .zip(allowed.0)
            .for_each(|(length, allowed)| *length *= allowed);
        let GroupMotion { u, v, x, w } = &self.now;
        kept.take((time, length), (&self.runs, [u, v]), (&self.guests, [x, w]));
    }

    /// Searches the step for the greatest forces, in these lanes.
    fn find_peaks(&mut self, before: &Eight, allowed: &Eight) {
        let threshold = &self.constants.threshold.0;
        for peaks in &mut self.peaks {
            let (near, far) = (peaks.contact - 1, peaks.contact);
            if !self.active[far] {
                continue;
            }
            for (lane, model) in self.models.iter().enumerate() {
                let length = self.length.0[lane];
                if allowed.0[lane] == 0.0 || length == 0.0 {
                    continue;
                }
                let between = |near: &Eight, far: &Eight| near.0[lane] - far.0[lane];
                let overlap = |motion: &GroupMotion, stage: usize| {
                    [
                        between(&motion.u[near], &motion.u[far]) - threshold[lane],
                        between(&motion.v[near], &motion.v[far]),
                        between(&self.rates[near][stage], &self.rates[far][stage]),
                    ]
                };
                let ends = (overlap(&self.now, 0), overlap(&self.next, END));
                if let Some(kept) = &mut self.kept {
                    kept.searched(KeptOverlap {
                        contact: far,
                        lane,
                        ends: ends.into(),
                    });
                }
                let contact = model.contact(far);
                peaks.search(lane, &contact, (before.0[lane], length), ends);
            }
        }
    }

    /// Searches the step for the greatest displacements of intruders, in these lanes.
    fn lengthen_strokes(&mut self, allowed: &Eight) {
        for &guest in &self.guests {
            let state = |motion: &GroupMotion, stage: usize, lane: usize| {
                let acceleration = self.guest_rates[guest][stage].0[lane];
                [motion.x[guest].0[lane], motion.w[guest].0[lane], acceleration]
            };
            for lane in (0..LANES).filter(|&lane| allowed.0[lane] != 0.0 && self.length.0[lane] > 0.0) {
                let ends = (state(&self.now, 0, lane), state(&self.next, END, lane));
                let stroke = &mut self.strokes[guest].0[lane];
                *stroke = farthest(*stroke, self.length.0[lane], ends);
            }
        }
    }
}

/// Difference of a coordinate between the bodies before and behind a contact.
#[inline(always)]
fn change<S: Wide>(simd: S, of: &[Eight], contact: usize) -> Vector<S> {
    of[contact - 1].load(simd) - of[contact].load(simd)
}

/// Returns displacement and velocity at a stage.
#[inline(always)]
pub(super) fn moved<S: Wide, const STAGE: usize>(
    simd: S,
    (u, v): (Vector<S>, Vector<S>),
    rates: &StageRates,
    length: Vector<S>,
) -> (Vector<S>, Vector<S>) {
    if STAGE == 0 {
        return (u, v);
    }
    let (mut once, mut twice) = (all(simd, 0.0), all(simd, 0.0));
    for stage in 0..STAGES {
        let (velocity, displacement) = (VELOCITY[STAGE][stage], DISPLACEMENT[STAGE][stage]);
        if velocity != 0.0 {
            once = rates[stage].load(simd).scaled_plus(velocity, once);
        }
        if displacement != 0.0 {
            twice = rates[stage].load(simd).scaled_plus(displacement, twice);
        }
    }
    let way = length.times_plus(twice, v * NODES[STAGE]);
    (length.times_plus(way, u), length.times_plus(once, v))
}

/// Returns the error of a velocity over the length of the step.
#[inline(always)]
fn estimate<S: Wide>(simd: S, rates: &StageRates) -> Eight {
    let mut error = all(simd, 0.0);
    for stage in 0..STAGES {
        if ERROR[stage] != 0.0 {
            error = rates[stage].load(simd).scaled_plus(ERROR[stage], error);
        }
    }
    error.store()
}
