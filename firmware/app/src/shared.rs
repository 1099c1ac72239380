//! A value that tasks of different priority share.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

/// A value behind a lock that keeps interrupts waiting; empty at first.
pub(crate) struct SharedCell<T>(Mutex<CriticalSectionRawMutex, RefCell<Slot<T>>>);

// `Empty` has the tag 0: an empty one is all zeros, and takes no flash.
#[repr(u32)]
enum Slot<T> {
    Empty,
    Full(T),
}

impl<T> SharedCell<T> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(RefCell::new(Slot::Empty)))
    }

    pub(crate) fn set(&self, value: T) {
        // Made outside the lock, so that under it there is a single copy.
        let slot = Slot::Full(value);
        self.0.lock(|cell| *cell.borrow_mut() = slot);
    }

    /// Lets `act` use the value. Panics if there is none.
    pub(crate) fn with<R>(&self, act: impl FnOnce(&mut T) -> R) -> R {
        self.0.lock(|cell| match &mut *cell.borrow_mut() {
            Slot::Full(value) => act(value),
            Slot::Empty => panic!("it is set before the tasks start"),
        })
    }
}

impl<T: Copy + Default> SharedCell<T> {
    /// Changes the value, which is the default one at first.
    pub(crate) fn update(&self, change: impl FnOnce(&mut T)) {
        self.0.lock(|cell| {
            let slot = &mut *cell.borrow_mut();
            if let Slot::Empty = slot {
                *slot = Slot::Full(T::default());
            }
            if let Slot::Full(value) = slot {
                change(value);
            }
        });
    }

    /// Returns a copy of the value.
    pub(crate) fn get(&self) -> T {
        self.0.lock(|cell| match &*cell.borrow() {
            Slot::Full(value) => *value,
            Slot::Empty => T::default(),
        })
    }
}
