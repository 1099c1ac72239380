//! The front end as options of a command.

use anyhow::ensure;
use clap::{Args, ValueEnum};

use crate::bench::front_end::FrontEnd;

/// Whether the front end is noisy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Noise {
    /// As noisy as the real one.
    #[default]
    On,
    /// Ideal, except for its filter and its twelve bits.
    Off,
}

/// Pairs of sensors that fit the front end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum Sensors {
    /// For weak strikes: 16 N and ±250 m/s² at the high gain, 256 N and ±4000 m/s² at the low one.
    #[default]
    Weak,
    /// For strong ones: a sixth as sensitive, six times the noise; 1536 N and ±24 km/s² at the low gain.
    Strong,
}

impl Sensors {
    /// The front end behind them.
    pub(crate) fn front_end(self) -> FrontEnd {
        match self {
            Self::Weak => FrontEnd::default(),
            Self::Strong => FrontEnd::default().behind_weaker_sensors(6.0),
        }
    }
}

/// Options that describe the front end.
#[derive(Debug, Args)]
#[command(next_help_heading = "Front end")]
pub(crate) struct FrontEndOptions {
    /// The pair of sensors.
    #[arg(long, value_enum, default_value_t)]
    sensors: Sensors,
    /// Noise of sensors, conditioner and converter.
    #[arg(long, value_enum, default_value_t)]
    noise: Noise,
    /// Seed of the noise, and of what else is left to chance: the same seed gives the same codes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Noise of the force at the high gain, N rms [default: 0.005; of strong sensors 0.03].
    #[arg(long, value_name = "N")]
    force_noise: Option<f64>,
    /// Noise of the acceleration at the high gain, m/s² rms [default: 0.05; of strong sensors 0.3].
    #[arg(long, value_name = "M/S2")]
    acceleration_noise: Option<f64>,
    /// Force that the 4096 codes span at the high gain, N [default: 16; of strong sensors 96].
    ///
    /// One thirty-second of it is below zero.
    #[arg(long, value_name = "N")]
    force_span: Option<f64>,
    /// Acceleration that the 4096 codes span at the high gain, m/s² [default: 500; of strong sensors 3000].
    ///
    /// Half of it is below zero.
    #[arg(long, value_name = "M/S2")]
    acceleration_span: Option<f64>,
    /// Force that the 4096 codes span at the low gain, N [default: 256; of strong sensors 1536].
    #[arg(long, value_name = "N")]
    wide_force_span: Option<f64>,
    /// Acceleration that the 4096 codes span at the low gain, m/s² [default: 8000; of strong sensors
    /// 48000].
    #[arg(long, value_name = "M/S2")]
    wide_acceleration_span: Option<f64>,
    /// Pole of both anti-alias filters, Hz; 0 for none [default: 40000].
    #[arg(long, value_name = "HZ")]
    pole: Option<f64>,
}

impl FrontEndOptions {
    /// The front end that the options describe.
    ///
    /// # Errors
    /// A value that no front end has.
    pub(crate) fn front_end(&self) -> anyhow::Result<FrontEnd> {
        let not_negative = |name: &str, value: f64, unit: &str| {
            let holds = value.is_finite() && value >= 0.0;
            ensure!(holds, "{name} {value}: give 0 or more, in {unit}");
            Ok(())
        };
        let mut front_end = self.sensors.front_end();
        let FrontEnd { force, acceleration } = &mut front_end;
        let (acceleration_span, wide_span) = (self.acceleration_span, self.wide_acceleration_span);
        for (channel, name, span, unit) in [
            (&mut force.sensitive, "--force-span", self.force_span, "N"),
            (&mut force.wide, "--wide-force-span", self.wide_force_span, "N"),
            (
                &mut acceleration.sensitive,
                "--acceleration-span",
                acceleration_span,
                "m/s²",
            ),
            (
                &mut acceleration.wide,
                "--wide-acceleration-span",
                wide_span,
                "m/s²",
            ),
        ] {
            if let Some(span) = span {
                let holds = span.is_finite() && span > 0.0;
                ensure!(holds, "{name} {span}: give more than 0, in {unit}");
                *channel = channel.with_span(span);
            }
        }
        for (sensor, name, rms, unit) in [
            (force, "--force-noise", self.force_noise, "N rms"),
            (
                acceleration,
                "--acceleration-noise",
                self.acceleration_noise,
                "m/s² rms",
            ),
        ] {
            if let Some(rms) = rms {
                not_negative(name, rms, unit)?;
                sensor.sensitive.noise_rms = rms;
                // The sensor's own noise is in both channels.
                sensor.wide.noise_rms = sensor.wide.noise_rms.max(rms);
            }
        }
        if let Some(hz) = self.pole {
            not_negative("--pole", hz, "Hz")?;
            for channel in front_end.channels_mut() {
                channel.pole_hz = (hz > 0.0).then_some(hz);
            }
        }
        if self.noise == Noise::Off {
            let given = self.force_noise.is_some() || self.acceleration_noise.is_some();
            ensure!(
                !given,
                "--noise off: leave out --force-noise and --acceleration-noise"
            );
            for channel in front_end.channels_mut() {
                channel.noise_rms = 0.0;
            }
        }
        Ok(front_end)
    }

    /// The seed of all that is left to chance.
    pub(crate) fn seed(&self) -> u64 {
        self.seed
    }

    /// The seed of the noise, if there is any.
    pub(crate) fn noise(&self) -> Option<u64> {
        (self.noise == Noise::On).then_some(self.seed)
    }
}
