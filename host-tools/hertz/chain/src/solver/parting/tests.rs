//! Bounds of a slow step, on motions with known results.

use super::*;
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::Striker;
use crate::solver::testing::{hosting, plain};

/// The bead that the tests are about: neither the first nor the last of its block.
const LANE: usize = BLOCK + 20;

/// 64 equal spheres, of which one may have an intruder; and no motion.
fn chain(relaxation: f64, host: Option<usize>) -> (Lanes, Motion) {
    let mut scenario = hosting(plain(63, relaxation, 1e-3), host);
    scenario.striker = Striker::new(scenario.chain.radius, scenario.chain.material(), 0.45);
    let lanes = Lanes::new(&Model::new(&scenario));
    let motion = Motion::zeros(&lanes);
    (lanes, motion)
}

/// Presses the contact before the bead [`LANE`] by `deep`, and no other.
fn press(motion: &mut Motion, deep: f64) {
    motion.u[BLOCK..LANE].fill(deep);
}

/// All blocks move, and none is calm but these.
fn calm(lanes: &Lanes, runs: Vec<Range<usize>>) -> Calm {
    let moves = vec![true; lanes.blocks];
    Calm { moves, runs }
}

#[track_caller]
fn same(one: f64, other: f64) {
    assert!((one / other - 1.0).abs() < 1e-12, "{one:e}, {other:e} expected");
}

#[test]
fn a_signal_is_at_most_as_fast_as_in_a_contact_that_has_all_energy() {
    // Beads a second in contacts that are pressed by an energy.
    let speed = |lanes: &Lanes, energy: f64| {
        let (stiffness, inverse) = (lanes.stiffness[LANE], lanes.inverse[LANE]);
        let deep = (2.5 * energy / stiffness).powf(0.4);
        (1.5 * stiffness * deep.sqrt() * inverse).sqrt()
    };
    let (lanes, still) = chain(0.0, None);
    let all = calm(&lanes, Vec::new());
    assert_eq!(all.fastest(&lanes, &still), 0.0);

    let mut pressed = still.clone();
    press(&mut pressed, 3e-6);
    let stiffness = 1.5 * lanes.stiffness[LANE] * 3e-6_f64.sqrt();
    same(
        all.fastest(&lanes, &pressed),
        (stiffness * lanes.inverse[LANE]).sqrt(),
    );
    // A calm block has no wave to send.
    let block = LANE / BLOCK - 1;
    let quiet = calm(
        &lanes,
        vec![Range {
            start: block,
            end: block + 1,
        }],
    );
    assert_eq!(quiet.fastest(&lanes, &pressed), 0.0);
    // An open contact holds nothing.
    let mut open = still.clone();
    press(&mut open, -3e-6);
    assert_eq!(all.fastest(&lanes, &open), 0.0);

    let mut moving = still.clone();
    moving.v[LANE] = -0.3;
    let kinetic = 0.5 * 0.3 * 0.3 / lanes.inverse[LANE];
    same(all.fastest(&lanes, &moving), speed(&lanes, kinetic));
    let mut both = moving;
    press(&mut both, 3e-6);
    let elastic = 0.4 * lanes.stiffness[LANE] * 3e-6_f64.powf(2.5);
    same(all.fastest(&lanes, &both), speed(&lanes, elastic + kinetic));

    // An intruder has energy by its own speed, not by that in its host, and in its spring.
    let (lanes, still) = chain(0.0, Some(LANE - BLOCK));
    let at = lanes.guests.lane(0);
    let all = calm(&lanes, Vec::new());
    let mut moving = still.clone();
    (moving.v[LANE], moving.v[at]) = (0.2, 0.4);
    let mass = Oscillator::PAPER.mass;
    let kinetic = 0.5 * 0.2 * 0.2 / lanes.inverse[LANE] + 0.5 * mass * 0.6 * 0.6;
    same(all.fastest(&lanes, &moving), speed(&lanes, kinetic));
    let mut stretched = still;
    stretched.u[at] = 2e-6;
    let spring = 0.5 * Oscillator::PAPER.stiffness * 2e-6 * 2e-6;
    same(all.fastest(&lanes, &stretched), speed(&lanes, spring));
}

#[test]
fn slopes_are_those_of_the_stiffest_contact_when_it_is_a_quarter_deeper() {
    let (lanes, mut motion) = chain(4.2e-6, None);
    press(&mut motion, 2e-6);
    let block = LANE / BLOCK - 1;
    let run = [Range {
        start: block,
        end: block + 1,
    }];
    let slopes = Slopes::of(&lanes, &motion, &run);
    let by_overlap = |deep: f64| 1.5 * lanes.stiffness[LANE] * deep.sqrt() * lanes.inverse[LANE];
    assert!(slopes.overlap >= by_overlap(1.25 * 2e-6) && slopes.overlap < by_overlap(1.8 * 2e-6));
    // F = κ √δ (δ + (3/2) τ δ'), so its slope by the rate is the other one times τ.
    assert!(slopes.rate >= 4.2e-6 * by_overlap(1.25 * 2e-6) && slopes.rate < 4.2e-6 * by_overlap(1.3 * 2e-6));
    // Contacts elsewhere, and open ones, have none.
    let elsewhere = [Range { start: 4, end: 6 }];
    assert_eq!(Slopes::of(&lanes, &motion, &elsewhere).overlap, 0.0);
    press(&mut motion, -2e-6);
    assert_eq!(Slopes::of(&lanes, &motion, &run).overlap, 0.0);
}

/// (A H/2K) e^(2K) z^(-K) with z + 2 + 1/z = λ²/(a + gλ), λ = 2K/H and K = 8, z found by halving.
fn bound(acceleration: f64, (a, g): (f64, f64), length: f64) -> f64 {
    let rate = 16.0 / length;
    let sum = rate * rate / (a + g * rate);
    let (mut low, mut high) = (1.0, sum);
    for _ in 0..200 {
        let z: f64 = 0.5 * (low + high);
        if z + 2.0 + 1.0 / z < sum {
            low = z
        } else {
            high = z
        }
    }
    acceleration / rate * 16.0_f64.exp() * low.powi(-8)
}

#[test]
fn what_a_slow_step_leaves_out_is_below_the_bound_that_is_derived() {
    let (lanes, mut motion) = chain(0.0, None);
    press(&mut motion, 2e-6);
    // The force of the contact on the bead behind it.
    let acceleration = lanes.stiffness[LANE] * 2e-6_f64.powf(1.5) * lanes.inverse[LANE];
    let slope = 1.9e8_f64;
    let length = 2.0 / slope.sqrt();
    let left_out = |motion: &Motion, beads: &[usize], rate: f64, length: f64| {
        let slopes = Slopes { overlap: slope, rate };
        slopes.left_out(&lanes, motion, beads, length)
    };
    let left = left_out(&motion, &[LANE], 0.0, length);
    let part = left / (acceleration * length);
    assert!((part / 2.5e-9 - 1.0).abs() < 0.02, "{left:e}");
    let of = |acceleration: f64| bound(acceleration, (slope, 0.0), length);
    same(left, of(acceleration));
    // The bead before is pushed as hard, one elsewhere not at all; the hardest counts.
    let others = [LANE + 5, LANE - 1, LANE + 9];
    same(left_out(&motion, &others, 0.0, length), left);
    assert_eq!(left_out(&motion, &[LANE + 5], 0.0, length), 0.0);

    let left = left_out(&motion, &[LANE], 2e3, length);
    same(left, bound(acceleration, (slope, 2e3), length));

    // A bead that moves changes both its contacts, at up to twice that rate.
    let (_, mut moving) = chain(0.0, None);
    moving.v[LANE] = 1e-3;
    let by_rate = |rate: f64| 2.0 * slope * rate * length;
    same(left_out(&moving, &[LANE], 0.0, length), of(by_rate(2e-3)));
    // With its neighbour, only one of them.
    let mut along = moving.clone();
    along.v[LANE + 1] = 1e-3;
    same(left_out(&along, &[LANE], 0.0, length), of(by_rate(1e-3)));
    moving.u = motion.u.clone();
    let both = of(acceleration + by_rate(2e-3));
    same(left_out(&moving, &[LANE], 0.0, length), both);

    // No z is above 1 where √a H is 8.
    for (length, is_finite) in [(7.999, true), (8.001, false)] {
        let left = left_out(&motion, &[LANE], 0.0, length / slope.sqrt());
        assert_eq!(left < f64::INFINITY, is_finite);
    }
}

#[test]
fn the_longest_step_is_stable_keeps_waves_out_and_leaves_out_what_is_quiet() {
    let (lanes, mut motion) = chain(4.2e-6, None);
    // A calm part, pressed by a quarter of a micrometre, and a wave in the last block.
    for lane in BLOCK..BLOCK + 64 {
        motion.u[lane] = -2.5e-7 * (lane - BLOCK) as f64;
    }
    let waves = |speed: f64| {
        let mut motion = motion.clone();
        motion.v[BLOCK + 60] = speed;
        motion
    };
    let part = calm(&lanes, std::iter::once(0..5).collect());
    let slopes = Slopes::of(&lanes, &motion, &part.runs);
    let root = slopes.overlap.sqrt() + slopes.rate;
    let step = |motion: &Motion, quiet, wanted| part.longest(&lanes, motion, quiet, wanted);
    let slow = waves(0.0);
    assert_eq!(step(&slow, 1.0, 1e-9), 1e-9);
    same(step(&slow, 1.0, 1.0), STABLE / root);
    let fast = waves(1e4);
    let way = (GUARD * BLOCK) as f64;
    same(step(&fast, 1.0, 1.0), way / part.fastest(&lanes, &fast));
    // It is shortened by tenths until the bound at the edge, the first bead after the run, is met.
    let edge = [first(5)];
    let left = |length: f64| slopes.left_out(&lanes, &slow, &edge, length);
    let quiet = 1e-3 * left(STABLE / root);
    let length = step(&slow, quiet, 1.0);
    assert!(left(length) <= quiet && left(length / 0.9) > quiet);
}

#[test]
fn beads_beside_calm_blocks_fly_freely_where_more_moves() {
    let (lanes, _) = chain(0.0, None);
    let mut all = calm(&lanes, Vec::new());
    let last = lanes.blocks;
    assert_eq!(all.edges(&[0..1, 3..last]), [first(1), first(3) - 1]);
    let run = [Range { start: 2, end: 4 }];
    assert_eq!(all.edges(&run), [first(2) - 1, first(4)]);
    all.moves[1] = false;
    assert_eq!(all.edges(&run), [first(4)]);
    all.moves[4] = false;
    assert!(all.edges(&run).is_empty());
}

#[test]
fn a_block_is_calm_whose_contacts_change_by_a_quarter_or_stay_open() {
    let (block, length) = (LANE / BLOCK - 1, 1e-5);
    let calm = |relaxation: f64, host: Option<usize>, deep: f64, rate: f64| {
        let (lanes, mut motion) = chain(relaxation, host);
        // The other contacts are pressed hard.
        for lane in BLOCK..BLOCK + 64 {
            let short = if lane < LANE { 0.0 } else { 1e-5 - deep };
            motion.u[lane] = short - 1e-5 * (lane - BLOCK) as f64;
        }
        motion.v[BLOCK..LANE].fill(rate);
        is_calm(&lanes, &motion, block, length)
    };
    // Pressed by 1 µm: it may change by 0.25 µm, either way.
    for sign in [1.0, -1.0] {
        assert!(calm(0.0, None, 1e-6, sign * 0.0249) && !calm(0.0, None, 1e-6, sign * 0.0251));
        // The viscous force changes with the rate: (3/2) τ counts as a time where it is longer.
        assert!(calm(1e-5, None, 1e-6, sign * 0.0166) && !calm(1e-5, None, 1e-6, sign * 0.0168));
        assert!(!calm(0.0, Some(LANE - BLOCK), 1e-6, 0.0));
    }
    // Open by 1 µm: it stays so in three times the step.
    for (rate, stays) in [(0.0333, true), (0.0334, false), (-1.0, true)] {
        assert_eq!(calm(0.0, None, -1e-6, rate), stays);
    }
}
