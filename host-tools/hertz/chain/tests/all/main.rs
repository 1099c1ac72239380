//! Tests of the simulator, one program: separate ones would each compile the solver.

mod accuracy;
mod any_scenario;
mod common;
mod contacts;
mod counts;
mod driven;
mod ensemble;
mod graded;
mod ground;
mod loaded;
mod optimise;
mod oscillator;
mod own_chain;
mod periodic;
mod reference;
mod scenario;
mod sensitivities;
mod spectra;
mod springs;
mod starts;
mod streamed;
mod transmission;
mod validity;
mod waves;
