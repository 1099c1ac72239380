//! The front end as options of a command.

use clap::{Args, ValueEnum};

use crate::failure::Failure;
use crate::front_end::FrontEnd;

/// Whether the front end is noisy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Noise {
    /// As noisy as the real one.
    #[default]
    On,
    /// Ideal but for its filter and its twelve bits.
    Off,
}

/// Options that describe the front end.
#[derive(Debug, Args)]
#[command(next_help_heading = "Front end")]
pub(crate) struct FrontEndOptions {
    /// Noise of sensors, conditioner and converter.
    #[arg(long, value_enum, default_value_t)]
    noise: Noise,
    /// Seed of the noise: the same seed gives the same codes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Noise of the force, N rms [default: 0.005].
    #[arg(long, value_name = "N")]
    force_noise: Option<f64>,
    /// Noise of the acceleration, m/s² rms [default: 0.05].
    #[arg(long, value_name = "M/S2")]
    acceleration_noise: Option<f64>,
    /// Force that the 4096 codes span, N [default: 16, one thirty-second of it below zero].
    #[arg(long, value_name = "N")]
    force_span: Option<f64>,
    /// Acceleration that the 4096 codes span, m/s² [default: 500, half of it below zero].
    #[arg(long, value_name = "M/S2")]
    acceleration_span: Option<f64>,
    /// Pole of both anti-alias filters, Hz; 0 for none [default: 40000].
    #[arg(long, value_name = "HZ")]
    pole: Option<f64>,
}

impl FrontEndOptions {
    /// The front end that the options describe.
    ///
    /// # Errors
    /// A value that no front end has.
    pub(crate) fn front_end(&self) -> Result<FrontEnd, Failure> {
        let not_negative = |name: &str, value: Option<f64>, unit: &str| match value {
            Some(value) if !(value.is_finite() && value >= 0.0) => Err(Failure::input(format!(
                "{name} {value}: give 0 or more, in {unit}"
            ))),
            value => Ok(value),
        };
        let positive = |name: &str, value: Option<f64>, unit: &str| match value {
            Some(value) if !(value.is_finite() && value > 0.0) => Err(Failure::input(format!(
                "{name} {value}: give more than 0, in {unit}"
            ))),
            value => Ok(value),
        };
        let mut front_end = FrontEnd::default();
        if let Some(span) = positive("--force-span", self.force_span, "N")? {
            front_end.force = front_end.force.with_span(span);
        }
        if let Some(span) = positive("--acceleration-span", self.acceleration_span, "m/s²")? {
            front_end.acceleration = front_end.acceleration.with_span(span);
        }
        if let Some(rms) = not_negative("--force-noise", self.force_noise, "N rms")? {
            front_end.force.noise_rms = rms;
        }
        if let Some(rms) = not_negative("--acceleration-noise", self.acceleration_noise, "m/s² rms")? {
            front_end.acceleration.noise_rms = rms;
        }
        if let Some(hz) = not_negative("--pole", self.pole, "Hz")? {
            let pole = (hz > 0.0).then_some(hz);
            (front_end.force.pole_hz, front_end.acceleration.pole_hz) = (pole, pole);
        }
        if self.noise == Noise::Off {
            (front_end.force.noise_rms, front_end.acceleration.noise_rms) = (0.0, 0.0);
        }
        Ok(front_end)
    }

    /// The seed, if there is noise.
    pub(crate) fn seed(&self) -> Option<u64> {
        (self.noise == Noise::On).then_some(self.seed)
    }
}
