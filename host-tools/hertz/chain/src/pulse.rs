//! Pulses of force at a contact.
//!
//! # Design
//!
//! Peaks and valleys are roots of the force's rate. They lie between ends of steps where the rate changes
//! sign, and are found inside as exactly as the motion is known. A chain leaves many ripples behind. A peak
//! counts as a pulse if it is high enough and if the force falls far enough before the next one. If it does
//! not fall between two peaks, the lower is taken for a ripple of the other.
//!
//! In a chain under a static load, all values are those of the force beyond the load.

use crate::bisection::bisect;
use crate::flow::Flow;
use crate::quantity::{PeakQuantity, StepSampler};
use crate::solution::Solution;

/// Criteria for the peaks of a force that count as pulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PulseSearch {
    /// Start of the search, s.
    pub from: f64,
    /// End of the search, s; the end of the run if that is earlier.
    pub to: f64,
    /// Least height of a pulse, as a part of the greatest at the contact within the search.
    pub height: f64,
    /// Least fall of the force between two pulses, as a part of the lower one's height. From one half on,
    /// every pulse between two others has a full width at half its height.
    pub fall: f64,
}

impl Default for PulseSearch {
    /// Searches the whole run for pulses of a thousandth of the greatest, between which the force halves.
    fn default() -> Self {
        Self {
            from: 0.0,
            to: f64::INFINITY,
            height: 1e-3,
            fall: 0.5,
        }
    }
}

/// One pulse of force at a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Pulse {
    /// The contact, which joins bodies `contact - 1` and `contact`.
    pub contact: usize,
    /// Greatest force, N, including the static load. All other values are those of the force beyond the load.
    pub force: f64,
    /// Arrival time, s: the time of the greatest force.
    pub time: f64,
    /// Start, s: the last zero of the force before the peak, or its least value since the previous pulse.
    pub from: f64,
    /// End, s: the first zero of the force after the peak, or its least value before the next pulse.
    pub to: f64,
    /// Full width at half its height, s; `None` if the force does not fall to half on both sides.
    pub fwhm: Option<f64>,
    /// Momentum that it carries through the contact, ∫ F dt over the pulse, N·s.
    pub impulse: f64,
    /// Energy that it carries through the contact, ∫ F V[j-1] dt over the pulse, J (see
    /// [`Transfer`](crate::Transfer)). Negative in a pulse that goes back to the striker.
    pub energy: f64,
}

/// A quantity at the end of a step or of the search.
struct TracePoint {
    time: f64,
    value: f64,
    rising: bool,
    /// Number of the step that follows.
    step: usize,
}

/// A peak between points `before` and `before + 1`.
#[derive(Clone, Copy)]
pub(crate) struct Peak {
    pub(crate) time: f64,
    pub(crate) value: f64,
    before: usize,
}

/// A quantity, usually the force of a contact, over the time of a search.
pub(crate) struct ForceTrace<'a> {
    solution: &'a Solution,
    quantity: PeakQuantity,
    points: Vec<TracePoint>,
}

impl Solution {
    /// Returns the pulses that pass `contact` (from 1), in the order of their time. A force that still rises
    /// at the end of the search is not yet a pulse.
    ///
    /// # Panics
    /// If there is no such contact, or `search.from` is not within the run.
    pub fn pulses(&self, contact: usize, search: &PulseSearch) -> Vec<Pulse> {
        self.pulses_of(&self.flow(contact), contact, search)
    }

    pub(crate) fn pulses_of(&self, flow: &Flow<'_>, contact: usize, search: &PulseSearch) -> Vec<Pulse> {
        let (force, end) = (PeakQuantity::ForceBeyond(contact), search.to.min(self.end()));
        let trace = ForceTrace::new(self, force, search.from, end);
        let peaks = trace.peaks(search);
        let load = self.model().contact(contact).load;
        let pulse = |i: usize| {
            let peak = peaks[i];
            let first = if i == 0 { 0 } else { peaks[i - 1].before + 1 };
            let next = peaks.get(i + 1).map(|next| next.before);
            let last = next.unwrap_or(trace.points.len() - 1);
            let (from, to) = (trace.begin(peak, first), trace.end(peak, last));
            let passed = flow.between(from, to);
            Pulse {
                contact,
                force: load + peak.value,
                time: peak.time,
                from,
                to,
                fwhm: trace.width(peak, first, last),
                impulse: passed.impulse - load * (to - from),
                energy: passed.energy,
            }
        };
        (0..peaks.len()).map(pulse).collect()
    }

    /// Speed of a wave that is `earlier` at one contact and `later` at another, m/s: the sum of the diameters
    /// between the contacts over the time between the peaks. Negative if the wave goes back to the striker.
    ///
    /// # Panics
    /// If both are at the same contact.
    pub fn speed(&self, earlier: &Pulse, later: &Pulse) -> f64 {
        assert!(
            earlier.contact != later.contact,
            "a speed takes pulses at two contacts"
        );
        let (from, to) = (earlier.contact, later.contact);
        let beads = from.min(to)..from.max(to);
        let way: f64 = beads.map(|bead| 2.0 * self.model().radius(bead)).sum();
        let sign = if from < to { 1.0 } else { -1.0 };
        sign * way / (later.time - earlier.time)
    }
}

impl<'a> ForceTrace<'a> {
    pub(crate) fn new(solution: &'a Solution, quantity: PeakQuantity, from: f64, to: f64) -> Self {
        let model = solution.model();
        let edge = |time: f64| {
            let step = solution.step_at(time);
            let mut inside = StepSampler::new(solution, step);
            TracePoint {
                time,
                value: inside.value(quantity, time),
                rising: inside.rate(quantity, time) > 0.0,
                step,
            }
        };
        let mut rate = vec![0.0; solution.state(0).len()];
        let mut points = vec![edge(from)];
        for (knot, &time) in solution.times.iter().enumerate() {
            if from < time && time < to {
                let state = solution.state(knot);
                model.rate(time, state, &mut rate);
                points.push(TracePoint {
                    time,
                    value: quantity.value(model, state),
                    rising: quantity.rate(model, state, &rate) > 0.0,
                    step: knot,
                });
            }
        }
        if to > from {
            points.push(edge(to));
        }
        Self {
            solution,
            quantity,
            points,
        }
    }

    /// Returns the time between points `before` and `before + 1` where `holds` changes.
    fn root(&self, before: usize, mut holds: impl FnMut(&mut StepSampler<'_>, f64) -> bool) -> f64 {
        let mut inside = StepSampler::new(self.solution, self.points[before].step);
        let (from, to) = (self.points[before].time, self.points[before + 1].time);
        bisect(from, to, |t| holds(&mut inside, t))
    }

    fn turn(&self, before: usize) -> f64 {
        self.root(before, |inside, t| inside.rate(self.quantity, t) > 0.0)
    }

    fn passage(&self, before: usize, level: f64) -> f64 {
        self.root(before, |inside, t| inside.value(self.quantity, t) > level)
    }

    pub(crate) fn peaks(&self, search: &PulseSearch) -> Vec<Peak> {
        let greatest = self.points.iter().map(|point| point.value).fold(0.0, f64::max);
        let least = search.height * greatest;
        let mut peaks: Vec<Peak> = (1..self.points.len())
            .map(|after| (after - 1, &self.points[after - 1], &self.points[after]))
            // The top between two points can stand above both, so points near the least height are kept.
            .filter(|(_, a, b)| a.rising && !b.rising && a.value.max(b.value) > 0.5 * least)
            .map(|(before, a, _)| {
                let time = self.turn(before);
                let value = StepSampler::new(self.solution, a.step).value(self.quantity, time);
                Peak { time, value, before }
            })
            .filter(|peak| peak.value > 0.0 && peak.value >= least)
            .collect();
        // Remove the lower peak of the pair with the least fall between, until all falls are deep enough.
        loop {
            let fall = |pair: &[Peak]| {
                let lower = pair[0].value.min(pair[1].value);
                1.0 - self.least(pair[0], pair[1]) / lower
            };
            let falls = peaks.windows(2).map(fall).enumerate();
            let shallow = falls.filter(|(_, fall)| *fall < search.fall);
            let least = shallow.min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((i, _)) = least else { return peaks };
            let lower = peaks[i].value < peaks[i + 1].value;
            peaks.remove(if lower { i } else { i + 1 });
        }
    }

    /// Returns the least value between two peaks, to the nearest step.
    fn least(&self, one: Peak, other: Peak) -> f64 {
        let between = self.points[one.before + 1..=other.before].iter();
        between.fold(one.value.min(other.value), |least, point| least.min(point.value))
    }

    /// Returns the start of a pulse, s. Point `first` is the first before its peak that belongs to it.
    fn begin(&self, peak: Peak, first: usize) -> f64 {
        match (first..=peak.before).rev().find(|&i| self.points[i].value <= 0.0) {
            Some(i) => self.passage(i, 0.0),
            None => self.valley(first, peak.before),
        }
    }

    /// Returns the end of a pulse, s. Point `last` is the last after its peak that belongs to it.
    fn end(&self, peak: Peak, last: usize) -> f64 {
        match (peak.before + 1..=last).find(|&i| self.points[i].value <= 0.0) {
            Some(i) => self.passage(i - 1, 0.0),
            None => self.valley(peak.before + 1, last),
        }
    }

    /// Returns the time of the least value around points `first` to `last`, s.
    fn valley(&self, first: usize, last: usize) -> f64 {
        let value = |i: &usize| self.points[*i].value;
        let least = (first..=last).min_by(|a, b| value(a).total_cmp(&value(b)));
        let least = least.unwrap_or(first);
        (least.saturating_sub(1)..=least)
            .filter(|i| i + 1 < self.points.len())
            .find(|&i| !self.points[i].rising && self.points[i + 1].rising)
            .map_or(self.points[least].time, |i| self.turn(i))
    }

    fn width(&self, peak: Peak, first: usize, last: usize) -> Option<f64> {
        let half = 0.5 * peak.value;
        let below = |i: &usize| self.points[*i].value < half;
        let rise = (first..=peak.before).rev().find(below)?;
        let fall = (peak.before + 1..=last).find(below)?;
        Some(self.passage(fall - 1, half) - self.passage(rise, half))
    }
}
