//! Symmetries of the equations of motion, on states of any kind, and the static load left out on both sides.

use super::{Contact, Model};
use crate::oscillator::Oscillator;
use crate::scenario::{ContactForce, Intruder, Material, Scenario, Section, Striker, Wall};
use crate::solver::testing::{plain, start};

/// The paper's strike on `beads` beads, one of which holds an intruder.
fn hosting(beads: usize, relaxation: f64, bead: usize, damping: f64) -> Scenario {
    let mut scenario = plain(beads, relaxation, 0.003);
    scenario.intruders = vec![Intruder {
        stiffness: 1e5,
        damping,
        ..Intruder::new([bead], Oscillator::PAPER)
    }];
    scenario
}

/// A bead like the striker.
fn like_striker(bead: usize, striker: &Striker) -> Section {
    Section {
        radius: Some(striker.radius),
        density: Some(striker.density),
        young: Some(striker.young),
        poisson: Some(striker.poisson),
        ..Section::of([bead])
    }
}

/// The state a time `duration` after `state`, at the reference accuracy.
fn evolve(model: &Model, state: &[f64], duration: f64) -> Vec<f64> {
    let mut run = start(model, (0.0, state), 1e-14, 0.125);
    run.run_to(duration);
    run.present(model)
}

/// Checks that two states differ by less than `most` of the scale of each component, without the losses.
#[track_caller]
fn same(model: &Model, one: &[f64], other: &[f64], most: f64) {
    let pairs = one.iter().zip(other).zip(model.scales());
    let motion = pairs.take(model.layout().contact_loss());
    let error = motion
        .map(|((a, b), scale)| (a - b).abs() / scale)
        .fold(0.0, f64::max);
    println!("{error:.1e}");
    assert!(error < most, "{error:e}");
}

/// Reverses all velocities.
fn turned(model: &Model, mut state: Vec<f64>) -> Vec<f64> {
    let layout = model.layout();
    let velocities = layout.velocity(0)..layout.relative(0);
    for i in velocities.chain(layout.relative_velocity(0)..layout.contact_loss()) {
        state[i] = -state[i];
    }
    state
}

#[test]
fn an_elastic_chain_runs_backwards_to_where_it_came_from() {
    let mut loaded = hosting(12, 0.0, 5, 0.0);
    loaded.chain.precompression = 3.0;
    loaded.wall = Some(Wall::flat(Material::STEEL));
    for scenario in [hosting(12, 0.0, 5, 0.0), loaded] {
        let model = Model::new(&scenario);
        let end = turned(&model, evolve(&model, &model.initial(), 0.003));
        let back = turned(&model, evolve(&model, &end, 0.003));
        assert!((end[0] / model.displacement_scale()).abs() > 1.0);
        same(&model, &back, &model.initial(), 5e-11);
    }
}

/// A chain in a mirror: the last bead becomes the striker, and the striker the last bead.
#[test]
fn a_chain_seen_in_a_mirror_moves_as_its_image() {
    let mut scenario = hosting(9, 4.2e-6, 4, 12.0);
    scenario.sections = vec![Section {
        radius: Some(0.012),
        young: Some(2e9),
        ..Section::of([2, 5])
    }];
    let mut image = scenario.clone();
    image.intruders[0].beads = vec![9 - 4];
    image.sections[0].beads = vec![9 - 2, 9 - 5];
    image.sections.push(like_striker(9, &scenario.striker));
    let chain = &scenario.chain;
    image.striker = Striker::new(chain.radius, chain.material(), scenario.striker.velocity);
    let (model, other) = (Model::new(&scenario), Model::new(&image));
    let layout = model.layout();
    let mirrored = |state: &[f64]| {
        let mut image = state.to_vec();
        for body in 0..model.bodies() {
            image[body] = -state[model.bodies() - 1 - body];
            image[layout.velocity(body)] = -state[layout.velocity(model.bodies() - 1 - body)];
        }
        for i in [layout.relative(0), layout.relative_velocity(0)] {
            image[i] = -state[i];
        }
        image
    };
    let end = evolve(&model, &model.initial(), 0.002);
    let of_image = evolve(&other, &mirrored(&model.initial()), 0.002);
    same(&model, &of_image, &mirrored(&end), 2e-10);
}

/// A rigid flat wall is a mirror: it acts like the same chain behind it, struck at the same time from the
/// other side. Two equal spheres that press each other by δ both press the plane between by δ/2, and κ
/// (δ/2)^(3/2) is 2^(3/2) times theirs.
#[test]
fn a_rigid_wall_is_a_mirror() {
    for (relaxation, load) in [(0.0, 0.0), (4.2e-6, 0.0), (4.2e-6, 5.0)] {
        let mut walled = hosting(6, relaxation, 4, 12.0);
        walled.chain.precompression = load;
        let mut double = walled.clone();
        walled.wall = Some(Wall {
            young: 1e30,
            ..Wall::flat(Material::STEEL)
        });
        double.chain.beads = 13;
        double.intruders[0].beads = vec![4, 9];
        double.sections = vec![like_striker(13, &walled.striker)];
        let (model, mut double) = (Model::new(&walled), Model::new(&double));
        // The other striker just touches, too, and the load acts on the bead that it strikes.
        double.contacts[12] = Contact {
            load: 0.0,
            static_overlap: 0.0,
            ..double.contacts[12]
        };
        let mut start = double.initial();
        start[double.layout().velocity(13)] = -walled.striker.velocity;
        let (ours, theirs) = (
            evolve(&model, &model.initial(), 0.003),
            evolve(&double, &start, 0.003),
        );
        let (layout, twice) = (model.layout(), double.layout());
        let mut half = ours.clone();
        for body in 0..7 {
            half[body] = theirs[body];
            half[layout.velocity(body)] = theirs[twice.velocity(body)];
        }
        half[layout.relative(0)] = theirs[twice.relative(0)];
        half[layout.relative_velocity(0)] = theirs[twice.relative_velocity(0)];
        same(&model, &ours, &half, 2e-11);
        // The wave has been at the wall.
        walled.wall = None;
        let free = Model::new(&walled);
        let free = evolve(&free, &free.initial(), 0.003);
        assert!((ours[6] - free[6]).abs() > 0.1 * model.displacement_scale());
    }
}

#[test]
fn the_motion_from_any_time_on_depends_on_the_state_then_alone() {
    let mut scenario = hosting(12, 4.2e-6, 5, 12.0);
    scenario.wall = Some(Wall::flat(Material::STEEL));
    let model = Model::new(&scenario);
    let whole = evolve(&model, &model.initial(), 0.003);
    for first in [0.0004, 0.0013, 0.0027] {
        let half = evolve(&model, &model.initial(), first);
        same(&model, &evolve(&model, &half, 0.003 - first), &whole, 1e-11);
    }
}

#[test]
fn a_chain_on_a_moving_table_moves_as_on_one_at_rest() {
    let model = Model::new(&hosting(12, 4.2e-6, 5, 12.0));
    let (speed, place, duration) = (0.3, 2e-4, 0.003);
    let layout = model.layout();
    let carried = |state: &[f64], t: f64| {
        let mut carried = state.to_vec();
        for body in 0..model.bodies() {
            carried[body] += place + speed * t;
            carried[layout.velocity(body)] += speed;
        }
        carried
    };
    let end = evolve(&model, &model.initial(), duration);
    let moving = evolve(&model, &carried(&model.initial(), 0.0), duration);
    same(&model, &moving, &carried(&end, duration), 5e-11);
}

/// ω = 2 √(K/M) sin(qa/2) with K = (3/2) κ^(2/3) F₀^(1/3): a standing wave of N beads under a load, with q a
/// = p π / N.
#[test]
fn small_waves_on_a_loaded_chain_have_the_frequencies_of_a_lattice() {
    let beads = 12;
    let mut scenario = plain(beads, 0.0, 0.003);
    scenario.chain.precompression = 40.0;
    let model = Model::new(&scenario);
    let layout = model.layout();
    let stiffness = 1.5 * model.contact(2).stiffness.powf(2.0 / 3.0) * 40.0_f64.powf(1.0 / 3.0);
    for p in [1, 2, 5, 11] {
        let phase = std::f64::consts::PI * p as f64 / beads as f64;
        let omega = 2.0 * (stiffness / model.mass(1)).sqrt() * (0.5 * phase).sin();
        let shape = |bead: usize| (phase * (bead as f64 - 0.5)).cos();
        let amplitude = 1e-6 * model.contact(2).static_overlap;
        let mut start = vec![0.0; layout.dimension()];
        // The striker is on its way back.
        (start[0], start[layout.velocity(0)]) = (-1e-3, -0.45);
        for bead in 1..=beads {
            start[layout.velocity(bead)] = amplitude * omega * shape(bead);
        }
        // After an eighth of a period, displacement and velocity are equal parts of their greatest values.
        let end = evolve(&model, &start, 0.25 * std::f64::consts::PI / omega);
        for bead in 1..=beads {
            let expected = 0.5_f64.sqrt() * shape(bead);
            let (place, rate) = (end[bead], end[layout.velocity(bead)] / omega);
            for found in [place, rate].map(|found| found / amplitude) {
                assert!(
                    (found - expected).abs() < 1e-6,
                    "p = {p}, bead {bead}: {found} {expected}"
                );
            }
        }
    }
}

/// The equations with F₀ written out on both sides.
#[test]
fn leaving_the_static_load_out_on_both_sides_changes_nothing() {
    for (clipped, walled) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut scenario = hosting(5, 2e-5, 3, 12.0);
        scenario.chain.precompression = 2.0;
        scenario.wall = walled.then(|| Wall::flat(Material::STEEL));
        if clipped {
            scenario.chain.contact_force = ContactForce::Clipped;
        }
        let model = Model::new(&scenario);
        let layout = model.layout();
        // Contacts near rest, far from it, parting fast, and open.
        let mut state = model.initial();
        for body in 0..6 {
            state[body] = 3e-6 * (2.7 * body as f64).sin();
            state[layout.velocity(body)] = 0.2 * (1.9 * body as f64).cos();
        }
        let mut rate = vec![0.0; layout.dimension()];
        model.rate(0.0, &state, &mut rate);
        let is_open = |j: &usize| model.overlap(&state, *j).0 <= 0.0;
        let open = (2..=model.contacts()).filter(is_open).count();
        assert!(open > 0 && open < 4, "{open}");
        let force = |j: usize| {
            if j > model.contacts() {
                return if j == 6 { 2.0 } else { 0.0 };
            }
            let (overlap, approach) = model.overlap(&state, j);
            let contact = model.contact(j);
            let force = contact.elastic_force(overlap) + contact.viscous_force(overlap, approach);
            if clipped { force.max(0.0) } else { force }
        };
        let mut total = 0.0;
        for bead in 1..=5 {
            let load = if bead == 1 { 2.0 } else { 0.0 };
            let expected = load + force(bead) - force(bead + 1);
            let ours = model.shells[bead] * rate[layout.velocity(bead)];
            assert!((ours - expected).abs() < 1e-13 * 2.0, "{bead}: {ours} {expected}");
            total += expected.abs();
        }
        assert!(total > 1.0);
        for j in 2..=model.contacts() {
            let contact = model.contact(j);
            let (overlap, rest) = (model.overlap(&state, j).0, contact.static_overlap);
            let whole = |overlap: f64| 0.4 * contact.stiffness * overlap.max(0.0).powf(2.5);
            let expected = whole(overlap) - whole(rest) - 2.0 * (overlap - rest);
            let ours = model.contact_energy(&state, j);
            let error = (ours - expected).abs() / whole(rest);
            assert!(ours >= 0.0 && error < 1e-13, "{ours} {expected}");
        }
    }
}
