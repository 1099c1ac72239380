//! Results of a run with their derivatives with respect to parameters of the scenario.

use std::time::Instant;

use super::chain::DualChain;
use super::dual::Dual;
use super::march::March;
use super::parameter::Parameter;
use super::variation::Variation;
use crate::options::{Options, SimulateError};
use crate::run::Run;
use crate::scenario::{InputError, Scenario};
use crate::summariser::Summariser;
use crate::summary::Summary;

/// The results of a run, each with its derivatives with respect to P parameters, in SI units.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Sensitivities<const P: usize> {
    /// All results, without derivatives.
    pub summary: Summary,
    /// Greatest force of each contact that ever carried one, N: one entry for each of
    /// [`Summary::peak_force`](crate::Summary::peak_force).
    pub peak_force: Vec<Dual<P>>,
    /// Energy that each intruder has dissipated, J, in the order of the beads.
    pub dissipated: Vec<Dual<P>>,
    /// Kinetic energy of the striker at t = 0, J.
    pub striker_initial: Dual<P>,
    /// Kinetic energy of the striker at the end, J.
    pub striker_final: Dual<P>,
    /// Energy of the chain at the end, with M - m for hosts, without intruders, J.
    pub chain_final: Dual<P>,
    /// Energy of the intruders at the end, J.
    pub intruders_final: Dual<P>,
    /// Energy dissipated in contacts, J: what is left in the balance.
    pub dissipated_contacts: Dual<P>,
}

/// Runs a scenario and returns its results with their derivatives with respect to up to P parameters.
///
/// A greatest force has the derivative of the force at the time of its maximum. One that still rises at the
/// end of the run has that of the force at the end. Where two maxima of a contact are equally high, the
/// derivative is that of the first.
///
/// The motion is that of [`summarise`](crate::summarise()). Derivatives are right within 1e-6 of the result
/// over the parameter's value at [`Accuracy::REFERENCE`](crate::Accuracy::REFERENCE).
///
/// # Errors
/// As [`summarise`](crate::summarise()), and [`SimulateError::Input`] if contact forces are clipped, which
/// have no derivative where a contact opens, or more than P parameters are given.
pub fn sensitivities<const P: usize>(
    scenario: &Scenario,
    parameters: &[Parameter],
    options: &Options<'_>,
) -> Result<Sensitivities<P>, SimulateError> {
    let clock = Instant::now();
    if parameters.len() > P {
        let what = format!(
            "{} parameters are given, but there is only room for {P}",
            parameters.len()
        );
        return Err(InputError::at("", what, "give fewer").into());
    }
    let end = options.end(scenario)?;
    let chain = DualChain::<P>::new(scenario, parameters)?;
    let mut run = Run::new(scenario, options.accuracy)?;
    run.check(end, options.accuracy.longest_step)?;
    let mut summariser = Summariser::new(&mut run);
    let mut values = [0.0; P];
    for (value, parameter) in values.iter_mut().zip(parameters) {
        *value = parameter.value(scenario).unwrap_or(0.0);
    }
    let mut variation = Variation::new(&chain, values);
    let mut peaks = vec![Dual::default(); chain.contacts.len()];
    let mut last = None;
    run.watch(end, |step| {
        summariser.observe(step);
        let (from, to) = (step.from(), step.to());
        for (contact, time) in summariser.peaks_after(from) {
            // A force that still rises at the end of a step has its maximum in a later one.
            if time < to || to >= end {
                peaks[contact - 1] = variation.force(step, contact, time);
            }
        }
        variation.follow(step);
        if to >= end {
            last = Some(Energies::of(variation.at_end()));
        }
        options.report(step.number(), to / end);
    })?;
    let mut summary = summariser.summary(&mut run);
    summary.solver.seconds = clock.elapsed().as_secs_f64();
    let peak_force = summary.peak_force.iter().map(|peak| Dual {
        value: peak.force,
        by: peaks[peak.contact - 1].by,
    });
    let mut order: Vec<_> = (0..chain.intruders.len()).collect();
    order.sort_by_key(|&number| chain.intruders[number].body);
    let dissipated = order
        .into_iter()
        .zip(&summary.intruders)
        .map(|(number, intruder)| Dual {
            value: intruder.dissipated,
            by: variation.dissipated(number),
        });
    let dissipated: Vec<_> = dissipated.collect();
    let energies = last.unwrap_or_default();
    let valued = |value: f64, slopes: Dual<P>| Dual { value, ..slopes };
    let energy = &summary.energy;
    let speed = chain.starts[0].1;
    let given = chain.shells[0] * speed * speed * 0.5;
    let mut before = chain.energy_at_start();
    for part in [energies.striker, energies.chain, energies.intruders] {
        before -= part;
    }
    for part in &dissipated {
        before -= *part;
    }
    Ok(Sensitivities {
        peak_force: peak_force.collect(),
        striker_initial: valued(energy.striker_initial, given),
        striker_final: valued(energy.striker_final, energies.striker),
        chain_final: valued(energy.chain_final, energies.chain),
        intruders_final: valued(energy.intruders_final, energies.intruders),
        dissipated_contacts: valued(energy.dissipated_contacts, before),
        dissipated,
        summary,
    })
}

/// Energies at the end of a run, J.
#[derive(Debug, Clone, Copy, Default)]
struct Energies<const P: usize> {
    striker: Dual<P>,
    chain: Dual<P>,
    intruders: Dual<P>,
}

impl<const P: usize> Energies<P> {
    /// Energies at the motion of the last evaluation.
    fn of(march: &March<'_, P>) -> Self {
        let (chain, layout) = (march.chain, march.layout);
        let kinetic = |mass: Dual<P>, velocity: Dual<P>| mass * velocity * velocity * 0.5;
        let places = &march.argument[..chain.bodies()];
        let mut energies = Self {
            striker: kinetic(chain.shells[0], march.velocities[0]),
            ..Self::default()
        };
        for body in 1..chain.bodies() {
            energies.chain += kinetic(chain.shells[body], march.velocities[body]);
        }
        for contact in 1..=chain.contacts.len() {
            energies.chain += chain.elastic_energy(places, contact);
        }
        for (number, intruder) in chain.intruders.iter().enumerate() {
            let velocity = march.argument[layout.velocity(number)];
            let way = march.argument[layout.place(number)] - places[intruder.body];
            energies.intruders += kinetic(intruder.inverse_mass.inverse(), velocity);
            energies.intruders += DualChain::spring_energy(intruder, way);
        }
        energies
    }
}
