//! Two equal solitary waves that meet: each leaves a small wave behind it, far smaller if they meet in a
//! sphere than if they meet at a contact. In experiments both are greater, which arXiv:1102.3364 puts down to
//! rolling friction. Here, too, both are greater with a friction in proportion to the contacts' forces. The
//! values with friction are those of an independent program (SciPy's DOP853).

use hertz_chain::{ContactLaw, PulseSearch, Scenario, Start, Striker};
use hertz_charts::Panel;

use crate::check::checks;
use crate::curve::{force_over_time, line, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::ordinates;
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, strike};

plans! {
    "meeting": "force at contact 10 as two solitary waves meet in the middle of 42 and of 41 spheres";
        "42 and 41 equal spheres R 19 mm, τ = 0: the first and the last come in at 0.45 m/s from both ends" => meeting,
}

const CONTACT: usize = 10;
const SPAN: std::ops::Range<f64> = 1e-3..9e-3;
/// Coefficient of friction, and the rate of an overlap, m/s, at which the friction reaches 76 % of its full
/// value.
const FRICTION: (f64, f64) = (0.03, 4.5e-4);

/// A row of spheres of which the first and the last fly towards each other.
fn scenario(spheres: usize) -> Scenario {
    let last = spheres - 1;
    let mut scenario = strike(last, ELASTIC, 0.01);
    let (chain, speed) = (&scenario.chain, scenario.striker.velocity);
    scenario.striker = Striker::new(chain.radius, chain.material(), speed);
    scenario.starts = vec![Start::moving([last], -speed)];
    scenario
}

/// These spheres with friction in all contacts.
fn rubbing(spheres: usize) -> Scenario {
    let (friction, speed) = FRICTION;
    let mut rubbing = scenario(spheres);
    rubbing.contact = Some(ContactLaw::default().rubbing(friction, speed));
    rubbing
}

/// Greatest force behind the second wave, over that of the first to pass, %.
fn behind(run: &FigureRun) -> Result<f64, Error> {
    let pulses = run.solution.pulses(CONTACT, &PulseSearch::default());
    let [first, second, ..] = pulses[..] else {
        return Err(Error::Missing(format!("no second wave passes contact {CONTACT}")));
    };
    let forces = ordinates(&force_over_time(&run.solution, &(second.time..SPAN.end), CONTACT));
    let falls = forces.windows(2).take_while(|pair| pair[1] <= pair[0]).count();
    let greatest = forces[falls..].iter().copied().fold(0.0, f64::max);
    Ok(100.0 * greatest / first.force)
}

fn meeting(lab: &Lab) -> Result<Figure, Error> {
    let [even, odd] = [lab.run(&scenario(42))?, lab.run(&scenario(41))?];
    let [even_rubs, odd_rubs] = [lab.run(&rubbing(42))?, lab.run(&rubbing(41))?];
    let checks = checks![
        "secondary wave, 42 spheres: the waves meet at a contact", "%": behind(&even)? => near(2.62, 0.005);
        "secondary wave, 41 spheres: the waves meet in a sphere", "%": behind(&odd)? => near(0.55, 0.005);
        "with friction in the contacts, 42 spheres", "%": behind(&even_rubs)? => near(3.063, 0.005);
        "with friction in the contacts, 41 spheres", "%": behind(&odd_rubs)? => near(2.680, 0.005);
    ];
    let force = |run: &FigureRun| force_over_time(&run.solution, &SPAN, CONTACT);
    let curves = |(even, odd): (&FigureRun, &FigureRun), named: bool| {
        let name = |name: &str| if named { name.to_owned() } else { String::new() };
        vec![
            line(name("42 spheres"), 0, force(even)),
            told_apart(name("41 spheres"), 1, force(odd)),
        ]
    };
    let magnified = |pair, note: &str| {
        let panel = Panel::new("force at 10 (N)", curves(pair, false));
        panel.range(0.0, 3.5).height(150).note(note)
    };
    let panels = vec![
        Panel::new("force at 10 (N)", curves((&even, &odd), true)).height(150),
        magnified((&even, &odd), "the same, magnified"),
        magnified((&even_rubs, &odd_rubs), "with friction in the contacts, f = 0.03"),
    ];
    Ok(Figure::over(time_axis(SPAN), panels, checks))
}
