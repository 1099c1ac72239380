//! Finds the summary of a run while it runs, without keeping the motion.
//!
//! # Design
//!
//! A peak is looked for at the ends of steps and inside each step, as the root of the quantity's rate. The
//! equations of motion give that rate, so the root is as exact as the motion; the place of a flat maximum
//! would be known only to the square root of rounding.
//!
//! The width of a pulse needs the time at which its force rose through half of a peak that came later. While
//! a force rises, its steps are therefore kept, as [`Glimpse`]s of that contact alone. Their number is
//! limited. A contact that finds no room forgets the rise of its force, and then has no width unless the
//! force doubles afterwards.
//!
//! Only moving beads are looked at, so a step costs in proportion to them.

use std::collections::VecDeque;
use std::ops::Range;
use std::time::Instant;

use crate::bisection::bisect;
use crate::model::Model;
use crate::options::{Options, SimulateError};
use crate::run::{Run, RunStep};
use crate::scenario::Scenario;
use crate::solver::{BLOCK, Glimpse, StepMoment, Stepper};
use crate::summary::{ContactPeak, EnergySummary, FinalState, IntruderSummary, SolverSummary, Summary};

/// Runs a scenario and returns its summary. The motion is not kept, so the chain may have any length.
///
/// The run lasts [`Options::duration`] if that is set, and otherwise the scenario's duration.
///
/// # Errors
/// [`SimulateError`]: the scenario or an option is out of range, or the integration cannot go on.
pub fn summarise(scenario: &Scenario, options: &Options<'_>) -> Result<Summary, SimulateError> {
    let clock = Instant::now();
    let end = options.end(scenario)?;
    let mut run = Run::new(scenario, options.accuracy)?;
    run.check(end, options.accuracy.longest_step)?;
    let mut summariser = Summariser::new(&mut run);
    run.watch(end, |step| {
        summariser.observe(step);
        options.report(step.number(), step.to() / end);
    })?;
    let mut summary = summariser.summary(&mut run);
    summary.solver.seconds = clock.elapsed().as_secs_f64();
    Ok(summary)
}

/// Forces below this part of the greatest are not resolved: a contact with less counts as unloaded.
const NO_FORCE: f64 = 1e-12;

/// The greatest value so far, and its time, s.
#[derive(Debug, Clone, Copy)]
struct Maximum {
    value: f64,
    time: f64,
}

impl Maximum {
    /// Takes a greater value from a step: at its end, or inside, where the rate changes from positive to
    /// negative. `of` returns the value and its rate at a time. Returns true if the maximum has grown.
    fn update(&mut self, from: f64, to: f64, mut of: impl FnMut(f64) -> [f64; 2]) -> bool {
        let before = self.value;
        let end = of(to);
        self.take(to, end[0]);
        if of(from)[1] > 0.0 && end[1] <= 0.0 {
            let time = bisect(from, to, |t| of(t)[1] > 0.0);
            self.take(time, of(time)[0]);
        }
        self.value > before
    }

    fn take(&mut self, time: f64, value: f64) {
        if value > self.value {
            *self = Self { value, time };
        }
    }
}

/// The greatest force of a contact beyond its static load, and the width of its pulse.
#[derive(Debug, Clone)]
struct ForceMaximum {
    maximum: Maximum,
    /// Full width at half of the maximum, s.
    width: Option<f64>,
    /// True until the force has fallen to half of the maximum.
    falling: bool,
    /// Steps in which the force may have risen through half of a peak for the last time, each with the force
    /// at its start. These starts increase: a step that starts lower replaces earlier ones that start higher.
    rising: VecDeque<(Glimpse, f64)>,
}

/// Steps of rising forces kept for all contacts together, in addition to [`KEPT_EACH`] for each: 60 MB. Only
/// a chain with one part very much faster than another comes near this number.
const KEPT: usize = 1 << 17;
/// Steps of a rising force that each contact may always keep. A rise usually takes about ten.
const KEPT_EACH: usize = 64;

/// Greatest values of an intruder's motion and of its negative.
#[derive(Debug, Clone, Copy)]
struct IntruderMaxima {
    acceleration: [Maximum; 2],
    displacement: [Maximum; 2],
}

/// Finds the summary of a [`Run`] step by step; see [`Summariser::observe`].
///
/// ```
/// use hertz_chain::{Accuracy, Run, Scenario, Summariser};
///
/// let mut run = Run::new(&Scenario::paper(), Accuracy::DRAFT)?;
/// let mut summariser = Summariser::new(&mut run);
/// run.watch(4e-3, |step| summariser.observe(step))?;
/// println!("{:?}", summariser.summary(&mut run).peak_force);
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Summariser {
    /// Energy of all bodies at the start, J.
    initial: f64,
    /// The greatest energy of striker, chain and intruders at any time, J.
    greatest: f64,
    /// Greatest error of the energy balance, J.
    imbalance: f64,
    /// Energy of the chain: its maximum, and its value and rate at the end of the last step.
    chain: Maximum,
    chain_now: f64,
    chain_rate: f64,
    forces: Vec<ForceMaximum>,
    intruders: Vec<IntruderMaxima>,
    ledger: Ledger,
    /// Steps of rising forces kept for all contacts, and the most that may be kept.
    kept: usize,
    room: usize,
}

/// Energies of the beads and intruders of each block of eight bodies when they last moved, J.
#[derive(Debug, Clone)]
struct Ledger {
    chain: Vec<f64>,
    intruders: Vec<f64>,
    /// Bodies that moved in the last step.
    moving: Vec<Range<usize>>,
    /// Sums over all other blocks.
    at_rest: [f64; 2],
}

/// The contacts booked with some bodies: each with the body behind it, the wall's with the last bead.
fn contacts(model: &Model, bodies: &Range<usize>) -> Range<usize> {
    let is_last = bodies.end == model.bodies();
    bodies.start.max(1)..if is_last { model.contacts() + 1 } else { bodies.end }
}

/// Energy of some beads with their contacts, and energy of their intruders, J.
fn energies(model: &Model, motion: StepMoment<'_>, bodies: &Range<usize>) -> [f64; 2] {
    let kinetic = |mass: f64, speed: f64| 0.5 * mass * speed * speed;
    let beads = bodies.start.max(1)..bodies.end;
    let of_bead = |bead: usize| kinetic(model.shells[bead], motion.body(bead).1);
    let mut chain: f64 = beads.map(of_bead).sum();
    let elastic = |contact| {
        model
            .contact_at(contact)
            .energy_beyond(motion.change(model, contact).0)
    };
    chain += contacts(model, bodies).map(elastic).sum::<f64>();
    let of_guest = |guest: usize| {
        let intruder = &model.intruders()[guest];
        let in_host = model.in_host(guest, |number| motion.guest(number).1);
        let speed = motion.body(intruder.bead).1 + in_host;
        kinetic(intruder.oscillator.mass, speed) + intruder.elastic_energy(motion.guest(guest).0)
    };
    [chain, guests(model, bodies).map(of_guest).sum()]
}

/// Numbers of the intruders in some bodies.
fn guests(model: &Model, bodies: &Range<usize>) -> Range<usize> {
    let until = |bead: usize| model.intruders().partition_point(|intruder| intruder.bead < bead);
    until(bodies.start)..until(bodies.end)
}

/// Rate of the chain's energy, W: the power of striker and intruders, less the losses in contacts and on the
/// ground.
fn chain_rate(model: &Model, motion: StepMoment<'_>, moving: &[Range<usize>]) -> f64 {
    let (first, rate) = motion.change(model, 1);
    let mut sum = model.force_beyond_at(1, first, rate) * motion.body(0).1;
    for bodies in moving {
        if model.is_dragged() {
            let pull = |body: usize| model.drag_on(body) * motion.body(body).1.powi(2);
            sum -= bodies.clone().map(pull).sum::<f64>();
        }
        for contact in contacts(model, bodies) {
            let (change, rate) = motion.change(model, contact);
            let elastic = model.contact_at(contact).elastic_force_beyond(change);
            sum -= (model.force_beyond_at(contact, change, rate) - elastic) * rate;
        }
        for guest in guests(model, bodies) {
            let intruder = &model.intruders()[guest];
            if intruder.carrier.is_some() {
                continue;
            }
            let (x, w) = motion.guest(guest);
            sum += intruder.pull(x, w) * motion.body(intruder.bead).1;
        }
    }
    sum
}

impl Summariser {
    /// Starts a summary at the run's present time.
    pub fn new(run: &mut Run) -> Self {
        let time = run.time();
        let snapshot = run.snapshot();
        let (model, energies) = (snapshot.model().clone(), snapshot.energies());
        let maximum = |value: f64| Maximum { value, time };
        let forces = (1..=model.contacts()).map(|contact| ForceMaximum {
            maximum: maximum(snapshot.force(contact) - model.contact_at(contact).load),
            width: None,
            falling: false,
            rising: VecDeque::new(),
        });
        let forces = forces.collect();
        let intruders = (0..model.intruders().len()).map(|number| {
            let maxima = |value: f64| [maximum(value), maximum(-value)];
            let motion = snapshot.motion_of(number);
            IntruderMaxima {
                acceleration: maxima(motion.acceleration),
                displacement: maxima(motion.displacement),
            }
        });
        let intruders = intruders.collect();
        let blocks = model.bodies().div_ceil(BLOCK);
        let mut ledger = Ledger {
            chain: vec![0.0; blocks],
            intruders: vec![0.0; blocks],
            moving: Vec::new(),
            at_rest: [0.0; 2],
        };
        let all = std::iter::once(0..model.bodies()).collect::<Vec<_>>();
        ledger.enter(&model, StepMoment::End(&run.stepper, time), &all);
        ledger.settle(&[]);
        Self {
            initial: energies.total(),
            greatest: energies.total() + energies.supplied,
            imbalance: 0.0,
            chain: maximum(energies.chain),
            chain_now: energies.chain,
            chain_rate: f64::INFINITY,
            forces,
            intruders,
            ledger,
            kept: 0,
            room: KEPT + KEPT_EACH * model.contacts(),
        }
    }

    /// Takes account of a step. Must be called with each step of the run, in order.
    pub fn observe(&mut self, step: &mut RunStep<'_>) {
        let (from, to) = (step.from(), step.to());
        let Run { model, stepper } = &mut *step.run;
        stepper.interpolate_ends(from);
        let moving: Vec<Range<usize>> = stepper.moving().collect();
        self.balance(model, stepper, &moving, (from, to));
        for bodies in &moving {
            for contact in bodies.start.max(1)..=bodies.end.min(model.contacts()) {
                let watch = &mut self.forces[contact - 1];
                self.kept -= watch.rising.len();
                watch.observe(model, stepper, contact, (from, to));
                if watch.rising.len() > KEPT_EACH && self.kept + watch.rising.len() > self.room {
                    watch.forget();
                }
                self.kept += watch.rising.len();
            }
            for guest in guests(model, bodies) {
                self.intruders[guest].observe(model, stepper, guest, (from, to));
            }
        }
    }

    fn balance(
        &mut self,
        model: &Model,
        stepper: &mut Stepper,
        moving: &[Range<usize>],
        (from, to): (f64, f64),
    ) {
        if self.ledger.moving != moving {
            self.ledger.settle(moving);
        }
        let end = StepMoment::End(stepper, from);
        let [chain, intruders] = self.ledger.enter(model, end, moving);
        let rate = chain_rate(model, end, moving);
        let speed = end.body(0).1;
        let striker = model.striker_energy_at(speed);
        let (contacts, of_guests) = stepper.lost();
        let all = striker + chain + intruders;
        let total = all + contacts + of_guests.sum::<f64>() - stepper.supplied() + stepper.lost_on_ground();
        self.greatest = self.greatest.max(all);
        self.imbalance = self.imbalance.max((total - self.initial).abs());
        // An upper bound of the energy between the ends of the step.
        let before = self.chain_rate.abs();
        let most = self.chain_now.max(chain) + (before + rate.abs()) * (to - from);
        self.chain.take(to, chain);
        if most > self.chain.value && self.chain_rate > 0.0 && rate <= 0.0 && !moving.is_empty() {
            let mut at = |t: f64| {
                stepper.interpolate(t);
                let inside = StepMoment::Inside(stepper, t);
                let parts = moving.iter().map(|bodies| energies(model, inside, bodies)[0]);
                let value = self.ledger.at_rest[0] + parts.sum::<f64>();
                [value, chain_rate(model, inside, moving)]
            };
            let time = bisect(from, to, |t| at(t)[1] > 0.0);
            let value = at(time)[0];
            self.chain.take(time, value);
        }
        (self.chain_now, self.chain_rate) = (chain, rate);
    }

    /// The summary up to the run's present time. [`SolverSummary::seconds`] is 0.
    pub fn summary(&self, run: &mut Run) -> Summary {
        let (time, steps, evaluations) = (run.time(), run.steps(), run.evaluations());
        let snapshot = run.snapshot();
        let (model, energies) = (snapshot.model(), snapshot.energies());
        let bodies = 0..model.bodies();
        let of_intruder = |(number, watch): (usize, &IntruderMaxima)| IntruderSummary {
            bead: model.intruders()[number].bead,
            place: model.place_in_host(number),
            acceleration_max: watch.acceleration[0].value,
            acceleration_min: -watch.acceleration[1].value,
            relative_displacement_max: watch.displacement[0].value.max(watch.displacement[1].value),
            dissipated: snapshot.dissipated_by(number),
        };
        let intruders = self.intruders.iter().enumerate();
        Summary {
            peak_force: self.contact_peaks(model),
            final_state: FinalState {
                time,
                displacement: bodies.clone().map(|body| snapshot.displacement(body)).collect(),
                velocity: bodies.map(|body| snapshot.velocity(body)).collect(),
            },
            energy: EnergySummary {
                striker_initial: model.striker_energy(),
                striker_final: energies.striker,
                chain_final: energies.chain,
                intruders_final: energies.intruders,
                chain_max: self.chain.value,
                dissipated_contacts: energies.dissipated_contacts,
                dissipated_intruders: energies.dissipated_intruders,
                dissipated_ground: model.is_dragged().then_some(energies.dissipated_ground),
                drive_work: model.drive.is_some().then_some(energies.supplied),
                balance_error: self.balance_error(model),
            },
            intruders: intruders.map(of_intruder).collect(),
            solver: SolverSummary {
                steps,
                evaluations,
                seconds: 0.0,
            },
        }
    }

    /// The contacts whose greatest force came after `from`, s, with its time.
    pub(crate) fn peaks_after(&self, from: f64) -> impl Iterator<Item = (usize, f64)> + '_ {
        let times = self.forces.iter().map(|force| force.maximum.time);
        (1..).zip(times).filter(move |(_, time)| *time > from)
    }

    /// Greatest error of the energy balance as a part of the energy at t = 0, or of the greatest energy that
    /// a drive has brought in.
    fn balance_error(&self, model: &Model) -> f64 {
        let whole = if model.drive.is_some() {
            self.greatest
        } else {
            self.initial
        };
        if whole > 0.0 { self.imbalance / whole } else { 0.0 }
    }

    fn contact_peaks(&self, model: &Model) -> Vec<ContactPeak> {
        let force = |contact: usize| model.contact_at(contact).load + self.forces[contact - 1].maximum.value;
        let contacts = 1..=model.contacts();
        let least = NO_FORCE * contacts.clone().map(force).fold(0.0, f64::max);
        let peak = |contact: usize| {
            let watch = &self.forces[contact - 1];
            let reached = watch.maximum.value > least;
            ContactPeak {
                contact,
                force: force(contact),
                time: if reached { watch.maximum.time } else { 0.0 },
                fwhm: watch.width.filter(|_| reached),
            }
        };
        contacts
            .filter(|&contact| force(contact) > least)
            .map(peak)
            .collect()
    }
}

impl Ledger {
    /// Enters the energies of moving bodies. Returns the sums over all bodies: beads and intruders.
    fn enter(&mut self, model: &Model, motion: StepMoment<'_>, moving: &[Range<usize>]) -> [f64; 2] {
        let [mut chain, mut intruders] = self.at_rest;
        for bodies in moving {
            for from in bodies.clone().step_by(BLOCK) {
                let block = from / BLOCK;
                let of_block = energies(model, motion, &(from..(from + BLOCK).min(bodies.end)));
                [self.chain[block], self.intruders[block]] = of_block;
                chain += of_block[0];
                intruders += of_block[1];
            }
        }
        [chain, intruders]
    }

    /// Sets the bodies that move from now on, and sums the energies of all others.
    fn settle(&mut self, moving: &[Range<usize>]) {
        self.moving = moving.to_vec();
        let blocks = |bodies: &Range<usize>| bodies.start / BLOCK..bodies.end.div_ceil(BLOCK);
        let sum = |of: &[f64]| {
            let (mut sum, mut from) = (0.0, 0);
            for run in moving
                .iter()
                .map(blocks)
                .chain(std::iter::once(of.len()..of.len()))
            {
                sum += of[from..run.start].iter().sum::<f64>();
                from = run.end;
            }
            sum
        };
        self.at_rest = [sum(&self.chain), sum(&self.intruders)];
    }
}

impl ForceMaximum {
    fn observe(&mut self, model: &Model, stepper: &mut Stepper, contact: usize, (from, to): (f64, f64)) {
        let force = |place: f64, rate: f64| model.force_beyond_at(contact, place, rate);
        let is_wall = contact == model.bodies();
        let near = stepper.body_at_ends(contact - 1, from);
        let far = if is_wall {
            [(0.0, 0.0); 2]
        } else {
            stepper.body_at_ends(contact, from)
        };
        let [start, end] = [0, 1].map(|at| force(near[at].0 - far[at].0, near[at].1 - far[at].1));
        let half = 0.5 * self.maximum.value;
        if start.max(end) <= half.max(0.0) {
            return self.forget();
        }
        let Some(glimpse) = stepper.glimpse_contact(contact, from) else {
            return;
        };
        let of = |glimpse: &Glimpse, t: f64| {
            let [place, rate, acceleration] = glimpse.at(t);
            let slope = model.force_rate_at(contact, place, rate, acceleration);
            [force(place, rate), slope]
        };
        if self.maximum.update(from, to, |t| of(&glimpse, t)) {
            (self.falling, self.width) = (true, None);
        }
        let half = 0.5 * self.maximum.value;
        let through = |glimpse: &Glimpse, from: f64, to: f64| bisect(from, to, |t| of(glimpse, t)[0] > half);
        while self.rising.back().is_some_and(|(_, before)| *before >= start) {
            self.rising.pop_back();
        }
        self.rising.push_back((glimpse, start));
        while self.rising.get(1).is_some_and(|(_, start)| *start < half) {
            self.rising.pop_front();
        }
        if self.falling && end < half {
            self.falling = false;
            let last = &self.rising[self.rising.len() - 1].0;
            let fall = through(last, from.max(self.maximum.time), to);
            let first = &self.rising[0].0;
            let low = of(first, first.from)[0] < half;
            let rise = low.then(|| through(first, first.from, first.to.min(self.maximum.time)));
            self.width = rise.map(|rise| fall - rise);
        }
        if end < half {
            self.forget();
        }
    }

    /// Forgets the rise of the force and releases its memory.
    fn forget(&mut self) {
        self.rising = VecDeque::new();
    }
}

impl IntruderMaxima {
    fn observe(&mut self, model: &Model, stepper: &mut Stepper, guest: usize, (from, to): (f64, f64)) {
        let places = stepper.guest_at_ends(guest).map(|(x, _)| x);
        let at = |end: usize| model.acceleration_at(guest, |number| stepper.guest_at_ends(number)[end]);
        let accelerations = [at(0), at(1)];
        let mut glimpse = None;
        // Glimpses of the intruders that it carries.
        let mut others = Vec::new();
        let mut update = |maxima: &mut [Maximum; 2], values: [f64; 2], accelerates: bool| {
            for (maximum, sign) in maxima.iter_mut().zip([1.0, -1.0]) {
                if (sign * values[0]).max(sign * values[1]) <= 0.5 * maximum.value {
                    continue;
                }
                glimpse = glimpse.take().or_else(|| stepper.glimpse_guest(guest, from));
                let Some(glimpse) = &glimpse else { continue };
                if accelerates && others.is_empty() {
                    let carried = model.carried_by(guest);
                    others.extend(
                        carried.filter_map(|number| Some((number, stepper.glimpse_guest(number, from)?))),
                    );
                }
                maximum.update(from, to, |t| {
                    let [x, w, rate] = glimpse.at(t);
                    if !accelerates {
                        return [sign * x, sign * w];
                    }
                    let motion = |number: usize| {
                        let other = others.iter().find(|(other, _)| *other == number);
                        other.map_or([x, w, rate], |(_, glimpse)| glimpse.at(t))
                    };
                    let acceleration = model.acceleration_at(guest, |number| {
                        let [x, w, _] = motion(number);
                        (x, w)
                    });
                    [
                        sign * acceleration,
                        sign * model.acceleration_rate_at(guest, motion),
                    ]
                });
            }
        };
        update(&mut self.displacement, places, false);
        update(&mut self.acceleration, accelerations, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Section;

    /// Runs six soft beads, the last two much harder. Returns the widths and the greatest number of steps
    /// kept.
    fn widths(room: Option<usize>) -> (Vec<Option<f64>>, usize) {
        let mut scenario = Scenario::paper();
        scenario.intruders.clear();
        scenario.chain.beads = 6;
        scenario.chain.young = 1e6;
        scenario.chain.relaxation = 0.0;
        scenario.sections = vec![Section {
            young: Some(1e14),
            ..Section::of([5, 6])
        }];
        let mut run = Run::new(&scenario, crate::options::Accuracy::DRAFT).unwrap();
        let mut found = Summariser::new(&mut run);
        found.room = room.unwrap_or(found.room);
        let mut most = 0;
        run.watch(0.03, |step| {
            found.observe(step);
            let kept = found.forces.iter().map(|watch| watch.rising.len()).sum();
            most = usize::max(most, kept);
            assert_eq!(found.kept, kept);
        })
        .unwrap();
        let peaks = found.summary(&mut run).peak_force;
        (peaks.iter().map(|peak| peak.fwhm).collect(), most)
    }

    #[test]
    fn a_rise_of_more_steps_than_there_is_room_for_has_no_width_and_no_wrong_one() {
        let (all, most) = widths(None);
        let room = 500;
        assert!(most > 4 * room, "{most} steps");
        let (found, kept) = widths(Some(room));
        assert!(kept <= room + KEPT_EACH * 6, "{kept} steps");
        assert_eq!(found.len(), all.len());
        for (one, other) in found.iter().zip(&all) {
            assert!(one.is_none() || one == other, "{one:?} {other:?}");
        }
        let count = |widths: &[Option<f64>]| widths.iter().flatten().count();
        assert!(count(&found) < count(&all), "{found:?} {all:?}");
    }
}
