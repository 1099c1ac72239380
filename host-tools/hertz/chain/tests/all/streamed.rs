//! Runs that keep nothing compared with runs that keep the motion, and summaries with scans of the motion.

use hertz_chain::{
    Accuracy, ContactForce, Intruder, Material, Observable, Options, Oscillator, Run, Samples, Scenario,
    Start, Summariser, Summary, Wall, simulate_with, summarise,
};

fn scenarios() -> Vec<Scenario> {
    let elastic = |beads: usize| {
        let mut scenario = Scenario::paper();
        scenario.chain.relaxation = 0.0;
        scenario.chain.beads = beads;
        scenario.duration = 2e-4 * beads as f64;
        scenario
    };
    let paper = Scenario::paper();
    let mut clipped = Scenario::paper();
    clipped.chain.contact_force = ContactForce::Clipped;
    let mut walled = elastic(20);
    walled.wall = Some(Wall::flat(Material::STEEL));
    walled.duration = 0.008;
    let mut loaded = walled.clone();
    loaded.chain.precompression = 20.0;
    loaded.chain.relaxation = 1e-6;
    let mut heavy = elastic(30);
    heavy.striker.mass = Some(0.2);
    let mut hosts = elastic(50);
    hosts.intruders = vec![Intruder::new(2..=49, Oscillator::PAPER)];
    let mut apart = elastic(40);
    apart.starts = vec![Start::apart([5, 20], 1e-6)];
    apart.starts[0].velocity = 0.1;
    let mut short = Scenario::paper();
    short.duration = 6e-5;
    // The force of the second contact has humps: it dips between half of one and half of the next.
    let mut humps = elastic(2);
    humps.intruders.clear();
    humps.duration = 0.004;
    humps.striker.radius = humps.chain.radius;
    humps.wall = Some(Wall::flat(Material::STEEL));
    vec![
        paper,
        clipped,
        walled,
        loaded,
        heavy,
        hosts,
        apart,
        short,
        humps,
        elastic(120),
    ]
}

/// `one` is `other` to a part `tolerance` of `scale`.
#[track_caller]
fn same(what: &str, one: f64, other: f64, scale: f64, tolerance: f64) {
    let error = (one - other).abs() / scale.max(f64::MIN_POSITIVE);
    assert!(
        error <= tolerance,
        "{what}: {one:e} and {other:e} differ by {error:e}"
    );
}

/// A summary without its wall-clock time, which differs from run to run.
fn timeless(mut summary: Summary) -> Summary {
    summary.solver.seconds = 0.0;
    summary
}

#[test]
fn keeping_the_motion_changes_no_bit_of_the_summary() {
    for scenario in scenarios() {
        for accuracy in [Accuracy::REFERENCE, Accuracy::DRAFT] {
            let options = Options::with(accuracy);
            let kept = simulate_with(&scenario, &options).unwrap().summary();
            let streamed = summarise(&scenario, &options).unwrap();
            assert_eq!(timeless(kept), timeless(streamed));
        }
    }
}

/// Peaks, widths and extremes against a fine scan of the motion, which finds them by comparison alone.
#[test]
fn a_summary_is_what_a_fine_scan_of_the_motion_finds() {
    const SCANS: u32 = 40_000;
    for scenario in scenarios() {
        let solution = simulate_with(&scenario, &Options::default()).unwrap();
        let summary = solution.summary();
        let time = |i: u32| solution.end() * f64::from(i) / f64::from(SCANS);
        let step = time(1);
        for peak in &summary.peak_force {
            let mut curve = solution.force_beyond_curve(peak.contact);
            let load = solution.model().contact(peak.contact).load;
            let forces: Vec<f64> = (0..=SCANS).map(|i| curve.at(time(i))).collect();
            let top = (0..forces.len())
                .max_by(|&a, &b| forces[a].total_cmp(&forces[b]))
                .unwrap();
            if forces[top] < 1e-6 * peak.force {
                continue;
            }
            // A scan misses the top of a parabola by an eighth of what it falls by in a step.
            let height = peak.force - load;
            assert!(forces[top] <= height * (1.0 + 1e-12) && forces[top] > height * (1.0 - 1e-3));
            assert!((curve.at(peak.time) / height - 1.0).abs() < 1e-9, "{peak:?}");
            let below = |i: &usize| forces[*i] < 0.5 * height;
            let (rise, fall) = ((0..top).rev().find(below), (top..forces.len()).find(below));
            let width = rise.zip(fall).map(|(rise, fall)| (fall - rise) as f64 * step);
            match (peak.fwhm, width) {
                (Some(one), Some(other)) => same("width", one, other, step, 2.1),
                (one, other) => assert_eq!(one, other, "{peak:?}"),
            }
        }
        for intruder in &summary.intruders {
            let mut curve = solution.acceleration_curve(intruder.bead).unwrap();
            let values = (0..=SCANS).map(|i| curve.at(time(i)));
            let [least, most] = values.fold([0.0_f64; 2], |[a, b], value| [a.min(value), b.max(value)]);
            // An intruder that the wave has not reached hardly moves.
            let range = (most - least).max(1e-6);
            same(
                "least acceleration",
                intruder.acceleration_min,
                least,
                range,
                1e-4,
            );
            same(
                "greatest acceleration",
                intruder.acceleration_max,
                most,
                range,
                1e-4,
            );
        }
        let mut sampler = solution.sampler();
        let (mut chain, mut far) = (0.0_f64, vec![0.0_f64; summary.intruders.len()]);
        for i in 0..=4000 {
            let snapshot = sampler.at(solution.end() * f64::from(i) / 4000.0);
            chain = chain.max(snapshot.energies().chain);
            for (far, intruder) in far.iter_mut().zip(&summary.intruders) {
                *far = far.max(snapshot.intruder_displacement(intruder.bead).unwrap().abs());
            }
        }
        let energy = summary.energy;
        assert!(chain <= energy.chain_max * (1.0 + 1e-12));
        same("chain_max", energy.chain_max, chain, energy.striker_initial, 1e-3);
        for (far, intruder) in far.into_iter().zip(&summary.intruders) {
            let found = intruder.relative_displacement_max;
            assert!(far <= found * (1.0 + 1e-9) + 1e-20);
            same("displacement", found, far, found.max(1e-12), 1e-3);
        }
    }
}

#[test]
fn a_run_that_goes_on_from_a_snapshot_comes_to_where_the_whole_run_does() {
    for scenario in scenarios() {
        let end = scenario.duration;
        let accuracy = Accuracy::new(1e-13, 0.125);
        let mut whole = Run::new(&scenario, accuracy).unwrap();
        whole.to(0.4 * end).unwrap();
        let mut rest = whole.snapshot().resume(accuracy).unwrap();
        let mut copy = whole.clone();
        whole.to(end).unwrap();
        rest.to(end).unwrap();
        copy.to(end).unwrap();
        let (whole, rest, copy) = (whole.snapshot(), rest.snapshot(), copy.snapshot());
        let speed = scenario.striker.velocity;
        for body in 0..=scenario.chain.beads {
            same("a copy", copy.velocity(body), whole.velocity(body), speed, 0.0);
            same(
                "a snapshot",
                rest.velocity(body),
                whole.velocity(body),
                speed,
                1e-10,
            );
        }
        same(
            "losses",
            rest.energies().total(),
            whole.energies().total(),
            whole.energies().total(),
            1e-12,
        );
    }
}

#[test]
fn a_moment_inside_a_step_is_what_a_kept_run_has_there() {
    for scenario in scenarios() {
        let kept = simulate_with(&scenario, &Options::default()).unwrap();
        let mut sampler = kept.sampler();
        let mut run = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
        let speed = scenario.striker.velocity;
        let greatest = kept
            .summary()
            .peak_force
            .iter()
            .map(|peak| peak.force)
            .fold(0.0, f64::max);
        run.watch(scenario.duration, |step| {
            if !step.number().is_multiple_of(7) {
                return;
            }
            let t = 0.3 * step.from() + 0.7 * step.to();
            let (there, here) = (sampler.at(t), step.at(t));
            for body in 0..=scenario.chain.beads {
                same(
                    "velocity",
                    here.velocity(body),
                    there.velocity(body),
                    speed,
                    1e-11,
                );
                same(
                    "displacement",
                    here.displacement(body),
                    there.displacement(body),
                    1e-5,
                    1e-9,
                );
            }
            for contact in 1..=scenario.chain.beads {
                same("force", here.force(contact), there.force(contact), greatest, 1e-9);
                same(
                    "overlap",
                    here.overlap(contact),
                    there.overlap(contact),
                    1e-5,
                    1e-9,
                );
            }
            for bead in scenario
                .intruders
                .iter()
                .flat_map(|intruder| intruder.beads.clone())
            {
                let (one, other) = (
                    here.intruder_acceleration(bead),
                    there.intruder_acceleration(bead),
                );
                same("intruder", one.unwrap(), other.unwrap(), 1e3, 1e-9);
                let (one, other) = (here.intruder_velocity(bead), there.intruder_velocity(bead));
                same("intruder", one.unwrap(), other.unwrap(), speed, 1e-10);
            }
        })
        .unwrap();
    }
}

#[test]
fn the_balance_error_is_the_worst_of_all_steps() {
    // The chain's energy is right again when a wave has gone.
    let mut scenario = Scenario::paper();
    scenario.chain.relaxation = 0.0;
    let accuracy = Accuracy::new(1e-3, 0.5);
    let mut run = Run::new(&scenario, accuracy).unwrap();
    let mut found = Summariser::new(&mut run);
    let mut worst = 0.0_f64;
    while run.time() < scenario.duration {
        let mut step = run.step(scenario.duration).unwrap();
        found.observe(&mut step);
        let energies = run.snapshot().energies();
        worst = worst.max((energies.total() / run.model().striker_energy() - 1.0).abs());
    }
    let error = found.summary(&mut run).energy.balance_error;
    assert!(worst > 1e-6, "{worst:e}");
    same("balance", error, worst, worst, 1e-6);
    let last = (run.snapshot().energies().total() / run.model().striker_energy() - 1.0).abs();
    assert!(
        last < 0.7 * worst,
        "the last step alone errs by {last:e}, not {worst:e}"
    );
}

#[test]
fn samples_taken_on_the_way_are_those_of_a_run_that_was_kept() {
    let scenario = Scenario::paper();
    let kept = simulate_with(&scenario, &Options::default()).unwrap();
    let mut sampler = kept.sampler();
    let channels = vec![
        Observable::Displacement(3),
        Observable::Velocity(0),
        Observable::Force(9),
        Observable::IntruderDisplacement(8),
        Observable::IntruderAcceleration(8),
        Observable::IntruderAcceleration(9),
    ];
    let mut samples = Samples::new(1e-5, channels);
    let mut run = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
    run.watch(scenario.duration, |step| samples.observe(step))
        .unwrap();
    assert_eq!(samples.len(), (scenario.duration / 1e-5).round() as usize + 1);
    for index in 0..samples.len() {
        let (row, there) = (
            samples.row(index),
            sampler.at(samples.time(index).min(kept.end())),
        );
        same("displacement", row[0], there.displacement(3), 1e-5, 1e-10);
        same("velocity", row[1], there.velocity(0), 0.45, 1e-11);
        same("force", row[2], there.force(9), 10.0, 1e-10);
        same("x", row[3], there.intruder_displacement(8).unwrap(), 1e-5, 1e-10);
        same("u''", row[4], there.intruder_acceleration(8).unwrap(), 1e3, 1e-10);
        assert!(row[5].is_nan(), "bead 9 has none");
    }
}

/// A wave that leaves most of the chain behind in slow motion, which takes longer steps.
fn long_and_viscous() -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 450;
    scenario.intruders = vec![Intruder::new([140], Oscillator::PAPER)];
    scenario.duration = 0.13;
    scenario
}

const FINE: Accuracy = Accuracy::new(1e-10, 1.0);

#[test]
fn a_long_viscous_chain_moves_the_same_observed_or_not() {
    let scenario = long_and_viscous();
    let options = Options::with(FINE);
    let kept = simulate_with(&scenario, &options).unwrap();
    let found = summarise(&scenario, &options).unwrap();
    let mut plain = Run::new(&scenario, FINE).unwrap();
    plain.to(scenario.duration).unwrap();
    let (end, plain) = (kept.at(kept.end()), plain.snapshot());
    for body in 0..=scenario.chain.beads {
        // The kept run is looked at inside its last step.
        same("velocity", plain.velocity(body), end.velocity(body), 0.45, 1e-15);
        same(
            "velocity",
            plain.velocity(body),
            found.final_state.velocity[body],
            0.45,
            0.0,
        );
    }
    assert_eq!(timeless(found.clone()), timeless(kept.summary()));
    // Longer steps far behind the wave add nothing to the error of the strike.
    let error = found.energy.balance_error;
    assert!(error < 1e-10, "{error:e}");
}

#[test]
fn a_long_viscous_chain_can_be_looked_into_and_run_on_at_any_time() {
    let scenario = long_and_viscous();
    let exact = simulate_with(&scenario, &Options::with(Accuracy::new(1e-13, 0.5))).unwrap();
    let mut sampler = exact.sampler();
    let mut run = Run::new(&scenario, FINE).unwrap();
    let end = scenario.duration;
    run.watch(end, |step| {
        if !step.number().is_multiple_of(23) {
            return;
        }
        for part in [0.2, 0.9] {
            let t = step.from() + part * (step.to() - step.from());
            let (there, here) = (sampler.at(t), step.at(t));
            for body in 0..=scenario.chain.beads {
                same("velocity", here.velocity(body), there.velocity(body), 0.45, 1e-9);
                same(
                    "displacement",
                    here.displacement(body),
                    there.displacement(body),
                    1e-3,
                    1e-9,
                );
            }
        }
    })
    .unwrap();
    // In the middle of a slow step too.
    let mut run = Run::new(&scenario, FINE).unwrap();
    let (mut number, mut first) = (0, None);
    while run.time() < end {
        run.step(end).unwrap();
        number += 1;
        if number % 300 != 0 {
            continue;
        }
        let now = run.snapshot();
        let energy = now.energies().total();
        let before = *first.get_or_insert(energy);
        same("energy", energy, before, before, 1e-11);
        let mut other = now.resume(FINE).unwrap();
        other.to(end).unwrap();
        let (other, last) = (other.snapshot(), exact.at(end));
        for body in 0..=scenario.chain.beads {
            same(
                "a run from a snapshot",
                other.velocity(body),
                last.velocity(body),
                0.45,
                1e-9,
            );
        }
    }
    let (ours, last) = (run.snapshot(), exact.at(end));
    for body in 0..=scenario.chain.beads {
        same("the end", ours.velocity(body), last.velocity(body), 0.45, 1e-9);
    }
}
