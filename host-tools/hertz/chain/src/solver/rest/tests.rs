//! Sleeping blocks, on motions with known results.

use super::*;
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{Material, Section, Wall};
use crate::solver::testing::{hosting, plain};

/// Speed that may be left out, over the scale of speeds.
const TOLERANCE: f64 = 1e-6;

/// 31 beads of the paper and a wall; some beads are lighter. All are at rest, all blocks asleep since 1 s.
fn asleep(light: &[usize], host: Option<usize>) -> (Lanes, Work, RestingBlocks) {
    let mut scenario = hosting(plain(31, 0.0, 1e-3), host);
    scenario.wall = Some(Wall::flat(Material::STEEL));
    let mut section = Section::of(light.to_vec());
    section.radius = Some(0.012);
    scenario.sections = vec![section];
    let lanes = Lanes::new(&Model::new(&scenario));
    let mut work = Work::new(&lanes);
    let rest = RestingBlocks::new(&lanes, &mut work, 1.0, TOLERANCE);
    assert!(rest.awake.is_empty() && work.active.is_empty());
    (lanes, work, rest)
}

#[track_caller]
fn same(one: f64, other: f64) {
    assert!((one / other - 1.0).abs() < 1e-12, "{one:e}, {other:e} expected");
}

#[test]
fn no_contact_as_shallow_holds_more_than_a_body_of_the_speed_that_is_left_out() {
    let (lanes, ..) = asleep(&[7], None);
    let quiet = 1e-9;
    let deep = shallow(&lanes, quiet);
    let mut most = 0.0_f64;
    for lane in BLOCK + 1..=BLOCK + lanes.bodies {
        let elastic = 0.4 * lanes.stiffness[lane] * deep.powf(2.5);
        let lighter = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
        most = most.max(elastic / (0.5 * quiet * quiet / lighter));
    }
    same(most, 1.0);
}

#[test]
fn bodies_that_touch_go_on_together_with_their_momentum() {
    let (lanes, mut work, rest) = asleep(&[10, 11], None);
    let (quiet, from) = (rest.quiet, first(1));
    // Beads 8 to 15: 8 alone, 9 to 12 in touch, 13 in touch but quicker, 14 slow and alone, 15 touches 16.
    let u = [0.0, 1e-6, 1e-6, 1e-6, 0.9e-6, 0.9e-6, 2e-6, 3e-6, 3e-6];
    let speeds = [
        0.1,
        0.2,
        0.2 + 0.9 * quiet,
        0.2,
        0.2 - 0.9 * quiet,
        0.2 - 2.0 * quiet,
        0.9 * quiet,
        1.1 * quiet,
    ];
    work.start.u[from..from + 9].copy_from_slice(&u);
    work.start.v[from..from + 8].copy_from_slice(&speeds);
    let momentum = |work: &Work| {
        let lanes = (from + 1..from + 5).zip(&lanes.inverse[from + 1..]);
        lanes
            .map(|(lane, inverse)| work.start.v[lane] / inverse)
            .sum::<f64>()
    };
    let before = momentum(&work);
    rest.join(&lanes, &mut work, 1);
    let v = &work.start.v[from..from + 9];
    assert_eq!((v[0], v[5], v[7]), (speeds[0], speeds[5], speeds[7]));
    assert_eq!((v[6], v[8]), (0.0, 0.0));
    assert!(v[1] == v[2] && v[2] == v[3] && v[3] == v[4] && (v[1] - 0.2).abs() < quiet);
    assert!((momentum(&work) / before - 1.0).abs() < 1e-15);
}

#[test]
fn sleeping_bodies_meet_when_their_gap_is_flown_through() {
    let (lanes, mut work, mut rest) = asleep(&[], None);
    let (quiet, shallow, lane) = (rest.quiet, rest.shallow, first(1) + 3);
    assert_eq!(rest.meeting(&lanes, &mut work, 1, 2.0), f64::INFINITY);
    // A gap of a micrometre, and the approach of two bodies that move towards each other.
    let mut meets = |gap: f64, speeds: [f64; 2]| {
        let mut work = Work::new(&lanes);
        for other in lane..first(4) {
            work.start.u[other] = gap;
        }
        (work.start.v[lane - 1], work.start.v[lane]) = (speeds[0], speeds[1]);
        // Their neighbours are far away.
        work.start.u[..lane - 1].fill(-1.0);
        work.start.u[lane + 1..].fill(1.0);
        for block in 0..lanes.blocks {
            rest.asleep[block] = Some(2.0);
        }
        rest.meeting(&lanes, &mut work, 1, 2.0)
    };
    same(meets(1e-6, [0.03, -0.01]), 2.0 + 1e-6 / 0.04);
    same(meets(1e-6, [-0.01, -0.03]), 2.0 + 1e-6 / 0.02);
    assert_eq!(meets(-1e-9, [0.03, 0.01]), 2.0);
    // A very slow approach may go on into an overlap that is too shallow to matter.
    let slow = [0.4 * quiet, -0.4 * quiet];
    same(meets(1e-6, slow) - 2.0, (1e-6 + 4.0 * shallow) / (0.8 * quiet));
    assert_eq!(meets(-5.0 * shallow, slow), 2.0);
}

#[test]
fn a_sleeping_neighbour_drifts_on_until_bodies_of_both_blocks_meet() {
    let (lanes, mut work, mut rest) = asleep(&[], None);
    let lane = first(2);
    // Since 1 s: inside both blocks all beads are apart, and beads 15 and 16 fly towards each other.
    for other in 0..lanes.len() {
        work.start.u[other] = other as f64;
    }
    (work.start.v[lane - 1], work.start.v[lane]) = (0.05, -0.25);
    let meets = 1.0 + 1.0 / 0.3;
    rest.settle(&mut work, 1, 2.0);
    same(rest.meeting(&lanes, &mut work, 1, 2.0), meets);
    same(work.start.u[lane], lane as f64 - 0.25);
    rest.settle(&mut work, 2, 3.0);
    same(rest.meeting(&lanes, &mut work, 2, 3.0), meets);
    same(work.start.u[lane - 1], lane as f64 - 1.0 + 0.1);
    assert_eq!(rest.meeting(&lanes, &mut work, 0, 3.0), f64::INFINITY);
    // A block that is awake is checked in each step instead.
    rest.asleep[1] = None;
    assert_eq!(rest.meeting(&lanes, &mut work, 2, 3.0), f64::INFINITY);
    rest.asleep[1] = Some(3.0);
    rest.asleep[2] = None;
    assert_eq!(rest.meeting(&lanes, &mut work, 1, 3.0), f64::INFINITY);
}

#[test]
fn a_block_may_sleep_whose_contacts_and_intruder_are_quiet_or_open_for_long() {
    let (lanes, mut work, rest) = asleep(&[], Some(12));
    let (quiet, shallow, lane, guest) = (rest.quiet, rest.shallow, first(1) + 3, lanes.guests.lane(0));
    let mut may = |bodies: &[(usize, f64, f64)]| {
        work.start.u.fill(0.0);
        work.start.v.fill(0.0);
        for &(lane, u, v) in bodies {
            (work.start.u[lane], work.start.v[lane]) = (u, v);
        }
        rest.may_sleep(&lanes, &work, 1, 1e-5)
    };
    assert!(may(&[]));
    // In touch: up to the speed and the depth that are neglected.
    assert!(may(&[(lane, 0.0, 0.99 * quiet)]) && !may(&[(lane, 0.0, 1.01 * quiet)]));
    assert!(may(&[(lane, 0.99 * shallow, 0.0)]) && !may(&[(lane, 1.01 * shallow, 0.0)]));
    // Apart: not closed within a dozen steps of 10 µs. A bead comes back at 0.1 m/s.
    let (near, far) = (1.19e-5, 1.21e-5);
    let apart = |gap: f64| {
        let behind = (lane + 1..first(3)).map(|lane| (lane, 1.0, 0.0));
        let ends = [(lane, gap, -0.1), (first(1) - 1, -1.0, 0.0)];
        behind.chain(ends).collect::<Vec<_>>()
    };
    assert!(may(&apart(far)) && !may(&apart(near)));
    // The intruder: its speed, and what its spring could make of it.
    let rest_of = Oscillator::PAPER;
    let stretch = quiet * (rest_of.mass / rest_of.stiffness).sqrt();
    assert!(may(&[(guest, 0.0, -0.99 * quiet)]) && !may(&[(guest, 0.0, -1.01 * quiet)]));
    assert!(may(&[(guest, 0.99 * stretch, 0.0)]) && !may(&[(guest, 1.01 * stretch, 0.0)]));
}

#[test]
fn a_contact_that_a_step_closes_with_a_sleeping_block_is_noticed_on_either_side() {
    let (lanes, _, mut rest) = asleep(&[], None);
    let (h, quiet) = (1e-4, rest.quiet);
    for behind in [true, false] {
        // Block 1 sleeps; the run is before it or behind it.
        let lane = if behind { first(1) } else { first(2) };
        let beside = (lane - 1, lane);
        let (mover, sleeper) = if behind { beside } else { (beside.1, beside.0) };
        let sign = if behind { 1.0 } else { -1.0 };
        // The gap at the start, how far the one comes closer, and how far the other flies from it.
        let closes = |gap: f64, way: f64, flight: f64| {
            let mut work = Work::new(&lanes);
            work.start.u[sleeper] = sign * gap;
            work.start.v[sleeper] = sign * flight / h;
            work.end.u[mover] = sign * way;
            // The end of an earlier step must not count for the sleeper.
            work.end.u[sleeper] = -sign;
            rest.closes(&lanes, &work, 1, behind, h)
        };
        assert!(closes(1e-6, 1.1e-6, 0.0) && closes(1e-6, 1e-6, 0.0) && !closes(1e-6, 0.9e-6, 0.0));
        assert!(!closes(1e-6, 1.1e-6, 0.2e-6) && closes(1e-6, 0.9e-6, -0.2e-6));
        // It was closed before, or touches already; or it closes too slowly to matter.
        assert!(!closes(-1e-6, 1e-6, 0.0) && !closes(0.0, 1e-6, 0.0));
        let way = h * quiet;
        assert!(!closes(0.9 * way, 0.99 * way, 0.0) && closes(0.9 * way, 1.01 * way, 0.0));
    }
    // A block that is awake is computed anyway.
    let mut work = Work::new(&lanes);
    (work.start.u[first(1)], work.end.u[first(1) - 1]) = (1e-6, 2e-6);
    assert!(rest.closes(&lanes, &work, 1, true, h));
    rest.asleep[1] = None;
    assert!(!rest.closes(&lanes, &work, 1, true, h));
}

#[test]
fn a_run_reaches_a_sleeping_block_by_a_gap_that_soon_closes_or_by_what_moves_at_its_edge() {
    let (lanes, _, rest) = asleep(&[], None);
    let (h, quiet, shallow) = (1e-5, rest.quiet, rest.shallow);
    for behind in [true, false] {
        // Block 1 sleeps; the run is before it or behind it.
        let beside = [(first(2), first(2) - 1), (first(1) - 1, first(1))];
        let (mover, sleeper) = beside[usize::from(behind)];
        let sign = if behind { 1.0 } else { -1.0 };
        let reaches = |gap: f64, speeds: &[(usize, f64)]| {
            let mut work = Work::new(&lanes);
            work.start.u[sleeper] = sign * gap;
            for &(lane, speed) in speeds {
                work.start.v[lane] = sign * speed;
            }
            rest.reaches(&lanes, &work, 1, behind, h)
        };
        // Apart: the gap is flown through within three steps, and not too slowly to be noticed.
        let apart = |gap: f64| reaches(gap, &[(mover, 0.3), (sleeper, 0.2)]);
        assert!(apart(2.9 * h * 0.1) && !apart(3.1 * h * 0.1));
        assert!(!reaches(0.1 * h * 0.1, &[(mover, 0.2), (sleeper, 0.3)]));
        let slow = |speed: f64| reaches(0.5 * h * quiet, &[(mover, speed)]);
        assert!(!slow(0.9 * quiet) && slow(1.1 * quiet));
        // In touch: too deep to be neglected, or one of the three beads next to the block too quick.
        assert!(!reaches(-3.9 * shallow, &[]) && reaches(-4.1 * shallow, &[]));
        for away in 0..=WATCHED {
            let lane = if behind { mover - away } else { mover + away };
            let quick = |speed: f64| reaches(0.0, &[(lane, speed)]);
            assert!(!quick(1.9 * quiet));
            assert_eq!(quick(2.1 * quiet), away < WATCHED, "{away}");
        }
        let nearest = if behind { mover + 1 - WATCHED } else { mover };
        let beads = nearest..nearest + WATCHED;
        let together: Vec<_> = beads.chain([sleeper]).map(|lane| (lane, 0.2)).collect();
        assert!(!reaches(0.0, &together));
        assert!(reaches(0.0, &[(sleeper, 2.1 * quiet)]));
    }
}

#[test]
fn in_a_loaded_chain_a_run_reaches_a_block_by_what_moves_at_all_at_its_edge() {
    let mut scenario = plain(31, 4.2e-6, 1e-3);
    scenario.chain.precompression = 2.0;
    let lanes = Lanes::new(&Model::new(&scenario));
    let mut work = Work::new(&lanes);
    let rest = RestingBlocks::new(&lanes, &mut work, 1.0, TOLERANCE);
    let reaches = |away: usize, (u, v): (f64, f64)| {
        let mut work = Work::new(&lanes);
        let lane = first(1) - 1 - away;
        (work.start.u[lane], work.start.v[lane]) = (u, v);
        rest.reaches(&lanes, &work, 1, true, 1e-5)
    };
    let (far, quick) = (STILL * lanes.depth, STILL * lanes.speed);
    for sign in [1.0, -1.0] {
        assert!(!reaches(0, (0.9 * sign * far, 0.9 * sign * quick)));
        for away in 0..=WATCHED {
            assert_eq!(reaches(away, (1.1 * sign * far, 0.0)), away < WATCHED);
            assert_eq!(reaches(away, (0.0, 1.1 * sign * quick)), away < WATCHED);
        }
    }
}
