//! Chains of one shape, from their models to their outcomes.

use std::sync::Arc;

use super::backwards::{ChainSlopes, EndSlopes, back};
use super::chain::{ChainShape, Constants, fewest_steps};
use super::group::{Group, GroupMotion, SavedChain};
use super::kept::KeptSteps;
use super::outcome::EnsembleOutcome;
use crate::model::Model;
use crate::summary::ContactPeak;

/// Most steps of a chain in a group, where it makes others wait. The single run refuses far more.
const MOST_STEPS: f64 = 1e6;

/// Allowed error of each step in a velocity, as a part of that of a bead in the wave. Of 10,000 random chains
/// like the paper's, none then errs by more than 8e-7 in the energy absorbed.
const TOLERANCE: f64 = 2.5e-7;

#[derive(Debug)]
pub(super) struct GroupMember<'a> {
    /// Index among the scenarios.
    pub(super) index: usize,
    pub(super) model: &'a Model,
    /// Duration, s.
    pub(super) time: f64,
    /// State to start from, if not that at t = 0.
    pub(super) start: Option<Arc<SavedChain>>,
}

impl<'a> GroupMember<'a> {
    /// A chain that starts at t = 0, with its shape; `None` if it cannot run in a group.
    pub(super) fn of(index: usize, model: &'a Model, time: f64) -> Option<(ChainShape, Self)> {
        let loaded = (1..=model.contacts()).any(|contact| model.contact_at(contact).load > 0.0);
        let given = model.is_dragged()
            || model.drive.is_some()
            || model.starts_displaced()
            || model.contact_at(1).powers.is_some();
        let cubic = model.has_cubic_springs();
        let member = Self {
            index,
            model,
            time,
            start: None,
        };
        let suits = !loaded && !given && !cubic && !model.clipped && fewest_steps(model, time) < MOST_STEPS;
        suits.then(|| (ChainShape::of(model), member))
    }
}

/// Up to eight chains at their starts.
struct Eightfold<'a> {
    constants: Constants,
    models: Vec<&'a Model>,
    start: GroupMotion,
    saved: Vec<Option<Arc<SavedChain>>>,
    peaks: Vec<usize>,
}

impl<'a> Eightfold<'a> {
    fn new(shape: &ChainShape, members: &[&GroupMember<'a>], peaks: &[usize]) -> Self {
        let chains: Vec<_> = members.iter().map(|member| (member.model, member.time)).collect();
        let mut start = GroupMotion::zeros(shape);
        for (lane, (model, _)) in chains.iter().enumerate() {
            for (body, &(place, speed)) in model.starts.iter().enumerate() {
                (start.u[body].0[lane], start.v[body].0[lane]) = (place, speed);
            }
        }
        let there = |contact: &usize| (1..shape.places()).contains(contact);
        let mut wanted: Vec<usize> = peaks.iter().copied().filter(there).collect();
        wanted.sort_unstable();
        wanted.dedup();
        Self {
            constants: Constants::new(shape, &chains, TOLERANCE),
            models: chains.iter().map(|(model, _)| *model).collect(),
            start,
            saved: members.iter().map(|member| member.start.clone()).collect(),
            peaks: wanted,
        }
    }

    fn group<'b>(&'b self, shape: &'b ChainShape) -> Group<'b> {
        let (constants, start) = (&self.constants, self.start.clone());
        let mut group = Group::new(shape, constants, &self.models, start, &self.peaks);
        for (lane, saved) in self.saved.iter().enumerate() {
            if let Some(saved) = saved {
                group.start_lane(lane, saved);
            }
        }
        group
    }
}

/// Runs up to eight chains without their intruders until a body from `last` on is pushed, and returns the
/// states before that step.
pub(super) fn before(
    shape: &ChainShape,
    members: &[&GroupMember<'_>],
    peaks: &[usize],
    last: usize,
) -> Vec<SavedChain> {
    let eight = Eightfold::new(shape, members, peaks);
    let mut group = eight.group(shape);
    group.stop_before_pushed(last);
    // A chain that is stuck here will be stuck again later.
    let _ = group.run();
    (0..members.len()).map(|lane| group.lane(lane)).collect()
}

/// Runs up to eight chains to their ends and finds the greatest forces of `peaks`, and the intruders' strokes
/// if wanted. `None` for a chain that got stuck.
pub(super) fn run(
    shape: &ChainShape,
    members: &[&GroupMember<'_>],
    (peaks, strokes): (&[usize], bool),
) -> Vec<Option<EnsembleOutcome>> {
    let eight = Eightfold::new(shape, members, peaks);
    let mut group = eight.group(shape);
    if strokes {
        group.find_strokes();
    }
    let stuck = group.run();
    let outcome = |(lane, member): (usize, &&GroupMember<'_>)| {
        (!stuck[lane]).then(|| outcome(shape, member, &group, lane))
    };
    members.iter().enumerate().map(outcome).collect()
}

/// Runs up to eight chains to their ends and back. `ends` returns the derivatives of a number of each by its
/// end, which may need the greatest force of one contact. `None` if a chain got stuck or has no such number.
pub(super) fn run_and_back(
    shape: &ChainShape,
    members: &[&GroupMember<'_>],
    peaks: &[usize],
    ends: &(dyn Fn(&EnsembleOutcome) -> Option<EndSlopes> + Sync),
) -> Option<Vec<(EnsembleOutcome, ChainSlopes)>> {
    let eight = Eightfold::new(shape, members, peaks);
    let mut group = eight.group(shape);
    group.kept = Some(KeptSteps::default());
    if group.run().contains(&true) {
        return None;
    }
    let outcomes = members.iter().enumerate();
    let outcomes: Vec<_> = outcomes
        .map(|(lane, member)| outcome(shape, member, &group, lane))
        .collect();
    let ends = outcomes.iter().map(ends).collect::<Option<Vec<EndSlopes>>>()?;
    let slopes = back(&mut group, &ends);
    Some(outcomes.into_iter().zip(slopes).collect())
}

fn outcome(shape: &ChainShape, member: &GroupMember<'_>, group: &Group<'_>, lane: usize) -> EnsembleOutcome {
    let outcome = EnsembleOutcome {
        model: Arc::new(member.model.clone()),
        time: member.time,
        state: state(shape, member.model, group, lane),
        peaks: greatest(group, lane),
        strokes: group.strokes.iter().map(|stroke| stroke.0[lane]).collect(),
        steps: group.tries[lane],
    };
    outcome.balanced()
}

/// The state of one lane, without the losses in contacts and the momentum of the wall.
fn state(shape: &ChainShape, model: &Model, group: &Group<'_>, lane: usize) -> Vec<f64> {
    let layout = model.layout();
    let mut state = vec![0.0; layout.dimension()];
    for body in 0..shape.bodies {
        state[body] = group.now.u[body].0[lane];
        state[layout.velocity(body)] = group.now.v[body].0[lane];
    }
    for guest in 0..shape.hosts.len() {
        state[layout.relative(guest)] = group.now.x[guest].0[lane];
        state[layout.relative_velocity(guest)] = group.now.w[guest].0[lane];
        state[layout.intruder_loss(guest)] = group.dissipated[guest].0[lane];
    }
    state
}

fn greatest(group: &Group<'_>, lane: usize) -> Vec<ContactPeak> {
    let of = |peaks: &super::peak::ForcePeaks| ContactPeak {
        contact: peaks.contact,
        force: peaks.greatest[lane].0,
        time: peaks.greatest[lane].1,
        fwhm: None,
    };
    let all = group.peaks.iter().map(of);
    all.filter(|peak| peak.force > 0.0).collect()
}
