//! Scenarios that cannot be used: each is refused with one line of file, line, key, fault and advice.

use crate::common::{of_radius, says};
use hertz_chain::{
    ContactLaw, Damping, Intruder, Options, Scenario, SimulateError, Start, simulate, simulate_with,
    summarise,
};

const SOUND: &str = "\
title = \"One absorber at bead 8\"
duration = 0.006
[chain]
beads = 16
radius = 0.019
density = 1775.0
young = 4.5e9
poisson = 0.44
relaxation = 4.2e-6
contact_force = \"printed\"
[striker]
radius = 0.0045
density = 7980.0
young = 203e9
poisson = 0.27
velocity = 0.45
[[intruder]]
beads = [8]
mass = 3.7e-3
stiffness = 3.95e5
damping = 12.0
";

/// Changes of [`SOUND`], and how the error begins, or `sound`. ` => ` separates old text, new text and error;
/// `\n` ends a line. Old text `+` means: add the new text at the end.
const CHANGES: &str = r#"
title => titel => 1: titel: unknown key; did you mean `title`?
title => "\nti\u001btle" => 1: \u000ati\u001btle: unknown key; did you mean `title`?
title => "ti`tle" => 1: ti`tle: unknown key; did you mean `title`?
young = 4.5e9 => yuong = 4.5e9 => 7: chain.yuong: unknown key; did you mean `young`?
velocity => velocty => 16: striker.velocty: unknown key; did you mean `velocity`?
stiffness => stifness => 20: intruder[1].stifness: unknown key; did you mean `stiffness`?
[[intruder]] => [[intruders]] => 17: intruders: unknown key; did you mean `intruder`?
damping => colour => 21: intruder[1].colour: unknown key; known here are beads, mass, stiffness, damping

young = 4.5e9\n =>  => 3: chain: the key `young` is missing; add it, in SI units
mass = 3.7e-3\n =>  => 17: intruder[1]: the key `mass` is missing; add it, in SI units
duration = 0.006\n =>  => 1: the key `duration` is missing; add it, in SI units

radius = 0.019 => radius = "0.019" => 5: chain.radius: the text "0.019", where a number belongs; give a value
beads = 16 => beads = -16 => 4: chain.beads: the number -16, where a whole number, 0 or more, belongs; give
beads = 16 => beads = 1e12 => 4: chain.beads: the number 1000000000000
"printed" => "cliped" => 10: chain.contact_force: `cliped` is not known; known are `printed` or `clipped`
[8] => "8" => 18: intruder[1].beads: the text "8", where the number of a bead, or a list of such numbers belongs
[8] => -8 => 18: intruder[1].beads: the number -8, where the number of a bead, or a list of such
[8] => [8, 9.5] => 18: intruder[1].beads: the number 9.5, where a whole number, 0 or more, belongs
density = 1775.0 => density =  => 6: not TOML (

duration = 0.006 => duration = 0 => 2: duration: 0 is not a positive number; give a number above zero in s, such as 0.004
duration = 0.006 => duration = inf => 2: duration: inf is not a positive number; give
beads = 16 => beads = 0 => 4: chain.beads: a chain of 0 beads cannot be simulated; give a number from 1 to 100000
beads = 16 => beads = 100001 => 4: chain.beads: a chain of 100001 beads
beads = 16 => beads = 9223372036854775807 => 4: chain.beads: a chain of 9223372036854775807 beads
radius = 0.019 => radius = nan => 5: chain.radius: NaN is not a positive number; give a number above zero in m, such as 0.019
radius = 0.019 => radius = 1e308 => 5: chain.radius: 1e308 is out of the range of sizes that can be computed; give a number from 1e-30 to 1e30, in SI units
relaxation = 4.2e-6 => relaxation = 1e-31 => 9: chain.relaxation: 1e-31 is out of the range
density = 1775.0 => density = -1 => 6: chain.density: -1 is not a positive number; give
young = 4.5e9 => young = 0.0 => 7: chain.young: 0 is not a positive number; give
poisson = 0.44 => poisson = 0.51 => 8: chain.poisson: 0.51 is not a Poisson's ratio; give a number above -1 and at most 0.5, such as 0.44
poisson = 0.44 => poisson = 0.5 => sound
poisson = 0.44 => poisson = -1.0 => 8: chain.poisson: -1 is not a Poisson's ratio
relaxation = 4.2e-6 => relaxation = -1.0 => 9: chain.relaxation: -1 is not zero or a positive number; give a time in s, such as 4.2e-6, or 0 for an elastic contact
relaxation = 4.2e-6 => relaxation = 0.0 => sound
relaxation = 4.2e-6 => relaxation = inf => 9: chain.relaxation: inf is not zero or a positive number
contact_force = "printed" => contact_force = "printed"\nprecompression = -1.0 => 11: chain.precompression: -1 is not zero or a positive number; give a force
contact_force = "printed" => contact_force = "printed"\ngravity = -9.81 => 11: chain.gravity: -9.81 is not zero or a positive number; give an acceleration
contact_force = "printed" => contact_force = "printed"\ngravity = 9.81 => 11: chain.gravity: a vertical chain without a wall below falls; add [wall]
contact_force = "printed" => contact_force = "printed"\ndrag_time = 0.0 => 11: chain.drag_time: 0 is not a positive number; give
density = 7980.0 => density = -inf => 13: striker.density: -inf is not a positive number
young = 203e9 => young = -0.0 => 14: striker.young: -0 is not a positive number
radius = 0.0045 => radius = 0.0 => 12: striker.radius: 0 is not a positive number; give a number above zero in m, such as 0.0045
poisson = 0.27 => poisson = 0.6 => 15: striker.poisson: 0.6 is no
velocity = 0.45 => velocity = -0.45 => 16: striker.velocity: -0.45 is not a positive number; give
velocity = 0.45 => velocity = 0.45\nmass = 0.0 => 17: striker.mass: 0 is not
velocity = 0.45 => velocity = 0.45\nrelaxation = -1.0 => 17: striker.relaxation: -1 is not zero or a positive number; give
mass = 3.7e-3 => mass = 0.0 => 19: intruder[1].mass: 0 is not
3.95e5 => nan => 20: intruder[1].stiffness: NaN is not
damping = 12.0 => damping = -1.0 => 21: intruder[1].damping: -1 is not zero or a positive number; give zero or more in N·s/m
damping = 12.0 => damping = 12.0\ncubic_stiffness = inf => 22: intruder[1].cubic_stiffness: inf is not a cubic stiffness; give
contact_force = "printed" => contact_force = "printed"\ngravity = 9.81\n[[intruder]]\nbeads = 7\nmass = 1e-3\nstiffness = 1e5\ndamping = 1\ncubic_stiffness = 1e16 => 17: intruder[1].cubic_stiffness: the stiffness of a nonlinear spring changes when a weight hangs from it; leave out
damping = 12.0 => damping = 12.0\ninside = 1 => 22: intruder[1].inside: intruder[1] does not come before intruder[1]; give
+ => [[intruder]]\nbeads = 9\nmass = 1e-3\nstiffness = 1e5\ndamping = 1\ninside = 1 => 27: intruder[2].inside: bead 9 holds no intruder[1] that could

+ => [wal]\nyoung = 203e9\npoisson = 0.27 => 22: wal: unknown key; did you mean `wall`?
+ => [wall]\npoisson = 0.27 => 22: wall: the key `young` is missing; add it, in SI units
+ => [wall]\nyuong = 203e9\npoisson = 0.27 => 23: wall.yuong: unknown key; did you mean `young`?
+ => [wall]\nyoung = -203e9\npoisson = 0.27 => 23: wall.young: -203000000000 is not a positive number; give
+ => [wall]\nyoung = 203e9\npoisson = 0.6 => 24: wall.poisson: 0.6 is not a Poisson's ratio; give
+ => [wall]\nradius = 0.0\nyoung = 203e9\npoisson = 0.27 => 23: wall.radius: 0 is not a positive number; give a number above zero in m, such as 0.1; a flat wall has none
+ => [wall]\nrelaxation = -1.0\nyoung = 203e9\npoisson = 0.27 => 23: wall.relaxation: -1 is not zero or a positive

mass = 3.7e-3 => mass = 0.051 => 19: intruder[1].mass: 0.051 kg is at least as heavy as its host, bead 8
+ => [[section]]\nbeads = [8]\nradius = 0.0075 => 19: intruder[1].mass: 0.0037 kg is at least as heavy as its host, bead 8
[8] => [17] => 18: intruder[1].beads: bead 17 is not in the chain; beads are counted from 1 to 16 (chain.beads)
[8] => 17 => 18: intruder[1].beads: bead 17 is not in the chain; beads are counted from 1 to 16 (chain.beads)
[8] => [0] => 18: intruder[1].beads: bead 0 is not in the chain
[8] => [8, 1000000000000] => 18: intruder[1].beads: bead 1000000000000 is not in the chain
[8] => [] => 18: intruder[1].beads: names no bead; name at least one from 1 to 16, or leave the table out
[8] => [8, 9, 8] => 18: intruder[1].beads: bead 8 is named twice; name each bead once
+ => [[intruder]]\nbeads = [7, 8]\nmass = 0.05\nstiffness = 1e5\ndamping = 1 => 24: intruder[2].mass: 0.05 kg, with the intruders before it, is at least as heavy as its host, bead 8
+ => [[section]]\nbeads = 3\nradius = 0.01\n[[section]]\nbeads = [4, 3] => 26: section[2].beads: bead 3 is already in section[1]; put
+ => [[section]]\nbeads = [3, 4]\nradius = -0.01 => 24: section[1].radius: -0.01 is not a positive number
+ => [[section]]\nbeads = 3\ndensity = 0.0 => 24: section[1].density: 0 is not a positive number
+ => [[section]]\nbeads = 3\nyoung = nan => 24: section[1].young: NaN is not a positive number
+ => [[section]]\nbeads = 3\npoisson = nan => 24: section[1].poisson: NaN is not a Poisson's ratio
+ => [[section]]\nbeads = 3\nrelaxation = nan => 24: section[1].relaxation: NaN is not zero or a positive number

+ => [[start]]\nbeads = [17]\ngap = 1e-6 => 23: start[1].beads: bead 17 is not in the chain
+ => [[intruder]]\nbeads = 8\nmass = 1e-3\nstiffness = 1e5\ndamping = 1\ncubic_stiffness = -1e18\n[[intruder]]\nbeads = 8\nmass = 1e-3\nstiffness = 1e5\ndamping = 1\n[[start]]\nbeads = [8]\nintruder_displacement = -1e-6 => 35: start[1].intruder_displacement: at -0.000001 m the softening spring in bead 8
+ => [[start]]\nbeads = []\ngap = 1e-6 => 23: start[1].beads: names no bead
+ => [[start]]\nbeads = [3]\ngap = -1e-6 => 24: start[1].gap: -0.000001 is not zero or a positive
+ => [[start]]\nbeads = [3]\nvelocity = inf => 24: start[1].velocity: inf is not a velocity
+ => [[start]]\nbeads = [3]\ngap = 1e-6\n[[start]]\nbeads = [3]\nvelocity = 0.1 => 26: start[2].beads: bead 3 is already in start[1]
+ => [[start]]\nbeads = [3]\nspeed = 0.1 => 24: start[1].speed: unknown key; known here
+ => [[start]]\nbeads = [3]\nintruder_velocity = 0.1 => 23: start[1].beads: bead 3 has no intruder that could start displaced or moving; name
+ => [[start]]\nbeads = [3]\ndisplacement = inf => 24: start[1].displacement: inf is not a displacement; give
contact_force = "printed" => contact_force = "printed"\nprecompression = 1.0\n[[start]]\nbeads = 4\ngap = 1e-6 => 14: start[1].gap: a gap of 0.000001 m cannot be in a chain under a load of 1 N; leave out the gap or chain.precompression
contact_force = "printed" => contact_force = "printed"\ngravity = 9.81\n[[start]]\nbeads = 4\ngap = 1e-6 => 14: start[1].gap: a gap of 0.000001 m cannot be in a vertical chain at rest; leave out the gap or chain.gravity
+ => [wall]\nyoung = 1e9\npoisson = 0.3\ngap = -1.0 => 25: wall.gap: -1 is not zero

+ => [drive]\nquantity = "force"\nfrequency = 1500.0 => 16: striker.velocity: a body that a drive moves cannot strike at 0.45 m/s; give
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "displacement"\namplitude = nan => 19: drive.amplitude: NaN is not an amplitude; give a number in m
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "force"\nfrequency = 0.0 => 19: drive.frequency: 0 is not a positive number; give
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "force" => 17: drive.frequency: the drive has no signal; give
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "force"\nfrequency = 9.0\nsweep = 0.1 => 20: drive.sweep: frequency_end and sweep belong together; give
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "force"\nfrequency = 9.0\nsamples = [[0.0, 0.0]] => 19: drive.frequency: a drive is either a sine or a record; leave
velocity = 0.45 => velocity = 0.0\n[drive]\nquantity = "force"\nsamples = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]] => 19: drive.samples: the time of sample 3 is not after that before it; sort

+ => [contact]\nexponent = 0.5 => 23: contact.exponent: 0.5 is not an exponent of a contact; give
+ => [contact]\nexponent = 3.0\nstiffness = 0.0 => 24: contact.stiffness: 0 is not a positive number; give
+ => [contact]\nexponent = 3.0 => 22: contact.stiffness: materials give a stiffness for the exponent 1.5 only; give
+ => [contact]\ncoefficient = 1.0 => 23: contact.coefficient: viscoelastic damping follows from the relaxation times of the materials; leave
+ => [contact]\ndamping_exponent = 0.5 => 23: contact.damping_exponent: it belongs to damping = "power", and
+ => [contact]\nfriction = 1.0 => 23: contact.friction: 1 is not a coefficient of friction; give
+ => [contact]\nfriction_speed = 0.0 => 23: contact.friction_speed: 0 is not a positive number; give
contact_force = "printed" => contact_force = "clipped"\n[contact]\nfriction = 0.1 => 10: chain.contact_force: only Hertz' contacts with a damping of the exponent 1/2, without friction, can be clipped; leave
"#;

fn sound() -> Scenario {
    Scenario::from_toml(SOUND, "s.toml").expect("sound")
}

/// The error for a scenario that must be refused.
fn refusal(text: &str) -> String {
    let error = Scenario::from_toml(text, "s.toml").expect_err(text).to_string();
    assert!(!error.contains('\n'), "{error}");
    error
}

#[test]
fn a_scenario_that_cannot_be_used_is_refused_in_one_line() {
    for row in CHANGES.lines().filter(|row| !row.is_empty()) {
        let [old, new, start] = row.split(" => ").collect::<Vec<_>>()[..] else {
            panic!("three parts: {row}");
        };
        // A key in quotes keeps its escapes.
        let line_end = |text: &str| if text.starts_with('"') { "\\n" } else { "\n" };
        let plain = |text: &str| text.replace("\\n", line_end(text));
        let text = if old == "+" {
            format!("{SOUND}{}\n", plain(new))
        } else {
            assert!(SOUND.contains(&plain(old)), "{row}");
            SOUND.replacen(&plain(old), &plain(new), 1)
        };
        if start == "sound" {
            assert!(Scenario::from_toml(&text, "s.toml").is_ok(), "{row}");
            continue;
        }
        let (error, start) = (refusal(&text), format!("s.toml:{start}"));
        assert!(error.starts_with(&start), "{error}\n{start}");
    }
}

#[test]
fn a_sound_scenario_is_read_and_written_back_the_same() {
    let scenario = sound();
    assert_eq!(scenario, Scenario::paper());
    let text = include_str!("../../../../../docs/scenarios/paper-strike.toml");
    assert_eq!(
        Scenario::from_toml(text, "paper-strike.toml").as_ref(),
        Ok(&scenario)
    );
    assert_eq!(Scenario::from_toml(&scenario.to_toml(), "t.toml"), Ok(scenario));
    // A number stands for a list of one bead.
    let one = SOUND.replace("[8]", "8");
    assert_eq!(Scenario::from_toml(&one, "s.toml"), Ok(Scenario::paper()));
    let starts = format!("{SOUND}[[section]]\nbeads = 3\nradius = 0.01\n[[start]]\nbeads = 9\ngap = 1e-6\n");
    let scenario = Scenario::from_toml(&starts, "s.toml").expect("sound");
    assert_eq!(scenario.sections[0].beads, [3]);
    assert_eq!(scenario.starts[0].beads, [9]);
    // With a law of contacts, under a load, and with beads that move.
    let mut scenario = scenario;
    let law = ContactLaw::power(3.0, 1e15).damped(Damping::LammpsTsuji, 0.3);
    scenario.contact = Some(law.rubbing(0.2, 5e-3));
    (scenario.chain.precompression, scenario.starts) = (1.0, vec![Start::moving([4], -0.2)]);
    assert_eq!(Scenario::from_toml(&scenario.to_toml(), "t.toml"), Ok(scenario));
}

#[test]
fn long_names_and_values_are_shown_by_their_beginning() {
    let (name, long) = ("n".repeat(60), "n".repeat(100_000));
    let known =
        "known here are title, duration, chain, striker, wall, intruder, section, start, drive, contact";
    let error = refusal(&SOUND.replacen("title", &long, 1));
    assert_eq!(error, format!("s.toml:1: {name}…: unknown key; {known}"));
    let error = refusal(&SOUND.replacen("\"printed\"", &format!("{long:?}"), 1));
    says(
        &error,
        "s.toml:10: chain.contact_force: `nnnn",
        "…; give a value of that kind",
    );
    assert!(error.len() < 500, "{error}");
}

/// Each key was once kept with the names of all tables around it: 279 kB took 2 GB.
#[test]
fn a_key_is_located_among_many_in_a_table_of_a_long_name() {
    let long = "n".repeat(1000);
    let many: String = (0..1000).map(|n| format!("k{n} = 1\n")).collect();
    let error = refusal(&format!("{SOUND}[{long}]\n{many}"));
    says(&error, "s.toml:22: nnn", "…: unknown key");
    let behind = format!("{SOUND}[[intruder]]\nbeads = [9]\nmass = 1e-3\nstiffness = 1e5\ndamping = -1.0\n");
    let error = refusal(&behind);
    assert!(error.starts_with("s.toml:26: intruder[2].damping: "), "{error}");
}

#[test]
fn an_intruder_exactly_as_heavy_as_its_host_is_refused() {
    let mut scenario = sound();
    let chain = &scenario.chain;
    let host = 4.0 / 3.0 * std::f64::consts::PI * chain.radius.powi(3) * chain.density;
    scenario.intruders[0].mass = host;
    let error = scenario.check().expect_err("no shell is left");
    assert_eq!(error.key, "intruder[1].mass");
    scenario.intruders[0].mass = host * (1.0 - 1e-15);
    assert_eq!(scenario.check(), Ok(()));
}

/// Lists as long as a chain can be are read through once, not once for each of their beads.
#[test]
fn lists_as_long_as_the_longest_chain_are_checked_in_no_time() {
    let mut scenario = sound();
    scenario.chain.beads = 100_000;
    let oscillator = scenario.intruders[0].oscillator();
    let one_by_one = (1..=50_000).map(|bead| Intruder::new([bead], oscillator));
    let rest = std::iter::once(Intruder::new(50_001..=100_000, oscillator));
    scenario.intruders = one_by_one.chain(rest).collect();
    scenario.sections = (1..=100_000).map(|bead| of_radius([bead], 0.02)).collect();
    let clock = std::time::Instant::now();
    assert_eq!(scenario.check(), Ok(()));
    scenario.intruders[50_000].beads = (0..3_000_000).map(|i| 50_001 + i % 50_000).collect();
    let error = scenario.check().expect_err("named twice");
    assert_eq!(error.key, "intruder[50001].beads");
    // Some 5 ms; a list looked through for each of its beads would take minutes.
    assert!(clock.elapsed().as_secs_f64() < 2.0, "{:?}", clock.elapsed());
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Scenario::load("no/such/scenario.toml").expect_err("there is none");
    says(&error.to_string(), "no/such/scenario.toml: ", "cannot be read (");
}

#[test]
fn scenarios_built_in_code_and_options_are_checked_too() {
    let mut scenario = sound();
    scenario.chain.young = f64::NAN;
    let error = simulate(&scenario).expect_err("NaN");
    assert!(matches!(error, SimulateError::Input(_)));
    says(
        &error.to_string(),
        "chain.young: NaN is not a positive number; ",
        "give",
    );
    let options = Options::default().with_duration(-1.0);
    let error = simulate_with(&sound(), &options).expect_err("negative");
    let expected = "duration: -1 s cannot be simulated; give a number above zero";
    assert_eq!(error.to_string(), expected);
    let mut options = Options::default();
    options.accuracy.tolerance = 1e-17;
    let error = simulate_with(&sound(), &options).expect_err("below rounding");
    assert!(error.to_string().starts_with("accuracy: tolerance"), "{error}");
}

#[test]
fn a_run_that_no_memory_holds_or_of_more_than_a_day_is_refused_before_it_starts() {
    let mut scenario = sound();
    scenario.duration = 1e4;
    let error = simulate(&scenario).expect_err("hours");
    assert_eq!(error, SimulateError::TooLong { time: 0.0, end: 1e4 });
    assert!(error.to_string().contains("only for the summary"), "{error}");
    let changes: [fn(&mut Scenario); 3] = [
        |one| one.duration = 1e12,
        |one| one.duration = 1e30,
        |one| (one.chain.radius, one.striker.radius) = (1e-20, 1e-20),
    ];
    for change in changes {
        let mut scenario = sound();
        scenario.intruders.clear();
        change(&mut scenario);
        let error = summarise(&scenario, &Options::default()).expect_err("years");
        assert!(matches!(error, SimulateError::TooManySteps { .. }), "{error}");
        assert_eq!(simulate(&scenario).expect_err("years"), error);
        says(&error.to_string(), "duration: ", "more than a day");
    }
}

#[test]
fn an_intruder_of_wrong_units_is_refused_with_the_time_it_would_take() {
    let change: [fn(&mut Intruder); 2] = [|one| one.damping = 1e9, |one| one.mass = 1e-9];
    for change in change {
        let mut scenario = sound();
        change(&mut scenario.intruders[0]);
        let error = simulate(&scenario).expect_err("a damper of glass");
        assert!(matches!(error, SimulateError::TooStiff { .. }), "{error}");
        says(&error.to_string(), "intruder in bead 8: ", " steps, more than ");
        says(&error.to_string(), "", "mass in kg");
        assert_eq!(summarise(&scenario, &Options::default()), Err(error));
    }
    // A stiff intruder is slow, but no mistake.
    let mut scenario = sound();
    scenario.duration = 1e-6;
    scenario.intruders[0].stiffness = 1e9;
    assert!(simulate(&scenario).is_ok());
}
