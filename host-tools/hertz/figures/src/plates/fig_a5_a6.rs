//! Figures A5 and A6: the experiment's strikers, on a chain with four hosts and on one without.

use std::sync::Arc;

use hertz_chain::{PulseSearch, Scenario};

use crate::check::checks;
use crate::curve::{dashed, force_over_time, line, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{
    greatest_within, half_power, least_growth, magnitudes, peak, pulse_spectrum, ratio, train,
};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, MASS, STIFFNESS, VISCOUS, intruder, strike, with};
use hertz_charts::{Axis, Chart, Panel, Series};

plans! {
    "A5": "force at contact 12 behind four intruders, three stiff strikers and a soft one"; FOUR_HOSTS => four_hosts,
    "A6a": "force at contacts 6 and 11, three stiff strikers and a soft one"; STRIKERS => forces,
    "A6b": "spectra of the waves at contacts 6 and 11, three stiff strikers and a soft one";
        STRIKERS => spectra,
}

/// Steel balls of the experiment's size and larger, radius in m.
const RADII: [f64; 3] = [0.0045, 0.0065, 0.0095];

const FOUR_HOSTS: &str = "16 beads, τ = 4.2 µs, intruders m 3.7 g, k 3.95e5 N/m, c 12 N·s/m in beads 4 to 7, 0.45 m/s: \
                          steel balls of R 4.5, 6.5, 9.5 mm, and a polymer ball of R 19 mm, 1100 kg/m³, 20 MPa, ν 0.45";

fn four_hosts(lab: &Lab) -> Result<Figure, Error> {
    const CONTACT: usize = 12;
    let mut panels = Vec::new();
    let mut losses = Vec::new();
    let mut second = f64::NAN;
    for (place, (name, plain)) in strikers(&strike(16, VISCOUS, 0.008)).into_iter().enumerate() {
        let hosts = intruder(4..=7, MASS, STIFFNESS, DAMPING);
        let (before, after) = (lab.run(&plain)?, lab.run(&with(plain, hosts))?);
        losses.push(100.0 * (1.0 - peak(&after, CONTACT) / peak(&before, CONTACT)));
        // The soft ball pushes for longer.
        let span = if place < RADII.len() {
            1.4e-3..3.4e-3
        } else {
            1.4e-3..6e-3
        };
        let force = |run: &FigureRun| force_over_time(&run.solution, &span, CONTACT);
        let [without, behind] = if place == 0 {
            ["no intruders", "four intruders"]
        } else {
            [""; 2]
        };
        let curves = vec![
            dashed(without, place, force(&before)),
            line(behind, place, force(&after)),
        ];
        // The second pulse of the soft ball: it has not yet parted from the first.
        let later = |series: &Series| greatest_within(&series.points, 3.2..3.7);
        second = 100.0 * (1.0 - later(&curves[1]) / later(&curves[0]));
        let panel = Panel::new("force (N)", curves).height(150).note(name);
        let axis_follows = place + 1 >= RADII.len();
        panels.push(if axis_follows {
            panel.over(time_axis(span))
        } else {
            panel
        });
    }
    let checks = checks![
        "loss of force, least growth from size to size": least_growth(&losses[..3]) => at_least(1.3);
        "loss of force, R = 4.5 mm", "%": losses[0] => at_least(4.0);
        "loss of force, polymer ball's first pulse", "%": losses[3] => at_most(1.0);
        "loss of force, polymer ball's second pulse", "%": second => at_least(5.0);
    ];
    Ok(Figure::over(time_axis(1.4e-3..3.4e-3), panels, checks))
}

const STRIKERS: &str = "16 beads, τ = 4.2 µs, 0.45 m/s: steel balls of R 4.5, 6.5, 9.5 mm, and a polymer ball of R 19 mm, \
                        1100 kg/m³, 20 MPa, ν 0.45";
/// The first and the last contact at which the paper measured (Fig. 2a). For Fig. A6 it names neither.
const NEAR: usize = 6;
const FAR: usize = 11;

/// The experiment's strikers on a chain: three of steel, and a soft one.
fn strikers(chain: &Scenario) -> Vec<(String, Scenario)> {
    let steel = RADII.into_iter().map(|radius| {
        let mut scenario = chain.clone();
        scenario.striker.radius = radius;
        (format!("steel, R = {} mm", 1e3 * radius), scenario)
    });
    let mut soft = chain.clone();
    soft.striker.radius = 0.019;
    soft.striker.density = 1100.0;
    soft.striker.young = 20e6;
    soft.striker.poisson = 0.45;
    steel.chain([("polymer, R = 19 mm".to_owned(), soft)]).collect()
}

fn runs(lab: &Lab) -> Result<Vec<(String, Arc<FigureRun>)>, Error> {
    strikers(&strike(16, VISCOUS, 0.008))
        .into_iter()
        .map(|(name, scenario)| Ok((name, lab.run(&scenario)?)))
        .collect()
}

fn forces(lab: &Lab) -> Result<Figure, Error> {
    let runs = runs(lab)?;
    let span = 0.5e-3..6e-3;
    let panels = runs.iter().enumerate().map(|(place, (name, run))| {
        let force = |contact| force_over_time(&run.solution, &span, contact);
        let curves = vec![
            line(format!("{name}: contact {NEAR}"), place, force(NEAR)),
            dashed(format!("contact {FAR}"), place, force(FAR)),
        ];
        Panel::new("force (N)", curves).height(130)
    });
    // On 16 beads the pulses of the soft ball's train have not parted: the force falls by a fifth between
    // them.
    let humps = PulseSearch {
        height: 0.05,
        fall: 0.1,
        ..PulseSearch::default()
    };
    let pulses = |run: usize| runs[run].1.solution.pulses(FAR, &humps).len() as f64;
    let checks = checks![
        "pulses at contact {FAR} from steel, R = 4.5 mm": pulses(0) => near(1.0, 0.0);
        "pulses at contact {FAR} from the polymer ball": pulses(3) => near(3.0, 0.0);
    ];
    let chart = Chart::new(time_axis(span.clone()), panels.collect());
    Ok(Figure::new(chart, checks))
}

fn spectra(lab: &Lab) -> Result<Figure, Error> {
    let runs = runs(lab)?;
    let axis = Axis::new("frequency (Hz)", 0.0..3000.0);
    let mut panels = Vec::new();
    let mut frequencies = Vec::new();
    for contact in [NEAR, FAR] {
        let mut curves = Vec::new();
        for (place, (name, run)) in runs.iter().enumerate() {
            let Some(first) = train(&run.solution, contact).into_iter().next() else {
                return Err(Error::Missing(format!("no pulse passes contact {contact}")));
            };
            let spectrum = pulse_spectrum(&run.solution, &first);
            frequencies.push(half_power(&spectrum));
            let whole = spectrum.values()[0].norm();
            let name = if contact == NEAR { name.as_str() } else { "" };
            curves.push(told_apart(
                name,
                place,
                magnitudes(&spectrum, 3000.0, 1.0 / whole),
            ));
        }
        let panel = Panel::new(format!("contact {contact}: |S| / impulse"), curves);
        panels.push(panel.log().range(1e-3, 1.5).height(200).over(axis.clone()));
    }
    let (near, far) = frequencies.split_at(runs.len());
    // A wave's clock runs with F^(1/6), and viscosity makes a short wave longer.
    let force = |run: &FigureRun, contact| train(&run.solution, contact)[0].force;
    let scaled = |frequencies: &[f64], contact: usize| {
        let pairs = frequencies.iter().zip(&runs);
        ratio(pairs.map(|(frequency, (_, run))| frequency / force(run, contact).powf(1.0 / 6.0)))
    };
    // The expected numbers are those of an independent program: RK4 at equal steps, and sums for the
    // transforms.
    let checks = checks![
        "-3 dB frequency at contact {NEAR}, stiff: greatest over least":
            ratio(near[..3].to_vec()) => close(1.405_77, 1e-4), paper "does not vary significantly with radius";
        "the same over F^(1/6)": scaled(&near[..3], NEAR) => close(1.032_02, 1e-4);
        "-3 dB frequency at contact {FAR}, stiff: greatest over least":
            ratio(far[..3].to_vec()) => close(1.364_37, 1e-4), paper "does not vary significantly with radius";
        "-3 dB frequency at contact {FAR}: the polymer ball's train over the smallest steel ball's wave":
            far[3] / far[0] => close(0.328_05, 1e-3), paper "nearly insensitive to changes in Young's modulus";
    ];
    Ok(Figure::over(axis, panels, checks))
}
