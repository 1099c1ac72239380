//! One run, seen from inside QEMU.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::count::Counters;
use super::qemu::{self, Qemu};
use super::recorder::{Outside, Recorder, written};
use super::{rtt, self_test};
use crate::exchange::{self, Description, FORMAT, Report, SELF_TEST_STATUS};
use crate::given::{Fault, Poke};
use crate::machine::{Board, Machine, Stimulus};
use crate::memory::{FLASH, WRITABLE, is_ram};

/// The log is looked at with an access of the processor after this time at the earliest.
const RTT_PERIOD_NS: u64 = 100_000;

/// One run, seen from inside QEMU.
pub(super) struct Overlay {
    machine: Machine,
    description: Description,
    folder: PathBuf,
    pub(super) recorder: Recorder,
    /// In order of time.
    pokes: VecDeque<Poke>,
    faults: VecDeque<Fault>,
    rtt_looked_at_ns: u64,
    powered_up: bool,
    interrupts_tested: bool,
    /// QEMU has loaded the image anew, over what the firmware had written to flash.
    reloaded: bool,
    ended: bool,
}

impl Overlay {
    /// Reads the run's description.
    ///
    /// # Errors
    /// One line, what is wrong with the directory.
    pub(super) fn new(folder: &Path) -> Result<Self, String> {
        let odd = |what: &str, why: String| format!("run directory {}: {what}: {why}", folder.display());
        let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| odd(name, e.to_string()));
        let create = |name: &str| File::create(folder.join(name)).map_err(|e| odd(name, e.to_string()));

        let json: serde_json::Value = serde_json::from_slice(&read(exchange::DESCRIPTION)?)
            .map_err(|e| odd(exchange::DESCRIPTION, e.to_string()))?;
        if json.get("format").and_then(serde_json::Value::as_u64) != Some(u64::from(FORMAT)) {
            return Err(
                "this overlay is of another build than the program that runs it; build both again".into(),
            );
        }
        let description: Description =
            serde_json::from_value(json).map_err(|e| odd(exchange::DESCRIPTION, e.to_string()))?;

        let bytes = read(exchange::STIMULUS)?;
        let codes: Vec<u16> = bytes
            .as_chunks()
            .0
            .iter()
            .copied()
            .map(u16::from_le_bytes)
            .collect();
        let rows = codes.as_chunks().0.to_vec();
        let hse_hz = off_by(description.hse_hz, description.hse_ppm);
        let stimulus = Stimulus::new(rows, description.sample_period_ns).on_clock(hse_hz, description.hse_hz);
        let machine = Machine::new(
            hse_hz,
            description.uid,
            stimulus,
            &description.uart_input,
            &description.pin_inputs,
        );
        let mut pokes = description.pokes.clone();
        pokes.sort_by_key(|poke| poke.at_ns);
        let mut faults = description.faults.clone();
        faults.sort_by_key(|fault| fault.at_ns);
        let counters = description.count_instructions.then(|| {
            // Kept for the life of QEMU: its callbacks point there.
            &*Box::leak(Box::new(Counters::new(
                description.labels,
                description.functions.clone(),
            )))
        });
        Ok(Self {
            machine,
            folder: folder.into(),
            recorder: Recorder {
                uart: BufWriter::new(create(exchange::UART)?),
                uart_times: BufWriter::new(create(exchange::UART_TIMES)?),
                rtt: create(exchange::RTT)?,
                counters,
                block_began: None,
                work: description.work.clone(),
                worked: 0,
                worst_block: None,
                working: None,
                flash_before: Vec::new(),
                idle: None,
            },
            pokes: pokes.into(),
            faults: faults.into(),
            rtt_looked_at_ns: 0,
            powered_up: false,
            interrupts_tested: false,
            reloaded: false,
            ended: false,
            description,
        })
    }

    /// The processor reads.
    pub(super) fn read(&mut self, address: u32, bytes: u32, qemu: &Qemu) -> u32 {
        let now = qemu.now();
        let value = self
            .machine
            .read(address, bytes, now, &mut Outside(qemu, &mut self.recorder));
        self.after(now, false, qemu);
        value
    }

    /// The processor writes.
    pub(super) fn write(&mut self, address: u32, bytes: u32, value: u32, qemu: &Qemu) {
        let now = qemu.now();
        self.machine
            .write(address, bytes, value, now, &mut Outside(qemu, &mut self.recorder));
        self.after(now, false, qemu);
    }

    /// The processor stores to flash.
    pub(super) fn store(&mut self, address: u32, bytes: u32, value: u32, qemu: &Qemu) {
        let now = qemu.now();
        self.machine
            .store(address, bytes, value, now, &mut Outside(qemu, &mut self.recorder));
        self.after(now, false, qemu);
    }

    /// The time that was asked for has come.
    pub(super) fn wake(&mut self, qemu: &Qemu) {
        if !std::mem::replace(&mut self.interrupts_tested, true) {
            if let Err(line) = self_test::interrupt_test(qemu) {
                qemu::exit(SELF_TEST_STATUS, &line);
            }
            // What QEMU has loaded there.
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
        while self.next_fault().is_some_and(|at| at <= now)
            && let Some(fault) = self.faults.pop_front()
        {
            self.machine
                .fail(fault.kind, now, &mut Outside(qemu, &mut self.recorder));
        }
        self.after(now, true, qemu);
        if self.ends_at().is_some_and(|end| end <= now) {
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

    /// When the next fault is due: not known before sampling has begun.
    fn next_fault(&self) -> Option<u64> {
        let sampling = self.machine.stimulus().sampling()?;
        Some(sampling.first_ns.saturating_add(self.faults.front()?.at_ns))
    }

    /// The machine is reset. The first time is power-up, which the machine was made for.
    pub(super) fn reset(&mut self, qemu: &Qemu) {
        if !std::mem::replace(&mut self.powered_up, true) {
            // The interrupt controller is ready once everything is reset: test it first of all.
            qemu.wake_at(qemu.now() + 1);
            return;
        }
        let now = qemu.now();
        self.machine.reset(now, &mut Outside(qemu, &mut self.recorder));
        self.recorder.block_began = None;
        while let Some((address, bytes)) = self.recorder.flash_before.pop() {
            qemu.poke(address, &bytes);
        }
        // QEMU's own loading comes after this, and the processor's first instruction after that.
        self.reloaded = true;
        self.after(now, true, qemu);
        qemu.wake_at(now);
    }

    /// When the run is over, as far as known: some time after the stimulus, or when sampling has not begun by then.
    fn ends_at(&self) -> Option<u64> {
        match self.machine.stimulus().ends_at() {
            Some(end) => Some(end.saturating_add(self.description.tail_ns)),
            None => Some(self.description.sampling_deadline_ns),
        }
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
        let next = [
            self.machine.next_interrupt(),
            poke,
            self.next_fault(),
            self.ends_at(),
        ]
        .into_iter()
        .flatten()
        .min();
        if let Some(next) = next {
            qemu.wake_at(next.max(now + 1));
        }
    }

    fn drain_log(&mut self, qemu: &Qemu) {
        if let Some(block) = self.description.rtt {
            let bytes = rtt::drain(block, &mut Guest(qemu));
            written(self.recorder.rtt.write_all(&bytes));
        }
        written(self.recorder.uart.flush());
        written(self.recorder.uart_times.flush());
    }

    /// Writes the report and asks QEMU to stop. What it still executes until then is not recorded.
    fn end(&mut self, now: u64, qemu: &Qemu) {
        if std::mem::replace(&mut self.ended, true) {
            return;
        }
        let report = Report {
            sampling: self.machine.stimulus().sampling(),
            virtual_ns: now,
            overruns: self.machine.overruns(),
            triggers_ignored: self.machine.triggers_ignored(),
            resets: self.machine.resets().to_vec(),
            unknown: self.machine.unknown_registers(),
            unmodelled: self.machine.unmodelled(),
            pins: self.machine.pins(),
            flash_operations: self.machine.flash_operations().to_vec(),
            instructions: self.recorder.counters.map_or(0, Counters::total),
            labels: self.recorder.counters.map_or_else(Vec::new, Counters::labels),
            worst_block: self.recorder.worst_block,
            working: self.recorder.working,
            idle: self.recorder.idle,
        };
        let json = serde_json::to_vec(&report).expect("a plain struct has a JSON form");
        written(std::fs::write(
            self.folder.join(exchange::FLASH),
            self.machine.flash(),
        ));
        written(std::fs::write(self.folder.join(exchange::REPORT), json));
        qemu.request_shutdown();
    }
}

/// The frequency of a crystal that is off by so much: whole Hz, at 8 MHz an eighth of a ppm.
fn off_by(hz: u32, ppm: f64) -> u32 {
    (f64::from(hz) * (1.0 + ppm * 1e-6)).round() as u32
}

/// Guest memory for the log.
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
