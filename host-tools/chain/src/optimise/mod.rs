//! Which intruders leave the least energy in the chain.
//!
//! # Design
//!
//! The search makes the share of the injected energy small that the intruders have *not* dissipated
//! ([`Remaining::share`]). The energy that an intruder still holds counts as remaining. So does a reflected
//! wave and, on a viscoelastic chain, the loss in contacts: none of it was absorbed. The dampers only take,
//! so the share only falls with time. It is decided once the last of the wave has passed the hosts, and the
//! scenario's duration says how long to wait for that. Energy that the striker keeps or gets back is not
//! injected.
//!
//! A design has three numbers a host. Stiffness and damping are searched as logarithms, masses as they are.
//! So the bound on their sum is linear, and no step between two designs that keep it breaks it. First all
//! intruders are alike: the best design of a grid is improved. Then each bead goes its own way, from there
//! and from stiffnesses that rise or fall along the hosts by `RAMP`, and then from fresh starts about the
//! best, until three in succession find nothing better. Derivatives are differences of runs to either side,
//! all of them one [`ensemble`](crate::ensemble()): its shares are smooth to some 1e-7, over two steps of
//! `STEP` 3e-5 of a derivative. The descent is Kraft's SLSQP, begun anew where it has ended until that gains
//! nothing.

mod descent;
mod find;
mod problem;
mod remaining;
mod search;

pub use find::{Optimum, optimise};
pub use problem::{SearchObserver, SearchProgress};
pub use remaining::{Remaining, remaining};
pub use search::{Aim, OptimiseError, Search};
