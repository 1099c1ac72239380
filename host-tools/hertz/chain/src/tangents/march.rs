//! Integration of motion and tangents together, by Runge and Kutta's method of order 4 in equal steps.
//!
//! # Design
//! The steps are equal because samples are, and because a step that depended on the motion would have a
//! derivative of its own. Bodies that no wave has reached are left out. The loop is compiled for the widest
//! vectors of the processor too, and its derivatives side by side fill them; results have the same bits
//! everywhere, since the order of additions never changes.

use pulp::{Arch, NullaryFnOnce};

use super::chain::{DualChain, DualIntruder};
use super::dual::Dual;
use super::sensor::{Push, Sensor, SensorPlace};

/// Places of the parts of a state: displacements and momenta of the bodies, displacements and velocities of
/// the intruders, and two values of each sensor's low-pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    bodies: usize,
    intruders: usize,
    sensors: usize,
}

impl Layout {
    pub(super) fn momentum(self, body: usize) -> usize {
        self.bodies + body
    }

    pub(super) fn place(self, intruder: usize) -> usize {
        2 * self.bodies + intruder
    }

    pub(super) fn velocity(self, intruder: usize) -> usize {
        2 * self.bodies + self.intruders + intruder
    }

    fn filter(self, sensor: usize) -> usize {
        2 * (self.bodies + self.intruders) + sensor
    }

    /// The low-pass of the host's velocity, for the front mass.
    fn front(self, sensor: usize) -> usize {
        self.filter(self.sensors) + sensor
    }

    pub(super) fn length(self) -> usize {
        self.front(self.sensors)
    }
}

/// A run with what it needs in each step.
pub(super) struct March<'a, const P: usize> {
    pub(super) chain: &'a DualChain<P>,
    sensors: &'a [Sensor],
    push: Option<&'a Push>,
    step: f64,
    pub(super) layout: Layout,
    pub(super) state: Vec<Dual<P>>,
    /// Rates of the four stages' sum, of one stage, and the argument of a stage.
    sum: Vec<Dual<P>>,
    pub(super) rates: Vec<Dual<P>>,
    pub(super) argument: Vec<Dual<P>>,
    /// Hertz' force of each contact, at index j, and the velocity of each body, of the last evaluation.
    forces: Vec<Dual<P>>,
    pub(super) velocities: Vec<Dual<P>>,
    /// The first body that moves, and the last that a wave has reached.
    first: usize,
    pub(super) front: usize,
}

impl<'a, const P: usize> March<'a, P> {
    pub(super) fn new(
        chain: &'a DualChain<P>,
        sensors: &'a [Sensor],
        push: Option<&'a Push>,
        step: f64,
    ) -> Self {
        let layout = Layout {
            bodies: chain.bodies(),
            intruders: chain.intruders.len(),
            sensors: sensors.len(),
        };
        let mut state = vec![Dual::default(); layout.length()];
        let first = push.map_or(0, |push| push.bead);
        let mut front = first;
        for (body, &(place, velocity)) in chain.starts.iter().enumerate().skip(first) {
            state[body] = Dual::constant(place);
            if push.is_none() {
                state[layout.momentum(body)] = chain.shells[body] * velocity;
                if velocity.value != 0.0 {
                    front = front.max(body);
                }
            }
        }
        for (number, intruder) in chain.intruders.iter().enumerate() {
            let (place, velocity) = chain.starts[intruder.body];
            state[layout.place(number)] = Dual::constant(place);
            if push.is_none() {
                state[layout.velocity(number)] = velocity;
            }
        }
        Self {
            chain,
            sensors,
            push,
            step,
            layout,
            sum: state.clone(),
            rates: state.clone(),
            argument: state.clone(),
            state,
            forces: vec![Dual::default(); chain.contacts.len() + 2],
            velocities: vec![Dual::default(); chain.bodies()],
            first,
            front,
        }
    }

    /// Makes `steps` steps. Returns the signals of each sensor at their starts.
    pub(super) fn run(self, steps: usize) -> Vec<Vec<Dual<P>>> {
        Arch::new().dispatch(MarchCall { march: self, steps })
    }

    /// The last body that the next step may move.
    #[inline(always)]
    pub(super) fn last(&self) -> usize {
        (self.front + 1).min(self.layout.bodies - 1)
    }

    /// Computes forces, velocities and rates of the motion, at time `t` and the motion `argument`.
    #[inline(always)]
    pub(super) fn evaluate(&mut self, t: f64) {
        let (layout, last) = (self.layout, self.last());
        let Self {
            chain,
            argument,
            forces,
            velocities,
            rates,
            ..
        } = self;
        let places = &argument[..layout.bodies];
        let inner = self
            .first
            .max(if self.push.is_some() { self.first + 1 } else { 1 });
        let end = (last + 1).min(chain.contacts.len());
        for (j, force) in forces.iter_mut().enumerate().take(end + 1).skip(inner) {
            *force = chain.force(places, j);
        }
        for body in self.first..=last {
            let mut momentum = argument[layout.momentum(body)];
            if body >= inner {
                momentum += chain.contacts[body - 1].relaxation * forces[body];
            }
            if let Some(contact) = chain.contacts.get(body) {
                momentum -= contact.relaxation * forces[body + 1];
            }
            velocities[body] = momentum * chain.inverse_shells[body];
            rates[body] = velocities[body];
            let pushed = match self.push {
                Some(push) if body == self.first => chain.push_gain * push.at(t),
                _ if body == 0 => Dual::default(),
                _ => forces[body],
            };
            rates[layout.momentum(body)] = pushed - forces[body + 1];
            if let Some(drags) = &chain.drags {
                rates[layout.momentum(body)] -= drags[body] * velocities[body];
            }
        }
        for (number, intruder) in chain.intruders.iter().enumerate() {
            if !(self.first..=last).contains(&intruder.body) {
                continue;
            }
            let velocity = argument[layout.velocity(number)];
            let (way, rate) = (
                argument[layout.place(number)] - argument[intruder.body],
                velocity - velocities[intruder.body],
            );
            let pull = DualChain::pull(intruder, way, rate);
            rates[layout.momentum(intruder.body)] += pull;
            rates[layout.place(number)] = velocity;
            rates[layout.velocity(number)] = -(pull * intruder.inverse_mass);
        }
        for (number, sensor) in self.sensors.iter().enumerate() {
            let pole = sensor.pole * std::f64::consts::TAU;
            let filter = layout.filter(number);
            match sensor.place {
                SensorPlace::Force(contact) => {
                    let host = contact.min(layout.bodies - 1);
                    let force = forces[contact];
                    let jump = chain.contacts[contact - 1].relaxation * force * pole;
                    rates[filter] = (force - argument[filter] - jump) * pole;
                    let front = layout.front(number);
                    rates[front] = (velocities[host] - argument[front]) * pole;
                }
                SensorPlace::Acceleration(_) => {
                    let acceleration = sensor_intruder(chain, sensor)
                        .map_or_else(Dual::default, |number| rates[layout.velocity(number)]);
                    rates[filter] = (acceleration - argument[filter]) * pole;
                }
            }
        }
    }

    /// Force of a contact beyond its static load, N, at the motion of the last evaluation.
    #[inline(always)]
    pub(super) fn force(&self, contact: usize) -> Dual<P> {
        let bodies = self.layout.bodies;
        let far = if contact < bodies {
            self.velocities[contact]
        } else {
            Dual::default()
        };
        let rate = self.velocities[contact - 1] - far;
        let places = &self.argument[..bodies];
        self.forces[contact] + self.chain.viscosity(places, contact) * rate
    }

    /// The momentum w of a body with this velocity, kg·m/s, where `argument` has the displacements.
    #[inline(always)]
    pub(super) fn momentum(&self, body: usize, velocity: f64) -> f64 {
        let chain = self.chain;
        let viscous = |contact: usize| {
            let contact_of = &chain.contacts[contact - 1];
            contact_of.relaxation.value * chain.force_value(&self.argument, contact)
        };
        let before = if body > 0 { viscous(body) } else { 0.0 };
        let after = if body < chain.contacts.len() {
            viscous(body + 1)
        } else {
            0.0
        };
        chain.shells[body].value * velocity - before + after
    }

    /// Appends the signal of each sensor at the motion of the last evaluation to its row.
    #[inline(always)]
    fn sense(&self, rows: &mut [Vec<Dual<P>>]) {
        let (layout, chain) = (self.layout, self.chain);
        for (row, (number, sensor)) in rows.iter_mut().zip(self.sensors.iter().enumerate()) {
            let filtered = self.argument[layout.filter(number)];
            row.push(match sensor.place {
                SensorPlace::Force(contact) => {
                    let host = contact.min(layout.bodies - 1);
                    let pole = sensor.pole * std::f64::consts::TAU;
                    if sensor.pole > 0.0 {
                        let jump = chain.contacts[contact - 1].relaxation * self.forces[contact] * pole;
                        let inertia = (self.velocities[host] - self.argument[layout.front(number)]) * pole;
                        filtered + jump - inertia * sensor.front_mass
                    } else {
                        self.force(contact)
                    }
                }
                SensorPlace::Acceleration(_) if sensor.pole > 0.0 => filtered,
                SensorPlace::Acceleration(_) => sensor_intruder(chain, sensor)
                    .map_or_else(Dual::default, |number| self.rates[layout.velocity(number)]),
            });
        }
    }

    /// Makes a step from `t`, and appends the signals at its start to the rows.
    #[inline(always)]
    fn advance(&mut self, t: f64, rows: &mut [Vec<Dual<P>>]) {
        const NODES: [f64; 4] = [0.0, 0.5, 0.5, 1.0];
        const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
        self.argument.copy_from_slice(&self.state);
        for (stage, (node, weight)) in NODES.into_iter().zip(WEIGHTS).enumerate() {
            self.evaluate(t + node * self.step);
            if stage == 0 {
                self.sense(rows);
                self.sum.copy_from_slice(&self.state);
            }
            let next = NODES.get(stage + 1).map(|node| node * self.step);
            self.each_moving(|march, at| {
                let rate = march.rates[at];
                march.sum[at].add_scaled(rate, weight * march.step);
                if let Some(next) = next {
                    let mut argument = march.state[at];
                    argument.add_scaled(rate, next);
                    march.argument[at] = argument;
                }
            });
        }
        self.state.copy_from_slice(&self.sum);
        let last = self.last();
        if self.state[last].value != self.chain.starts[last].0 {
            self.front = last;
        }
    }

    /// Calls a function for each value of the state that moves.
    #[inline(always)]
    fn each_moving(&mut self, mut visit: impl FnMut(&mut Self, usize)) {
        let (layout, last) = (self.layout, self.last());
        for body in self.first..=last {
            visit(self, body);
            visit(self, layout.momentum(body));
        }
        for at in layout.place(0)..layout.length() {
            visit(self, at);
        }
    }
}

/// A run, compiled for each kind of vectors.
struct MarchCall<'a, const P: usize> {
    march: March<'a, P>,
    steps: usize,
}

impl<const P: usize> NullaryFnOnce for MarchCall<'_, P> {
    type Output = Vec<Vec<Dual<P>>>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { mut march, steps } = self;
        let mut rows = vec![Vec::with_capacity(steps); march.sensors.len()];
        for number in 0..steps {
            march.advance(number as f64 * march.step, &mut rows);
        }
        rows
    }
}

/// Number of the intruder whose acceleration a sensor measures.
#[inline(always)]
fn sensor_intruder<const P: usize>(chain: &DualChain<P>, sensor: &Sensor) -> Option<usize> {
    let SensorPlace::Acceleration(bead) = sensor.place else {
        return None;
    };
    let is_here = |intruder: &DualIntruder<P>| intruder.body == bead;
    chain.intruders.iter().position(is_here)
}
