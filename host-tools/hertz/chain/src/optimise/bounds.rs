//! Bounds of a design, and limits on its strokes.

use super::catalogue::CatalogueSpring;

/// Part by which strokes of a search stay below their limit: far more than the error of an ensemble.
const MARGIN: f64 = 1e-5;
/// Logarithm of a stroke over its limit, without the margin, up to which the limit counts as kept.
const KEPT: f64 = 5e-6;
/// A stroke counts as at least this part of its limit: that of an intruder at rest has no logarithm.
const LEAST_STROKE: f64 = 1e-3;

/// Mass, kg, stiffness, N/m, and damping, N·s/m.
pub(super) type Properties = [f64; 3];

/// Bounds of one entry of a design. Ends that are equal fix a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    /// Least and greatest mass, kg, stiffness, N/m, and damping, N·s/m.
    pub(super) properties: [[f64; 2]; 3],
    /// Loss factor that ties the damping to mass and stiffness.
    pub(super) loss_factor: Option<f64>,
    /// Greatest stroke, m; infinite if any is allowed.
    pub(super) stroke: f64,
}

impl Bounds {
    /// These bounds with a spring of a catalogue.
    pub(super) fn with(&self, spring: &CatalogueSpring) -> Self {
        let fixed = |value: f64| [value, value];
        let [mass, _, damping] = self.properties;
        Self {
            properties: [
                spring.mass.map_or(mass, fixed),
                fixed(spring.stiffness),
                spring.damping.map_or(damping, fixed),
            ],
            loss_factor: match spring.damping {
                Some(_) => None,
                None => spring.loss_factor.or(self.loss_factor),
            },
            stroke: spring
                .stroke
                .map_or(self.stroke, |stroke| stroke.min(self.stroke)),
        }
    }

    /// Ties the damping to mass and stiffness if a loss factor does.
    pub(super) fn tied(&self, [mass, stiffness, damping]: Properties) -> Properties {
        let tied = |factor: f64| factor * (stiffness * mass).sqrt();
        [mass, stiffness, self.loss_factor.map_or(damping, tied)]
    }

    /// The logarithm of a stroke, m, over its limit: above 0 if it is too long.
    fn overreach(&self, stroke: f64) -> f64 {
        let limit = self.stroke * (1.0 - MARGIN);
        (stroke / limit).max(LEAST_STROKE).ln()
    }
}

/// The overreach of each stroke of a design that has a limit, run by run. `bounds` has an entry for each
/// host, or one for all.
pub(super) fn overreaches(strokes: &[f64], bounds: &[Bounds]) -> Vec<f64> {
    let each = strokes.iter().zip(bounds.iter().cycle());
    let limited = each.filter(|(_, bounds)| bounds.stroke.is_finite());
    limited
        .map(|(&stroke, bounds)| bounds.overreach(stroke))
        .collect()
}

/// The greatest overreach of a design's strokes; 0 if all limits are kept.
pub(super) fn excess(strokes: &[f64], bounds: &[Bounds]) -> f64 {
    let greatest = overreaches(strokes, bounds).into_iter().fold(0.0, f64::max);
    if greatest <= KEPT { 0.0 } else { greatest }
}
