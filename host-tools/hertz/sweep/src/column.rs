//! A column of a sweep along one of its axes.

use crate::axis::Along;
use crate::plan::Plan;

/// A column along an axis of the sweep.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisColumn {
    pub(super) axis: usize,
    /// The key along the axis; `None` for the column of places.
    pub(super) along: Option<usize>,
}

impl AxisColumn {
    /// The column of this name.
    pub(super) fn find(plan: &Plan, name: &str) -> Option<Self> {
        plan.axes().iter().enumerate().find_map(|(axis, of)| {
            if of.name.as_deref() == Some(name) {
                return Some(Self { axis, along: None });
            }
            let along = of.along.iter().position(|along| along.key.column() == name);
            along.map(|along| Self {
                axis,
                along: Some(along),
            })
        })
    }

    /// The key of the column; `None` for a column of places.
    pub(super) fn along<'a>(&self, plan: &'a Plan) -> Option<&'a Along> {
        self.along.map(|along| &plan.axes()[self.axis].along[along])
    }

    /// The name of the column.
    pub(super) fn name(&self, plan: &Plan) -> String {
        match self.along(plan) {
            Some(along) => along.key.column(),
            None => plan.axes()[self.axis].index(),
        }
    }
}
