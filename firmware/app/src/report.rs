//! Identity, settings, status, health and link of the bead, sent at boot and every second.

use bead_wire::{Detail, Fault, FaultCause, Identity, LastFault, ResetCauses, Status, Update, UpdateStage};

use crate::bead::BeadState;
use crate::block::{CHANNELS, SAMPLE_RATE_HZ};
use crate::boot::ThisBoot;
use crate::device::{Device, MS};
use crate::settings::RefusedSettings;

impl<D: Device> BeadState<D> {
    /// Sends everything due at boot, with the fault that ended the previous boot, the reason why settings
    /// were `refused`, and the faults that the start has `found`.
    pub fn report_boot(
        &self,
        boot: &ThisBoot,
        refused: Option<RefusedSettings>,
        found: impl IntoIterator<Item = (FaultCause, Detail)>,
    ) {
        self.update(|c| c.health.frames_lost_by_reset = boot.frames_lost);
        self.guard.update(|guard| guard.boots_failed = boot.failed);
        self.report(boot);
        if let Some(ended) = &boot.ended_by {
            self.send(Fault {
                cause: ended.cause,
                boot: ended.boot,
                pc: ended.pc,
                detail: ended.detail.clone(),
            });
        }
        if let Some(refused) = refused {
            self.fault_with(FaultCause::SettingsRefused, refused.detail());
        }
        for (cause, detail) in found {
            self.fault_with(cause, detail);
        }
    }

    /// Sends identity, last fault, settings and status. Called at boot and once a second.
    pub fn report(&self, boot: &ThisBoot) {
        self.send_identity(boot);
        if let Some(last) = &boot.last_fault {
            self.send(LastFault {
                faults: boot.faults,
                cause: last.cause,
                boot: last.boot,
                pc: last.pc,
                detail: last.detail.clone(),
            });
        }
        self.send_settings();
        self.send_status();
    }

    pub(crate) fn send_identity(&self, boot: &ThisBoot) {
        self.send(Identity {
            firmware: D::FIRMWARE.into(),
            git: D::GIT.into(),
            uid: self.device.uid(),
            boot: boot.number,
            reset_cause: ResetCauses::from_bits(boot.reset_cause),
            sample_rate_hz: SAMPLE_RATE_HZ,
            channels: CHANNELS as u8,
        });
        self.send(self.device.board());
        let stage = self.device.update_stage();
        if stage != UpdateStage::Settled {
            self.send(Update { stage });
        }
    }

    /// Sends status, health, link and guard.
    pub(crate) fn send_status(&self) {
        self.send(self.status());
        self.send(self.snapshot().health);
        self.send_link();
        self.send(self.guard.get());
    }

    /// Sends the counts of the link.
    pub(crate) fn send_link(&self) {
        self.send(self.link.get());
    }

    /// Logs and sends a fault that the bead survived.
    #[inline(never)]
    pub fn fault(&self, cause: FaultCause, detail: &'static str) {
        self.fault_with(cause, detail.into());
    }

    /// [`fault`](Self::fault) with a formatted detail.
    fn fault_with(&self, cause: FaultCause, detail: Detail) {
        #[cfg(feature = "defmt")]
        defmt::warn!("{=str}", detail.as_str());
        self.send(Fault {
            cause,
            boot: self.boot(),
            pc: 0,
            detail,
        });
    }

    fn status(&self) -> Status {
        let counters = self.snapshot();
        Status {
            uptime_ms: self.device.now() / MS,
            epoch: counters.epoch,
            samples: counters.samples,
            strikes: counters.strikes,
            overruns: counters.overruns,
            blocks_dropped: counters.blocks_dropped,
            frames_dropped_queue_full: counters.frames_dropped_queue_full,
            frames_dropped_too_long: counters.frames_dropped_too_long,
            stack_free_min: self.device.stack_never_used(),
            settings_source: self.settings.source(),
            armed: counters.armed,
        }
    }
}
