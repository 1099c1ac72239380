//! Derivatives of one number at the end of each chain of a group, with respect to all constants of the chain.
//!
//! # Design
//!
//! The run keeps the start of each step, and a backward pass carries the derivatives from the end to the
//! start, step by step. It applies the transpose of the run's own arithmetic, stage by stage, with contacts
//! that open and close. The results are the derivatives of the number as it is computed, with the lengths of
//! the steps held fixed. All of them together take as long as some three runs, however many they are.

use pulp::{Arch, NullaryFnOnce};

use super::eight::{Eight, LANES, Vector, Wide, all};
use super::group::{Group, StageRates, moved};
use super::kept::{KeptCrossing, KeptOverlap, KeptStep};
use super::method::{DISPLACEMENT, END, NODES, STAGES, VELOCITY};
use super::turn::{OverlapSlopes, StepOverlap};
use crate::model::Model;

/// Derivatives of one number with respect to the end of a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct EndSlopes {
    /// With respect to the state, in the places of [`Model::layout`].
    pub(crate) state: Vec<f64>,
    /// With respect to the greatest force of the one contact that is wanted.
    pub(crate) peak: f64,
}

/// Derivatives of one number of a run with respect to the constants of its chain.
#[derive(Debug, Clone)]
pub(crate) struct ChainSlopes {
    /// With respect to 1/(M - m) of each body, κ and τ of each contact, k, c and 1/m of each intruder.
    inverse: Vec<f64>,
    stiffness: Vec<f64>,
    relaxation: Vec<f64>,
    guests: Vec<[f64; 3]>,
}

impl ChainSlopes {
    /// Change of the number, to first order, from one chain to another near that of the run.
    pub(crate) fn change(&self, from: &Model, to: &Model) -> f64 {
        let by_bodies = self.inverse.iter().enumerate();
        let of_bodies =
            by_bodies.map(|(body, slope)| slope * (1.0 / to.shells[body] - 1.0 / from.shells[body]));
        let by_contacts = (1..).zip(self.stiffness.iter().zip(&self.relaxation));
        let of_contacts = by_contacts.map(|(contact, (by_stiffness, by_relaxation))| {
            let (from, to) = (from.contact_at(contact), to.contact_at(contact));
            by_stiffness * (to.stiffness - from.stiffness) + by_relaxation * (to.relaxation - from.relaxation)
        });
        let pairs = from.intruders().iter().zip(to.intruders());
        let of_guests = self
            .guests
            .iter()
            .zip(pairs)
            .map(|([stiffness, damping, inverse], (from, to))| {
                let (from, to) = (from.oscillator, to.oscillator);
                stiffness * (to.stiffness - from.stiffness)
                    + damping * (to.damping - from.damping)
                    + inverse * (1.0 / to.mass - 1.0 / from.mass)
            });
        of_bodies.sum::<f64>() + of_contacts.sum::<f64>() + of_guests.sum::<f64>()
    }
}

/// Derivatives with respect to the values of one body or intruder: in the state, and at each stage of a step.
#[derive(Debug, Clone)]
struct PlaceSlopes {
    place: Eight,
    velocity: Eight,
    /// By displacement and velocity of each stage.
    stages: [StageRates; 2],
    /// By the acceleration at the start and at the end of the step, through the contacts.
    ends: [Eight; 2],
    /// By the acceleration of the present stage.
    rate: Eight,
}

impl PlaceSlopes {
    const ZERO: Self = Self {
        place: Eight::ZERO,
        velocity: Eight::ZERO,
        stages: [[Eight::ZERO; STAGES]; 2],
        ends: [Eight::ZERO; 2],
        rate: Eight::ZERO,
    };

    /// Clears what contacts added in another step.
    fn clear_start(&mut self) {
        self.ends = [Eight::ZERO; 2];
        self.stages.iter_mut().for_each(|stages| stages[0] = Eight::ZERO);
    }

    /// Returns the derivative by the acceleration of a stage, which later stages and contacts have used.
    #[inline(always)]
    fn gather<S: Wide, const STAGE: usize>(&mut self, simd: S, length: Vector<S>) -> Vector<S> {
        let (mut once, mut twice) = (all(simd, 0.0), all(simd, 0.0));
        for later in STAGE + 1..STAGES {
            let (velocity, displacement) = (VELOCITY[later][STAGE], DISPLACEMENT[later][STAGE]);
            if velocity != 0.0 {
                once = self.stages[1][later].load(simd).scaled_plus(velocity, once);
            }
            if displacement != 0.0 {
                twice = self.stages[0][later].load(simd).scaled_plus(displacement, twice);
            }
        }
        let mut rate = length * length.times_plus(twice, once);
        if STAGE == 0 {
            rate = rate + self.ends[0].load(simd);
        }
        if STAGE == END {
            rate = rate + self.ends[1].load(simd);
        }
        rate
    }

    /// Sets the derivatives by displacement and velocity of a stage. At the start and the end of the step
    /// they are added to those already there.
    #[inline(always)]
    fn set<S: Wide, const STAGE: usize>(&mut self, simd: S, by_place: Vector<S>, by_velocity: Vector<S>) {
        let [places, velocities] = &mut self.stages;
        let (place, velocity) = match STAGE {
            0 => (places[0], velocities[0]),
            END => (self.place, self.velocity),
            _ => (Eight::ZERO, Eight::ZERO),
        };
        places[STAGE] = (place.load(simd) + by_place).store();
        velocities[STAGE] = (velocity.load(simd) + by_velocity).store();
    }

    /// Takes the derivatives from the end of a step to its start.
    #[inline(always)]
    fn step_back<S: Wide>(&mut self, simd: S, length: Vector<S>) {
        let (mut place, mut once, mut velocity) = (all(simd, 0.0), all(simd, 0.0), all(simd, 0.0));
        let [places, velocities] = &self.stages;
        for ((by_place, by_velocity), node) in places.iter().zip(velocities).zip(NODES) {
            let by_place = by_place.load(simd);
            place = place + by_place;
            once = by_place.scaled_plus(node, once);
            velocity = velocity + by_velocity.load(simd);
        }
        self.place = place.store();
        self.velocity = length.times_plus(once, velocity).store();
    }
}

/// The backward pass of a group.
struct Backwards {
    bodies: Vec<PlaceSlopes>,
    guests: Vec<PlaceSlopes>,
    /// By the energy that each intruder dissipates.
    lost: Vec<Eight>,
    pulls: Vec<Eight>,
    /// By the greatest force, 0 once it has been met, and its time, s; infinite if none is wanted.
    peak: ([f64; LANES], [f64; LANES]),
    /// By the logarithm of 1/(M - m) of each body, κ and (3/2) τ of each contact, k, c and the logarithm of
    /// 1/m of each intruder.
    inverse: Vec<Eight>,
    stiffness: Vec<Eight>,
    viscosity: Vec<Eight>,
    guest_stiffness: Vec<Eight>,
    guest_damping: Vec<Eight>,
    guest_inverse: Vec<Eight>,
}

/// Follows the kept steps of a group back from these derivatives with respect to the end of each lane.
pub(super) fn back(group: &mut Group<'_>, ends: &[EndSlopes]) -> Vec<ChainSlopes> {
    let models = group.models;
    let mut back = Backwards::new(group, ends);
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => simd.vectorize(BackCall(simd, group, &mut back)),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => simd.vectorize(BackCall(pulp::x86::V3_512b(simd), group, &mut back)),
        _ => BackCall(pulp::Scalar512b, group, &mut back).call(),
    }
    let lanes = models.iter().enumerate();
    lanes.map(|(lane, model)| back.of_lane(lane, model)).collect()
}

impl Backwards {
    fn new(group: &Group<'_>, ends: &[EndSlopes]) -> Self {
        let (shape, models) = (group.shape, group.models);
        let (places, guests) = (shape.places(), shape.hosts.len());
        let mut back = Self {
            bodies: vec![PlaceSlopes::ZERO; places],
            guests: vec![PlaceSlopes::ZERO; guests],
            lost: vec![Eight::ZERO; guests],
            pulls: vec![Eight::ZERO; guests],
            peak: ([0.0; LANES], [f64::INFINITY; LANES]),
            inverse: vec![Eight::ZERO; places],
            stiffness: vec![Eight::ZERO; places],
            viscosity: vec![Eight::ZERO; places],
            guest_stiffness: vec![Eight::ZERO; guests],
            guest_damping: vec![Eight::ZERO; guests],
            guest_inverse: vec![Eight::ZERO; guests],
        };
        for (lane, (end, model)) in ends.iter().zip(models).enumerate() {
            let layout = model.layout();
            for body in 0..shape.bodies {
                back.bodies[body].place.0[lane] = end.state[body];
                back.bodies[body].velocity.0[lane] = end.state[layout.velocity(body)];
            }
            for guest in 0..guests {
                back.guests[guest].place.0[lane] = end.state[layout.relative(guest)];
                back.guests[guest].velocity.0[lane] = end.state[layout.relative_velocity(guest)];
                back.lost[guest].0[lane] = end.state[layout.intruder_loss(guest)];
            }
            back.peak.0[lane] = end.peak;
            if let Some(peak) = group.peaks.first().filter(|_| end.peak != 0.0) {
                back.peak.1[lane] = peak.greatest[lane].1;
            }
        }
        back
    }

    fn of_lane(&self, lane: usize, model: &Model) -> ChainSlopes {
        let of = |slopes: &[Eight]| slopes.iter().map(|slope| slope.0[lane]).collect::<Vec<f64>>();
        let inverse = of(&self.inverse).into_iter().zip(&model.shells);
        let guests = model.intruders().iter().enumerate().map(|(guest, intruder)| {
            [
                self.guest_stiffness[guest].0[lane],
                self.guest_damping[guest].0[lane],
                self.guest_inverse[guest].0[lane] * intruder.oscillator.mass,
            ]
        });
        ChainSlopes {
            inverse: inverse.map(|(slope, shell)| slope * shell).collect(),
            stiffness: of(&self.stiffness[1..]),
            relaxation: of(&self.viscosity[1..]).iter().map(|slope| 1.5 * slope).collect(),
            guests: guests.collect(),
        }
    }
}

struct BackCall<'a, 'b, 'c, S>(S, &'a mut Group<'b>, &'c mut Backwards);

impl<S: Wide> NullaryFnOnce for BackCall<'_, '_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(simd, group, back) = self;
        let kept = group.kept.take().unwrap_or_default();
        for step in kept.steps.into_iter().rev() {
            group.now_again(&step);
            group.stages(simd);
            back.begin(simd, group);
            group.cross_back(&step, back);
            group.stage_back::<S, 8>(simd, back);
            group.stage_back::<S, 7>(simd, back);
            group.stage_back::<S, 6>(simd, back);
            group.stage_back::<S, 5>(simd, back);
            group.stage_back::<S, 4>(simd, back);
            group.stage_back::<S, 3>(simd, back);
            group.stage_back::<S, 2>(simd, back);
            group.stage_back::<S, 1>(simd, back);
            group.stage_back::<S, 0>(simd, back);
            back.end(simd, group);
        }
    }
}

impl Backwards {
    /// Begins a step at its end. For bodies without a force, this completes the step.
    #[inline(always)]
    fn begin<S: Wide>(&mut self, simd: S, group: &Group<'_>) {
        let length = group.length.load(simd);
        for (body, slopes) in self.bodies.iter_mut().enumerate() {
            if !group.computed(body) {
                let (place, velocity) = (slopes.place.load(simd), slopes.velocity.load(simd));
                slopes.velocity = length.times_plus(place, velocity).store();
            }
        }
        let in_runs = group.runs.iter().flat_map(|run| run.start - 1..run.end);
        for body in in_runs {
            self.bodies[body].clear_start();
        }
        for &guest in &group.guests {
            self.guests[guest].clear_start();
        }
    }

    /// Adds the derivatives by the overlap of a contact, times a weight.
    fn add_overlap(&mut self, overlap: &KeptOverlap, slopes: &OverlapSlopes, weight: f64) {
        let &KeptOverlap { contact, lane, .. } = overlap;
        for (body, sign) in [(contact - 1, weight), (contact, -weight)] {
            let of = &mut self.bodies[body];
            let ([u, v, a], [u_end, v_end, a_end]) = (slopes.start, slopes.end);
            of.stages[0][0].0[lane] += sign * u;
            of.stages[1][0].0[lane] += sign * v;
            of.ends[0].0[lane] += sign * a;
            of.place.0[lane] += sign * u_end;
            of.velocity.0[lane] += sign * v_end;
            of.ends[1].0[lane] += sign * a_end;
        }
        self.stiffness[contact].0[lane] += weight * slopes.stiffness;
        self.viscosity[contact].0[lane] += weight * slopes.viscosity;
    }

    /// Ends a step at its start.
    #[inline(always)]
    fn end<S: Wide>(&mut self, simd: S, group: &Group<'_>) {
        let length = group.length.load(simd);
        for run in &group.runs {
            for slopes in &mut self.bodies[run.start - 1..run.end] {
                slopes.step_back(simd, length);
            }
        }
        for &guest in &group.guests {
            self.guests[guest].step_back(simd, length);
        }
    }
}

impl Group<'_> {
    /// Returns to the start of a kept step.
    fn now_again(&mut self, step: &KeptStep) {
        self.time = step.time;
        self.length = step.length;
        self.runs.clone_from(&step.runs);
        self.guests.clone_from(&step.guests);
        let places = step.runs.iter().flat_map(|run| run.start - 1..run.end);
        for (body, [u, v]) in places.zip(&step.bodies) {
            (self.now.u[body], self.now.v[body]) = (*u, *v);
        }
        for (&guest, [x, w]) in step.guests.iter().zip(&step.intruders) {
            (self.now.x[guest], self.now.w[guest]) = (*x, *w);
        }
    }

    /// Returns true if a body belongs to the present runs.
    fn computed(&self, body: usize) -> bool {
        self.runs
            .iter()
            .any(|run| (run.start - 1..run.end).contains(&body))
    }

    /// The backward pass through greatest forces, and through contacts that open or close in the step.
    fn cross_back(&self, step: &KeptStep, back: &mut Backwards) {
        for overlap in &step.peaks {
            let lane = overlap.lane;
            let (slope, time) = (back.peak.0[lane], back.peak.1[lane]);
            let (from, length) = (step.time.0[lane], step.length.0[lane]);
            if slope != 0.0 && time > from {
                let x = ((time - from) / length).min(1.0);
                back.add_overlap(overlap, &self.overlap(step, overlap).of_force(x), slope);
                // Earlier steps do not contain it.
                back.peak.0[lane] = 0.0;
            }
        }
        // The run computed all changes before it applied any, so all derivatives by changes are computed here
        // before any are passed on.
        let by_changes = step.crossings.iter().map(|&KeptCrossing { overlap, change }| {
            let (contact, lane) = (overlap.contact, overlap.lane);
            let mut by_change = [0.0; 2];
            for (body, sign) in [(contact - 1, -1.0), (contact, 1.0)] {
                let part = sign * self.constants.inverse[body].0[lane];
                let own = [back.bodies[body].place, back.bodies[body].velocity].map(|of| of.0[lane]);
                let guests = self.shape.guests(body).map(|guest| &back.guests[guest]);
                let by_body = guests.fold(own, |[place, velocity], of| {
                    [place - of.place.0[lane], velocity - of.velocity.0[lane]]
                });
                let of_body = change[0] * by_body[0] + change[1] * by_body[1];
                back.inverse[body].0[lane] += part * of_body;
                by_change = [0, 1].map(|at| by_change[at] + part * by_body[at]);
            }
            by_change
        });
        let by_changes: Vec<[f64; 2]> = by_changes.collect();
        for (KeptCrossing { overlap, .. }, [shift, kick]) in step.crossings.iter().zip(by_changes) {
            let slopes = self.overlap(step, overlap).of_crossing(shift, kick);
            back.add_overlap(overlap, &slopes, 1.0);
        }
    }

    fn overlap(&self, step: &KeptStep, overlap: &KeptOverlap) -> StepOverlap {
        let &KeptOverlap {
            contact,
            lane,
            ends: [start, end],
        } = overlap;
        StepOverlap {
            start,
            end,
            length: step.length.0[lane],
            stiffness: self.constants.stiffness[contact].0[lane],
            viscosity: self.constants.viscosity[contact].0[lane],
        }
    }

    #[inline(always)]
    fn stage_back<S: Wide, const STAGE: usize>(&mut self, simd: S, back: &mut Backwards) {
        let constants = self.constants;
        let length = self.length.load(simd);
        for run in &self.runs {
            for slopes in &mut back.bodies[run.start - 1..run.end] {
                slopes.rate = slopes.gather::<S, STAGE>(simd, length).store();
            }
        }
        for &guest in &self.guests {
            let host = self.shape.hosts[guest];
            let by_rate = back.guests[guest].gather::<S, STAGE>(simd, length);
            let own = self.guest_rates[guest][STAGE].load(simd) + self.rates[host][STAGE].load(simd);
            add(simd, &mut back.guest_inverse[guest], own * by_rate);
            let of_host = back.bodies[host].rate.load(simd) - by_rate;
            back.bodies[host].rate = of_host.store();
            back.pulls[guest] = (constants.guest_inverse[guest].load(simd) * by_rate).store();
        }
        for &guest in &self.guests {
            let host = self.shape.hosts[guest];
            let from = (self.now.x[guest].load(simd), self.now.w[guest].load(simd));
            let (x, w) = moved::<S, STAGE>(simd, from, &self.guest_rates[guest], length);
            let of_host = constants.inverse[host].load(simd) * back.bodies[host].rate.load(simd);
            let by_pull = of_host - back.pulls[guest].load(simd);
            let by_power = back.lost[guest].load(simd) * length * VELOCITY[END][STAGE];
            let damping = constants.guest_damping[guest].load(simd);
            add(simd, &mut back.guest_stiffness[guest], x * by_pull);
            add(
                simd,
                &mut back.guest_damping[guest],
                w * by_power.times_plus(w, by_pull),
            );
            let by_place = constants.guest_stiffness[guest].load(simd) * by_pull;
            let by_velocity = damping * (by_power * 2.0).times_plus(w, by_pull);
            back.guests[guest].set::<S, STAGE>(simd, by_place, by_velocity);
        }
        for run in &self.runs {
            let first = run.start - 1;
            let from = (self.now.u[first].load(simd), self.now.v[first].load(simd));
            let (mut u, mut v) = moved::<S, STAGE>(simd, from, &self.rates[first], length);
            let (mut place_before, mut velocity_before) = (all(simd, 0.0), all(simd, 0.0));
            for body in first..run.end {
                let by_rate = back.bodies[body].rate.load(simd);
                add(
                    simd,
                    &mut back.inverse[body],
                    self.rates[body][STAGE].load(simd) * by_rate,
                );
                let (mut by_place, mut by_velocity) = (all(simd, 0.0), all(simd, 0.0));
                if body + 1 < run.end {
                    let contact = body + 1;
                    let from = (self.now.u[contact].load(simd), self.now.v[contact].load(simd));
                    let (u_behind, v_behind) = moved::<S, STAGE>(simd, from, &self.rates[contact], length);
                    let behind = constants.inverse[contact].load(simd) * back.bodies[contact].rate.load(simd);
                    let by_force = behind - constants.inverse[body].load(simd) * by_rate;
                    let overlap = (u - u_behind - constants.threshold.load(simd)).positive();
                    let rate = v - v_behind;
                    let (stiffness, viscosity) = (
                        constants.stiffness[contact].load(simd),
                        constants.viscosity[contact].load(simd),
                    );
                    let root = overlap.sqrt();
                    let closed = overlap.above(all(simd, 0.0));
                    let rising = closed.select(viscosity * rate * 0.5 / root, all(simd, 0.0));
                    let by_pressed = root * by_force;
                    by_place = stiffness * by_force * root.scaled_plus(1.5, rising);
                    by_velocity = stiffness * viscosity * by_pressed;
                    add(
                        simd,
                        &mut back.stiffness[contact],
                        by_pressed * viscosity.times_plus(rate, overlap),
                    );
                    add(simd, &mut back.viscosity[contact], stiffness * rate * by_pressed);
                    (u, v) = (u_behind, v_behind);
                }
                let slopes = &mut back.bodies[body];
                slopes.set::<S, STAGE>(simd, by_place - place_before, by_velocity - velocity_before);
                (place_before, velocity_before) = (by_place, by_velocity);
            }
        }
    }
}

#[inline(always)]
fn add<S: Wide>(simd: S, sum: &mut Eight, term: Vector<S>) {
    *sum = (sum.load(simd) + term).store();
}
