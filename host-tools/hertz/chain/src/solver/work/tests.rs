//! The ends of a step, apart from the equations of motion.

use super::*;
use crate::model::Model;
use crate::scenario::{ContactForce, Material, Wall};
use crate::solver::testing::{across, hosting, plain};

#[test]
fn overlaps_their_rates_and_accelerations_are_those_of_the_model() {
    for (precompression, contact_force) in [
        (0.0, ContactForce::Clipped),
        (2.0, ContactForce::Clipped),
        (2.0, ContactForce::Printed),
    ] {
        let mut scenario = hosting(plain(20, 4.2e-6, 1e-3), [4, 9, 10]);
        (scenario.chain.precompression, scenario.chain.contact_force) = (precompression, contact_force);
        scenario.wall = Some(Wall::flat(Material::STEEL));
        let model = Model::new(&scenario);
        let (lanes, layout) = (Lanes::new(&model), model.layout());
        // Contacts of every kind beside each other: open, shallow, deep, closing, opening.
        let mut state = model.initial();
        let mut motion = Motion::zeros(&lanes);
        let draw = |n: usize| (n as f64 * 12.9898).sin();
        for body in 0..model.bodies() {
            let (u, v) = (2e-5 * draw(body), 0.1 * draw(body + 40));
            (state[body], state[layout.velocity(body)]) = (u, v);
            (motion.u[BLOCK + body], motion.v[BLOCK + body]) = (u, v);
        }
        for guest in 0..model.intruders().len() {
            let (x, w) = (1e-5 * draw(guest + 80), 0.2 * draw(guest + 90));
            state[layout.relative(guest)] = x;
            state[layout.relative_velocity(guest)] = w;
            let lane = lanes.guests.lane(guest);
            (motion.u[lane], motion.v[lane]) = (x, w);
        }
        let mut rate = model.initial();
        model.rate(0.0, &state, &mut rate);
        let mut open = 0;
        for contact in 1..=model.contacts() {
            let lane = BLOCK + contact;
            let [overlap, approach, acceleration] = bend(&lanes, lane, &motion, 0.0);
            let of = |values: &[f64], from: usize| across(&values[from..][..model.bodies()], contact);
            let near = |one: f64, other: f64, scale: f64| {
                let error = (one - other).abs() / scale;
                assert!(error < 1e-12, "contact {contact}: {one:e}, {other:e}");
            };
            near(overlap - lanes.rest[lane], of(&state, 0), 1e-6);
            near(approach, of(&state, layout.velocity(0)), 0.1);
            near(acceleration, of(&rate, layout.velocity(0)), 1e5);
            open += usize::from(overlap <= 0.0);
        }
        assert!((4..model.contacts() - 4).contains(&open), "{open}");
    }
}

#[test]
fn bodies_beside_a_run_fly_on() {
    let lanes = Lanes::new(&Model::new(&plain(40, 4.2e-6, 1e-3)));
    let mut work = Work::new(&lanes);
    for (lane, u, v) in [(first(2) - 1, 1e-6, 0.3), (first(4), -2e-6, 0.2)] {
        (work.start.u[lane], work.start.v[lane]) = (u, v);
    }
    work.fly_beside(2..4, 1e-5);
    let end = |lane: usize| (work.end.u[lane], work.end.v[lane]);
    assert_eq!(end(first(2) - 1), (1e-6 + 1e-5 * 0.3, 0.3));
    assert_eq!(end(first(4)), (-2e-6 + 1e-5 * 0.2, 0.2));
}
