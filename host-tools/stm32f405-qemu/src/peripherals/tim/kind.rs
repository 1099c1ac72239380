//! Features of each kind of timer: sections 17 (advanced), 18 (general), 19 (one or two channels) and 20
//! (basic).

use super::super::clock::Apb;
use super::super::peripheral::NoRegister;
use super::super::register::index;

/// A kind of timer. Registers are masks of the bits that exist; a register without bits does not exist.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TimerKind {
    pub(super) apb: Apb,
    /// The highest value of its counter.
    pub(super) max: u32,
    pub(super) channels: usize,
    pub(super) cr1: u32,
    pub(super) cr2: u32,
    pub(super) smcr: u32,
    pub(super) dier: u32,
    pub(super) egr: u32,
    pub(super) ccer: u32,
    pub(super) rcr: u32,
    pub(super) bdtr: u32,
    /// OR: TI1_RMP of TIM11.
    pub(super) or: u32,
    /// The flags of each of its interrupt lines.
    pub(super) lines: &'static [u32],
}

impl TimerKind {
    /// Four channels and 16 bits: TIM3, TIM4.
    pub(crate) const GENERAL: Self = Self {
        apb: Apb::One,
        max: 0xffff,
        channels: 4,
        cr1: 0x3ff,
        cr2: 0xf8,
        smcr: 0xfff7,
        dier: 0x5f5f,
        egr: 0x5f,
        ccer: 0xbbbb,
        rcr: 0,
        bdtr: 0,
        or: 0,
        lines: &[0x5f],
    };
    /// Four channels and 32 bits: TIM2, TIM5.
    pub(crate) const GENERAL_32: Self = Self {
        max: u32::MAX,
        ..Self::GENERAL
    };
    /// With complementary outputs, a break and a repetition counter: TIM1, TIM8. Break, update, trigger and
    /// commutation, and capture and compare have a line each.
    pub(crate) const ADVANCED: Self = Self {
        apb: Apb::Two,
        cr2: 0x7ffd,
        dier: 0x7fff,
        egr: 0xff,
        ccer: 0x3fff,
        rcr: 0xff,
        bdtr: 0xffff,
        lines: &[0x80, 0x01, 0x60, 0x1e],
        ..Self::GENERAL
    };
    /// Two channels: TIM12, and TIM9 on APB2.
    pub(crate) const TWO_CHANNELS: Self = Self {
        channels: 2,
        cr1: 0x38f,
        cr2: 0,
        smcr: 0xf7,
        dier: 0x47,
        egr: 0x47,
        ccer: 0xbb,
        ..Self::GENERAL
    };
    /// One channel: TIM13, TIM14, and TIM10, TIM11 on APB2.
    pub(crate) const ONE_CHANNEL: Self = Self {
        channels: 1,
        smcr: 0,
        dier: 0x3,
        egr: 0x3,
        ccer: 0xb,
        ..Self::TWO_CHANNELS
    };
    /// TIM11: its input may be the crystal.
    pub(crate) const WITH_CRYSTAL: Self = Self {
        or: 0b11,
        ..Self::ONE_CHANNEL
    };
    /// No channels: TIM6, TIM7.
    pub(crate) const BASIC: Self = Self {
        channels: 0,
        cr1: 0x8f,
        cr2: 0x70,
        dier: 0x101,
        egr: 0x1,
        ccer: 0,
        ..Self::ONE_CHANNEL
    };

    /// This kind, on APB2.
    pub(crate) const fn on_apb2(self) -> Self {
        let apb = Apb::Two;
        Self { apb, ..self }
    }

    /// Checks that this kind has a register.
    pub(super) fn check(&self, offset: u32) -> Result<(), NoRegister> {
        let has = match offset {
            0x04 => self.cr2 != 0,
            0x08 => self.smcr != 0,
            0x18 | 0x1c => index(offset, 0x18) < self.channels.div_ceil(2),
            0x20 => self.ccer != 0,
            0x30 => self.rcr != 0,
            0x34..=0x40 => index(offset, 0x34) < self.channels,
            0x44 => self.bdtr != 0,
            0x50 => self.or != 0,
            _ => offset < 0x44,
        };
        (has && offset.is_multiple_of(4)).then_some(()).ok_or(NoRegister)
    }
}
