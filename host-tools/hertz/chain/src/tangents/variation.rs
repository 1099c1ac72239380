//! Derivatives along a motion that the solver has already found.
//!
//! # Design
//! The equations of motion, differentiated by a parameter, are linear in the derivatives, and their
//! coefficients depend on the motion alone. The solver gives the motion at any time of a step, so only the
//! derivatives are integrated here, over its steps, by the method of order 6 of the ensembles.
//!
//! The stiffness of a contact rises as the root of the time since it closed, and falls as the root of the
//! time until it opens. A step is divided at these times, and a piece that begins soon after one or ends soon
//! before one is integrated over that root in place of the time ([`Piece`]): everything is a smooth function
//! of it.

use pulp::{Arch, NullaryFnOnce};

use super::chain::DualChain;
use super::dual::Dual;
use super::march::March;
use crate::ensemble::method::{END, ERROR, NODES, STAGES, VELOCITY};
use crate::run::{RunStep, StepView};

/// Derivatives of one value.
type Slopes<const P: usize> = [f64; P];

/// A piece of a step, from `start` to `end`, s, over which a variable goes from 0 to 1.
#[derive(Debug, Clone, Copy)]
struct Piece {
    start: f64,
    end: f64,
    /// Time at which a contact closed, at or before the start, or will open, at or after the end.
    root: Option<f64>,
    /// Number of halvings still allowed, and the error of the piece that this one is a half of.
    halvings: u32,
    before: f64,
}

impl Piece {
    fn new(start: f64, end: f64, root: Option<f64>, halvings: u32) -> Self {
        Self {
            start,
            end,
            root,
            halvings,
            before: f64::INFINITY,
        }
    }

    /// The time, s, at a value of the variable, and its rate.
    fn time(self, at: f64) -> (f64, f64) {
        let Some(root) = self.root else {
            let length = self.end - self.start;
            return (self.start + length * at, length);
        };
        let [first, last] = [self.start, self.end].map(|time| (time - root).abs().sqrt());
        let here = first + (last - first) * at;
        let away = if root <= self.start { 1.0 } else { -1.0 };
        (root + away * here * here, away * 2.0 * (last - first) * here)
    }

    /// Second and first half of the piece; `before` is the error of the piece.
    fn halves(self, before: f64) -> [Self; 2] {
        let middle = self.time(0.5).0;
        let halvings = self.halvings - 1;
        [
            Self {
                start: middle,
                halvings,
                before,
                ..self
            },
            Self {
                end: middle,
                halvings,
                before,
                ..self
            },
        ]
    }
}

/// Allowed error of a piece, as a part of the derivatives.
const TOLERANCE: f64 = 1e-6;
/// Kinds of values whose error is estimated: displacements and momenta of bodies, displacements and
/// velocities of intruders. What an intruder dissipates follows from these.
const KINDS: usize = 4;
/// Steps between a root and a piece beyond which the piece is not divided.
const FAR: f64 = 0.5;
/// Error over that of the whole piece, above which another division gains too little. At a root halving gains
/// a factor of 2.8.
const HELPS: f64 = 0.4;
/// Most times that a piece is halved: the motion inside a step is itself known only to some 1e-9.
const HALVINGS: u32 = 2;

/// A time at which the overlap of a contact is zero.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    time: f64,
    closes: bool,
}

/// Overlaps below this part of the greatest of the run count as none: their contacts move nothing.
const NO_OVERLAP: f64 = 1e-12;

/// Derivatives of the state of a chain at the present end of a run.
pub(super) struct Variation<'a, const P: usize> {
    march: March<'a, P>,
    /// Of displacements, momenta, intruders, and of the energy that each intruder has dissipated.
    state: Vec<Slopes<P>>,
    /// Their rates in time at the present end, once they are known.
    now: Option<Vec<Slopes<P>>>,
    /// Rates at the stages of a piece, by its variable, and the derivatives at one of them.
    rates: Vec<Vec<Slopes<P>>>,
    there: Vec<Slopes<P>>,
    /// Greatest overlap so far, m.
    deepest: f64,
    /// Values of the parameters; 0 for one without a size of its own.
    parameters: [f64; P],
    /// Greatest derivatives so far, of each kind of value in the state.
    greatest: [Slopes<P>; KINDS],
    /// Greatest values so far, of each kind.
    sizes: [f64; KINDS],
}

impl<'a, const P: usize> Variation<'a, P> {
    /// `parameters` has the value of each parameter, which sets the scale of its derivatives.
    pub(super) fn new(chain: &'a DualChain<P>, parameters: [f64; P]) -> Self {
        let march = March::new(chain, &[], None, 0.0);
        let mut state: Vec<_> = march.state.iter().map(|value| value.by).collect();
        state.resize(state.len() + chain.intruders.len(), [0.0; P]);
        Self {
            rates: vec![state.clone(); STAGES],
            there: state.clone(),
            state,
            now: None,
            march,
            deepest: 0.0,
            parameters,
            greatest: [[0.0; P]; KINDS],
            sizes: [0.0; KINDS],
        }
    }

    /// Begins with the derivatives with respect to the values of the state at these places, one for each
    /// direction. All bodies move.
    pub(super) fn start_at(&mut self, places: &[usize]) {
        self.march.front = self.march.chain.bodies() - 1;
        self.state.fill([0.0; P]);
        for (direction, &place) in places.iter().enumerate() {
            self.state[place][direction] = 1.0;
        }
    }

    /// The derivatives of a value of the state.
    pub(super) fn slopes(&self, place: usize) -> Slopes<P> {
        self.state[place]
    }

    /// Follows a step of the run.
    pub(super) fn follow(&mut self, step: &mut RunStep<'_>) {
        let moving = step.moving().map(|bodies| bodies.end).max().unwrap_or(0);
        self.march.front = self.march.front.max(moving.saturating_sub(1));
        self.follow_to(step, step.to());
    }

    /// The force of a contact at a time of a step that is yet to be followed, with its derivatives.
    pub(super) fn force(&mut self, step: &mut RunStep<'_>, contact: usize, t: f64) -> Dual<P> {
        let (state, now) = (self.state.clone(), self.now.clone());
        self.follow_to(step, t);
        let force = self.march.force(contact);
        (self.state, self.now) = (state, now);
        force
    }

    /// The motion at the present end with its derivatives.
    pub(super) fn at_end(&self) -> &March<'a, P> {
        &self.march
    }

    /// Derivatives of the energy that an intruder has dissipated.
    pub(super) fn dissipated(&self, intruder: usize) -> Slopes<P> {
        self.state[self.march.layout.length() + intruder]
    }

    /// Follows a step from its start to a time within it. The last evaluation is at its end.
    fn follow_to(&mut self, step: &mut RunStep<'_>, to: f64) {
        let from = step.from();
        let crossings = self.crossings(step, to);
        let ends = crossings.iter().map(|crossing| crossing.time);
        let ends: Vec<_> = ends
            .filter(|time| *time > from && *time < to)
            .chain([to])
            .collect();
        // Far from any root the solver's own steps are short enough.
        let far = FAR * (to - from);
        let is_near = |one: &Crossing| one.time > from - far && one.time < to + far;
        let halvings = if crossings.iter().any(is_near) {
            HALVINGS
        } else {
            0
        };
        let mut start = from;
        for end in ends {
            // The nearest closing before this piece, and the nearest opening after it, if they are near.
            let near = 0.1 * (end - start);
            let closings = crossings.iter().filter(|one| one.closes && one.time <= start);
            let closed = closings.map(|one| one.time).reduce(f64::max);
            let closed = closed.filter(|time| start - time < near);
            let openings = crossings.iter().filter(|one| !one.closes && one.time >= end);
            let opens = openings.map(|one| one.time).reduce(f64::min);
            let opens = opens.filter(|time| time - end < near);
            let middle = 0.5 * (start + end);
            let pieces = match (closed, opens) {
                (Some(_), Some(_)) => vec![
                    Piece::new(middle, end, opens, halvings),
                    Piece::new(start, middle, closed, halvings),
                ],
                (root, None) | (None, root) => vec![Piece::new(start, end, root, halvings)],
            };
            self.pass(step, pieces);
            start = end;
        }
    }

    /// Times at which a contact opens or closes in a step up to `to`, closed shortly before it, or will open
    /// shortly after it.
    fn crossings(&mut self, step: &mut RunStep<'_>, to: f64) -> Vec<Crossing> {
        let from = step.from();
        let contacts = self.march.chain.contacts.len().min(self.march.last() + 1);
        let overlaps = |view: StepView<'_>| {
            let overlap = |j| (view.overlap(j), view.overlap_rate(j));
            (1..=contacts).map(overlap).collect::<Vec<_>>()
        };
        let (before, after) = (overlaps(step.at(from)), overlaps(step.at(to)));
        let deepest = after
            .iter()
            .fold(self.deepest, |most, overlap| most.max(overlap.0));
        self.deepest = deepest;
        let mut found = Vec::new();
        for (contact, (before, after)) in (1..).zip(before.into_iter().zip(after)) {
            if before.0.max(after.0) <= NO_OVERLAP * deepest {
                continue;
            }
            let closes = after.0 > 0.0;
            if (before.0 > 0.0) != closes {
                let time = root(step, contact, (from, to), (before.0, after.0));
                found.push(Crossing { time, closes });
                continue;
            }
            // Both ends are in contact, and the root lies outside: near it the overlap is linear.
            if before.1 > 0.0 {
                let time = from - before.0 / before.1;
                found.push(Crossing { time, closes: true });
            }
            if after.1 < 0.0 {
                let time = to - after.0 / after.1;
                found.push(Crossing { time, closes: false });
            }
        }
        found.sort_by(|one, other| one.time.total_cmp(&other.time));
        found
    }

    /// Integrates the derivatives over pieces of a step, the last one first, and divides those whose error is
    /// too great.
    fn pass(&mut self, step: &mut RunStep<'_>, mut pieces: Vec<Piece>) {
        while let Some(piece) = pieces.pop() {
            for (stage, node) in NODES.into_iter().enumerate() {
                let (time, pace) = piece.time(node);
                match &self.now {
                    Some(now) if stage == 0 => self.rates[0].copy_from_slice(now),
                    _ => self.evaluate(stage, &step.at(time.clamp(step.from(), step.to()))),
                }
                if stage == 0 {
                    self.now.get_or_insert_with(|| self.rates[0].clone());
                }
                if stage < END {
                    self.rates[stage]
                        .as_flattened_mut()
                        .iter_mut()
                        .for_each(|rate| *rate *= pace);
                }
            }
            let last = piece.time(1.0).1;
            if piece.halvings > 0 {
                let error = self.error(last);
                if error > TOLERANCE && error < HELPS * piece.before {
                    pieces.extend(piece.halves(error));
                    continue;
                }
            }
            self.state.copy_from_slice(&self.there);
            self.now = Some(self.rates[END].clone());
        }
    }

    /// Estimated error of a piece, with the rate of the time at its end. For each kind it is relative to the
    /// greatest derivative by a parameter so far, or to the greatest value over that parameter if it is more.
    fn error(&mut self, last: f64) -> f64 {
        let layout = self.march.layout;
        let ends = [
            layout.momentum(0),
            layout.place(0),
            layout.velocity(0),
            layout.length(),
        ];
        let (mut worst, mut from) = (0.0_f64, 0);
        for (kind, to) in ends.into_iter().enumerate() {
            let values = self.march.argument.iter().take(to).skip(from);
            let size = values.fold(self.sizes[kind], |most, dual| most.max(dual.value.abs()));
            self.sizes[kind] = size;
            let (mut off, greatest) = ([0.0_f64; P], &mut self.greatest[kind]);
            for at in from..to {
                for (direction, off) in off.iter_mut().enumerate() {
                    greatest[direction] = greatest[direction].max(self.there[at][direction].abs());
                    let earlier = self.rates.iter().zip(ERROR).take(END);
                    let sum: f64 = earlier.map(|(rates, weight)| weight * rates[at][direction]).sum();
                    let error = sum + ERROR[END] * last * self.rates[END][at][direction];
                    *off = off.max(error.abs());
                }
            }
            for ((off, greatest), parameter) in off.iter().zip(greatest).zip(self.parameters) {
                // A parameter that is 0 sets no scale; only the derivatives do.
                let size = if parameter == 0.0 {
                    0.0
                } else {
                    size / parameter.abs()
                };
                let scale = size.max(*greatest);
                if *off > 0.0 {
                    worst = worst.max(off / scale);
                }
            }
            from = to;
        }
        worst
    }

    /// Computes the rates of the derivatives at a stage.
    fn evaluate(&mut self, stage: usize, view: &StepView<'_>) {
        let march = &mut self.march;
        let (layout, chain, last) = (march.layout, march.chain, march.last());
        for body in 0..=last {
            march.argument[body].value = view.displacement(body) + chain.starts[body].0;
        }
        for body in 0..=last {
            let momentum = march.momentum(body, view.velocity(body));
            march.argument[layout.momentum(body)].value = momentum;
        }
        for (number, intruder) in chain.intruders.iter().enumerate() {
            let bead = intruder.body;
            let relative = view.intruder_displacement(bead).zip(view.intruder_velocity(bead));
            let (place, velocity) = relative.unwrap_or_default();
            march.argument[layout.place(number)].value = march.argument[bead].value + place;
            march.argument[layout.velocity(number)].value = view.velocity(bead) + velocity;
        }
        Arch::new().dispatch(EvaluateCall {
            variation: self,
            stage,
            time: view.time(),
        });
    }
}

/// The time at which a contact's overlap is zero, by Newton's method between two times around it.
fn root(
    step: &mut RunStep<'_>,
    contact: usize,
    (mut low, mut high): (f64, f64),
    (before, after): (f64, f64),
) -> f64 {
    if before == 0.0 {
        return low;
    }
    let rises = after > before;
    let mut time = low + (high - low) * before / (before - after);
    for _ in 0..40 {
        let view = step.at(time.clamp(low, high));
        let overlap = view.overlap(contact);
        if (overlap > 0.0) == rises {
            high = time;
        } else {
            low = time;
        }
        let rate = view.overlap_rate(contact);
        let newton = time - overlap / rate;
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - time).abs() <= 1e-13 * high.abs() {
            break;
        }
        time = next;
    }
    time
}

/// An evaluation, compiled for each kind of vectors.
struct EvaluateCall<'v, 'a, const P: usize> {
    variation: &'v mut Variation<'a, P>,
    stage: usize,
    time: f64,
}

impl<const P: usize> NullaryFnOnce for EvaluateCall<'_, '_, P> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Variation {
            march,
            state,
            rates,
            there,
            ..
        } = self.variation;
        there.copy_from_slice(state);
        let (earlier, rates) = rates.split_at_mut(self.stage);
        for (rates, &weight) in earlier.iter().zip(&VELOCITY[self.stage]) {
            if weight != 0.0 {
                for (slope, rate) in there.as_flattened_mut().iter_mut().zip(rates.as_flattened()) {
                    *slope += weight * rate;
                }
            }
        }
        for (argument, by) in march.argument.iter_mut().zip(&*there) {
            argument.by = *by;
        }
        march.evaluate(self.time);
        let (layout, rates) = (march.layout, &mut rates[0]);
        for (rate, dual) in rates.iter_mut().zip(&march.rates) {
            *rate = dual.by;
        }
        for (number, intruder) in march.chain.intruders.iter().enumerate() {
            let velocity = march.argument[layout.velocity(number)];
            let rate = velocity - march.velocities[intruder.body];
            rates[layout.length() + number] = (intruder.damping * rate * rate).by;
        }
    }
}
