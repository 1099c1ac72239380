//! The Runge-Kutta method of an ensemble: Verner's "most efficient" pair of orders 6 and 5, with nine stages
//! (<https://www.sfu.ca/~jverner/RKV65.IIIXb.Efficient.00000144617.081204.RATOnWeb>).
//!
//! At an error of 1e-6 the motion between two contacts that open or close is too short for a higher order to
//! pay: pairs of order 5, 7, 8 and 9 take more evaluations. As in the solver of single chains, stages give
//! displacements from accelerations directly.

/// Number of stages. The last is the end of the step.
pub(super) const STAGES: usize = 9;
/// The stage whose argument is the end of the step.
pub(super) const END: usize = STAGES - 1;

type Row = [f64; STAGES];

/// Weights of earlier accelerations in the velocity of each stage, over the length of the step.
pub(super) const VELOCITY: [Row; STAGES] = [
    [0.0; STAGES],
    [0.06, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [
        0.019239962962962962,
        0.07669337037037037,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ],
    [0.035975, 0.0, 0.107925, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [
        1.3186834152331484,
        0.0,
        -5.042058063628562,
        4.220674648395414,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    ],
    [
        -41.872591664327516,
        0.0,
        159.4325621631375,
        -122.11921356501003,
        5.531743066200054,
        0.0,
        0.0,
        0.0,
        0.0,
    ],
    [
        -54.430156935316504,
        0.0,
        207.06725136501848,
        -158.61081378459,
        6.991816585950242,
        -0.018597231062203234,
        0.0,
        0.0,
        0.0,
    ],
    [
        -54.66374178728198,
        0.0,
        207.95280625538936,
        -159.2889574744995,
        7.018743740796944,
        -0.018338785905045722,
        -0.0005119484997882099,
        0.0,
        0.0,
    ],
    [
        0.03438957868357036,
        0.0,
        0.0,
        0.2582624555633503,
        0.4209371189673537,
        4.40539646966931,
        -176.48311902429865,
        172.36413340141507,
        0.0,
    ],
];

/// The result of order 5.
const EMBEDDED: Row = [
    0.0490996764838249,
    0.0,
    0.0,
    0.22511122295165242,
    0.4694682253029562,
    0.8065792249988868,
    0.0,
    -0.607119489177796,
    0.056861139440475696,
];

/// Weights in the displacement of each stage, over the square of the length: the square of [`VELOCITY`].
pub(super) const DISPLACEMENT: [Row; STAGES] = {
    let mut rows = [[0.0; STAGES]; STAGES];
    let mut row = 0;
    while row < STAGES {
        let mut stage = 0;
        while stage < row {
            let (mut sum, mut between) = (0.0, stage + 1);
            while between < row {
                sum += VELOCITY[row][between] * VELOCITY[between][stage];
                between += 1;
            }
            // A smaller value is a zero with rounding.
            rows[row][stage] = if sum < 1e-12 && sum > -1e-12 { 0.0 } else { sum };
            stage += 1;
        }
        row += 1;
    }
    rows
};

/// Time of each stage, as a part of the step.
pub(super) const NODES: Row = {
    let mut nodes = [0.0; STAGES];
    let mut row = 0;
    while row < STAGES {
        let mut stage = 0;
        while stage < row {
            nodes[row] += VELOCITY[row][stage];
            stage += 1;
        }
        row += 1;
    }
    // Exact, so that a body without a force moves by its velocity times the step.
    nodes[END] = 1.0;
    nodes[END - 1] = 1.0;
    nodes
};

/// Weights of the estimated error of velocities: the difference of both results.
pub(super) const ERROR: Row = {
    let mut error = VELOCITY[END];
    let mut stage = 0;
    while stage < STAGES {
        error[stage] -= EMBEDDED[stage];
        stage += 1;
    }
    error
};
