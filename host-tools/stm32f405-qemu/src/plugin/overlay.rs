//! One run, seen from inside QEMU.

use std::collections::VecDeque;
use std::fs::File;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::Sender;

use super::blocks::Blocks;
use super::count::InstructionCounters;
use super::failures::{Failures, Sighting};
use super::fences::fences;
use super::qemu::{self, Qemu};
use super::recorder::{Outside, RunRecorder, written};
use super::stops::Stops;
use super::{handlers, priorities, rtt, self_test, waiting};
use crate::ending::RunEnd;
use crate::exchange::{self, FORMAT, Reached, RunDescription, SELF_TEST_STATUS, TimeStep};
use crate::given::{Fault, Poke, Since};
use crate::machine::{Exterior, Machine};
use crate::memory::{FLASH, WRITABLE, is_ram};
use crate::outcome::{Outcome, StretchWork};
use crate::thumb::{HandBack, Registers};

/// Instructions left to QEMU before the next event.
const MARGIN: u64 = 64;
/// Longest stretch of virtual time executed at once, ns: the overlay listens to the host in between.
const LONGEST_NS: u64 = 1_000_000_000_000;
/// The register with the address of the vectors.
const VTOR: u32 = 0xe000_ed08;

/// One run, seen from inside QEMU.
pub(super) struct Overlay {
    pub(super) machine: Machine,
    pub(super) description: RunDescription<'static>,
    folder: PathBuf,
    recorder: RunRecorder,
    /// For a live run: receives the host's steps.
    pub(super) steps: Option<Sender<TimeStep>>,
    /// Pokes in order of time.
    pokes: VecDeque<Poke>,
    /// Faults counted from power-up, and from the first scan, each in order of time.
    faults: [VecDeque<Fault>; 2],
    failures: Failures,
    /// Time of the last call of the overlay.
    now: u64,
    /// Time for which the overlay has requested the next call.
    wakes_at: u64,
    /// Time up to which the processor stands still: its instructions up to then have been executed.
    executed_to: Option<u64>,
    /// Registers with which the processor continues after a wait of the overlay's own.
    goes_on_with: Option<Registers>,
    /// Time at which the processor has executed the return from a handler that it enters again.
    returns_at: Option<u64>,
    powered_up: bool,
    interrupts_tested: bool,
    /// QEMU has loaded the image anew, over what the firmware wrote to flash.
    reloaded: bool,
    ended: bool,
}

impl Overlay {
    /// Reads the run's description.
    ///
    /// # Errors
    /// One line: what is wrong with the directory.
    pub(super) fn new(folder: &Path) -> Result<Self, String> {
        let description = describe(folder)?;
        let run = &description.run;
        let mut whole = run.clone().into_owned();
        whole.stimulus = exchange::rows(&read(folder, exchange::STIMULUS)?);
        let mut pokes = run.pokes.clone();
        pokes.sort_by_key(|poke| poke.at_ns);
        let faults = [Since::PowerUp, Since::FirstScan].map(|since| {
            let faults = run.faults.iter().filter(|fault| fault.since == since);
            let mut faults: Vec<Fault> = faults.copied().collect();
            faults.sort_by_key(|fault| fault.at_ns);
            faults.into()
        });
        let blocks = run.count_instructions.then(|| {
            let counters = InstructionCounters::new(
                &description.labels,
                description.functions.clone(),
                run.count_cycles,
            );
            // Kept for the life of QEMU: its callbacks point there.
            Blocks::new(Box::leak(Box::new(counters)), description.work.clone())
        });
        let devices = (!run.devices.is_empty()).then(|| {
            let reached = UnixStream::connect(folder.join(exchange::DEVICES));
            reached.map_err(|e| odd(folder, exchange::DEVICES, e.to_string()))
        });
        let (stops, steps) = description.live.then(Stops::new).unzip();
        let mut recorder = RunRecorder::new(folder, blocks, stops)?;
        recorder.devices = devices.transpose()?;
        Ok(Self {
            machine: Machine::new(whole),
            folder: folder.into(),
            recorder,
            steps,
            pokes: pokes.into(),
            faults,
            failures: Failures::default(),
            now: 0,
            wakes_at: 0,
            executed_to: None,
            goes_on_with: None,
            returns_at: None,
            powered_up: false,
            interrupts_tested: false,
            reloaded: false,
            ended: false,
            description,
        })
    }

    /// Sets the stream to the host of a live run.
    pub(super) fn talk_to(&mut self, host: File) {
        if let Some(stops) = &mut self.recorder.stops {
            stops.to = Some(host);
        }
    }

    pub(super) fn counters(&self) -> Option<&'static InstructionCounters> {
        Some(self.recorder.blocks.as_ref()?.counters)
    }

    /// Reads a register for the processor. Most reads change nothing, so the time of the next call stays
    /// valid.
    pub(super) fn read(&mut self, address: u32, bytes: u32, qemu: &Qemu) -> u32 {
        let now = qemu.now();
        if self.machine.is_quiet(now) {
            let mut outside = Outside(qemu, &mut self.recorder);
            if let Some(read) = self.machine.read_steady(address, bytes, now, &mut outside) {
                self.recorder.called();
                self.now = now;
                return read.value;
            }
        }
        self.access(qemu, |machine, now, outside| {
            machine.read(address, bytes, now, outside)
        })
    }

    /// Passes the processor's read, write or store to flash on to the machine by `access`.
    pub(super) fn access<T>(
        &mut self,
        qemu: &Qemu,
        access: impl FnOnce(&mut Machine, u64, &mut Outside<'_>) -> T,
    ) -> T {
        let now = qemu.now();
        self.recorder.called();
        let result = access(&mut self.machine, now, &mut Outside(qemu, &mut self.recorder));
        self.after(now, qemu);
        if self.description.run.stop_when_stuck
            && let Some(register) = self.machine.stuck()
        {
            self.end(RunEnd::Stuck(register), now, qemu);
        }
        result
    }

    /// Handles the events that are due. QEMU calls this at the requested time.
    pub(super) fn wake(&mut self, qemu: &Qemu) {
        if self.goes_on(qemu) {
            return;
        }
        self.recorder.called();
        if !std::mem::replace(&mut self.interrupts_tested, true) {
            if let Err(line) = self_test::interrupt_test(qemu) {
                qemu::exit(SELF_TEST_STATUS, &line);
            }
            let mut vectors = [0; 4 * handlers::VECTORS];
            qemu.read_memory(self.description.vectors, &mut vectors);
            self.machine.set_vectors(self.description.vectors);
            handlers::find(vectors.as_chunks().0);
            // Takes over the contents that QEMU has loaded.
            let mut contents = vec![0; self.machine.flash().len()];
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
        self.judge(now, qemu);
        self.drain_log(qemu);
        self.stop_for_host(now, qemu);
        self.after(now, qemu);
        if self.ends_at() <= now {
            self.end(RunEnd::Over, now, qemu);
        }
    }

    /// Executes a waiting loop here, up to the next time at which something may happen, and stops the
    /// processor for as long. Returns the addresses of the executed instructions, with their counts.
    pub(super) fn shorten_wait(&mut self, qemu: &Qemu) -> Vec<(u32, u64)> {
        let now = qemu.now();
        let ns = qemu.pace.instruction_ns();
        let until = self.wakes_at.saturating_sub(MARGIN * ns);
        let until = until.min(now + LONGEST_NS);
        let may = self.interrupts_tested
            && !self.ended
            && self.executed_to.is_none()
            && self.failures.sightings.is_empty()
            && !self.machine.stands_still()
            && self.description.shortens_waits
            && self.counters().is_none_or(|counters| !counters.times())
            && !qemu.reset_requested.load(Relaxed)
            && now < until;
        let reason = waiting::WATCH.take();
        let returned = self.returns_at.take() == Some(now);
        let fences = may.then(|| fences(qemu)).flatten();
        let registers = fences.as_ref().and_then(|_| qemu.registers_of_processor());
        let registers = registers.filter(|registers| {
            let pending = priorities::pending(qemu);
            pending == 0 || !priorities::may_preempt(pending, registers.exception(), qemu)
        });
        let (Some(fences), Some(registers)) = (fences, registers) else {
            waiting::WATCH.in_vain(reason);
            return Vec::new();
        };
        let mut outside = Outside(qemu, &mut self.recorder);
        let log = self.description.rtt.map(rtt::write_offset);
        let vectors = match qemu.read_nvic(VTOR, 4) as u32 {
            // Flash is also mapped at 0.
            0 => FLASH.start,
            vectors => vectors,
        };
        self.machine.keep_registers();
        let around = waiting::Surroundings {
            machine: &mut self.machine,
            outside: &mut outside,
            qemu,
            log,
            repeats_at: (reason != waiting::Reason::Reads).then_some(now + ns),
            watched: [
                &self.description.fault_handlers,
                &self.description.panic_functions,
            ],
            refused_begun: false,
            fences,
            vectors,
            at_entry: returned,
            margin_ns: MARGIN * ns,
            kept: waiting::KeptWords::default(),
        };
        let executed = waiting::execute(registers, now..until, ns, reason, around);
        waiting::WATCH.executed(reason, &executed);
        self.returns_at = (executed.hands_back == Some(HandBack::Return)).then_some(executed.now + ns);
        if executed.instructions == 0 {
            return Vec::new();
        }
        if executed.endless && self.description.run.stop_when_hung && self.nothing_is_to_come() {
            self.end(RunEnd::Hung(executed.registers.r[15].into()), now, qemu);
            return Vec::new();
        }
        self.now = executed.now;
        self.executed_to = Some(executed.now);
        qemu.wake_at(executed.now);
        self.send_to_wait(executed.registers, qemu);
        executed.counts
    }

    /// Returns `true` if nothing can end a loop that waits.
    fn nothing_is_to_come(&self) -> bool {
        let fault = self.next_fault();
        self.machine.is_at_rest()
            && self.pokes.is_empty()
            && fault.is_none()
            && self.failures.end_at().is_none()
    }

    /// Lets the processor wait for an interrupt or until it is resumed, and then continue with these
    /// registers.
    fn send_to_wait(&mut self, registers: Registers, qemu: &Qemu) {
        self.goes_on_with = Some(registers);
        qemu.send_to_wait(&registers);
    }

    /// The processor has begun to wait: gives it the registers with which it continues.
    pub(super) fn halted(&mut self, qemu: &Qemu) {
        if let Some(registers) = self.goes_on_with.take() {
            qemu.set_registers_of_processor(&registers);
        }
    }

    /// Resumes the processor when its loop is over. Returns `false` if no loop was executed.
    fn goes_on(&mut self, qemu: &Qemu) -> bool {
        let Some(to) = self.executed_to else { return false };
        if qemu.now() < to {
            qemu.wake_at(to);
            return true;
        }
        self.executed_to = None;
        qemu.stall(false);
        // A register that was written may bring an interrupt earlier.
        self.after(qemu.now(), qemu);
        true
    }

    /// The processor has executed WFE, and no event has come.
    pub(super) fn wait_for_event(&mut self, qemu: &Qemu) {
        let vectors = qemu.read_nvic(VTOR, 4) as u32;
        // With another vector table, some handlers may be unknown.
        let at_zero = vectors == 0 && self.description.vectors == FLASH.start;
        let known = vectors == self.description.vectors || at_zero;
        if known
            && self.executed_to.is_none()
            && !priorities::is_any_pending(qemu)
            && !self.machine.stands_still()
            && let Some(registers) = qemu.registers_of_processor()
        {
            self.send_to_wait(registers, qemu);
        }
    }

    /// If this is a stop of a live run, waits for the host to set the next one.
    fn stop_for_host(&mut self, now: u64, qemu: &Qemu) {
        let stops = self.recorder.stops.as_ref();
        if self.ended || stops.is_none_or(|stops| now < stops.at_ns) {
            return;
        }
        self.tell_host(now, false);
        let Some(stops) = &mut self.recorder.stops else {
            return;
        };
        match stops.wait() {
            Some(inputs) => self.machine.feed(inputs, now),
            None => self.end(RunEnd::Over, now, qemu),
        }
    }

    /// In a live run, sends the host the output since the last stop.
    fn tell_host(&mut self, now: u64, ended: bool) {
        let total = self.counters().map_or(0, InstructionCounters::total);
        let Some(stops) = &mut self.recorder.stops else {
            return;
        };
        // The first stop is before the first instruction, but for one that it comes with.
        let is_first = stops.at_ns == 0;
        let before = if is_first {
            0
        } else {
            std::mem::replace(&mut stops.instructions, total)
        };
        let stimulus = self.machine.stimulus();
        let reached = Reached {
            now_ns: now,
            ended,
            sampling: stimulus.sampling(),
            codes_until_ns: stimulus.ends_at(),
            work: StretchWork {
                calls: stops.calls,
                instructions: total - before,
                held: self.machine.held(),
            },
            ..Reached::default()
        };
        self.recorder.tell(reached);
    }

    /// Notes what a callback saw in the middle of a block. It is handled at the end of that block.
    pub(super) fn note_sighting(&mut self, sighting: Sighting, qemu: &Qemu) {
        self.failures.sightings.push(sighting);
        qemu.wake_at(self.now + 1);
    }

    /// Ends the run if the image has failed.
    fn judge(&mut self, now: u64, qemu: &Qemu) {
        for sighting in std::mem::take(&mut self.failures.sightings) {
            match sighting {
                Sighting::Exception(mut exception) => {
                    exception.at_ns = now;
                    if let Some(end) = self.failures.fault(exception) {
                        self.end(end, now, qemu);
                    }
                }
                Sighting::Panic => self.failures.panic(now),
                Sighting::DeepSleep => self.machine.sleep(now, &mut Outside(qemu, &mut self.recorder)),
            }
        }
        if self.failures.end_at().is_some_and(|at| at <= now)
            && let Some(end) = self.failures.due_end(self.machine.watchdog_runs(), qemu)
        {
            self.end(end, now, qemu);
        }
    }

    fn poke(&mut self, poke: &Poke, qemu: &Qemu) {
        let mut outside = Outside(qemu, &mut self.recorder);
        if self.machine.part().flash_space().contains(&poke.address) {
            outside.overwrite_flash(poke.address, &poke.bytes);
        } else {
            qemu.poke(poke.address, &poke.bytes);
        }
    }

    /// Time of the next fault, and its queue. Those counted from the first scan are unknown before it.
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

    /// Handles a reset of the machine by QEMU. The first one is power-up.
    pub(super) fn reset(&mut self, qemu: &Qemu) {
        if !std::mem::replace(&mut self.powered_up, true) {
            // The interrupt controller is ready once everything is reset, and is tested first.
            qemu.wake_at(qemu.now() + 1);
            return;
        }
        let now = qemu.now();
        self.machine.reset(now, &mut Outside(qemu, &mut self.recorder));
        if let Some(blocks) = &mut self.recorder.blocks {
            blocks.restart();
        }
        (self.executed_to, self.goes_on_with, self.returns_at) = (None, None, None);
        waiting::BASE_PRIORITY.forget();
        self.recorder.restore_flash(qemu);
        // After this QEMU loads the image, and then the processor executes its first instruction.
        self.reloaded = true;
        self.failures.reset();
        self.drain_log(qemu);
        self.after(now, qemu);
        qemu.wake_at(now);
    }

    /// End of the run: some time after the stimulus, or the deadline if sampling has not begun.
    fn ends_at(&self) -> u64 {
        if self.recorder.stops.is_some() {
            return u64::MAX;
        }
        let run = &self.description.run;
        let end = self.machine.stimulus().ends_at();
        end.map_or(run.sampling_deadline_ns, |end| end.saturating_add(run.tail_ns))
    }

    /// Requests the next call, at the time of the next event.
    fn after(&mut self, now: u64, qemu: &Qemu) {
        self.now = now;
        if self.ended {
            return;
        }
        let (interrupt, end) = (self.machine.next_interrupt(), self.failures.end_at());
        let poke = self.pokes.front().map(|poke| poke.at_ns);
        let fault = self.next_fault().map(|(at, _)| at);
        let stop = self.recorder.stops.as_ref().map(|stops| stops.at_ns);
        let next = [interrupt, poke, fault, end, stop].into_iter().flatten();
        self.wakes_at = next.fold(self.ends_at(), u64::min).max(now + 1);
        qemu.follow_clock(self.machine.hclk(), self.description.instruction_ns);
        qemu.wake_at(self.wakes_at);
    }

    /// Takes the image's log from its memory. Returns `true` if the image has set the log up.
    pub(super) fn drain_log(&mut self, qemu: &Qemu) -> bool {
        let block = self.description.rtt;
        let log = block.and_then(|block| rtt::drain(block, &mut Guest(qemu)));
        self.recorder.flush(log.as_deref().unwrap_or_default());
        log.is_some()
    }

    /// Address of the log's write offset.
    pub(super) fn log_offset(&self) -> Option<u32> {
        self.description.rtt.map(rtt::write_offset)
    }

    /// First addresses of the handlers of faults, and of the functions that a panic enters.
    pub(super) fn entries(&self) -> [Vec<u32>; 2] {
        let description = &self.description;
        [&description.fault_handlers, &description.panic_functions].map(Clone::clone)
    }

    /// Writes the report: the host requests it, or QEMU ends by itself.
    pub(super) fn stop(&mut self, end: RunEnd, qemu: &Qemu) {
        let now = qemu.now();
        self.drain_log(qemu);
        self.report(end, now, qemu);
    }

    /// Writes the report after a lock-up of the processor, when QEMU can no longer give the time.
    pub(super) fn lock_up(&mut self, qemu: &Qemu) {
        for sighting in std::mem::take(&mut self.failures.sightings) {
            if let Sighting::Exception(mut exception) = sighting {
                exception.at_ns = self.now;
                self.failures.exceptions.push(exception);
            }
        }
        self.drain_log(qemu);
        self.report(RunEnd::LockedUp(None), self.now, qemu);
    }

    /// Writes the outcome and asks QEMU to stop. Instructions that QEMU executes until then are not recorded.
    fn end(&mut self, end: RunEnd, now: u64, qemu: &Qemu) {
        self.drain_log(qemu);
        if self.report(end, now, qemu) {
            qemu.request_shutdown();
        }
    }

    /// Faults and pokes that were still to come at the end of the run.
    fn never_came(&self) -> impl Iterator<Item = String> {
        let sampled = self.machine.stimulus().sampling().is_some();
        let faults = self.faults.iter().flatten().map(move |fault| {
            let (seconds, why) = (fault.at_ns as f64 * 1e-9, fault.since.missed(sampled));
            format!("fault {:?} at {seconds:.6} s{why}", fault.kind)
        });
        let pokes = self.pokes.iter().map(|poke| {
            let seconds = poke.at_ns as f64 * 1e-9;
            format!("poke of {:#010x} at {seconds:.6} s", poke.address)
        });
        faults.chain(pokes)
    }

    /// Writes the outcome, once. Returns `true` the first time.
    fn report(&mut self, end: RunEnd, now: u64, qemu: &Qemu) -> bool {
        if std::mem::replace(&mut self.ended, true) {
            return false;
        }
        let waits = "processor WFE does not wait here: the time that it waits is counted as instructions";
        let mut outcome = Outcome {
            end,
            instructions: self.recorder.blocks.as_ref().map(Blocks::instructions),
            exceptions: std::mem::take(&mut self.failures.exceptions),
            panics: std::mem::take(&mut self.failures.panics),
            interrupts: handlers::taken(),
            stopped_at: qemu::last_block().map(Into::into),
            instruction_ns: qemu.pace.instruction_ns() as u32,
            ..self.machine.outcome(now)
        };
        outcome.never_came.extend(self.never_came());
        let waited = qemu::WAITED_FOR_EVENT.load(Relaxed).then(|| waits.into());
        outcome
            .unmodelled
            .extend(waited.into_iter().chain(self.recorder.lost_log()));
        let json = serde_json::to_vec(&outcome).expect("a plain struct has a JSON form");
        let file = |name: &str| self.folder.join(name);
        written(std::fs::write(file(exchange::FLASH), self.machine.flash()));
        written(std::fs::write(file(exchange::OUTCOME), json));
        self.tell_host(now, true);
        true
    }
}

fn read(folder: &Path, name: &str) -> Result<Vec<u8>, String> {
    std::fs::read(folder.join(name)).map_err(|e| odd(folder, name, e.to_string()))
}

fn odd(folder: &Path, name: &str, why: String) -> String {
    format!("run directory {}: {name}: {why}", folder.display())
}

/// The run's description.
fn describe(folder: &Path) -> Result<RunDescription<'static>, String> {
    let odd = |e: serde_json::Error| odd(folder, exchange::DESCRIPTION, e.to_string());
    let json: serde_json::Value =
        serde_json::from_slice(&read(folder, exchange::DESCRIPTION)?).map_err(odd)?;
    if json.get("format").and_then(serde_json::Value::as_u64) != Some(u64::from(FORMAT)) {
        let other = "this overlay comes from another build than the program that runs it; build both again";
        return Err(other.into());
    }
    serde_json::from_value(json).map_err(odd)
}

/// Guest memory for the log. Addresses outside RAM read as zero: an address that the image has not set yet
/// may be that of one of our registers.
struct Guest<'a>(&'a Qemu);

impl rtt::GuestMemory for Guest<'_> {
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
