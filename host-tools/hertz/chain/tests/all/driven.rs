//! Driven, vertical and displaced chains: an independent program, energy with the drive's work, rest, and
//! closed forms.

use std::f64::consts::{PI, TAU};
use std::fs;

use crate::common::{changed, close, near, numbers, run, says};
use hertz_chain::{
    Accuracy, Drive, DriveQuantity, EnsembleOptions, Intruder, Material, Model, Oscillator, Run, Scenario,
    SimulateError, Start, Wall, ensemble, summarise,
};

/// Eight viscous beads, vertical, loaded and on a steel plate, the fourth with the paper's intruder.
fn driven(drive: Drive) -> Scenario {
    changed(Scenario::paper(), |scenario| {
        scenario.duration = 4e-3;
        scenario.chain.beads = 8;
        (scenario.chain.precompression, scenario.chain.gravity) = (2.0, 9.81);
        scenario.intruders = vec![Intruder::new([4], Oscillator::PAPER)];
        scenario.wall = Some(Wall::flat(Material::STEEL));
        scenario.striker.velocity = 0.0;
        scenario.drive = Some(drive);
    })
}

/// Velocities of the beads after 4 ms by SciPy's DOP853 at a relative tolerance of 1e-13 and steps of up to 1
/// µs, over equations of its own in whole overlaps. Steps twice as long change them by up to 1.5e-10.
#[test]
fn driven_chains_move_as_an_independent_program_says() {
    use DriveQuantity::{Displacement, Force};
    for (drive, velocities) in [
        (
            Drive::sine(Displacement, 2e-6, 1500.0),
            "-0.007779963755093013 0.006702781127305414 -0.003229273545880029 0.000826040014459159
             0.0026386371697517453 -0.0019863627832342723 6.51161751652172e-5 0.001358375443420868",
        ),
        (
            Drive::sine(Displacement, 2e-5, 1500.0),
            "-0.007773051277043174 0.01789547842340608 0.14697032774287822 0.06723211577927178
             0.013501654495284291 -8.083913337346774e-5 0.00033617384441111806 0.0009704219567854611",
        ),
        (
            Drive::sine(Force, 1.0, 900.0),
            "-0.0003253473267942322 0.005141244643428962 0.0016675781257125624 -0.006092390983388122
             -0.00649805586856135 0.0011775006812304743 0.007159649153361666 0.003983212703468726",
        ),
        (
            Drive::sine(Force, 20.0, 900.0),
            "0.0007098901137526434 -0.03726814306359489 -0.011263592384562343 0.0031138674123965143
             0.006536775336173176 -0.00011248357075317439 0.0005621601674857074 0.0017403169837539832",
        ),
    ] {
        let velocities = numbers(velocities);
        let solution = run(&driven(drive.clone()));
        let end = solution.at(4e-3);
        let greatest = velocities.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        for (bead, velocity) in (1..).zip(velocities) {
            let error = (end.velocity(bead) - velocity) / greatest;
            assert!(error.abs() < 1e-9, "{drive:?}, bead {bead}: {error:e}");
        }
    }
}

/// Drives of every kind; the strong ones open contacts.
fn drives() -> Vec<Drive> {
    use DriveQuantity::{Displacement, Force};
    let mut chirp = Drive::sine(Displacement, 1e-6, 500.0);
    (chirp.frequency_end, chirp.sweep, chirp.ramp) = (Some(4000.0), Some(3e-3), 1e-3);
    let record = |quantity, height: f64| {
        let samples = (0..=80).map(|n| {
            let t = 5e-5 * f64::from(n);
            [
                t,
                height * ((TAU * 700.0 * t).sin() + 0.3 * (TAU * 2900.0 * t).cos()),
            ]
        });
        Drive::record(quantity, samples.collect())
    };
    vec![
        Drive::sine(Displacement, 1e-7, 1500.0),
        Drive::sine(Displacement, 3e-5, 1500.0),
        Drive::sine(Force, 1.0, 1500.0),
        Drive::sine(Force, 30.0, 700.0),
        chirp,
        record(Displacement, 1e-6),
        record(Force, 3.0),
    ]
}

#[test]
fn the_energy_of_a_driven_chain_is_the_work_of_its_drive() {
    for drive in drives() {
        let scenario = driven(drive.clone());
        let summary = summarise(&scenario, &hertz_chain::Options::default()).expect("it runs");
        let work = summary.energy.drive_work.expect("it is driven");
        assert!(work > 0.0, "{drive:?}: a damped chain takes energy, not {work}");
        let error = summary.energy.balance_error;
        assert!(error < 1e-11, "{drive:?}: {error:e}");
        // Inside steps too.
        let solution = run(&scenario);
        let mut sampler = solution.sampler();
        let start = sampler.at(0.0).energies().total();
        let (mut greatest, mut worst) = (0.0_f64, 0.0_f64);
        for n in 1..=500 {
            let energies = sampler.at(4e-3 * f64::from(n) / 500.0).energies();
            greatest = greatest.max(energies.chain + energies.intruders + energies.striker);
            worst = worst.max((energies.total() - start).abs());
        }
        assert!(worst < 1e-10 * greatest, "{drive:?}: {:e}", worst / greatest);
        assert_eq!(solution.summary().energy.drive_work, Some(work));
    }
}

#[test]
fn a_driven_run_goes_on_from_its_middle() {
    for drive in drives() {
        let scenario = driven(drive.clone());
        let mut whole = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
        whole.to(1.7e-3).unwrap();
        let mut again = whole.snapshot().resume(Accuracy::REFERENCE).unwrap();
        whole.to(4e-3).unwrap();
        again.to(4e-3).unwrap();
        let (whole, again) = (whole.snapshot(), again.snapshot());
        for bead in 1..=8 {
            close(whole.velocity(bead), again.velocity(bead), 1e-12);
        }
        close(whole.energies().supplied / again.energies().supplied, 1.0, 1e-9);
    }
}

#[test]
fn a_vertical_chain_stays_at_rest_and_carries_its_weight() {
    let mut scenario = driven(Drive::sine(DriveQuantity::Force, 0.0, 1000.0));
    scenario.drive = None;
    scenario.duration = 0.1;
    let model = Model::of(&scenario).unwrap();
    // The striker lies on the chain.
    let mut load = 2.0 - 2.0 + model.mass(0) * 9.81;
    for contact in 1..=model.contacts() {
        let carried = model.contact(contact);
        if contact == 2 {
            load += 2.0;
        }
        near(carried.load, load, 1e-14);
        near(carried.elastic_force(carried.static_overlap), load, 1e-13);
        if contact < model.bodies() {
            load += model.mass(contact) * 9.81;
        }
    }
    let end = run(&scenario);
    for body in 0..=8 {
        let at = end.at(0.1);
        assert_eq!((at.velocity(body), at.displacement(body)), (0.0, 0.0));
    }
    // Pushed a little it does not stay, but the load is not lost either.
    scenario.starts = vec![Start::displaced([5], 1e-9)];
    let pushed = run(&scenario);
    let middle = pushed.at(2e-3);
    assert!(middle.displacement(3).abs() > 1e-11 && middle.displacement(3).abs() < 1e-8);
    assert!(pushed.summary().energy.balance_error < 1e-11);
}

#[test]
fn a_dropped_striker_meets_the_chain_at_the_speed_of_its_fall() {
    let mut scenario = driven(Drive::sine(DriveQuantity::Force, 0.0, 1000.0));
    scenario.drive = None;
    let height = 5e-3;
    (scenario.starts, scenario.chain.precompression) = (vec![Start::apart([1], height)], 0.0);
    let time = (2.0 * height / 9.81_f64).sqrt();
    scenario.duration = time + 1e-3;
    let solution = run(&scenario);
    let before = solution.at(time * (1.0 - 1e-9));
    near(before.velocity(0), 9.81 * time, 2e-9);
    assert_eq!(before.force(1), 0.0);
    // The chain's own motion is the rounding of its loads.
    close(before.velocity(1), 0.0, 1e-17);
    assert!(solution.at(time + 1e-4).force(1) > 1.0);
    let energy = solution.summary().energy;
    assert!(energy.balance_error < 1e-11, "{:e}", energy.balance_error);
    let fallen = solution.at(scenario.duration).displacement(0);
    near(
        energy.drive_work.unwrap(),
        solution.model().mass(0) * 9.81 * fallen,
        1e-12,
    );
}

/// Host and intruder alone swing at √(k M/(m₁ m)) about their common centre of mass.
#[test]
fn a_displaced_intruder_swings_as_an_oscillator_of_two_masses() {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 1;
    scenario.intruders[0].beads = vec![1];
    scenario.intruders[0].damping = 0.0;
    scenario.starts = vec![Start::apart([1], 1.0)];
    scenario.starts[0].intruder_displacement = 1e-6;
    scenario.starts[0].intruder_velocity = 2e-3;
    scenario.striker.velocity = 0.0;
    let solution = run(&scenario);
    let (whole, mass) = (solution.model().mass(1), Oscillator::PAPER.mass);
    let omega = (Oscillator::PAPER.stiffness * whole / ((whole - mass) * mass)).sqrt();
    for n in 0..40 {
        let t = 1e-4 * f64::from(n);
        let (at, phase) = (solution.at(t), omega * t);
        let x = 1e-6 * phase.cos() + 2e-3 / omega * phase.sin();
        close(at.intruder_displacement(1).unwrap(), x, 1e-18);
        close(at.momentum(), mass * 2e-3, 1e-18);
    }
}

#[test]
fn the_energy_that_a_drive_injects_is_found_again_in_the_chain() {
    let drives = [(DriveQuantity::Displacement, 2e-6), (DriveQuantity::Force, 5.0)];
    let scenarios = drives.map(|(quantity, amplitude)| driven(Drive::sine(quantity, amplitude, 1500.0)));
    for outcome in ensemble(&scenarios, &EnsembleOptions::default()) {
        let outcome = outcome.expect("it runs");
        let (injected, end) = (outcome.injected(), outcome.end().energies());
        let dissipated = end.dissipated_contacts + end.dissipated_intruders;
        near(injected, end.chain + end.intruders + dissipated, 1e-6);
        let parts = outcome.absorption().into_iter().map(|one| one.of_injected);
        near(parts.sum::<f64>(), end.dissipated_intruders / injected, 1e-12);
    }
}

/// Below the cut-off a long chain of masses and springs takes its piston's work away as a travelling wave of
/// power ½ A² ω² √(K M) cos(q/2), with sin(q/2) = ω/2 √(M/K).
#[test]
fn a_weak_sine_sends_the_power_of_a_lattice_wave_down_the_chain() {
    let mut scenario = driven(Drive::sine(DriveQuantity::Displacement, 1e-10, 1500.0));
    let chain = &mut scenario.chain;
    (chain.beads, chain.relaxation, chain.gravity, chain.precompression) = (150, 0.0, 0.0, 100.0);
    (scenario.intruders, scenario.wall, scenario.duration) = (Vec::new(), None, 0.02);
    // A piston whose contact is as stiff as one between two beads.
    (scenario.striker.radius, scenario.striker.young) = (scenario.chain.radius, scenario.chain.young);
    scenario.striker.poisson = scenario.chain.poisson;
    let mut run = Run::new(&scenario, Accuracy::new(1e-11, 0.25)).unwrap();
    let (mass, stiffness) = (run.model().mass(1), run.model().contact(2).linear_stiffness());
    let omega = TAU * 1500.0;
    let sine = 0.5 * omega * (mass / stiffness).sqrt();
    let power = 0.5 * 1e-20 * omega * omega * (stiffness * mass).sqrt() * (1.0 - sine * sine).sqrt();
    run.to(0.010).unwrap();
    let before = run.snapshot().energies().supplied;
    run.to(0.014).unwrap();
    // Six whole periods, before the wave comes back from the far end.
    near((run.snapshot().energies().supplied - before) / 4e-3, power, 2e-3);
}

#[test]
fn a_scenario_file_names_the_file_of_its_record() {
    let folder = std::env::temp_dir().join(format!("hertz-chain-record-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let rows = (0..=100).map(|n| format!("{},{}\n", 5e-5 * f64::from(n), (PI * f64::from(n) / 20.0).sin()));
    fs::write(
        folder.join("force.csv"),
        format!("time_s,force_n\n{}", rows.collect::<String>()),
    )
    .unwrap();
    let mut scenario = driven(Drive::record(DriveQuantity::Force, Vec::new()));
    let drive = scenario.drive.as_mut().unwrap();
    (drive.file, drive.amplitude) = (Some("force.csv".to_owned()), 0.5);
    let (path, text) = (folder.join("driven.toml"), scenario.to_toml());
    fs::write(&path, &text).unwrap();
    let read = Scenario::load(&path).expect("both files are sound");
    let samples = &read.drive.as_ref().unwrap().samples;
    assert_eq!((samples.len(), samples[10]), (101, [5e-4, 1.0]));
    assert_eq!(
        Scenario::from_toml(&read.to_toml(), "x.toml").expect("it holds the record"),
        read
    );
    assert!(run(&read).summary().energy.drive_work.unwrap() > 0.0);

    let refused = |text: &str| {
        fs::write(&path, text).unwrap();
        Scenario::load(&path).expect_err("it is refused").to_string()
    };
    let file = format!("{}:", path.display());
    let line = refused(&text.replace("duration = 0.004", "duration = 0.006"));
    let words = "the record ends at 0.005 s, the run at 0.006 s; shorten the duration, or record longer";
    says(&line, &format!("{file}32: drive.samples: "), words);
    let line = refused(&text.replace("force.csv", "none.csv"));
    says(&line, &file, "none.csv: cannot be read");
    fs::write(folder.join("force.csv"), "0,0\n1e-3\n").unwrap();
    let words = "force.csv:2: not a time and a value; give two numbers";
    says(&refused(&text), &file, words);
    let line = scenario.check().expect_err("the file was never read").to_string();
    says(&line, "drive.file: force.csv has not been read; ", "");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_run_beyond_the_end_of_its_record_is_refused_or_stops_there() {
    let samples = (0..=50)
        .map(|n| [1e-4 * f64::from(n), f64::from(n % 3)])
        .collect();
    let scenario = driven(Drive::record(DriveQuantity::Force, samples));
    let mut run = Run::new(&scenario, Accuracy::DRAFT).unwrap();
    let error = run.check(6e-3, 0.5).unwrap_err();
    assert_eq!(
        error,
        SimulateError::DriveEnds {
            last: 5e-3,
            end: 6e-3
        }
    );
    let words = "drive: the record ends at 0.005 s, the run at 0.006 s; ";
    says(&error.to_string(), words, "");
    assert_eq!(run.to(6e-3), Err(error));
    assert_eq!(run.time(), 5e-3);
    let options = hertz_chain::Options::default().with_duration(6e-3);
    assert!(matches!(
        summarise(&scenario, &options),
        Err(SimulateError::DriveEnds { .. })
    ));
}

#[test]
fn a_load_that_presses_a_body_flat_and_a_drive_too_fast_for_its_samples_are_refused() {
    let mut chirp = Drive::sine(DriveQuantity::Displacement, 1e-6, 1500.0);
    let mut pressed = driven(chirp.clone());
    pressed.chain.precompression = 1e8;
    let line = Model::of(&pressed).expect_err("it is flat").to_string();
    let words = "chain.precompression: a load of 1.000e8 N presses the bodies of contact 1 together by ";
    says(&line, words, "");
    (chirp.frequency_end, chirp.sweep) = (Some(4000.0), Some(0.01));
    chirp.check_rate(8000.0).expect("two samples a period");
    let line = chirp.check_rate(7000.0).unwrap_err().to_string();
    let words = "drive.frequency: 7000 samples a second cannot show a drive of up to 4000 Hz; ";
    says(&line, words, "");
}
