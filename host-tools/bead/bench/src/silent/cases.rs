//! The cases, by their causes.

use bead_model::design::{Description, SensorEnds};
use bead_wire::StrikeFlags as Flags;
use hertz_chain::{Material, Scenario, Section, Wall};

use super::case::{Signal, SilentCase};
use super::law::SpringLaw;
use crate::faults::{Planned, PlannedKind};
use crate::tables::Sensors;
use bead_compare::front_end::AnalogFrontEnd;

/// The paper's chain and bead, behind sensors that its strike does not fill.
fn paper(group: &'static str, cause: impl Into<String>, named_by: Flags) -> SilentCase {
    SilentCase {
        group,
        cause: cause.into(),
        named_by,
        scenario: Scenario::paper(),
        bead: 8,
        front_end: AnalogFrontEnd::default(),
        signal: Signal::Chain,
        strikes: 1,
        faults: Vec::new(),
        state: Box::new(|_| {}),
    }
}

impl SilentCase {
    fn stating(mut self, state: impl Fn(&mut Description) + Send + Sync + 'static) -> Self {
        self.state = Box::new(state);
        self
    }

    fn on(mut self, change: impl FnOnce(&mut Scenario)) -> Self {
        change(&mut self.scenario);
        self
    }

    fn feeling(self, signal: Signal) -> Self {
        Self { signal, ..self }
    }

    fn strong(self) -> Self {
        Self {
            front_end: Sensors::Strong.front_end(),
            ..self
        }
    }
}

/// Every case.
pub fn cases() -> Vec<SilentCase> {
    let groups = [
        waves(),
        supplies(),
        windows(),
        beads(),
        trains(),
        neighbours(),
        sensors(),
        springs(),
    ];
    groups.into_iter().flatten().collect()
}

/// Waves that follow each other too closely.
fn waves() -> Vec<SilentCase> {
    let named = Flags::ANOTHER_WAVE
        .with(Flags::WINDOW_CUT)
        .with(Flags::NOT_AT_REST);
    let gaps = [
        0.5, 1.0, 2.0, 3.0, 4.0, 4.4, 4.5, 4.7, 5.0, 5.5, 6.0, 6.7, 7.5, 8.0, 10.0,
    ];
    let mut cases: Vec<_> = gaps
        .iter()
        .map(|gap| {
            paper("second wave", format!("two equal strikes {gap} ms apart"), named)
                .feeling(Signal::Twice(gap * 1e-3))
        })
        .collect();
    for (bead, velocity) in [(7, 0.45), (8, 0.7)] {
        let cause = format!("a wall behind bead 16, bead {bead} at {velocity} m/s");
        let case = paper("second wave", cause, named).on(|scenario| {
            scenario.wall = Some(Wall::flat(Material::STEEL));
            scenario.striker.velocity = velocity;
            scenario.intruders[0].beads = vec![bead];
        });
        cases.push(SilentCase { bead, ..case });
    }
    cases
}

/// The supply, which sets the gain.
fn supplies() -> Vec<SilentCase> {
    [3.27, 3.2, 3.1, 3.0, 2.95]
        .map(|volts| {
            let fault = Planned {
                kind: PlannedKind::Supply,
                at: 1e-3,
                duration: None,
                volts: Some(volts),
            };
            let case = paper("supply", format!("{volts} V instead of 3.3 V"), Flags::SUPPLY_OFF);
            SilentCase {
                faults: vec![fault],
                ..case
            }
        })
        .into()
}

/// Intruders that ring beyond the window.
fn windows() -> Vec<SilentCase> {
    [1.0, 2.0, 3.0, 5.0]
        .map(|damping| {
            let named = Flags::RINGING_LEFT;
            paper("window", format!("c = {damping} N·s/m rings on"), named).on(|scenario| {
                scenario.intruders[0].damping = damping;
                scenario.duration = 0.04;
            })
        })
        .into()
}

/// Beads that are not what their settings say.
fn beads() -> Vec<SilentCase> {
    let named = Flags::MODEL_DIFFERS
        .with(Flags::INTRUDER_DRIFTED)
        .with(Flags::DRIFTING);
    let mut cases = Vec::new();
    for part in [-0.05, -0.03, 0.03, 0.05] {
        let percent = 100.0 * part;
        cases.push(
            paper("intruder", format!("k {percent:+} %"), named)
                .stating(move |stated| stated.intruder.stiffness /= 1.0 + part),
        );
        cases.push(
            paper("intruder", format!("m {percent:+} %"), named)
                .stating(move |stated| stated.intruder.mass /= 1.0 + part),
        );
    }
    cases.push(paper("intruder", "c +20 %", named).stating(|stated| stated.intruder.damping /= 1.2));
    cases.push(paper("intruder", "c -20 %", named).stating(|stated| stated.intruder.damping /= 0.8));
    cases
}

/// Trains of waves, with right settings.
fn trains() -> Vec<SilentCase> {
    let strikers = [
        (19.0, 0.45),
        (19.0, 0.5),
        (19.0, 0.55),
        (19.0, 0.6),
        (25.0, 0.4),
        (30.0, 0.4),
        (40.0, 0.2),
        (1.0, 5.0),
        (4.5, 5.0),
        (11.5, 0.1),
    ];
    let train = |&(radius, velocity): &(f64, f64)| {
        let cause = format!("a steel striker of {radius} mm at {velocity} m/s, 30 beads");
        let case = paper("train", cause, Flags::WAVE_TRAIN);
        // Its wave is too faint for the strong sensors: 0.4 N.
        let is_faint = radius < 2.0;
        let case = if is_faint { case } else { case.strong() };
        case.on(|scenario| {
            scenario.chain.beads = 30;
            (scenario.striker.radius, scenario.striker.velocity) = (radius * 1e-3, velocity);
            scenario.duration = 0.012;
        })
    };
    let mut cases: Vec<_> = strikers.iter().map(train).collect();
    cases.push(
        paper(
            "train",
            "a row of ten intruders, a striker of 25 mm at 0.4 m/s",
            Flags::WAVE_TRAIN,
        )
        .strong()
        .on(|scenario| {
            scenario.intruders[0].beads = (7..=16).collect();
            (scenario.striker.radius, scenario.striker.velocity) = (0.025, 0.4);
            scenario.chain.beads = 30;
            scenario.duration = 0.012;
        }),
    );
    cases
}

/// Neighbours that are not like the host, as the settings say.
fn neighbours() -> Vec<SilentCase> {
    let named = Flags::WAVE_TRAIN;
    let steel = |beads: &[usize]| {
        let mut section = Section::of(beads.iter().copied());
        let Material {
            density,
            young,
            poisson,
            ..
        } = Material::STEEL;
        (section.density, section.young, section.poisson) = (Some(density), Some(young), Some(poisson));
        section
    };
    let round = |beads: std::ops::RangeInclusive<usize>, radius: f64| {
        let mut section = Section::of(beads);
        section.radius = Some(radius);
        section
    };
    let with = |cause: &str, sections: Vec<Section>| {
        paper("neighbour", cause, named)
            .strong()
            .on(|scenario| scenario.sections = sections)
    };
    let taper = (9..=16).map(|bead: usize| round(bead..=bead, 0.019 * 0.99_f64.powi(bead as i32 - 8)));
    let wall = |behind: usize| {
        paper(
            "neighbour",
            format!("a wall {behind} beads behind"),
            named.with(Flags::ANOTHER_WAVE).with(Flags::WINDOW_CUT),
        )
        .strong()
        .on(|scenario| {
            scenario.chain.beads = 8 + behind;
            scenario.wall = Some(Wall::flat(Material::STEEL));
        })
    };
    vec![
        with("one steel bead right behind", vec![steel(&[9])]),
        with("steel beads at 10, 12, 14 and 16", vec![steel(&[10, 12, 14, 16])]),
        with("a taper of 1 % a bead", taper.collect()),
        with("beads of 10 mm behind", vec![round(9..=16, 0.01)]),
        wall(5),
        wall(3),
        // Under a static load even a quiet end answers at once, so the chain is long.
        paper("neighbour", "a static load of 5 N, 60 beads", named)
            .strong()
            .on(|scenario| {
                scenario.chain.beads = 60;
                scenario.chain.precompression = 5.0;
            }),
        paper("neighbour", "an intruder of 12 g alone", Flags::NONE)
            .strong()
            .on(|scenario| scenario.intruders[0].mass = 12e-3),
        paper("neighbour", "a row of intruders of 12 g", named)
            .strong()
            .on(|scenario| {
                scenario.intruders[0].beads = (7..=16).collect();
                scenario.intruders[0].mass = 12e-3;
            }),
    ]
}

/// Sensors that clip before the converter, wrong gains, and a start that is not at rest.
fn sensors() -> Vec<SilentCase> {
    let drift = Flags::DRIFTING
        .with(Flags::GAINS_DIFFER)
        .with(Flags::MODEL_DIFFERS);
    let wide = paper("sensor", "both low gains 1.9 % too high", drift).stating(|stated| {
        stated.force.wide_per_code *= 1.019;
        stated.acceleration.wide_per_code *= 1.019;
    });
    let wide = SilentCase { strikes: 20, ..wide }.on(|scenario| scenario.striker.velocity = 2.0);
    let rest = |damping: f64| {
        let named = Flags::NOT_AT_REST
            .with(Flags::ANOTHER_WAVE)
            .with(Flags::WINDOW_CUT);
        paper(
            "start",
            format!("the second of two strikes 8 ms apart, c = {damping} N·s/m"),
            named,
        )
        .feeling(Signal::Twice(8e-3))
        .on(|scenario| {
            scenario.intruders[0].damping = damping;
            scenario.duration = 0.04;
        })
    };
    vec![
        paper(
            "sensor",
            "both sensors end at 90 % of the peaks",
            Flags::SENSOR_END,
        )
        .feeling(Signal::Clipped([5.8, 175.0]))
        .stating(|stated| {
            stated.sensor_end = Some(SensorEnds {
                force: Some(5.8),
                acceleration: Some(175.0),
            });
        }),
        wide,
        rest(1.0),
        rest(2.0),
    ]
}

/// Springs that no settings can state.
fn springs() -> Vec<SilentCase> {
    let named = Flags::MODEL_DIFFERS
        .with(Flags::INTRUDER_DRIFTED)
        .with(Flags::DRIFTING);
    // Stroke and spring force of the paper's strike.
    let (stroke, force) = (1.9e-6, 0.75);
    let law = |cause: &str, law| paper("spring", cause, named).feeling(Signal::Law(law));
    let hardening = |part| SpringLaw::Hardening { part, stroke };
    vec![
        law("hardening of 5 % at peak stroke", hardening(0.05)),
        law("hardening of 20 % at peak stroke", hardening(0.2)),
        law("softening of 20 % at peak stroke", hardening(-0.2)),
        law(
            "friction of 5 % of the peak force",
            SpringLaw::Friction(0.05 * force),
        ),
        law(
            "a Maxwell arm of 10 % of k, 50 µs",
            SpringLaw::Maxwell {
                part: 0.1,
                time: 50e-6,
            },
        ),
    ]
}
