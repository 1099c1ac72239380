//! Motion of a chain until a bead with an intruder moves, shared by many chains.
//!
//! # Design
//!
//! This motion is equal, bit for bit, for chains that differ in their intruders alone, since an intruder at
//! rest changes nothing. It is computed once for all of them, up to the first step that would move the bead
//! before the first host, and each chain continues from there.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::chain::ChainShape;
use super::eight::LANES;
use super::group::SavedChain;
use super::together::{self, GroupMember};

/// All numbers that the motion depends on, as bits.
type PrefixKey = Vec<u64>;

#[derive(Debug, Default)]
pub(crate) struct Prefixes(Mutex<HashMap<PrefixKey, Arc<SavedChain>>>);

/// Body whose motion ends the shared part; `None` if that part is too short to share.
fn last(shape: &ChainShape) -> Option<usize> {
    shape.hosts.first().filter(|host| **host > 2).map(|host| host - 1)
}

fn key(shape: &ChainShape, member: &GroupMember<'_>, peaks: &[usize]) -> Option<PrefixKey> {
    let (model, last) = (member.model, last(shape)?);
    let mut key = vec![last as u64, u64::from(shape.walled), member.time.to_bits()];
    key.extend(peaks.iter().map(|contact| *contact as u64));
    // End of the list of wanted contacts.
    key.push(0);
    for (body, &(place, speed)) in model.starts.iter().enumerate() {
        key.extend([model.mass(body), place, speed].map(f64::to_bits));
    }
    for contact in 1..=model.contacts() {
        let contact = model.contact_at(contact);
        key.extend([contact.stiffness, contact.relaxation].map(f64::to_bits));
    }
    Some(key)
}

impl Prefixes {
    /// Sets the state to start from for members that share it with many others, or whose state is known.
    pub(super) fn share(&self, members: &mut [(ChainShape, GroupMember<'_>)], peaks: &[usize]) {
        let keys = members
            .par_iter()
            .map(|(shape, member)| key(shape, member, peaks));
        let keys: Vec<Option<PrefixKey>> = keys.collect();
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut users: HashMap<&PrefixKey, (usize, usize)> = HashMap::new();
        for (index, key) in keys.iter().enumerate() {
            if let Some(key) = key {
                users.entry(key).or_insert((index, 0)).1 += 1;
            }
        }
        // Chains of one shape run together.
        let mut wanted: BTreeMap<(ChainShape, usize), Vec<usize>> = BTreeMap::new();
        for (key, (index, count)) in users {
            // Fewer chains would run in one group anyway.
            if count > LANES && !known.contains_key(key) {
                let shape = &members[index].0;
                let bare = ChainShape {
                    hosts: Vec::new(),
                    nested: Vec::new(),
                    ..shape.clone()
                };
                let last = last(shape).expect("there is a way");
                wanted.entry((bare, last)).or_default().push(index);
            }
        }
        let groups = wanted.iter();
        let groups = groups.flat_map(|(kind, all)| all.chunks(LANES).map(move |some| (kind, some)));
        let groups: Vec<(&(ChainShape, usize), &[usize])> = groups.collect();
        let ways = groups.into_par_iter().flat_map_iter(|((shape, last), some)| {
            let some_members: Vec<&GroupMember<'_>> = some.iter().map(|index| &members[*index].1).collect();
            let lanes = together::before(shape, &some_members, peaks, *last);
            some.iter().copied().zip(lanes)
        });
        let ways: Vec<(usize, SavedChain)> = ways.collect();
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
