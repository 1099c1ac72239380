//! Runs that keep nothing compared with runs that keep the motion, and summaries with scans of the motion.

use crate::common::{changed, close, elastic};
use hertz_chain::{
    Accuracy, ContactForce, Intruder, Material, Options, Oscillator, Run, Scenario, Solution, Start,
    Summariser, Summary, Wall, simulate_with, summarise,
};

fn scenarios() -> Vec<Scenario> {
    let hosting = |beads: usize| {
        changed(elastic(beads, 2e-4 * beads as f64), |one| {
            one.intruders = Scenario::paper().intruders
        })
    };
    let steel = || Some(Wall::flat(Material::STEEL));
    let walled = changed(hosting(20), |one| (one.wall, one.duration) = (steel(), 0.008));
    vec![
        Scenario::paper(),
        changed(Scenario::paper(), |one| {
            one.chain.contact_force = ContactForce::Clipped
        }),
        changed(walled.clone(), |one| {
            (one.chain.precompression, one.chain.relaxation) = (20.0, 1e-6)
        }),
        walled,
        changed(hosting(30), |one| one.striker.mass = Some(0.2)),
        changed(hosting(50), |one| {
            one.intruders = vec![Intruder::new(2..=49, Oscillator::PAPER)]
        }),
        changed(hosting(40), |one| {
            one.starts = vec![Start::apart([5, 20], 1e-6)];
            one.starts[0].velocity = 0.1;
        }),
        changed(Scenario::paper(), |one| one.duration = 6e-5),
        // The force of the second contact has humps: it dips between half of one and half of the next.
        changed(elastic(2, 0.004), |one| {
            (one.striker.radius, one.wall) = (one.chain.radius, steel())
        }),
        hosting(120),
    ]
}

fn run_at(scenario: &Scenario, accuracy: Accuracy) -> Run {
    Run::new(scenario, accuracy).expect("the scenario is sound")
}

fn kept(scenario: &Scenario, accuracy: Accuracy) -> Solution {
    simulate_with(scenario, &Options::with(accuracy)).expect("the scenario runs")
}

/// A summary without its wall-clock time, which differs from run to run.
fn timeless(mut summary: Summary) -> Summary {
    summary.solver.seconds = 0.0;
    summary
}

fn streamed(scenario: &Scenario, accuracy: Accuracy) -> Summary {
    timeless(summarise(scenario, &Options::with(accuracy)).expect("the scenario runs"))
}

#[test]
fn keeping_the_motion_changes_no_bit_of_the_summary() {
    for scenario in scenarios() {
        for accuracy in [Accuracy::REFERENCE, Accuracy::DRAFT] {
            let kept = kept(&scenario, accuracy).summary();
            assert_eq!(timeless(kept), streamed(&scenario, accuracy));
        }
    }
}

/// Peaks, widths and extremes against a fine scan of the motion, which finds them by comparison alone.
#[test]
fn a_summary_is_what_a_fine_scan_of_the_motion_finds() {
    const SCANS: u32 = 40_000;
    for scenario in scenarios() {
        let solution = kept(&scenario, Accuracy::REFERENCE);
        let summary = solution.summary();
        let time = |i: u32| solution.end() * f64::from(i) / f64::from(SCANS);
        let step = time(1);
        for peak in &summary.peak_force {
            let mut curve = solution.force_beyond_curve(peak.contact);
            let load = solution.model().contact(peak.contact).load;
            let forces: Vec<f64> = (0..=SCANS).map(|i| curve.at(time(i))).collect();
            let all = 0..forces.len();
            let top = all
                .max_by(|&a, &b| forces[a].total_cmp(&forces[b]))
                .expect("some");
            if forces[top] < 1e-6 * peak.force {
                continue;
            }
            // A scan misses the top of a parabola by an eighth of what it falls by in a step.
            let height = peak.force - load;
            assert!(forces[top] <= height * (1.0 + 1e-12) && forces[top] > height * (1.0 - 1e-3));
            close(curve.at(peak.time) / height, 1.0, 1e-9);
            let below = |i: &usize| forces[*i] < 0.5 * height;
            let (rise, fall) = ((0..top).rev().find(below), (top..forces.len()).find(below));
            let width = rise.zip(fall).map(|(rise, fall)| (fall - rise) as f64 * step);
            match (peak.fwhm, width) {
                (Some(one), Some(other)) => close(one, other, 2.1 * step),
                (one, other) => assert_eq!(one, other, "{peak:?}"),
            }
        }
        for intruder in &summary.intruders {
            let mut curve = solution.acceleration_curve(intruder.bead).expect("a host");
            let values = (0..=SCANS).map(|i| curve.at(time(i)));
            let [least, most] = values.fold([0.0_f64; 2], |[a, b], value| [a.min(value), b.max(value)]);
            // An intruder that the wave has not reached hardly moves.
            let range = (most - least).max(1e-6);
            close(intruder.acceleration_min, least, 1e-4 * range);
            close(intruder.acceleration_max, most, 1e-4 * range);
        }
        let mut sampler = solution.sampler();
        let (model, (mut force, mut acceleration)) = (solution.model(), (0.0_f64, 0.0_f64));
        let mut forces: Vec<_> = (1..=model.contacts())
            .map(|contact| solution.force_curve(contact))
            .collect();
        let hosts = summary.intruders.iter();
        let mut hosts: Vec<_> = hosts
            .map(|one| solution.acceleration_curve(one.bead).expect("a host"))
            .collect();
        let (mut chain, mut far) = (0.0_f64, vec![0.0_f64; summary.intruders.len()]);
        for i in 0..=4000 {
            let snapshot = sampler.at(solution.end() * f64::from(i) / 4000.0);
            chain = chain.max(snapshot.energies().chain);
            for (curve, contact) in forces.iter_mut().zip(1..) {
                force = force.max((curve.at(snapshot.time()) - snapshot.force(contact)).abs());
            }
            for (curve, one) in hosts.iter_mut().zip(&summary.intruders) {
                let there = snapshot.intruder_acceleration(one.bead).expect("a host");
                acceleration = acceleration.max((curve.at(snapshot.time()) - there).abs());
            }
            for (far, intruder) in far.iter_mut().zip(&summary.intruders) {
                let place = snapshot.intruder_displacement(intruder.bead);
                *far = far.max(place.expect("a host").abs());
            }
        }
        assert!(
            force < 1e-9 && acceleration < 1e-7,
            "{force:e} N, {acceleration:e} m/s²"
        );
        let energy = summary.energy;
        assert!(chain <= energy.chain_max * (1.0 + 1e-12));
        close(energy.chain_max, chain, 1e-3 * energy.striker_initial);
        for (far, intruder) in far.into_iter().zip(&summary.intruders) {
            let found = intruder.relative_displacement_max;
            assert!(far <= found * (1.0 + 1e-9) + 1e-20);
            close(found, far, 1e-3 * found.max(1e-12));
        }
    }
}

#[test]
fn a_run_that_goes_on_from_a_snapshot_comes_to_where_the_whole_run_does() {
    for scenario in scenarios() {
        let end = scenario.duration;
        let accuracy = Accuracy::new(1e-13, 0.125);
        let mut whole = run_at(&scenario, accuracy);
        whole.to(0.4 * end).expect("it runs");
        let mut rest = whole.snapshot().resume(accuracy).expect("it is sound");
        let mut copy = whole.clone();
        for run in [&mut whole, &mut rest, &mut copy] {
            run.to(end).expect("it runs");
        }
        let (whole, rest, copy) = (whole.snapshot(), rest.snapshot(), copy.snapshot());
        for body in 0..=scenario.chain.beads {
            assert_eq!(copy.velocity(body), whole.velocity(body));
            let speed = scenario.striker.velocity;
            close(rest.velocity(body), whole.velocity(body), 1e-10 * speed);
        }
        close(rest.energies().total() / whole.energies().total(), 1.0, 1e-12);
    }
}

#[test]
fn a_moment_inside_a_step_is_what_a_kept_run_has_there() {
    for scenario in scenarios() {
        let kept = kept(&scenario, Accuracy::REFERENCE);
        let mut sampler = kept.sampler();
        let mut run = run_at(&scenario, Accuracy::REFERENCE);
        let speed = scenario.striker.velocity;
        let peaks = kept.summary().peak_force;
        let greatest = peaks.iter().map(|peak| peak.force).fold(0.0, f64::max);
        let watched = run.watch(scenario.duration, |step| {
            if !step.number().is_multiple_of(7) {
                return;
            }
            let t = 0.3 * step.from() + 0.7 * step.to();
            let (there, here) = (sampler.at(t), step.at(t));
            for body in 0..=scenario.chain.beads {
                close(here.velocity(body), there.velocity(body), 1e-11 * speed);
                close(here.displacement(body), there.displacement(body), 1e-14);
            }
            for contact in 1..=scenario.chain.beads {
                close(here.force(contact), there.force(contact), 1e-9 * greatest);
                close(here.overlap(contact), there.overlap(contact), 1e-14);
            }
            for bead in scenario.hosts() {
                let pair = |one: Option<f64>, other: Option<f64>, most: f64| {
                    close(one.expect("a host"), other.expect("a host"), most)
                };
                pair(
                    here.intruder_acceleration(bead),
                    there.intruder_acceleration(bead),
                    1e-6,
                );
                pair(
                    here.intruder_velocity(bead),
                    there.intruder_velocity(bead),
                    1e-10 * speed,
                );
            }
        });
        watched.expect("it runs");
    }
}

#[test]
fn the_balance_error_is_the_worst_of_all_steps() {
    // The chain's energy is right again when a wave has gone.
    let scenario = changed(Scenario::paper(), |one| one.chain.relaxation = 0.0);
    let mut run = run_at(&scenario, Accuracy::new(1e-3, 0.5));
    let mut found = Summariser::new(&mut run);
    let (mut worst, mut last) = (0.0_f64, 0.0);
    while run.time() < scenario.duration {
        let mut step = run.step(scenario.duration).expect("it runs");
        found.observe(&mut step);
        let total = run.snapshot().energies().total();
        last = (total / run.model().striker_energy() - 1.0).abs();
        worst = worst.max(last);
    }
    assert!(worst > 1e-6, "{worst:e}");
    close(found.summary(&mut run).energy.balance_error, worst, 1e-6 * worst);
    assert!(
        last < 0.7 * worst,
        "the last step alone errs by {last:e}, not {worst:e}"
    );
}

/// A wave leaves most of the chain behind in slow motion, which takes longer steps.
#[test]
fn a_long_viscous_chain_moves_the_same_observed_or_not() {
    let scenario = changed(Scenario::paper(), |one| {
        one.chain.beads = 450;
        one.intruders = vec![Intruder::new([140], Oscillator::PAPER)];
        one.duration = 0.13;
    });
    let fine = Accuracy::new(1e-10, 1.0);
    let kept = kept(&scenario, fine);
    let found = streamed(&scenario, fine);
    let mut plain = run_at(&scenario, fine);
    plain.to(scenario.duration).expect("it runs");
    let (end, plain) = (kept.at(kept.end()), plain.snapshot());
    for body in 0..=scenario.chain.beads {
        // The kept run is looked at inside its last step.
        close(plain.velocity(body), end.velocity(body), 0.45e-15);
        assert_eq!(plain.velocity(body), found.final_state.velocity[body]);
    }
    // Longer steps far behind the wave add nothing to the error of the strike.
    let error = found.energy.balance_error;
    assert!(error < 1e-10, "{error:e}");
    assert_eq!(found, timeless(kept.summary()));
}
