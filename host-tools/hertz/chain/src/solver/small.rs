//! Small runs of every kind, which together take less than a second, so that faults of the solver are noticed
//! early.

use std::sync::Arc;

use super::against::{across, distance, other};
use super::{Dense, Lanes, Stepper};
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{Chain, ContactForce, Intruder, Material, Scenario, Section, Start, Striker, Wall};

/// Beads of the paper with this relaxation time, struck as in the paper.
fn plain(beads: usize, relaxation: f64, duration: f64) -> Scenario {
    let chain = Chain {
        beads,
        relaxation,
        ..Chain::PAPER
    };
    Scenario::new(duration, chain, Striker::PAPER)
}

fn with_intruders(mut scenario: Scenario, beads: &[usize]) -> Scenario {
    scenario.intruders = beads
        .iter()
        .map(|&bead| {
            let mut oscillator = Oscillator::PAPER;
            oscillator.stiffness *= 1.0 + 0.1 * bead as f64;
            Intruder::new([bead], oscillator)
        })
        .collect();
    scenario
}

/// Chains of one block and of several, whose intruders share a block with beads or do not.
fn kinds() -> Vec<(&'static str, Scenario)> {
    let steel = Wall::flat(Material::STEEL);
    let heavy = Striker::new(0.02, Material::STEEL, 1.5);

    let mut rough = with_intruders(plain(6, 2e-5, 0.0015), &[2, 3, 6]);
    rough.chain.contact_force = ContactForce::Clipped;
    rough.striker = heavy.clone();
    let mut section = Section::of([4]);
    (section.radius, section.relaxation) = (Some(0.012), Some(8e-5));
    rough.sections = vec![section];

    let mut loaded = with_intruders(plain(7, 4.2e-6, 0.0015), &[5]);
    (loaded.chain.precompression, loaded.wall) = (2.0, Some(steel.clone()));
    let mut loaded_and_rough = plain(14, 1e-5, 0.0015);
    loaded_and_rough.chain.precompression = 0.3;
    loaded_and_rough.chain.contact_force = ContactForce::Clipped;
    loaded_and_rough.striker = heavy.clone();

    let mut gaps = with_intruders(plain(20, 0.0, 0.003), &[17]);
    gaps.wall = Some(steel.clone());
    let mut apart = Start::apart([6, 13], 3e-6);
    apart.velocity = 0.05;
    gaps.starts = vec![apart];

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

    vec![
        (
            "the paper's",
            Scenario {
                duration: 0.003,
                ..Scenario::paper()
            },
        ),
        ("one bead", with_intruders(plain(1, 4.2e-6, 0.002), &[1])),
        ("elastic", with_intruders(plain(12, 0.0, 0.0025), &[5])),
        ("rough", rough),
        ("loaded", loaded),
        ("loaded and rough", loaded_and_rough),
        ("gaps", gaps),
        ("both ends", ends),
        ("walled", walled),
        (
            "blocks",
            with_intruders(plain(41, 4.2e-6, 0.004), &[1, 7, 8, 15, 16, 17, 30]),
        ),
        ("long", plain(60, 0.0, 0.008)),
        ("rung down", rung_down),
        ("creeping", creeping),
        ("flying", flying),
        ("opened", opened),
        ("opened and rough", opened_and_rough),
    ]
}

/// A chain so long that most of it, left in contact by a wave, takes longer steps.
fn parted() -> Scenario {
    let mut scenario = with_intruders(plain(360, 4.2e-6, 0.08), &[2]);
    let mut section = Section::of(200..=206);
    section.relaxation = Some(2e-6);
    scenario.sections = vec![section];
    scenario
}

fn start(model: &Model, (time, state): (f64, &[f64]), tolerance: f64, longest: f64) -> Stepper {
    let longest = longest * model.shortest_contact();
    Stepper::new(
        Arc::new(Lanes::new(model)),
        model.layout(),
        (time, state),
        tolerance,
        longest,
    )
}

/// The present state of a run, taken from a copy.
fn state(model: &Model, stepper: &Stepper) -> Vec<f64> {
    let mut state = model.initial();
    stepper.clone().state(&mut state);
    state
}

#[test]
fn small_runs_of_every_kind_end_where_another_method_says() {
    for (name, scenario) in kinds() {
        let model = Model::new(&scenario);
        let reference = other(&model, scenario.duration);
        for (tolerance, most) in [(1e-13, 5e-10), (1e-8, 2e-7)] {
            let mut run = start(&model, (0.0, &model.initial()), tolerance, 0.5);
            while run.time < scenario.duration {
                run.advance(scenario.duration).expect("it goes on");
            }
            let error = distance(&model, &state(&model, &run), &reference);
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
    while run.time < scenario.duration {
        run.advance(scenario.duration).expect("it goes on");
    }
    let error = distance(&model, &state(&model, &run), &other(&model, scenario.duration));
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
        while run.time < scenario.duration {
            run.advance(scenario.duration).expect("it goes on");
        }
        let energy = |state: &[f64]| {
            let energies = model.energies(state);
            energies.striker + energies.chain
        };
        let error = (energy(&state(&model, &run)) / energy(&model.initial()) - 1.0).abs();
        assert!(error < 1e-12, "{n}: {error:e}");
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
            let (mut computed, mut moved) = (0, 0);
            while run.time < scenario.duration {
                run.advance(scenario.duration).expect("it goes on");
                computed += run.computed();
                moved += run.moving().map(|run| run.len()).sum::<usize>();
            }
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

/// Compares the motion inside each step that `every` divides: states, dense output, and accelerations.
fn inside_of_steps(tolerance: f64, longest: f64, every: u64, most: [f64; 3]) {
    for (name, scenario) in kinds() {
        let model = Model::new(&scenario);
        let (layout, scales) = (model.layout(), model.scales());
        let (lanes, mut run) = (
            Lanes::new(&model),
            start(&model, (0.0, &model.initial()), tolerance, longest),
        );
        let mut rate = model.initial();
        let mut worst = [0.0_f64; 3];
        while run.time < scenario.duration {
            let (from, before) = (run.time, state(&model, &run));
            run.advance(scenario.duration).expect("it goes on");
            if !run.steps.is_multiple_of(every) {
                continue;
            }
            let (to, after) = (run.time, state(&model, &run));
            let t = from + [0.11, 0.5, 0.93][run.steps as usize % 3] * (to - from);
            let mut other = start(&model, (from, &before), 1e-15, 0.125);
            other.leave_nothing_out();
            while other.time < t {
                other.advance(t).expect("it goes on");
            }
            let there = state(&model, &other);
            model.rate(&there, &mut rate);
            let mut same = |what: &str, index: usize, kind: usize, (one, other): (f64, f64), scale: f64| {
                let error = (one - other).abs() / scale;
                worst[kind] = worst[kind].max(error);
                assert!(
                    error < most[kind],
                    "{name} at {t:e} s, {what} {index}: {one:e}, {other:e} there"
                );
            };

            run.look(t);
            for body in 0..model.bodies() {
                let (velocity, (u, v)) = (layout.velocity(body), run.body(body, t));
                same("place", body, 0, (u, there[body]), scales[body]);
                same("velocity", body, 0, (v, there[velocity]), scales[velocity]);
                assert_eq!(run.speed(body), v);
            }
            for guest in 0..model.intruders().len() {
                let (place, velocity) = (layout.relative(guest), layout.relative_velocity(guest));
                let (x, w) = run.guest(guest);
                same("guest", guest, 0, (x, there[place]), scales[place]);
                same(
                    "guest's velocity",
                    guest,
                    0,
                    (w, there[velocity]),
                    scales[velocity],
                );
            }
            let mut dense = Dense::new(&lanes, layout, (from, to), &before, run.tolerance());
            let mut inside = before.clone();
            let beside = 1e-3 * (to - from);
            assert!([from, t].into_iter().all(|t| dense.holds(t)));
            assert!(!dense.holds(from - beside) && !dense.holds(to + beside));
            dense.at(t, &mut inside);
            for component in 0..inside.len() {
                let pair = (inside[component], there[component]);
                same("component", component, 1, pair, scales[component]);
            }

            // One contact or intruder alone, with its acceleration.
            run.look_at_ends(from);
            let fastest = model.speed_scale() / model.shortest_contact();
            let mut glimpsed = |what: &str, index: usize, at: [f64; 3], there: [f64; 3]| {
                for (kind, scale) in [scales[0], model.speed_scale(), fastest].into_iter().enumerate() {
                    same(what, index, kind, (at[kind], there[kind]), scale);
                }
            };
            for contact in 1..=model.contacts() {
                let of = |values: &[f64], from: usize| across(&values[from..][..model.bodies()], contact);
                let velocities = layout.velocity(0);
                let expected = [of(&there, 0), of(&there, velocities), of(&rate, velocities)];
                let times = (from, to);
                glimpsed(
                    "contact",
                    contact,
                    dense.glimpse_contact(contact, times).at(t),
                    expected,
                );
                let moves = run
                    .moving()
                    .any(|run| run.contains(&(contact - 1)) && run.contains(&contact));
                if moves {
                    let glimpse = run.glimpse_contact(contact, from).expect("it moves");
                    glimpsed("glimpsed contact", contact, glimpse.at(t), expected);
                }
            }
            for (guest, intruder) in model.intruders().iter().enumerate() {
                let (place, velocity) = (layout.relative(guest), layout.relative_velocity(guest));
                let expected = [there[place], there[velocity], rate[velocity]];
                let times = (from, to);
                glimpsed(
                    "intruder",
                    guest,
                    dense.glimpse_guest(guest, times).at(t),
                    expected,
                );
                if run.moving().any(|run| run.contains(&intruder.bead)) {
                    let glimpse = run.glimpse_guest(guest, from).expect("it moves");
                    glimpsed("glimpsed intruder", guest, glimpse.at(t), expected);
                }
            }

            // Both ends of the step, and what is lost by then.
            let near = |one: (f64, f64), state: &[f64], place: usize, velocity: usize| {
                assert!(
                    (one.0 - state[place]).abs() <= 1e-14 * scales[place],
                    "{name}: {place}"
                );
                assert!(
                    (one.1 - state[velocity]).abs() <= 1e-14 * scales[velocity],
                    "{name}: {velocity}"
                );
            };
            for body in 0..model.bodies() {
                let [first, last] = run.body_at_ends(body, from);
                near(first, &before, body, layout.velocity(body));
                near(last, &after, body, layout.velocity(body));
            }
            for guest in 0..model.intruders().len() {
                let [first, last] = run.guest_at_ends(guest);
                let (place, velocity) = (layout.relative(guest), layout.relative_velocity(guest));
                near(first, &before, place, velocity);
                near(last, &after, place, velocity);
            }
            let (contacts, guests) = run.lost();
            let energy = scales[layout.contact_loss()];
            assert!(
                (contacts - after[layout.contact_loss()]).abs() <= 1e-14 * energy,
                "{name}"
            );
            for (guest, lost) in guests.enumerate() {
                assert!(
                    (lost - after[layout.intruder_loss(guest)]).abs() <= 1e-14 * energy,
                    "{name}"
                );
            }
        }
        let [kept, dense, bent] = worst;
        println!("{name}: {kept:.0e}, {dense:.0e}, {bent:.0e}");
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
            while whole.time < t {
                whole.advance(t).expect("it goes on");
            }
            state(&model, &whole)
        };
        let mut same = |one: f64, other: f64, scale: f64| {
            let error = (one - other).abs() / scale;
            worst = worst.max(error);
            assert!(
                error < 1e-9,
                "from {from:e} to {to:e} s: {one:e}, {other:e} there"
            );
        };
        let ends = |state: &[f64], body: usize| (state[body], state[layout.velocity(body)]);
        let before = there(from);
        let t = from + 0.4 * (to - from);
        let inside = there(t);
        run.look(t);
        for body in 0..model.bodies() {
            let (there, here) = (ends(&inside, body), run.body(body, t));
            same(here.0, there.0, far);
            same(here.1, there.1, model.speed_scale());
            assert_eq!(run.speed(body), here.1);
        }
        run.look_at_ends(from);
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
            let moves = run
                .moving()
                .any(|run| run.contains(&(contact - 1)) && run.contains(&contact));
            let Some(glimpse) = run.glimpse_contact(contact, from).filter(|_| moves) else {
                continue;
            };
            let (near, behind) = (ends(&inside, contact - 1), ends(&inside, contact));
            let [change, rate, _] = glimpse.at(t);
            same(change, near.0 - behind.0, far);
            same(rate, near.1 - behind.1, model.speed_scale());
        }
        // A run from here reaches the same end.
        let now = state(&model, &run);
        for component in 0..now.len() {
            let scale = if component < model.bodies() {
                far
            } else {
                scales[component]
            };
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
        let (mut computed, mut moved) = (0, 0);
        while run.time < scenario.duration {
            run.advance(scenario.duration).expect("it goes on");
            computed += run.computed();
            moved += run.moving().map(|run| run.len()).sum::<usize>();
        }
        println!("{computed} of {moved} bodies");
        assert!(20 * computed < 17 * moved, "{computed} of {moved} bodies");
        state(&model, &run)[model.bodies()..2 * model.bodies()].to_vec()
    });
    let errors = carried
        .iter()
        .zip(&still)
        .map(|(one, other)| (one - TABLE - other).abs());
    let worst = errors.fold(0.0, f64::max) / 0.45;
    println!("{worst:.0e}");
    assert!(worst < 1e-9, "{worst:e}");
}
