//! The way of a chain until something moves a bead that has an intruder.
//!
//! # Design
//!
//! It is the same, bit for bit, for chains that differ in their intruders alone: an intruder at rest changes
//! nothing. So it is gone once for all of them, up to the first step that would move the bead before the
//! first host, and each goes on from there.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::chain::Shape;
use super::eight::LANES;
use super::group::Lane;
use super::together::{self, Member};

/// All that the way depends on, as bits.
type Key = Vec<u64>;

/// The ways that are known.
#[derive(Debug, Default)]
pub(crate) struct Prefixes(Mutex<HashMap<Key, Arc<Lane>>>);

/// The body that ends the way when it moves; none if there is no way to speak of.
fn last(shape: &Shape) -> Option<usize> {
    shape.hosts.first().filter(|host| **host > 2).map(|host| host - 1)
}

fn key(shape: &Shape, member: &Member<'_>, peaks: &[usize]) -> Option<Key> {
    let (model, last) = (member.model, last(shape)?);
    let mut key = vec![last as u64, u64::from(shape.walled), member.time.to_bits()];
    key.extend(peaks.iter().map(|contact| *contact as u64));
    // The end of the contacts that are wanted.
    key.push(0);
    for body in 0..model.bodies() {
        let (place, speed) = (model.start(body), model.initial_speed(body));
        key.extend([model.mass(body), place, speed].map(f64::to_bits));
    }
    for contact in 1..=model.contacts() {
        let contact = model.contact(contact);
        key.extend([contact.stiffness, contact.relaxation].map(f64::to_bits));
    }
    Some(key)
}

impl Prefixes {
    /// Gives the members that share their way with many others, or whose way is known, a place to start from.
    pub(super) fn share(&self, members: &mut [(Shape, Member<'_>)], peaks: &[usize]) {
        let keys: Vec<Option<Key>> = members
            .par_iter()
            .map(|(shape, member)| key(shape, member, peaks))
            .collect();
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut users: HashMap<&Key, (usize, usize)> = HashMap::new();
        for (index, key) in keys.iter().enumerate() {
            if let Some(key) = key {
                users.entry(key).or_insert((index, 0)).1 += 1;
            }
        }
        // Chains of one shape go together.
        let mut wanted: BTreeMap<(Shape, usize), Vec<usize>> = BTreeMap::new();
        for (key, (index, count)) in users {
            // So few would go together anyway.
            if count > LANES && !known.contains_key(key) {
                let shape = &members[index].0;
                let bare = Shape {
                    hosts: Vec::new(),
                    ..shape.clone()
                };
                let last = last(shape).expect("there is a way");
                wanted.entry((bare, last)).or_default().push(index);
            }
        }
        let groups: Vec<(&(Shape, usize), &[usize])> = wanted
            .iter()
            .flat_map(|(kind, of_kind)| of_kind.chunks(LANES).map(move |some| (kind, some)))
            .collect();
        let ways = groups.into_par_iter().flat_map_iter(|((shape, last), some)| {
            let some_members: Vec<&Member<'_>> = some.iter().map(|index| &members[*index].1).collect();
            let lanes = together::before(shape, &some_members, peaks, *last);
            some.iter().copied().zip(lanes)
        });
        let ways: Vec<(usize, Lane)> = ways.collect();
        for (index, way) in ways {
            if let Some(key) = &keys[index] {
                known.insert(key.clone(), Arc::new(way));
            }
        }
        for ((_, member), key) in members.iter_mut().zip(&keys) {
            member.start = key.as_ref().and_then(|key| known.get(key)).map(Arc::clone);
        }
    }
}
