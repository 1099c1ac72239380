//! The paper's plates, and figures beyond it: one file a plate.

mod bands;
mod beyond;
mod collision;
mod contacts;
mod diatomic;
mod driven;
mod fig2;
mod fig3;
mod fig4;
mod fig5;
mod fig6;
mod fig7;
mod fig_a2_a3;
mod fig_a4;
mod fig_a5_a6;
mod meeting;
mod periodic;
mod protection;
mod shaken;

use crate::plan::FigurePlan;

/// The figures of every plate, in the paper's order.
pub(crate) const PLATES: [&[FigurePlan]; 19] = [
    fig2::PLANS,
    fig3::PLANS,
    fig4::PLANS,
    fig5::PLANS,
    fig6::PLANS,
    fig7::PLANS,
    shaken::PLANS,
    fig_a2_a3::PLANS,
    fig_a4::PLANS,
    fig_a5_a6::PLANS,
    collision::PLANS,
    beyond::PLANS,
    bands::PLANS,
    driven::PLANS,
    diatomic::PLANS,
    periodic::PLANS,
    contacts::PLANS,
    meeting::PLANS,
    protection::PLANS,
];
