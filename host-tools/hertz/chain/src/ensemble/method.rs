//! The Runge-Kutta method of an ensemble: Verner's "most efficient" pair of orders 6 and 5, with nine stages
//! (<https://www.sfu.ca/~jverner/RKV65.IIIXb.Efficient.00000144617.081204.RATOnWeb>).
//!
//! At an error of 1e-6 the motion between two contacts that open or close is too short for a higher order to
//! pay: pairs of order 5, 7, 8 and 9 take more evaluations. As in the solver of single chains, stages give
//! displacements from accelerations directly.

use crate::tableau::{Square, nodes, spread, twice};

/// Number of stages. The last is the end of the step.
pub(crate) const STAGES: usize = 9;
/// The stage whose argument is the end of the step.
pub(crate) const END: usize = STAGES - 1;

/// Row s: the weights `(stage, a)` that give the argument of stage s.
const A: [&[(usize, f64)]; STAGES] = [
    &[],
    &[(0, 0.06)],
    &[(0, 0.019239962962962962), (1, 0.07669337037037037)],
    &[(0, 0.035975), (2, 0.107925)],
    &[
        (0, 1.3186834152331484),
        (2, -5.042058063628562),
        (3, 4.220674648395414),
    ],
    &[
        (0, -41.872591664327516),
        (2, 159.4325621631375),
        (3, -122.11921356501003),
        (4, 5.531743066200054),
    ],
    &[
        (0, -54.430156935316504),
        (2, 207.06725136501848),
        (3, -158.61081378459),
        (4, 6.991816585950242),
        (5, -0.018597231062203234),
    ],
    &[
        (0, -54.66374178728198),
        (2, 207.95280625538936),
        (3, -159.2889574744995),
        (4, 7.018743740796944),
        (5, -0.018338785905045722),
        (6, -0.0005119484997882099),
    ],
    &[
        (0, 0.03438957868357036),
        (3, 0.2582624555633503),
        (4, 0.4209371189673537),
        (5, 4.40539646966931),
        (6, -176.48311902429865),
        (7, 172.36413340141507),
    ],
];

/// The result of order 5.
const EMBEDDED: [(usize, f64); 6] = [
    (0, 0.0490996764838249),
    (3, 0.22511122295165242),
    (4, 0.4694682253029562),
    (5, 0.8065792249988868),
    (7, -0.607119489177796),
    (8, 0.056861139440475696),
];

/// Weights of earlier accelerations in the velocity of each stage, over the length of the step.
pub(crate) const VELOCITY: Square<STAGES> = spread(&A);

/// Weights in the displacement of each stage, over the square of the length: the square of [`VELOCITY`].
pub(super) const DISPLACEMENT: Square<STAGES> = {
    let mut rows = VELOCITY;
    let mut row = 0;
    while row < STAGES {
        rows[row] = twice(&VELOCITY, &VELOCITY[row], 1e-12);
        row += 1;
    }
    rows
};

/// Time of each stage, as a part of the step.
pub(crate) const NODES: [f64; STAGES] = {
    let mut nodes = nodes(&VELOCITY);
    // Exact, so that a body without a force moves by its velocity times the step.
    nodes[END] = 1.0;
    nodes[END - 1] = 1.0;
    nodes
};

/// Weights of the estimated error of velocities: the difference of both results.
pub(crate) const ERROR: [f64; STAGES] = {
    let mut error = VELOCITY[END];
    let mut at = 0;
    while at < EMBEDDED.len() {
        let (stage, weight) = EMBEDDED[at];
        error[stage] -= weight;
        at += 1;
    }
    error
};
