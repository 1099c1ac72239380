//! A mass on a spring and damper, and how it follows its host (Appendix A1 of the paper).

use std::f64::consts::TAU;

use realfft::num_complex::Complex64;

/// A mass on a spring and damper; SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillator {
    /// Mass m, kg.
    pub mass: f64,
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Damping c, N·s/m.
    pub damping: f64,
}

impl Oscillator {
    /// A mass in kg on a spring of a stiffness in N/m, with a damper in N·s/m.
    pub const fn new(mass: f64, stiffness: f64, damping: f64) -> Self {
        Self {
            mass,
            stiffness,
            damping,
        }
    }

    /// h = (k + iωc) / (k + iωc - mω²), eq. (A1): motion of the mass over that of its host, frequency in Hz.
    pub fn transmissibility(&self, frequency: f64) -> Complex64 {
        let omega = TAU * frequency;
        let coupling = Complex64::new(self.stiffness, omega * self.damping);
        coupling / (coupling - self.mass * omega * omega)
    }

    /// Force k x + c x' of spring and damper, N. `distance` is x, in m from the host; `rate` is x', in m/s.
    #[inline]
    pub(crate) fn pull(&self, distance: f64, rate: f64) -> f64 {
        self.stiffness * distance + self.damping * rate
    }

    /// Distance √(-k/k₃), m, at which a spring that softens by the cubic stiffness k₃, N/m³, no longer pulls
    /// back; `None` if it does so at any distance.
    pub(crate) fn reach(&self, cubic_stiffness: f64) -> Option<f64> {
        (cubic_stiffness < 0.0).then(|| (self.stiffness / -cubic_stiffness).sqrt())
    }

    /// √(k/m) / 2π, Hz.
    pub fn natural_frequency(&self) -> f64 {
        (self.stiffness / self.mass).sqrt() / TAU
    }

    /// ζ = c / (2 √(k m)). The paper calls it a loss factor, but that would be twice as much.
    pub fn damping_ratio(&self) -> f64 {
        0.5 * self.damping / (self.stiffness * self.mass).sqrt()
    }

    /// Frequency (Hz) and height of the peak of |h|, at √(√(1 + 8ζ²) - 1) / 2ζ of the natural frequency.
    pub fn transmissibility_peak(&self) -> (f64, f64) {
        let square = self.damping_ratio().powi(2);
        // √(1 + 8ζ²) - 1 without the loss of digits for small ζ.
        let part = 8.0 * square / ((1.0 + 8.0 * square).sqrt() + 1.0);
        let frequency = self.natural_frequency() * (0.25 * part / square).sqrt();
        (frequency, self.transmissibility(frequency).norm())
    }
}
