//! A model as arrays, with a lane for each body and contact and eight lanes in a block.
//!
//! # Design
//!
//! Body n shares lane n with contact n, which joins bodies n - 1 and n. A wall is a body of infinite mass.
//! Arrays begin one block before lane 0, so a neighbour can always be read. The intruders follow, in the
//! order of their hosts: in the free lanes of the last block of a short chain, or else in blocks of their
//! own.

use std::ops::Range;
use std::sync::Arc;

use pulp::{Simd, f64x8};

use super::aligned::CacheAligned;
use crate::drive::EndDrive;
use crate::model::Model;
use crate::power_law::ContactPowers;

/// Lanes of a block, which are computed together.
pub(crate) const BLOCK: usize = 8;

/// The longest chain, in blocks, whose intruders may share the last block. They move with it.
const SHARED: usize = 4;

/// Index of the first lane of a block in an array.
pub(super) const fn first(block: usize) -> usize {
    (block + 1) * BLOCK
}

/// Values of the eight lanes of a block.
pub(super) type LaneBlock = [f64; BLOCK];

/// Divides an array into blocks.
#[inline(always)]
pub(super) fn blocks(array: &[f64]) -> &[LaneBlock] {
    array.as_chunks().0
}

#[inline(always)]
pub(super) fn blocks_mut(array: &mut [f64]) -> &mut [LaneBlock] {
    array.as_chunks_mut().0
}

/// Selects one or the other value, lane by lane.
#[inline(always)]
pub(super) fn select<S: Simd<f64s = f64x8>>(simd: S, mask: S::m64s, yes: f64x8, no: f64x8) -> f64x8 {
    pulp::cast(simd.select_u64s(mask, pulp::cast(yes), pulp::cast(no)))
}

/// Values of the bodies before, given those of this block and the block before.
#[inline(always)]
pub(super) fn before(previous: f64x8, block: f64x8) -> f64x8 {
    let (p, b): (LaneBlock, LaneBlock) = (pulp::cast(previous), pulp::cast(block));
    pulp::cast([p[7], b[0], b[1], b[2], b[3], b[4], b[5], b[6]])
}

/// Values of the contacts behind, given those of this block and the block behind.
#[inline(always)]
pub(super) fn behind(block: f64x8, next: f64x8) -> f64x8 {
    let (b, n): (LaneBlock, LaneBlock) = (pulp::cast(block), pulp::cast(next));
    pulp::cast([b[1], b[2], b[3], b[4], b[5], b[6], b[7], n[0]])
}

/// Constants of a chain, lane by lane, and its layout in the arrays.
#[derive(Debug, Clone)]
pub(crate) struct Lanes {
    pub(super) bodies: usize,
    pub(super) blocks: usize,
    /// κ, N/m^(3/2); zero where there is no contact.
    pub(super) stiffness: CacheAligned,
    /// (3/2) τ, s.
    pub(super) viscosity: CacheAligned,
    /// 1 / (M - m), 1/kg; zero for the wall.
    pub(super) inverse: CacheAligned,
    /// δ₀, m, its root, and F₀, N.
    pub(super) rest: CacheAligned,
    pub(super) root: CacheAligned,
    pub(super) load: CacheAligned,
    pub(super) guests: Guests,
    pub(super) wall: Option<usize>,
    pub(super) viscous: bool,
    pub(super) clipped: bool,
    pub(super) loaded: bool,
    /// True if the chain is loaded, clipped, driven or dragged, or has springs that are not linear: its steps
    /// are computed by code for all of these.
    pub(super) general: bool,
    /// Coefficients of the ground's drag, N·s/m, in the lanes of the bodies, if it drags.
    pub(super) drag: Option<CacheAligned>,
    /// Drive of the first body.
    pub(super) drive: Option<Arc<EndDrive>>,
    /// Powers of the contacts; `None` if they are Hertz' with a damping exponent of 1/2 and no friction. With
    /// powers, `viscosity` has the coefficients η.
    pub(super) powers: Option<ContactPowers>,
    /// Scales of velocities, m/s, and displacements, m.
    pub(super) speed: f64,
    pub(super) depth: f64,
}

/// The intruders, in the order of their hosts; a carrier precedes those that it carries.
#[derive(Debug, Clone)]
pub(super) struct Guests {
    pub(super) count: usize,
    /// Lane of the first intruder, after those of the bodies.
    first: usize,
    /// Their blocks in an array.
    pub(super) blocks: Range<usize>,
    /// The block of bodies that also holds them, if there is one.
    pub(super) home: Option<usize>,
    /// k, N/m, c, N·s/m, and 1/m, 1/kg, in lanes counted from the first of `blocks`.
    pub(super) stiffness: CacheAligned,
    pub(super) damping: CacheAligned,
    pub(super) inverse: CacheAligned,
    /// k₃, N/m³, in the same lanes, if a spring hardens or softens.
    pub(super) cubic: Option<CacheAligned>,
    /// Intruders on springs that soften, each with the distance at which its spring no longer pulls back, m.
    pub(super) reaches: Vec<(usize, f64)>,
    /// Lane of each intruder's host.
    pub(super) hosts: Vec<usize>,
    /// The intruder that carries each one; the host itself carries the others.
    pub(super) carriers: Vec<Option<usize>>,
    /// Intruders that another one carries, each with its carrier.
    nested: Vec<(usize, usize)>,
    /// Intruders whose hosts are in each block of bodies.
    pub(super) of_block: Vec<Range<usize>>,
}

impl Guests {
    /// Intruders in the body at a lane.
    pub(super) fn in_body(&self, lane: usize) -> impl Iterator<Item = usize> + '_ {
        let range = self.of_block.get((lane / BLOCK).wrapping_sub(1));
        let range = range.cloned().unwrap_or_default();
        range.filter(move |&guest| self.hosts[guest] == lane)
    }

    /// Intruders that the body at a lane carries itself.
    pub(super) fn of(&self, lane: usize) -> impl Iterator<Item = usize> + '_ {
        self.in_body(lane)
            .filter(move |&guest| self.carriers[guest].is_none())
    }

    /// Carried intruders whose hosts are in these runs of blocks, each with its carrier. The pulls of others
    /// are those of an earlier stage.
    #[inline(always)]
    pub(super) fn carried_in(&self, runs: &[Range<usize>]) -> impl Iterator<Item = (usize, usize)> {
        let moves = |guest: usize| {
            let block = self.hosts[guest] / BLOCK - 1;
            runs.iter().any(|run| run.contains(&block))
        };
        self.nested
            .iter()
            .copied()
            .filter(move |&(guest, _)| moves(guest))
    }

    /// Acceleration of an intruder by the pulls of its own spring and damper and of those that it carries,
    /// m/s².
    pub(super) fn acceleration(&self, guest: usize, pulls: &[LaneBlock]) -> f64 {
        let seat = self.seat(guest);
        -pulls[seat / BLOCK][seat % BLOCK] * self.inverse[seat]
    }

    #[inline(always)]
    pub(super) fn lane(&self, guest: usize) -> usize {
        self.first + guest
    }

    pub(super) fn lanes(&self) -> Range<usize> {
        self.first..self.first + self.count
    }

    /// Index of an intruder in the arrays of intruders.
    #[inline(always)]
    pub(super) fn seat(&self, guest: usize) -> usize {
        self.first + guest - self.blocks.start * BLOCK
    }

    /// Cubic stiffness of the spring of an intruder at this place in the arrays of intruders, N/m³.
    pub(super) fn cubic(&self, seat: usize) -> f64 {
        self.cubic.as_ref().map_or(0.0, |cubic| cubic[seat])
    }

    /// Intruders in a block of an array.
    pub(super) fn within(&self, block: usize) -> Range<usize> {
        let until = |lane: usize| lane.saturating_sub(self.first).min(self.count);
        until(block * BLOCK)..until((block + 1) * BLOCK)
    }
}

impl Lanes {
    pub(crate) fn new(model: &Model) -> Self {
        let bodies = model.bodies();
        let blocks = (bodies + 1).div_ceil(BLOCK);
        let guests = guests(model, blocks);
        let length = (blocks + 2).max(guests.blocks.end + 1) * BLOCK;
        let zeros = || CacheAligned::zeros(length);
        let mut lanes = Self {
            bodies,
            blocks,
            stiffness: zeros(),
            viscosity: zeros(),
            inverse: zeros(),
            rest: zeros(),
            root: zeros(),
            load: zeros(),
            guests,
            wall: (model.contacts() == bodies).then_some(BLOCK + bodies),
            viscous: false,
            clipped: model.clipped,
            loaded: false,
            general: false,
            drag: model.is_dragged().then(zeros),
            drive: model.drive.clone(),
            powers: model.contact_at(1).powers,
            speed: model.speed_scale(),
            depth: model.displacement_scale(),
        };
        for (body, shell) in model.shells.iter().enumerate() {
            lanes.inverse[BLOCK + body] = 1.0 / shell;
            if let Some(drag) = &mut lanes.drag {
                drag[BLOCK + body] = model.drag_on(body);
            }
        }
        for number in 1..=model.contacts() {
            let (contact, at) = (model.contact_at(number), BLOCK + number);
            lanes.stiffness[at] = contact.stiffness;
            lanes.viscosity[at] = 1.5 * contact.relaxation;
            lanes.rest[at] = contact.static_overlap;
            lanes.root[at] = contact.static_overlap.sqrt();
            lanes.load[at] = contact.load;
            lanes.viscous |= contact.relaxation > 0.0;
            lanes.loaded |= contact.load > 0.0;
            if let Some(powers) = &contact.powers {
                lanes.viscosity[at] = powers.coefficient;
                lanes.viscous |= powers.coefficient > 0.0 || powers.friction > 0.0;
            }
        }
        let acts = lanes.drive.is_some() || lanes.drag.is_some();
        lanes.general = lanes.loaded || lanes.clipped || acts || lanes.guests.cubic.is_some();
        lanes
    }

    #[inline(always)]
    pub(super) fn contacts<'a>(&'a self, length: usize, closed: &'a [f64]) -> Contacts<'a> {
        Contacts {
            stiffness: &blocks(&self.stiffness)[..length],
            viscosity: &blocks(&self.viscosity)[..length],
            rest: &blocks(&self.rest)[..length],
            root: &blocks(&self.root)[..length],
            load: &blocks(&self.load)[..length],
            clipped: self.clipped,
            powers: self.powers.as_ref(),
            closed: blocks(closed),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.inverse.len()
    }
}

fn guests(model: &Model, blocks: usize) -> Guests {
    let intruders = model.intruders();
    let count = intruders.len();
    // The lane after the last body belongs to the wall.
    let (after, end) = (BLOCK + model.bodies() + 1, first(blocks));
    let shares = count > 0 && blocks <= SHARED && after + count <= end;
    let begin = if shares { after } else { end + BLOCK };
    let seats = begin / BLOCK..(begin + count).div_ceil(BLOCK);
    let zeros = || CacheAligned::zeros(seats.len() * BLOCK);
    let hosts: Vec<usize> = intruders.iter().map(|intruder| BLOCK + intruder.bead).collect();
    let carriers: Vec<_> = intruders.iter().map(|intruder| intruder.carrier).collect();
    let of_block = (0..blocks)
        .map(|block| {
            let until = |lane: usize| hosts.partition_point(|&host| host < lane);
            until(first(block))..until(first(block + 1))
        })
        .collect();
    let (mut stiffness, mut damping, mut inverse) = (zeros(), zeros(), zeros());
    let mut cubic = model.has_cubic_springs().then(zeros);
    let mut reaches = Vec::new();
    for (guest, intruder) in intruders.iter().enumerate() {
        let seat = begin + guest - seats.start * BLOCK;
        stiffness[seat] = intruder.oscillator.stiffness;
        damping[seat] = intruder.oscillator.damping;
        inverse[seat] = 1.0 / intruder.oscillator.mass;
        if let Some(cubic) = &mut cubic {
            cubic[seat] = intruder.cubic_stiffness;
        }
        reaches.extend(intruder.reach().map(|reach| (guest, reach)));
    }
    Guests {
        count,
        first: begin,
        blocks: seats,
        home: shares.then(|| blocks - 1),
        stiffness,
        damping,
        inverse,
        cubic,
        reaches,
        hosts,
        nested: (0..)
            .zip(&carriers)
            .filter_map(|(guest, carrier)| Some((guest, (*carrier)?)))
            .collect(),
        carriers,
        of_block,
    }
}

/// Constants of the contacts, block by block, in arrays of one length.
#[derive(Clone, Copy)]
pub(super) struct Contacts<'a> {
    stiffness: &'a [LaneBlock],
    viscosity: &'a [LaneBlock],
    rest: &'a [LaneBlock],
    root: &'a [LaneBlock],
    load: &'a [LaneBlock],
    clipped: bool,
    powers: Option<&'a ContactPowers>,
    /// 1 where a contact with other powers is closed for all of the step.
    closed: &'a [LaneBlock],
}

/// Force of eight contacts beyond their static loads, and the power that they dissipate. `near` and `far` are
/// displacements and velocities of the bodies before and behind.
#[inline(always)]
pub(super) fn push<S: Simd<f64s = f64x8>, const GENERAL: bool, const POWERS_TOO: bool>(
    simd: S,
    contacts: Contacts<'_>,
    at: usize,
    near: (f64x8, f64x8),
    far: (f64x8, f64x8),
) -> (f64x8, f64x8) {
    if POWERS_TOO && let Some(powers) = contacts.powers {
        return push_by_powers(simd, (contacts, powers), at, near, far);
    }
    let zero = simd.splat_f64s(0.0);
    let change = simd.sub_f64s(near.0, far.0);
    let approach = simd.sub_f64s(near.1, far.1);
    let stiffness = pulp::cast(contacts.stiffness[at]);
    let viscosity = pulp::cast(contacts.viscosity[at]);
    if !GENERAL {
        let overlap = simd.max_f64s(zero, change);
        let stiff = simd.mul_f64s(stiffness, simd.sqrt_f64s(overlap));
        let viscous = simd.mul_f64s(viscosity, approach);
        let force = simd.mul_f64s(stiff, simd.add_f64s(overlap, viscous));
        let power = simd.mul_f64s(simd.mul_f64s(stiff, viscous), approach);
        return (force, power);
    }
    let (rest, root) = (pulp::cast(contacts.rest[at]), pulp::cast(contacts.root[at]));
    let overlap = simd.add_f64s(rest, change);
    let closed = simd.greater_than_f64s(overlap, zero);
    let open_force = simd.sub_f64s(zero, pulp::cast(contacts.load[at]));
    let r = simd.sqrt_f64s(simd.max_f64s(zero, overlap));
    // κ (a³ - b³) = κ (δ - δ₀) (a² + ab + b²) / (a + b), see `Contact::elastic_force_beyond`.
    let squares = simd.add_f64s(simd.add_f64s(overlap, simd.mul_f64s(r, root)), rest);
    let ratio = simd.div_f64s(squares, simd.add_f64s(r, root));
    let beyond = simd.mul_f64s(simd.mul_f64s(stiffness, change), ratio);
    let stiff = simd.mul_f64s(stiffness, r);
    let elastic = simd.mul_f64s(stiff, overlap);
    let viscous = simd.mul_f64s(simd.mul_f64s(viscosity, stiff), approach);
    let (mut force, mut lost) = (simd.add_f64s(beyond, viscous), viscous);
    if contacts.clipped {
        let pulls = simd.less_than_f64s(simd.add_f64s(elastic, viscous), zero);
        force = select(simd, pulls, open_force, force);
        lost = select(simd, pulls, simd.sub_f64s(zero, elastic), lost);
    }
    let force = select(simd, closed, force, open_force);
    let power = select(simd, closed, simd.mul_f64s(lost, approach), zero);
    (force, power)
}

/// [`push`] of contacts with other powers, lane by lane.
#[inline(always)]
fn push_by_powers<S: Simd<f64s = f64x8>>(
    simd: S,
    (contacts, powers): (Contacts<'_>, &ContactPowers),
    at: usize,
    near: (f64x8, f64x8),
    far: (f64x8, f64x8),
) -> (f64x8, f64x8) {
    let changes: LaneBlock = pulp::cast(simd.sub_f64s(near.0, far.0));
    let rates: LaneBlock = pulp::cast(simd.sub_f64s(near.1, far.1));
    let (mut forces, mut lost) = ([0.0; BLOCK], [0.0; BLOCK]);
    for lane in 0..BLOCK {
        let (load, rest) = (contacts.load[at][lane], contacts.rest[at][lane]);
        if contacts.closed[at][lane] == 0.0 {
            forces[lane] = -load;
            continue;
        }
        let of_lane = ContactPowers {
            coefficient: contacts.viscosity[at][lane],
            ..*powers
        };
        let stiffness = contacts.stiffness[at][lane];
        let damping = of_lane.damping_force(stiffness, rest + changes[lane], rates[lane]);
        let elastic = of_lane.force_beyond((load, rest), stiffness, changes[lane]);
        (forces[lane], lost[lane]) = (elastic + damping, damping * rates[lane]);
    }
    (pulp::cast(forces), pulp::cast(lost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::testing::{hosting, plain};

    #[test]
    fn each_intruder_is_in_the_block_of_its_lane_and_in_that_of_its_host() {
        let scenario = hosting(plain(90, 4.2e-6, 1e-3), (5..=60).step_by(3));
        let lanes = Lanes::new(&Model::new(&scenario));
        let guests = &lanes.guests;
        assert_eq!((guests.count, guests.blocks.len()), (19, 3));
        for block in 0..guests.blocks.end + 2 {
            let those = |block_of: &dyn Fn(usize) -> usize| -> Vec<usize> {
                let all = 0..guests.count;
                all.filter(|&guest| block_of(guest) == block).collect()
            };
            let within: Vec<usize> = guests.within(block).collect();
            assert_eq!(within, those(&|guest| guests.lane(guest) / BLOCK));
            let hosts = guests.of_block.get(block).cloned().unwrap_or_default();
            let known = those(&|guest| guests.hosts[guest] / BLOCK - 1);
            assert_eq!(hosts.collect::<Vec<_>>(), known);
        }
    }
}
