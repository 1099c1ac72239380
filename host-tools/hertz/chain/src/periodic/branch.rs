//! Motions that repeat, followed as a drive changes.
//!
//! # Design
//! The branch is a curve of points and drives. It is followed along its length, not along the drive
//! (pseudo-arclength, Keller 1977), so it passes around a fold, where the drive turns back. A step goes along
//! the tangent, and Newton's method leads back to the curve, in the plane across the tangent. Folds are
//! located where the tangent has no component along the drive.

use std::ops::{ControlFlow, RangeInclusive};
use std::str::FromStr;

use nalgebra::{DMatrix, DVector};

use super::error::PeriodicError;
use super::map::PeriodMap;
use super::state::{CLOSED, PeriodicState, missed};
use crate::scenario::{InputError, Scenario};

/// The parameter of the drive that changes along a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DriveParameter {
    /// Amplitude, m or N.
    Amplitude,
    /// Frequency, Hz.
    Frequency,
}

impl FromStr for DriveParameter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Self::Amplitude, Self::Frequency];
        let named = all.into_iter().find(|parameter| parameter.name() == text);
        named.ok_or_else(|| format!("{text:?} is neither amplitude nor frequency"))
    }
}

impl DriveParameter {
    /// `amplitude` or `frequency`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Amplitude => "amplitude",
            Self::Frequency => "frequency",
        }
    }

    /// Value of the parameter in a scenario that is driven by a sine.
    pub fn value(self, scenario: &Scenario) -> Option<f64> {
        let drive = scenario.drive.as_ref()?;
        match self {
            Self::Amplitude => Some(drive.amplitude),
            Self::Frequency => drive.frequency,
        }
    }

    fn set(self, scenario: &Scenario, value: f64) -> Scenario {
        let mut scenario = scenario.clone();
        if let Some(drive) = &mut scenario.drive {
            match self {
                Self::Amplitude => drive.amplitude = value,
                Self::Frequency => (drive.frequency, drive.frequency_end) = (Some(value), None),
            }
        }
        scenario
    }
}

/// Extent of a branch, and its step lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BranchOptions {
    /// Most points.
    pub points: usize,
    /// Longest step: of the parameter as a part of its range, and of the motion in static overlaps.
    pub longest_step: f64,
    /// Value of the parameter that ends a branch which turned back, m, N or Hz; that of the start if `None`.
    pub back: Option<f64>,
}

impl Default for BranchOptions {
    fn default() -> Self {
        Self {
            points: 400,
            longest_step: 0.02,
            back: None,
        }
    }
}

/// A change of stability along a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Bifurcation {
    /// The branch turns back, and a multiplier passes +1: two motions meet (a saddle-node).
    Fold,
    /// A multiplier passes -1: a motion of twice the period branches off.
    PeriodDoubling,
    /// A pair of multipliers passes the unit circle elsewhere: a motion of two frequencies branches off
    /// (Neimark and Sacker).
    Torus,
    /// A multiplier passes +1 where the branch does not turn: another branch crosses.
    Crossing,
}

impl Bifurcation {
    /// `fold`, `period-doubling`, `torus` or `crossing`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fold => "fold",
            Self::PeriodDoubling => "period-doubling",
            Self::Torus => "torus",
            Self::Crossing => "crossing",
        }
    }
}

/// A motion on a branch.
#[derive(Debug, Clone)]
pub struct BranchPoint {
    /// Value of the parameter, m, N or Hz.
    pub value: f64,
    /// The motion.
    pub state: PeriodicState,
    /// The bifurcation at this point, if it is a fold; else the one between the point before and this.
    pub bifurcation: Option<Bifurcation>,
}

/// Reason why a branch ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BranchEnd {
    /// The parameter reached an end of its range.
    Range,
    /// The branch has as many points as are allowed.
    Points,
    /// Newton's method found no motion even in the shortest steps.
    Lost,
    /// The caller stopped it.
    Stopped,
}

impl BranchEnd {
    /// `range`, `points`, `lost` or `stopped`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Range => "range",
            Self::Points => "points",
            Self::Lost => "lost",
            Self::Stopped => "stopped",
        }
    }
}

/// Motions that repeat, along one parameter of the drive.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Branch {
    /// The parameter.
    pub parameter: DriveParameter,
    /// The motions in order along the branch.
    pub points: Vec<BranchPoint>,
    /// Reason why the branch ends.
    pub end: BranchEnd,
}

impl Branch {
    /// Follows a motion as a parameter of its drive goes from its value to `to`, and around folds. The branch
    /// ends at `to`, or where it turned back to [`BranchOptions::back`]. `observe` is called with each point,
    /// and `Break` stops it.
    ///
    /// # Errors
    /// [`PeriodicError`]: values are not above zero, or the start is not between the others.
    pub fn follow(
        start: PeriodicState,
        parameter: DriveParameter,
        to: f64,
        options: &BranchOptions,
        mut observe: impl FnMut(&BranchPoint) -> ControlFlow<()>,
    ) -> Result<Self, PeriodicError> {
        let mut walk = Walk::new(start, parameter, to, options)?;
        let end = loop {
            let known = walk.points.len();
            let end = walk.go_on();
            let observed = walk.points[known..].iter().try_for_each(&mut observe);
            match end {
                Some(end) => break end,
                None if observed.is_break() => break BranchEnd::Stopped,
                None => {}
            }
        };
        Ok(Self {
            parameter,
            points: walk.points,
            end,
        })
    }

    /// The folds, in order along the branch.
    pub fn folds(&self) -> impl Iterator<Item = &BranchPoint> {
        let is_fold = |point: &&BranchPoint| point.bifurcation == Some(Bifurcation::Fold);
        self.points.iter().filter(is_fold)
    }
}

/// Least cosine between the tangents of two points: 18 degrees. A longer step round a bend might land on
/// another branch.
const BEND: f64 = 0.95;
/// Parts of the longest step: the first, the shortest, and one that may go round any bend.
const FIRST: f64 = 0.25;
const SHORTEST: f64 = 1e-6;
const SHORT: f64 = 1e-3;

/// A branch that is being followed.
struct Walk<'a> {
    curve: Curve,
    options: &'a BranchOptions,
    range: RangeInclusive<f64>,
    place: DVector<f64>,
    tangent: DVector<f64>,
    step: f64,
    points: Vec<BranchPoint>,
}

impl<'a> Walk<'a> {
    fn new(
        start: PeriodicState,
        parameter: DriveParameter,
        to: f64,
        options: &'a BranchOptions,
    ) -> Result<Self, PeriodicError> {
        let from = parameter.value(&start.scenario).unwrap_or(f64::NAN);
        let back = options.back.unwrap_or(from);
        let range = back.min(to)..=back.max(to);
        if !(*range.start() > 0.0 && to.is_finite() && range.contains(&from) && from != to) {
            let what = format!("no branch goes from {from} to {to} and turns back to {back}");
            let advice = "give values above zero, with the start between the other two";
            return Err(InputError::at("", what, advice).into());
        }
        let curve = Curve {
            scenario: start.scenario.clone(),
            map: start.map.clone(),
            parameter,
            unit: range.end() - range.start(),
        };
        let place = curve.place(&start.point, from);
        let mut towards = DVector::zeros(place.len());
        towards[place.len() - 1] = (to - from).signum();
        let tangent = Curve::tangent(&curve.jacobian(&place)?, &towards);
        let first = BranchPoint {
            value: from,
            state: start,
            bifurcation: None,
        };
        Ok(Self {
            curve,
            options,
            range,
            place,
            tangent,
            step: FIRST * options.longest_step,
            points: vec![first],
        })
    }

    fn last(&self) -> &PeriodicState {
        &self.points[self.points.len() - 1].state
    }

    /// Adds the next point, and the fold before it if there is one. Returns why the branch ends, if it does.
    fn go_on(&mut self) -> Option<BranchEnd> {
        if self.points.len() >= self.options.points {
            return Some(BranchEnd::Points);
        }
        let Some(next) = self.land() else {
            return Some(BranchEnd::Lost);
        };
        let value = self.curve.value(&next.place);
        if !self.range.contains(&value) {
            self.end_at(value.clamp(*self.range.start(), *self.range.end()));
            return Some(BranchEnd::Range);
        }
        let turns = along(&next.tangent) * along(&self.tangent) < 0.0;
        let mut point = self.curve.point(&next, None);
        if turns {
            let behind = (self.step, along(&next.tangent));
            let fold = self.curve.fold(&self.place, &self.tangent, behind);
            let fold = fold.map(|fold| self.curve.point(&fold, Some(Bifurcation::Fold)));
            self.points.extend(fold);
        } else {
            point.bifurcation = change(self.last(), &point.state);
        }
        self.points.push(point);
        if next.iterations <= EASY {
            self.step = (1.5 * self.step).min(self.options.longest_step);
        }
        (self.place, self.tangent) = (next.place, next.tangent);
        None
    }

    /// The next place on the curve, in a step that is short enough.
    fn land(&mut self) -> Option<Landing> {
        let longest = self.options.longest_step;
        while self.step > SHORTEST * longest {
            let next = self.curve.advance(&self.place, &self.tangent, self.step);
            let is_near =
                |next: &Landing| next.tangent.dot(&self.tangent) > BEND || self.step < SHORT * longest;
            if let Some(next) = next.filter(is_near) {
                return Some(next);
            }
            self.step *= 0.5;
        }
        None
    }

    /// Adds the motion at the end of the range.
    fn end_at(&mut self, value: f64) {
        let scenario = self.curve.scenario(value);
        let Ok(state) = self.last().near(&scenario) else {
            return;
        };
        let bifurcation = change(self.last(), &state);
        self.points.push(BranchPoint {
            value,
            state,
            bifurcation,
        });
    }
}

/// The part of a tangent along the parameter.
fn along(tangent: &DVector<f64>) -> f64 {
    tangent[tangent.len() - 1]
}

/// Most steps of Newton's method, and the most after which the next step may be longer.
const ITERATIONS: usize = 8;
const EASY: usize = 3;

/// The bifurcation between two motions of a branch that does not turn between them, by the number of
/// multipliers outside the unit circle.
fn change(before: &PeriodicState, after: &PeriodicState) -> Option<Bifurcation> {
    let (fewer, more) = (before.growing(), after.growing());
    if fewer == more {
        return None;
    }
    let state = if more > fewer { after } else { before };
    let passed = state.multipliers()[fewer.max(more) - 1];
    Some(if passed.im.abs() > 1e-9 {
        Bifurcation::Torus
    } else if passed.re < 0.0 {
        Bifurcation::PeriodDoubling
    } else {
        Bifurcation::Crossing
    })
}

/// The curve of points and drives. A place on it is a point and the parameter in units of its range.
struct Curve {
    scenario: Scenario,
    /// The map at the start, which has the units of points.
    map: PeriodMap,
    parameter: DriveParameter,
    unit: f64,
}

/// A place that Newton's method found.
struct Landing {
    place: DVector<f64>,
    tangent: DVector<f64>,
    derivative: DMatrix<f64>,
    residual: f64,
    iterations: usize,
}

impl Curve {
    fn place(&self, point: &DVector<f64>, value: f64) -> DVector<f64> {
        point.clone().push(value / self.unit)
    }

    fn value(&self, place: &DVector<f64>) -> f64 {
        place[place.len() - 1] * self.unit
    }

    fn split(&self, place: &DVector<f64>) -> (DVector<f64>, f64) {
        (place.rows(0, place.len() - 1).into_owned(), self.value(place))
    }

    fn scenario(&self, value: f64) -> Scenario {
        self.parameter.set(&self.scenario, value)
    }

    fn map(&self, value: f64) -> Result<PeriodMap, PeriodicError> {
        Ok(self.map.with_drive_of(&self.scenario(value))?)
    }

    /// Derivative of end minus start of a period by point and parameter: one row fewer than columns.
    fn jacobian(&self, place: &DVector<f64>) -> Result<DMatrix<f64>, PeriodicError> {
        let (point, value) = self.split(place);
        let (_, derivative) = self.map(value)?.image_and_derivative(&point)?;
        self.extended(&point, value, &derivative)
    }

    fn extended(
        &self,
        point: &DVector<f64>,
        value: f64,
        derivative: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, PeriodicError> {
        let count = point.len();
        let step = 1e-5 * value;
        let [more, less] = [value + step, value - step].map(|value| self.map(value)?.image(point));
        let by_value = (more? - less?) * (0.5 / step * self.unit);
        let mut jacobian = (derivative - DMatrix::identity(count, count)).insert_column(count, 0.0);
        jacobian.set_column(count, &by_value);
        Ok(jacobian)
    }

    /// Unit tangent of the curve, on the side of `direction`; `direction` itself if the equations are
    /// singular.
    fn tangent(jacobian: &DMatrix<f64>, direction: &DVector<f64>) -> DVector<f64> {
        let last = direction.len() - 1;
        let mut equations = jacobian.clone().insert_row(last, 0.0);
        equations.set_row(last, &direction.transpose());
        let mut right = DVector::zeros(direction.len());
        right[last] = 1.0;
        let tangent = equations.lu().solve(&right);
        tangent.map_or_else(|| direction.clone(), |tangent| tangent.normalize())
    }

    /// The place of the curve at a distance along the tangent.
    fn advance(&self, place: &DVector<f64>, tangent: &DVector<f64>, step: f64) -> Option<Landing> {
        let last = place.len() - 1;
        let mut now = place + tangent * step;
        let mut before = f64::INFINITY;
        for iterations in 0..=ITERATIONS {
            let (point, value) = self.split(&now);
            if value <= 0.0 {
                return None;
            }
            let (image, derivative) = self.map(value).ok()?.image_and_derivative(&point).ok()?;
            let residual = missed(&point, &image);
            let jacobian = self.extended(&point, value, &derivative).ok()?;
            if residual <= CLOSED {
                let tangent = Self::tangent(&jacobian, tangent);
                return Some(Landing {
                    place: now,
                    tangent,
                    derivative,
                    residual,
                    iterations,
                });
            }
            let converges = residual < before && residual < 1.0;
            if !converges {
                return None;
            }
            before = residual;
            let mut equations = jacobian.insert_row(last, 0.0);
            equations.set_row(last, &tangent.transpose());
            let mut right = (&point - &image).push(0.0);
            right[last] = step - tangent.dot(&(&now - place));
            now += equations.lu().solve(&right)?;
        }
        None
    }

    /// The fold between a place, whose tangent points towards it, and the place at `step`, where the
    /// tangent's part along the parameter is `behind`: regula falsi (Illinois) on that part.
    fn fold(
        &self,
        place: &DVector<f64>,
        tangent: &DVector<f64>,
        (step, behind): (f64, f64),
    ) -> Option<Landing> {
        let (mut low, mut high) = ((0.0, along(tangent)), (step, behind));
        let mut found: Option<Landing> = None;
        for _ in 0..12 {
            let at = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
            let landing = self.advance(place, tangent, at)?;
            let part = along(&landing.tangent);
            found = Some(landing);
            if part.abs() < 1e-7 {
                break;
            }
            if part * low.1 > 0.0 {
                low = (at, part);
                high.1 *= 0.5;
            } else {
                high = (at, part);
                low.1 *= 0.5;
            }
        }
        found
    }

    fn point(&self, landing: &Landing, bifurcation: Option<Bifurcation>) -> BranchPoint {
        let (point, value) = self.split(&landing.place);
        let map = self.map(value).expect("the landing was found with it");
        let scenario = self.scenario(value);
        let state = PeriodicState::found(map, scenario, point, &landing.derivative, landing.residual);
        BranchPoint {
            value,
            state,
            bifurcation,
        }
    }
}
