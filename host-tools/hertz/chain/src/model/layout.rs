//! Places of the parts of a state.

/// Indices of the state vector. It holds displacements and velocities of the bodies, relative displacements
/// and velocities of the intruders, the energy dissipated in all contacts, the energy dissipated in each
/// intruder, the momentum given to the wall if there is one, the work of a drive if there is one, and the
/// energy dissipated on the ground if that drags.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StateLayout {
    pub(super) bodies: usize,
    pub(super) intruders: usize,
    pub(super) walled: bool,
    pub(super) driven: bool,
    pub(super) dragged: bool,
}

impl StateLayout {
    pub(crate) fn velocity(&self, body: usize) -> usize {
        self.bodies + body
    }

    pub(crate) fn relative(&self, intruder: usize) -> usize {
        2 * self.bodies + intruder
    }

    pub(crate) fn relative_velocity(&self, intruder: usize) -> usize {
        2 * self.bodies + self.intruders + intruder
    }

    pub(crate) fn contact_loss(&self) -> usize {
        2 * (self.bodies + self.intruders)
    }

    pub(crate) fn intruder_loss(&self, intruder: usize) -> usize {
        self.contact_loss() + 1 + intruder
    }

    pub(crate) fn wall_impulse(&self) -> Option<usize> {
        self.walled.then_some(self.contact_loss() + 1 + self.intruders)
    }

    pub(crate) fn drive_work(&self) -> Option<usize> {
        self.driven
            .then_some(self.contact_loss() + 1 + self.intruders + usize::from(self.walled))
    }

    pub(crate) fn ground_loss(&self) -> Option<usize> {
        let before = usize::from(self.walled) + usize::from(self.driven);
        self.dragged
            .then_some(self.contact_loss() + 1 + self.intruders + before)
    }

    pub(crate) fn dimension(&self) -> usize {
        let optional = [self.walled, self.driven, self.dragged];
        self.contact_loss() + 1 + self.intruders + optional.into_iter().map(usize::from).sum::<usize>()
    }
}
