//! Chains under a static load, and chains with a fixed far end.

use crate::common::{changed, close, elastic, from_height, near, of_radius, run, softer, struck_by_a_bead};
use hertz_chain::{ContactForce, Material, Scenario, Section, Snapshot, Solution, Wall};

/// Walls and loads, weak and strong, with everything that makes a run harder.
fn harder() -> Vec<(&'static str, Scenario)> {
    let mut cases: Vec<_> = [
        ("weak load", 0.5, false),
        ("strong load", 200.0, false),
        ("wall", 0.0, true),
        ("wall, weak load", 0.5, true),
        ("wall, strong load", 200.0, true),
    ]
    .map(|(name, load, walled)| {
        let mut scenario = elastic(16, 0.006);
        scenario.chain.relaxation = 4.2e-6;
        scenario.chain.precompression = load;
        scenario.wall = walled.then(|| Wall::flat(Material::BAKELITE));
        scenario.intruders = vec![softer([5, 16])];
        scenario.sections = vec![of_radius([9, 10], 0.012)];
        (name, scenario)
    })
    .into();
    let clip = |one: &mut Scenario| one.chain.contact_force = ContactForce::Clipped;
    cases.push(("wall, weak load, clipped", changed(cases[3].1.clone(), clip)));
    cases
}

/// Greatest difference between the energy that passes some contacts and the gain behind, over the striker's.
fn unaccounted(solution: &Solution, contacts: &[usize], times: &[f64]) -> f64 {
    let (model, mut worst) = (solution.model(), 0.0_f64);
    let flows: Vec<_> = (1..=model.contacts())
        .map(|contact| solution.flow(contact))
        .collect();
    for &t in times {
        for &from in contacts {
            let lost: f64 = flows[from - 1..]
                .iter()
                .map(|flow| flow.between(0.0, t).lost)
                .sum();
            let passed = flows[from - 1].between(0.0, t).energy;
            let gain = solution.at(t).region(from..=model.bodies() - 1).total();
            worst = worst.max((passed - lost - gain).abs());
        }
        let lost: f64 = flows.iter().map(|flow| flow.between(0.0, t).lost).sum();
        worst = worst.max((lost - solution.at(t).energies().dissipated_contacts).abs());
    }
    worst / model.striker_energy()
}

#[test]
fn energy_and_momentum_are_kept_with_load_and_wall() {
    for (name, scenario) in harder() {
        let solution = run(&scenario);
        let energy = solution.summary().energy;
        let start = solution.model().mass(0) * scenario.striker.velocity;
        let (mut worst, mut reckoned) = (0.0_f64, 0.0_f64);
        let (beads, load) = (scenario.chain.beads, scenario.chain.precompression);
        let wall = scenario.wall.as_ref().map(|_| solution.flow(beads + 1));
        for i in 0..=60 {
            let t = solution.end() * f64::from(i) / 60.0;
            let snapshot = solution.at(t);
            let momentum = snapshot.momentum() + snapshot.wall_impulse();
            worst = worst.max((momentum / start - 1.0).abs());
            // The flow through the wall's contact gives the same.
            if let Some(wall) = &wall {
                let impulse = wall.between(0.0, t).impulse - load * t;
                reckoned = reckoned.max((snapshot.wall_impulse() - impulse).abs() / start);
            }
        }
        assert!(energy.balance_error < 1e-12, "{name}: {:e}", energy.balance_error);
        assert!(
            worst < 1e-13 && reckoned < 5e-12,
            "{name}: {worst:e}, {reckoned:e}"
        );
    }
}

#[test]
fn what_passes_a_contact_is_what_the_beads_after_it_gain() {
    for (name, scenario) in harder() {
        let solution = run(&scenario);
        let times = [0.0007, 0.0031, 0.0052, 0.006];
        let worst = unaccounted(&solution, &[2, 6, 12, 16], &times);
        assert!(worst < 2e-11, "{name}: {worst:e}");
    }
    let mut lossy = elastic(16, 0.004);
    lossy.intruders = vec![softer([8, 9])];
    lossy.chain.relaxation = 4.2e-6;
    let clipped = changed(lossy.clone(), |one| {
        one.chain.contact_force = ContactForce::Clipped
    });
    for scenario in [lossy, clipped] {
        let times = [0.0007, 0.0016, 0.00203, 0.004];
        let worst = unaccounted(&run(&scenario), &[1, 6, 8, 9, 12], &times);
        assert!(worst < 2e-12, "{worst:e}");
    }
}

#[test]
fn a_loaded_chain_waits_at_rest_and_carries_its_load() {
    for walled in [false, true] {
        let mut scenario = elastic(40, 0.0007);
        scenario.chain.precompression = 12.5;
        scenario.wall = walled.then(|| Wall::flat(Material::BAKELITE));
        let solution = run(&scenario);
        let (model, start) = (solution.model(), solution.at(0.0));
        assert_eq!((start.force(1), start.overlap(1)), (0.0, 0.0));
        for contact in 2..=model.contacts() {
            let overlap = (12.5 / model.contact(contact).stiffness).powf(2.0 / 3.0);
            near(start.force(contact), 12.5, 2e-15);
            near(start.overlap(contact), overlap, 1e-15);
        }
        // The wave has not come to bead 40 yet, and the load has not pushed it.
        assert!(solution.at(0.0007).velocity(40).abs() < 1e-12 * scenario.striker.velocity);
        let peaks = solution.summary().peak_force;
        assert_eq!(peaks.len(), model.contacts());
        let (third, last) = (peaks[2], peaks[peaks.len() - 1]);
        near(last.force, 12.5, 1e-12);
        assert_eq!((last.fwhm, third.fwhm.is_some()), (None, true));
        assert!(third.force > 13.0, "{third:?}");
    }
}

/// κ = 1 / (θa + θb) / √(1/Ra + 1/Rb), with 1/Rb = 0 where it is flat.
#[test]
fn the_walls_stiffness_is_hertz() {
    let mut scenario = elastic(3, 0.001);
    let compliance = |of: Material| 0.75 * (1.0 - of.poisson * of.poisson) / of.young;
    let far = compliance(Material::STEEL);
    let theta = compliance(Material::BAKELITE) + far;
    for (radius, curvature) in [(None, 1.0 / 0.019), (Some(0.05), 1.0 / 0.019 + 1.0 / 0.05)] {
        let mut wall = Wall::flat(Material::STEEL);
        (wall.radius, wall.relaxation) = (radius, Some(3e-6));
        scenario.wall = Some(wall);
        let wall = run(&scenario).model().contact(4);
        close(wall.stiffness * theta * f64::sqrt(curvature), 1.0, 1e-15);
        // The beads are elastic, so only the wall's part of the overlap is viscous.
        near(wall.relaxation, 3e-6 * far / theta, 1e-15);
    }
    // Without one of its own, the contact has the last bead's relaxation time.
    let mut last = Section::of([3]);
    last.relaxation = Some(1e-6);
    scenario.sections = vec![last];
    scenario.wall = Some(Wall::flat(Material::STEEL));
    assert_eq!(run(&scenario).model().contact(4).relaxation, 1e-6);
}

#[test]
fn a_solitary_wave_comes_back_from_the_wall() {
    let mut scenario = struck_by_a_bead(40, 0.012);
    scenario.wall = Some(Wall::flat(Material::BAKELITE));
    let solution = run(&scenario);
    let pulses = solution.pulses(20, &from_height(0.1));
    assert_eq!(pulses.len(), 2, "{pulses:?}");
    let (there, back) = (pulses[0], pulses[1]);
    let wall = solution.pulses(41, &from_height(0.1))[0];
    // Nearly all of the wave comes back, as strong as it was.
    close(back.energy / there.energy, -0.99723, 1e-5);
    close(back.force / there.force, 0.99834, 1e-5);
    // The beads near the wall follow the wave back, so the wall gives a little more than twice its momentum.
    close(wall.impulse / there.impulse, 2.06043, 1e-5);
    let end = solution.at(back.to);
    let behind = (20..=40).map(|bead| solution.model().mass(bead) * end.velocity(bead));
    let given = solution.flow(41).between(there.from, back.to).impulse;
    let passed = solution.flow(20).between(there.to, back.to).impulse;
    near(given, there.impulse + passed - behind.sum::<f64>(), 1e-12);
}

/// A strike so soft and weak on a chain so loaded that the wave is long and small.
fn long_and_small(load: f64, beads: usize, duration: f64) -> Scenario {
    let mut scenario = struck_by_a_bead(beads, duration);
    scenario.striker.young = 2e8;
    scenario.striker.velocity = 1e-3;
    scenario.chain.precompression = load;
    scenario
}

/// c = 2R √(K/M) with K = (3/2) κ^(2/3) F₀^(1/3). Whatever the lattice does to a wave's shape, the mean time
/// of its force, ∫ t (F - F₀) dt / ∫ (F - F₀) dt, goes from contact to contact at c.
#[test]
fn a_small_wave_goes_at_the_speed_of_sound() {
    for load in [100.0, 800.0, 6400.0] {
        let solution = run(&long_and_small(load, 240, 0.016));
        let model = solution.model();
        let stiffness = 1.5 * model.contact(2).stiffness.powf(2.0 / 3.0) * f64::cbrt(load);
        near(model.contact(2).linear_stiffness(), stiffness, 1e-15);
        let mut sampler = solution.sampler();
        let mut sums = [[0.0; 2]; 2];
        for i in 0..8000 {
            let t = solution.end() * f64::from(i) / 8000.0;
            let snapshot = sampler.at(t);
            for (sum, contact) in sums.iter_mut().zip([20, 60]) {
                let force = snapshot.force(contact) - load;
                *sum = [sum[0] + force, sum[1] + t * force];
            }
        }
        let [early, late] = sums.map(|[force, moment]| moment / force);
        near(40.0 / (late - early), (stiffness / model.mass(1)).sqrt(), 5e-5);
    }
}

#[test]
fn a_small_wave_gives_a_rigid_wall_twice_its_momentum() {
    let mut scenario = long_and_small(800.0, 160, 0.025);
    let mut wall = Wall::flat(Material::BAKELITE);
    wall.young = 1e30;
    scenario.wall = Some(wall);
    let solution = run(&scenario);
    // Before the wave reaches the wall, and on its way back.
    let (before, after) = (solution.at(0.012), solution.at(0.025));
    let momentum = before.momentum() - solution.model().mass(0) * before.velocity(0);
    assert!(before.wall_impulse().abs() < 1e-8 * momentum);
    close(after.wall_impulse() / momentum, 2.0, 3e-5);
    let energy = |snapshot: &Snapshot<'_>| snapshot.region(1..=160).mechanical();
    near(energy(&after), energy(&before), 1e-12);
}
