//! The paper's plates, and figures beyond it: one file a plate.

pub(crate) mod bands;
pub(crate) mod beyond;
pub(crate) mod collision;
pub(crate) mod contacts;
pub(crate) mod diatomic;
pub(crate) mod driven;
pub(crate) mod fig2;
pub(crate) mod fig3;
pub(crate) mod fig4;
pub(crate) mod fig5;
pub(crate) mod fig6;
pub(crate) mod fig7;
pub(crate) mod fig_a2_a3;
pub(crate) mod fig_a4;
pub(crate) mod fig_a5_a6;
pub(crate) mod meeting;
pub(crate) mod periodic;
pub(crate) mod protection;
pub(crate) mod shaken;
