//! The options of `bead optimise`, the search that they ask for, and its run.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

use hertz_chain::{
    Aim, Catalogue, InputError, Intruder, Objective, OptimiseError, Optimum, Search, SearchProgress, Sizes,
    Spread, optimise,
};

use bead_console::beads::BeadNumbers;
use bead_console::prelude::*;

const AFTER_HELP: &str = "\
The energy that remains is the share of the injected energy that the intruders have not dissipated by the end \
of the run: what they still hold, what was reflected and transmitted, and what the contacts lost. The scenario's \
duration is that of a strike at the scenario's speed V. A strike at speed v runs (V/v)^(1/5) times as long: \
in that time its wave travels as far, unless the chain is under a load. The duration must let the whole wave pass \
the hosts, and the chain must be so long that nothing comes back; the result shows whether both hold.

Intruders that leave the least energy are not those that protect best. --objective chooses what is made small:
  remaining         the share of the injected energy that the intruders have not dissipated
  force:13          the greatest force of contact 13, N
  energy-behind:13  the energy of the beads behind bead 13 at the end of the run, J
  impulse:13        the impulse that contact 13 passes on, N·s
Each value is divided by the value without intruders; of several strikes, the mean (or the worst) of these ratios \
counts.

--spread looks for a robust design: the one whose worst value is least while stiffness and damping of all \
intruders deviate together, as those of a batch do. The optimum without the spread is found first, and both \
are compared.

--stroke limits how far each intruder may move from rest in its bead.

--catalogue chooses springs that can be bought. The file has a [[spring]] for each, with name and stiffness in \
N/m, and if known also damping (N·s/m) or loss_factor, mass of the intruder (kg), stroke (m). \
The optimum with free stiffnesses is found first; then springs are exchanged until no exchange improves the result.

--hosts-at-most limits how many of the beads hold an intruder; the search chooses which.

--radii lets the sizes of some beads vary too, hosts or not, each by itself: 10-16:0.012:0.022 varies the radii of \
beads 10 to 16 from 12 to 22 mm. Their material and the intruders' masses stay as they are.

Examples:
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-16 \\
      --total-mass 0.037
  bead optimise docs/scenarios/ten-intruders.toml --bead 7,9,11 \\
      --total-mass 0.03 --mass 0.001:0.02 --out best.toml
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-16 \\
      --total-mass 0.12 --velocity 0.1,1,10 --worst
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-9 \\
      --total-mass 0.004,0.008,0.016,0.032 --picture front.svg
  bead optimise docs/scenarios/paper-strike.toml --bead 5,7,8 \\
      --total-mass 0.03 --objective force:13 --loss-factor 0.2
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-9 \\
      --total-mass 0.03 --stroke 6e-6
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-9 \\
      --total-mass 0.03 --catalogue docs/scenarios/springs.toml
  bead optimise docs/scenarios/ten-intruders.toml --bead 5-16 \\
      --total-mass 0.03 --hosts-at-most 3
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-9 \\
      --total-mass 0.03 --radii 4-12:0.012:0.022
  bead optimise docs/scenarios/ten-intruders.toml --bead 7-9 \\
      --total-mass 0.12 --spread stiffness:15%,damping:30%
  bead simulate best.toml";

/// Arguments of `bead optimise`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// The scenario, a TOML file in SI units. Its own intruders serve only for comparison.
    pub(super) scenario: PathBuf,
    /// The beads that hold an intruder each, or may hold one (--hosts-at-most), such as 7-16 or 7,9,12-14;
    /// `all` names the hosts of the scenario.
    #[arg(long, value_name = "BEADS")]
    pub(super) bead: BeadNumbers,
    /// Greatest mass of all intruders together, kg; several give a front, the best design at each.
    #[arg(long, value_name = "KG,…", value_delimiter = ',', required = true)]
    pub(super) total_mass: Vec<f64>,
    /// Least and greatest mass of each intruder, kg [default: up to half the lightest host].
    #[arg(long, value_name = "LOW:HIGH", value_parser = bounds)]
    pub(super) mass: Option<Limits>,
    /// Least and greatest stiffness, N/m [default: five decades about the stiffness that fits the strike].
    #[arg(long, value_name = "LOW:HIGH", value_parser = bounds)]
    pub(super) stiffness: Option<Limits>,
    /// Least and greatest damping, N·s/m [default: three decades about the damping that fits the strike].
    #[arg(long, value_name = "LOW:HIGH", value_parser = bounds)]
    pub(super) damping: Option<Limits>,
    /// Loss factor c/√(k m) of all intruders, in place of a free damping: one material for all springs.
    #[arg(long, value_name = "ETA", conflicts_with = "damping")]
    pub(super) loss_factor: Option<f64>,
    /// Greatest displacement of an intruder in its bead, m, at every velocity and corner of the spread.
    #[arg(long, value_name = "M")]
    pub(super) stroke: Option<f64>,
    /// A TOML file of springs, of which each intruder gets one.
    #[arg(long, value_name = "F.toml")]
    pub(super) catalogue: Option<PathBuf>,
    /// Greatest number of the beads that hold an intruder; the search chooses them.
    #[arg(long, value_name = "N")]
    pub(super) hosts_at_most: Option<usize>,
    /// Beads whose radii may vary too, each by itself, with the least and the greatest in m.
    #[arg(long, value_name = "BEADS:LOW:HIGH", value_parser = radii)]
    pub(super) radii: Option<(BeadNumbers, Limits)>,
    /// Quantity to make small: remaining, force:CONTACT, energy-behind:BEAD, impulse:CONTACT.
    #[arg(long, value_name = "WHAT", default_value = "remaining")]
    pub(super) objective: Objective,
    /// Deviations of all intruders' stiffness and damping that the design must tolerate, such as
    /// stiffness:15%,damping:30%: judge by the worst of their corners.
    #[arg(long, value_name = "SPREAD")]
    pub(super) spread: Option<Spread>,
    /// Velocities of the striker, m/s [default: the scenario's].
    #[arg(long, value_name = "M/S,…", value_delimiter = ',')]
    pub(super) velocity: Vec<f64>,
    /// Judge by the worst of these strikes, not by their mean.
    #[arg(long, requires = "velocity")]
    pub(super) worst: bool,
    /// Make all intruders alike.
    #[arg(long)]
    pub(super) alike: bool,
    /// Greatest number of designs to try, each at every velocity and corner of the spread, a gradient
    /// counting as four; as many again for --spread, --catalogue and --hosts-at-most.
    #[arg(long, value_name = "N", default_value_t = 200_000)]
    pub(super) evaluations: usize,
    /// Write the scenario with the intruders found to this file, for `bead simulate`.
    #[arg(long, value_name = "F.toml")]
    pub(super) out: Option<PathBuf>,
    /// Draw the front to this file.
    #[arg(long, value_name = "F.svg")]
    pub(super) picture: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

pub(super) type Limits = [f64; 2];

fn bounds(text: &str) -> Result<Limits, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok();
    let parts = text.split_once(':');
    let bounds = parts.and_then(|(low, high)| Some([number(low)?, number(high)?]));
    bounds.ok_or_else(|| "write the bounds as LOW:HIGH, such as 1e4:1e6".to_owned())
}

fn radii(text: &str) -> Result<(BeadNumbers, Limits), String> {
    let (beads, limits) = text
        .split_once(':')
        .ok_or("write the beads and their bounds as BEADS:LOW:HIGH, such as 10-16:0.012:0.022")?;
    Ok((beads.parse()?, bounds(limits)?))
}

/// The search that the options ask for, checked.
pub(super) fn search(arguments: &Arguments, scenario: &Scenario, mass: f64) -> Result<Search, Failure> {
    let hosts = arguments.bead.listed(scenario)?;
    let mut search = Search::new(scenario, hosts, mass).map_err(refusal)?;
    if let Some((beads, radius)) = &arguments.radii {
        let sizes = Sizes {
            beads: beads.listed(scenario)?,
            radius: *radius,
        };
        search.vary_sizes(scenario, sizes).map_err(refusal)?;
    }
    search.mass = arguments.mass.unwrap_or(search.mass);
    search.stiffness = arguments.stiffness.unwrap_or(search.stiffness);
    search.damping = arguments.damping.unwrap_or(search.damping);
    search.loss_factor = arguments.loss_factor;
    search.stroke = arguments.stroke;
    search.hosts_at_most = arguments.hosts_at_most;
    let catalogue = arguments.catalogue.as_deref().map(Catalogue::load);
    search.catalogue = catalogue.transpose().map_err(Failure::input)?;
    search.objective = arguments.objective;
    search.hosts.sort_unstable();
    search.speeds.clone_from(&arguments.velocity);
    search.aim = if arguments.worst { Aim::Worst } else { Aim::Mean };
    search.spread = arguments.spread.unwrap_or_default();
    search.alike = arguments.alike;
    search.evaluations = arguments.evaluations;
    search.check(scenario).map_err(refusal)?;
    Ok(search)
}

/// Searches, with a progress bar whose text begins with `begins`. Ctrl-C ends the search with the best so
/// far.
pub(super) fn find(scenario: &Scenario, search: &Search, begins: &str) -> Result<Optimum, Failure> {
    let bar = output::progress(search.evaluations as u64);
    let stop = interrupt::orderly("the search did not end in time and nothing was written".to_owned());
    let remains = match search.objective {
        Objective::Remaining => "remains",
        _ => "of that without intruders",
    };
    let watch = |sofar: SearchProgress| {
        bar.set_position(sofar.evaluations as u64);
        if let Some(best) = sofar.best {
            let (best, descents) = (100.0 * best, sofar.descents);
            bar.set_message(format!(
                "{begins}designs; {best:.4} % {remains}, descent {descents}"
            ));
        }
        if stop.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    };
    let optimum = optimise(scenario, search, Some(&watch)).map_err(refusal)?;
    bar.finish_and_clear();
    Ok(optimum)
}

pub(super) fn name(objective: Objective) -> String {
    match objective {
        Objective::Force(contact) => format!("force of contact {contact}"),
        Objective::EnergyBehind(bead) => format!("energy behind bead {bead}"),
        Objective::Impulse(contact) => format!("impulse of contact {contact}"),
        _ => "energy that remains".to_owned(),
    }
}

/// Turns an error of a search into a failure that names the option in place of the search's field.
fn refusal(error: OptimiseError) -> Failure {
    match error {
        OptimiseError::Search(InputError {
            key, what, advice, ..
        }) => {
            let option = match &*key {
                "hosts" => "bead".to_owned(),
                "speeds" => "velocity".to_owned(),
                "sizes" => "radii".to_owned(),
                key => key.replace('_', "-"),
            };
            failure!(Input, "--{option}: {what}; {advice}")
        }
        other => Failure::input(other),
    }
}

pub(super) fn total_mass(intruders: &[Intruder]) -> f64 {
    let mass = |intruder: &Intruder| intruder.mass * intruder.beads.len() as f64;
    intruders.iter().map(mass).sum()
}

pub(super) fn percent(share: f64) -> String {
    format!("{:.2}", 100.0 * share)
}
