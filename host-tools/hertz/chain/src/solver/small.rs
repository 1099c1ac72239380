//! Small runs of every kind, together less than a second, so that faults of the solver are noticed early.

use std::ops::Range;

use super::testing::{across, distance, hosting, plain, referee, start};
use super::{Dense, Glimpse, StepLog, Stepper};
use crate::model::{Model, StateLayout};
use crate::oscillator::Oscillator;
use crate::scenario::{ContactForce, Intruder, Material, Scenario, Section, Start, Striker, Wall};

/// The scenario with an intruder of its own stiffness in each of these beads.
fn with_intruders(mut scenario: Scenario, beads: &[usize]) -> Scenario {
    let intruder = |&bead: &usize| Intruder {
        stiffness: Oscillator::PAPER.stiffness * (1.0 + 0.1 * bead as f64),
        ..Intruder::new([bead], Oscillator::PAPER)
    };
    scenario.intruders = beads.iter().map(intruder).collect();
    scenario
}

/// Chains of one block and of several, whose intruders share a block with beads or do not.
fn kinds() -> Vec<(&'static str, Scenario)> {
    let steel = Wall::flat(Material::STEEL);
    let heavy = Striker::new(0.02, Material::STEEL, 1.5);

    let mut rough = with_intruders(plain(6, 2e-5, 0.0015), &[2, 3, 6]);
    rough.chain.contact_force = ContactForce::Clipped;
    rough.striker = heavy.clone();
    rough.sections = vec![Section::of([4])];
    (rough.sections[0].radius, rough.sections[0].relaxation) = (Some(0.012), Some(8e-5));

    let mut loaded = with_intruders(plain(7, 4.2e-6, 0.0015), &[5]);
    (loaded.chain.precompression, loaded.wall) = (2.0, Some(steel.clone()));
    let mut loaded_and_rough = plain(14, 1e-5, 0.0015);
    loaded_and_rough.chain.precompression = 0.3;
    loaded_and_rough.chain.contact_force = ContactForce::Clipped;
    loaded_and_rough.striker = heavy.clone();

    let mut gaps = with_intruders(plain(20, 0.0, 0.003), &[17]);
    gaps.wall = Some(steel.clone());
    gaps.starts = vec![Start::apart([6, 13], 3e-6)];
    gaps.starts[0].velocity = 0.05;

    let mut ends = plain(23, 3e-6, 0.003);
    ends.chain.contact_force = ContactForce::Clipped;
    ends.starts = vec![Start::moving([23], -0.3)];
    ends.sections = vec![Section::of([23])];

    let mut walled = with_intruders(plain(15, 2e-6, 0.004), &[14, 15]);
    walled.wall = Some(steel);

    // The intruder comes to rest long before the end.
    let mut rung_down = with_intruders(plain(22, 0.0, 0.008), &[10]);
    rung_down.intruders[0].damping = 60.0;
    // Beads that meet so slowly that their contact may be left out, and others that are left behind.
    let mut creeping = plain(26, 0.0, 0.004);
    creeping.starts = vec![Start::moving([20], -2e-9), Start::moving([24], -1e-3)];

    // Pressed so little that the pulse opens the contacts behind it.
    let mut opened = with_intruders(plain(10, 3e-6, 0.0015), &[6]);
    (opened.chain.precompression, opened.wall) = (0.05, Some(Wall::flat(Material::STEEL)));
    let mut opened_and_rough = opened.clone();
    opened_and_rough.chain.contact_force = ContactForce::Clipped;
    opened_and_rough.chain.relaxation = 2e-5;

    // At first nothing touches.
    let mut flying = plain(9, 0.0, 0.006);
    flying.starts = vec![Start::apart([1, 4, 7], 4e-4)];

    // Intruders in intruders, up to three deep, in blocks that fall asleep and wake.
    let mut nested = with_intruders(plain(26, 0.0, 0.006), &[3, 8, 9, 20]);
    let carried = |beads: &[usize], mass: f64, carrier: usize| Intruder {
        inside: Some(carrier),
        ..Intruder::new(beads.iter().copied(), Oscillator::new(mass, 3e5, 4.0))
    };
    nested.intruders = vec![
        Intruder::new([3, 8, 9, 20], Oscillator::PAPER),
        carried(&[3, 9, 20], 0.8e-3, 1),
        carried(&[9, 20], 0.3e-3, 2),
        carried(&[8, 9], 0.5e-3, 1),
    ];

    let mut dragged = with_intruders(plain(18, 2e-6, 0.003), &[3, 9, 16]);
    dragged.chain.drag_time = Some(2e-3);
    dragged.wall = Some(Wall::flat(Material::STEEL));
    dragged.starts = vec![Start::apart([11], 2e-6)];

    let blocks = with_intruders(plain(41, 4.2e-6, 0.004), &[1, 7, 8, 15, 16, 17, 30]);
    vec![
        ("the paper's", hosting(plain(16, 4.2e-6, 0.003), [8])),
        ("one bead", with_intruders(plain(1, 4.2e-6, 0.002), &[1])),
        ("elastic", with_intruders(plain(12, 0.0, 0.0025), &[5])),
        ("rough", rough),
        ("loaded", loaded),
        ("loaded and rough", loaded_and_rough),
        ("gaps", gaps),
        ("both ends", ends),
        ("walled", walled),
        ("blocks", blocks),
        ("long", plain(60, 0.0, 0.008)),
        ("rung down", rung_down),
        ("creeping", creeping),
        ("flying", flying),
        ("opened", opened),
        ("opened and rough", opened_and_rough),
        ("nested", nested),
        ("dragged", dragged),
    ]
}

/// A chain so long that most of it, left in contact by a wave, takes longer steps.
fn parted() -> Scenario {
    let mut scenario = with_intruders(plain(360, 4.2e-6, 0.08), &[2]);
    scenario.sections = vec![Section::of(200..=206)];
    scenario.sections[0].relaxation = Some(2e-6);
    scenario
}

#[test]
fn small_runs_of_every_kind_end_where_another_method_says() {
    for (name, scenario) in kinds() {
        let model = Model::new(&scenario);
        let reference = referee(&model, scenario.duration);
        for (tolerance, most) in [(1e-13, 5e-10), (1e-8, 2e-7)] {
            let mut run = start(&model, (0.0, &model.initial()), tolerance, 0.5);
            run.run_to(scenario.duration);
            let error = distance(&model, &run.present(&model), &reference);
            println!("{name} at {tolerance:e}: {error:.1e}");
            assert!(error < most, "{name} at {tolerance:e}: {error:e}");
        }
    }
}

#[test]
fn a_bead_that_is_hit_beside_a_sleeping_block_pushes_it_in_the_same_step() {
    // Bead 7 is the last one of its block. It stands still and apart until bead 6 hits it, and then crosses a
    // gap of a tenth of a nanometre within one long step. Without a second look at that step the error is
    // 3e-4.
    let mut scenario = plain(20, 0.0, 0.003);
    scenario.starts = vec![Start::apart([7], 2e-5), Start::apart([8], 1e-10)];
    let model = Model::new(&scenario);
    let mut run = start(&model, (0.0, &model.initial()), 1e-4, 1.0);
    run.run_to(scenario.duration);
    let error = distance(&model, &run.present(&model), &referee(&model, scenario.duration));
    assert!(error < 4e-5, "{error:e}");
}

#[test]
fn a_contact_that_closes_at_the_end_of_a_step_keeps_the_energy() {
    // Beads apart meet at any part of a step. If they meet after the last stage inside it, no stage sees
    // their force; a step that did not end before would lose up to 1.5e-8 of the energy.
    for n in 0..120 {
        let mut scenario = plain(2, 0.0, 0.0012);
        scenario.wall = Some(Wall::flat(Material::STEEL));
        scenario.starts = vec![Start::apart([1, 2], 1.1e-5 + 3e-8 * f64::from(n))];
        let model = Model::new(&scenario);
        let mut run = start(&model, (0.0, &model.initial()), 1e-14, 0.125);
        run.run_to(scenario.duration);
        let energies = model.energies(&run.present(&model));
        let error = (energies.striker + energies.chain) / model.initial_energy() - 1.0;
        assert!(error.abs() < 1e-12, "{n}: {error:e}");
    }
}

/// Steps, evaluations, bodies that steps computed and bodies that they moved, at two tolerances.
const TALLIES: &[(&str, [[usize; 4]; 2])] = &[
    ("the paper's", [[39, 784, 744, 555], [160, 3472, 3168, 2342]]),
    ("one bead", [[32, 704, 256, 64], [107, 2176, 856, 214]]),
    ("elastic", [[38, 736, 608, 494], [139, 2912, 2224, 1807]]),
    ("rough", [[50, 1360, 400, 350], [187, 4288, 1496, 1309]]),
    ("loaded", [[25, 512, 400, 200], [90, 1856, 1440, 720]]),
    ("loaded and rough", [[36, 736, 552, 519], [119, 2208, 1792, 1687]]),
    ("gaps", [[55, 1216, 1320, 1155], [281, 6512, 6744, 5901]]),
    ("both ends", [[71, 1840, 1576, 1576], [272, 6800, 6184, 6184]]),
    ("walled", [[52, 1088, 1024, 704], [186, 3664, 3680, 2512]]),
    ("blocks", [[59, 1200, 1008, 1008], [236, 5088, 4184, 4184]]),
    ("long", [[85, 1744, 1312, 1312], [293, 5712, 4752, 4752]]),
    ("rung down", [[87, 1680, 1504, 1450], [270, 5552, 4608, 4455]]),
    ("creeping", [[47, 944, 1104, 984], [172, 3680, 4056, 3676]]),
    ("flying", [[25, 464, 192, 192], [77, 1648, 608, 608]]),
    ("opened", [[24, 432, 384, 264], [103, 2256, 1648, 1133]]),
    ("opened and rough", [[32, 816, 512, 352], [100, 2320, 1600, 1100]]),
    ("nested", [[95, 1888, 2040, 1915], [331, 6688, 7440, 6930]]),
    ("dragged", [[45, 928, 1080, 855], [186, 4032, 4464, 3534]]),
    (
        "parted",
        [[654, 11696, 67416, 92984], [1841, 34272, 211760, 245112]],
    ),
];

#[test]
fn small_runs_take_as_many_steps_and_move_as_many_bodies_as_they_did() {
    let mut found = String::new();
    for (name, scenario) in kinds().into_iter().chain([("parted", parted())]) {
        let model = Model::new(&scenario);
        let tallies = [1e-6, 1e-11].map(|tolerance| {
            let mut run = start(&model, (0.0, &model.initial()), tolerance, 1.0);
            let [computed, moved] = run.run_to(scenario.duration);
            [run.steps as usize, run.evaluations as usize, computed, moved]
        });
        found += &format!("    ({name:?}, {tallies:?}),\n");
    }
    let known: String = TALLIES.iter().map(|row| format!("    {row:?},\n")).collect();
    assert_eq!(found, known, "if that is meant, the table is now:\n{found}");
}

#[test]
fn inside_a_step_all_is_as_a_run_that_ends_there_leaves_it() {
    inside_of_steps(1e-13, 0.5, 5, [2e-12, 2e-12, 2e-9]);
}

#[test]
fn inside_a_long_step_in_which_contacts_open_and_close_it_is_so_too() {
    inside_of_steps(1e-8, 1.0, 2, [1e-7, 1e-7, 1e-5]);
}

/// Compares the motion inside each step that `every` divides with runs that end there: places and velocities,
/// the dense output, and accelerations, each with errors of up to `most`.
fn inside_of_steps(tolerance: f64, longest: f64, every: u64, most: [f64; 3]) {
    for (name, scenario) in kinds() {
        let model = Model::new(&scenario);
        let mut run = start(&model, (0.0, &model.initial()), tolerance, longest);
        while run.time < scenario.duration {
            let (from, before) = (run.time, run.present(&model));
            run.advance(scenario.duration).expect("it goes on");
            if run.steps.is_multiple_of(every) {
                let part = [0.11, 0.5, 0.93][run.steps as usize % 3];
                inside_of_step(name, &model, &mut run, (from, &before), part, most);
            }
        }
    }
}

/// The dense output that is kept of the last step of a run, which began at this time and state.
fn dense_of(run: &mut Stepper, from: f64, before: &[f64], layout: StateLayout) -> Dense {
    let mut log = StepLog::default();
    run.record(from, &mut log);
    let mut dense = Dense::new(&run.lanes, layout);
    dense.load(&log, 0, before);
    dense
}

/// Compares the motion at a part of the last step of a run, which began at this time and state.
fn inside_of_step(
    name: &str,
    model: &Model,
    run: &mut Stepper,
    (from, before): (f64, &[f64]),
    part: f64,
    most: [f64; 3],
) {
    let (layout, scales, bodies) = (model.layout(), model.scales(), model.bodies());
    let (to, after) = (run.time, run.present(model));
    let t = from + part * (to - from);
    let mut exact = start(model, (from, before), 1e-15, 0.125);
    exact.leave_nothing_out();
    exact.run_to(t);
    let (there, mut rate) = (exact.present(model), model.initial());
    model.rate(t, &there, &mut rate);
    let same = |what: &str, index: usize, (one, other): (f64, f64), most: f64| {
        let error = (one - other).abs();
        assert!(
            error < most,
            "{name} at {t:e} s, {what} {index}: {one:e}, {other:e} there"
        );
    };

    // Places and velocities inside the step, at both of its ends, and the losses.
    run.interpolate(t);
    run.interpolate_ends(from);
    let places = (0..bodies).map(|body| [body, layout.velocity(body)]);
    let guests = 0..model.intruders().len();
    let of_guests = guests.map(|guest| [layout.relative(guest), layout.relative_velocity(guest)]);
    for (index, at) in places.chain(of_guests).enumerate() {
        let (here, ends) = match index.checked_sub(bodies) {
            Some(guest) => (run.guest(guest), run.guest_at_ends(guest)),
            None => (run.body(index, t), run.body_at_ends(index, from)),
        };
        assert!(index >= bodies || run.speed(index) == here.1);
        for ((u, v), state, most) in [
            (here, &there[..], most[0]),
            (ends[0], before, 1.1e-14),
            (ends[1], &after, 1.1e-14),
        ] {
            same("place", index, (u, state[at[0]]), most * scales[at[0]]);
            same("velocity", index, (v, state[at[1]]), most * scales[at[1]]);
        }
    }
    let (contacts, guests) = run.lost();
    for (lost, at) in std::iter::once(contacts)
        .chain(guests)
        .zip(layout.contact_loss()..)
    {
        same("loss", at, (lost, after[at]), 1.1e-14 * scales[at]);
    }

    let mut dense = dense_of(run, from, before, layout);
    let mut inside = before.to_vec();
    let beside = 1e-3 * (to - from);
    assert!([from, t].into_iter().all(|t| dense.holds(t)));
    assert!(!dense.holds(from - beside) && !dense.holds(to + beside));
    dense.at(t, &mut inside);
    for component in 0..inside.len() {
        let pair = (inside[component], there[component]);
        same("component", component, pair, most[1] * scales[component]);
    }

    // One contact or intruder alone, with its acceleration.
    let fastest = model.speed_scale() / model.shortest_contact();
    let glimpsed = |what: &str, index: usize, glimpse: Glimpse, expected: [f64; 3]| {
        let scales = [scales[0], model.speed_scale(), fastest];
        for (kind, value) in glimpse.at(t).into_iter().enumerate() {
            same(what, index, (value, expected[kind]), most[kind] * scales[kind]);
        }
    };
    let moving: Vec<_> = run.moving().collect();
    for contact in 1..=model.contacts() {
        let of = |values: &[f64], from: usize| across(&values[from..][..bodies], contact);
        let velocities = layout.velocity(0);
        let expected = [of(&there, 0), of(&there, velocities), of(&rate, velocities)];
        let glimpse = dense.glimpse_contact(contact);
        glimpsed("contact", contact, glimpse, expected);
        let near = |run: &Range<usize>| run.contains(&(contact - 1)) && run.contains(&contact);
        if moving.iter().any(near) {
            let glimpse = run.glimpse_contact(contact, from).expect("it moves");
            glimpsed("moving contact", contact, glimpse, expected);
        }
    }
    for (guest, intruder) in model.intruders().iter().enumerate() {
        let (place, velocity) = (layout.relative(guest), layout.relative_velocity(guest));
        let expected = [there[place], there[velocity], rate[velocity]];
        let glimpse = dense.glimpse_guest(guest);
        glimpsed("intruder", guest, glimpse, expected);
        if moving.iter().any(|run| run.contains(&intruder.bead)) {
            let glimpse = run.glimpse_guest(guest, from).expect("it moves");
            glimpsed("moving intruder", guest, glimpse, expected);
        }
    }
}

#[test]
fn a_chain_that_is_parted_is_everywhere_and_always_as_one_that_is_not() {
    let scenario = parted();
    let model = Model::new(&scenario);
    let (layout, scales) = (model.layout(), model.scales());
    let [mut run, mut whole] =
        [1e-10, 1e-12].map(|tolerance| start(&model, (0.0, &model.initial()), tolerance, 1.0));
    whole.leave_nothing_out();
    let (mut worst, mut computed, mut moved) = (0.0_f64, 0, 0);
    while run.time < scenario.duration {
        let from = run.time;
        let start = run.present(&model);
        run.advance(scenario.duration).expect("it goes on");
        computed += run.computed();
        moved += run.moving().map(|run| run.len()).sum::<usize>();
        if run.steps % 10 != 3 && run.time < scenario.duration {
            continue;
        }
        let to = run.time;
        // The distance the striker would have travelled: errors of velocities add up over it.
        let far = model.speed_scale() * to;
        let mut there = |t: f64| {
            whole.run_to(t);
            whole.present(&model)
        };
        let mut same = |one: f64, other: f64, scale: f64| {
            let error = (one - other).abs() / scale;
            worst = worst.max(error);
            assert!(error < 1e-9, "{from:e} to {to:e} s: {one:e}, {other:e} there");
        };
        let ends = |state: &[f64], body: usize| (state[body], state[layout.velocity(body)]);
        let before = there(from);
        let t = from + 0.4 * (to - from);
        let inside = there(t);
        run.interpolate(t);
        for body in 0..model.bodies() {
            let (there, here) = (ends(&inside, body), run.body(body, t));
            same(here.0, there.0, far);
            same(here.1, there.1, model.speed_scale());
            assert_eq!(run.speed(body), here.1);
        }
        let mut kept = Vec::new();
        let mut dense = dense_of(&mut run, from, &start, layout);
        dense.at(t, &mut kept);
        for component in 0..kept.len() {
            let scale = if component < model.bodies() {
                far
            } else {
                scales[component]
            };
            same(kept[component], inside[component], scale);
        }
        run.interpolate_ends(from);
        let after = there(to);
        for body in 0..model.bodies() {
            for (here, state) in run.body_at_ends(body, from).into_iter().zip([&before, &after]) {
                same(here.0, state[body], far);
                same(here.1, state[layout.velocity(body)], model.speed_scale());
            }
        }
        let loss = layout.contact_loss();
        same(run.lost().0, after[loss], scales[loss]);
        for contact in 1..=model.contacts() {
            let near = |run: Range<usize>| run.contains(&(contact - 1)) && run.contains(&contact);
            let moves = run.moving().any(near);
            let Some(glimpse) = run.glimpse_contact(contact, from).filter(|_| moves) else {
                continue;
            };
            let (near, behind) = (ends(&inside, contact - 1), ends(&inside, contact));
            let [change, rate, _] = glimpse.at(t);
            same(change, near.0 - behind.0, far);
            same(rate, near.1 - behind.1, model.speed_scale());
            // The kept step lacks stages that have no weight but rounding.
            let [kept, kept_rate, _] = dense.glimpse_contact(contact).at(t);
            let errors = [(kept - change) / far, (kept_rate - rate) / model.speed_scale()];
            assert!(errors.iter().all(|error| error.abs() < 1e-12), "{errors:?}");
        }
        // A run from here reaches the same end.
        let now = run.present(&model);
        for component in 0..now.len() {
            let is_place = component < model.bodies();
            let scale = if is_place { far } else { scales[component] };
            same(now[component], after[component], scale);
        }
    }
    println!("{worst:.0e}, {computed} of {moved} bodies computed");
    assert!(20 * computed < 17 * moved, "{computed} of {moved} bodies");
}

#[test]
fn a_parted_chain_on_a_moving_table_moves_as_on_one_at_rest() {
    const TABLE: f64 = 0.02;
    let still = parted();
    let mut carried = still.clone();
    carried.striker.velocity += TABLE;
    carried.starts = vec![Start::moving(1..=still.chain.beads, TABLE)];
    let [still, carried] = [still, carried].map(|scenario| {
        let model = Model::new(&scenario);
        let mut run = start(&model, (0.0, &model.initial()), 1e-10, 1.0);
        let [computed, moved] = run.run_to(scenario.duration);
        assert!(20 * computed < 17 * moved, "{computed} of {moved} bodies");
        run.present(&model)[model.bodies()..2 * model.bodies()].to_vec()
    });
    for (one, other) in carried.iter().zip(&still) {
        assert!((one - TABLE - other).abs() < 0.45e-9, "{one} {other}");
    }
}
