//! A column of a sweep along one of its axes.

use bead_tables::CellKind;

use crate::axis::{Along, SweepAxis};
use crate::plan::Plan;

/// A column along an axis of the sweep.
#[derive(Clone, Copy)]
pub(super) struct AxisColumn<'a> {
    /// Number of the axis.
    pub(super) axis: usize,
    pub(super) of: &'a SweepAxis,
    /// The key along the axis; `None` for the column of places.
    pub(super) along: Option<&'a Along>,
}

impl<'a> AxisColumn<'a> {
    /// The column of this name.
    pub(super) fn find(plan: &'a Plan, name: &str) -> Option<Self> {
        plan.axes().iter().enumerate().find_map(|(axis, of)| {
            let is_places = of.name.as_deref() == Some(name);
            let along = of.along.iter().find(|along| along.key.column() == name);
            let along = along.filter(|_| !is_places);
            (is_places || along.is_some()).then_some(Self { axis, of, along })
        })
    }

    /// The column that is the index of an axis.
    pub(super) fn index(plan: &'a Plan, axis: usize) -> Self {
        let of = &plan.axes()[axis];
        let along = of.along.first().filter(|_| of.name.is_none());
        Self { axis, of, along }
    }

    /// The name of the column.
    pub(super) fn name(&self) -> String {
        self.along
            .map_or_else(|| self.of.index(), |along| along.key.column())
    }

    /// The key, if its values are texts.
    pub(super) fn of_texts(&self) -> Option<&'a Along> {
        self.along.filter(|along| along.kind() == CellKind::Text)
    }

    /// The number at a place. The number of a text is its place.
    pub(super) fn number(&self, place: u64) -> f64 {
        match self.along.filter(|along| along.kind() != CellKind::Text) {
            Some(along) => along.cell(place).as_f64().unwrap_or(f64::NAN),
            None => place as f64,
        }
    }
}
