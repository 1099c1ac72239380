//! One run, seen from inside QEMU.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use super::blocks::Blocks;
use super::count::Counters;
use super::qemu::{self, Qemu};
use super::recorder::{Outside, Recorder, written};
use super::{rtt, self_test};
use crate::exchange::{self, Description, FORMAT, SELF_TEST_STATUS};
use crate::given::{Fault, Poke, Run, Since};
use crate::machine::{Board, Machine};
use crate::memory::{FLASH, WRITABLE, is_ram};
use crate::outcome::Outcome;

/// An access of the processor makes the overlay look at the log, if this time has passed since the last look.
const RTT_PERIOD_NS: u64 = 100_000;

/// One run, seen from inside QEMU.
pub(super) struct Overlay {
    machine: Machine,
    description: Description<'static>,
    folder: PathBuf,
    recorder: Recorder,
    /// In order of time.
    pokes: VecDeque<Poke>,
    /// Those since power-up, and those since the first scan.
    faults: [VecDeque<Fault>; 2],
    rtt_looked_at_ns: u64,
    powered_up: bool,
    interrupts_tested: bool,
    /// QEMU has loaded the image anew, over what the firmware wrote to flash.
    reloaded: bool,
    ended: bool,
}

impl Overlay {
    /// Reads what to run.
    ///
    /// # Errors
    /// One line: what is wrong with the directory.
    pub(super) fn new(folder: &Path) -> Result<Self, String> {
        let description = describe(folder)?;
        let run = &description.run;
        let machine = Machine::new(Run {
            stimulus: rows(folder)?,
            ..run.clone().into_owned()
        });
        let mut pokes = run.pokes.clone();
        pokes.sort_by_key(|poke| poke.at_ns);
        let faults = [Since::PowerUp, Since::FirstScan].map(|since| {
            let faults = run.faults.iter().filter(|fault| fault.since == since);
            let mut faults: Vec<Fault> = faults.copied().collect();
            faults.sort_by_key(|fault| fault.at_ns);
            faults.into()
        });
        let blocks = run.count_instructions.then(|| {
            let counters = Counters::new(&description.labels, description.functions.clone());
            // Kept for the life of QEMU: its callbacks point there.
            Blocks::new(Box::leak(Box::new(counters)), description.work.clone())
        });
        Ok(Self {
            machine,
            folder: folder.into(),
            recorder: Recorder::new(folder, blocks)?,
            pokes: pokes.into(),
            faults,
            rtt_looked_at_ns: 0,
            powered_up: false,
            interrupts_tested: false,
            reloaded: false,
            ended: false,
            description,
        })
    }

    /// The counters of instructions, if any are counted.
    pub(super) fn counters(&self) -> Option<&'static Counters> {
        Some(self.recorder.blocks.as_ref()?.counters)
    }

    /// The processor reads, writes or stores to flash: `access` says it to the machine.
    pub(super) fn access<T>(
        &mut self,
        qemu: &Qemu,
        access: impl FnOnce(&mut Machine, u64, &mut Outside<'_>) -> T,
    ) -> T {
        let now = qemu.now();
        let result = access(&mut self.machine, now, &mut Outside(qemu, &mut self.recorder));
        self.after(now, false, qemu);
        result
    }

    /// The time that the overlay asked for has come.
    pub(super) fn wake(&mut self, qemu: &Qemu) {
        if !std::mem::replace(&mut self.interrupts_tested, true) {
            if let Err(line) = self_test::interrupt_test(qemu) {
                qemu::exit(SELF_TEST_STATUS, &line);
            }
            // Takes over what QEMU has loaded there.
            let mut contents = vec![0; WRITABLE.len()];
            qemu.read_memory(WRITABLE.start, &mut contents);
            self.machine.set_flash(contents);
        }
        if std::mem::take(&mut self.reloaded) {
            qemu.poke(WRITABLE.start, self.machine.flash());
        }
        let now = qemu.now();
        self.machine.advance(now, &mut Outside(qemu, &mut self.recorder));
        while let Some(poke) = self.pokes.pop_front_if(|poke| poke.at_ns <= now) {
            self.poke(&poke, qemu);
        }
        while let Some((_, queue)) = self.next_fault().filter(|(at, _)| *at <= now)
            && let Some(fault) = self.faults[queue].pop_front()
        {
            self.machine
                .fail(fault.kind, now, &mut Outside(qemu, &mut self.recorder));
        }
        self.after(now, true, qemu);
        if self.ends_at() <= now {
            self.end(now, qemu);
        }
    }

    fn poke(&mut self, poke: &Poke, qemu: &Qemu) {
        let mut outside = Outside(qemu, &mut self.recorder);
        if FLASH.contains(&poke.address) {
            outside.overwrite_flash(poke.address, &poke.bytes);
        } else {
            qemu.poke(poke.address, &poke.bytes);
        }
    }

    /// When the next fault is due, and its queue. Those since the first scan are not known before it.
    fn next_fault(&self) -> Option<(u64, usize)> {
        let first = self
            .machine
            .stimulus()
            .sampling()
            .map(|sampling| sampling.first_ns);
        let fronts = self.faults.iter().enumerate().filter_map(|(queue, faults)| {
            let fault = faults.front()?;
            Some((fault.since.plus(fault.at_ns, first)?, queue))
        });
        fronts.min()
    }

    /// QEMU has reset the machine. The first time is power-up.
    pub(super) fn reset(&mut self, qemu: &Qemu) {
        if !std::mem::replace(&mut self.powered_up, true) {
            // The interrupt controller is ready once everything is reset. Its test comes first of all.
            qemu.wake_at(qemu.now() + 1);
            return;
        }
        let now = qemu.now();
        self.machine.reset(now, &mut Outside(qemu, &mut self.recorder));
        if let Some(blocks) = &mut self.recorder.blocks {
            blocks.restart();
        }
        self.recorder.restore_flash(qemu);
        // After this QEMU loads the image, and after that comes the processor's first instruction.
        self.reloaded = true;
        self.after(now, true, qemu);
        qemu.wake_at(now);
    }

    /// When the run is over: some time after the stimulus, or at a deadline if sampling has
    /// not begun.
    fn ends_at(&self) -> u64 {
        let run = &self.description.run;
        let end = self.machine.stimulus().ends_at();
        end.map_or(run.sampling_deadline_ns, |end| end.saturating_add(run.tail_ns))
    }

    fn after(&mut self, now: u64, look_at_log: bool, qemu: &Qemu) {
        if self.ended {
            return;
        }
        if look_at_log || now >= self.rtt_looked_at_ns + RTT_PERIOD_NS {
            self.drain_log(qemu);
            self.rtt_looked_at_ns = now;
        }
        let poke = self.pokes.front().map(|poke| poke.at_ns);
        let fault = self.next_fault().map(|(at, _)| at);
        let next = [self.machine.next_interrupt(), poke, fault].into_iter().flatten();
        let next = next.fold(self.ends_at(), u64::min);
        qemu.wake_at(next.max(now + 1));
    }

    fn drain_log(&mut self, qemu: &Qemu) {
        let block = self.description.rtt;
        let log = block.map(|block| rtt::drain(block, &mut Guest(qemu)));
        self.recorder.flush(&log.unwrap_or_default());
    }

    /// Writes the outcome and asks QEMU to stop. What it still executes until then is not recorded.
    fn end(&mut self, now: u64, qemu: &Qemu) {
        if std::mem::replace(&mut self.ended, true) {
            return;
        }
        let outcome = Outcome {
            instructions: self.recorder.blocks.as_ref().map(Blocks::instructions),
            ..self.machine.outcome(now)
        };
        let json = serde_json::to_vec(&outcome).expect("a plain struct has a JSON form");
        let file = |name: &str| self.folder.join(name);
        written(std::fs::write(file(exchange::FLASH), self.machine.flash()));
        written(std::fs::write(file(exchange::OUTCOME), json));
        qemu.request_shutdown();
    }
}

fn read(folder: &Path, name: &str) -> Result<Vec<u8>, String> {
    std::fs::read(folder.join(name)).map_err(|e| odd(folder, name, e.to_string()))
}

fn odd(folder: &Path, name: &str, why: String) -> String {
    format!("run directory {}: {name}: {why}", folder.display())
}

/// The run's description.
fn describe(folder: &Path) -> Result<Description<'static>, String> {
    let odd = |e: serde_json::Error| odd(folder, exchange::DESCRIPTION, e.to_string());
    let json: serde_json::Value =
        serde_json::from_slice(&read(folder, exchange::DESCRIPTION)?).map_err(odd)?;
    if json.get("format").and_then(serde_json::Value::as_u64) != Some(u64::from(FORMAT)) {
        return Err(
            "this overlay is of another build than the program that runs it; build both again".into(),
        );
    }
    serde_json::from_value(json).map_err(odd)
}

/// The rows of the stimulus.
fn rows(folder: &Path) -> Result<Vec<[u16; 4]>, String> {
    let bytes = read(folder, exchange::STIMULUS)?;
    let row = |row: &[[u8; 2]; 4]| row.map(u16::from_le_bytes);
    Ok(bytes.as_chunks().0.as_chunks().0.iter().map(row).collect())
}

/// Guest memory for the log. What is not RAM reads as zero: an address that the image has not set yet may be
/// a register of ours.
struct Guest<'a>(&'a Qemu);

impl rtt::Memory for Guest<'_> {
    fn read(&mut self, address: u32, bytes: &mut [u8]) {
        if is_ram(address, bytes.len()) {
            self.0.read_memory(address, bytes);
        }
    }

    fn write(&mut self, address: u32, bytes: &[u8]) {
        if is_ram(address, bytes.len()) {
            self.0.write_memory(address, bytes);
        }
    }
}
