//! Threads of a process that was forked.
//!
//! # Design
//! Python's `multiprocessing` forks on Linux, and a child has none of its parent's threads: work that is
//! given to the parent's pool would wait for ever. A child therefore makes a pool of its own. The first
//! process works on the calling thread, where Python looks for Ctrl-C.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// The process in which the package was imported.
static FIRST: OnceLock<u32> = OnceLock::new();
/// The pool of a child.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Notes the process in which the package is imported.
pub(crate) fn note_process() {
    let _ = FIRST.set(process::id());
}

/// Runs a function with threads that this process has.
pub(crate) fn on_threads<T: Send>(run: impl FnOnce() -> T + Send) -> T {
    let process = process::id();
    if FIRST.get() == Some(&process) {
        return run();
    }
    match pool(process) {
        Some(pool) => pool.install(run),
        // Without a thread to spare, the calling one does the work.
        None => run(),
    }
}

fn pool(process: u32) -> Option<Arc<ThreadPool>> {
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if kept.as_ref().is_none_or(|(of, _)| *of != process) {
        let made = Arc::new(ThreadPoolBuilder::new().build().ok()?);
        // Never drops the parent's pool: its threads are not here to end.
        std::mem::forget(kept.replace((process, made)));
    }
    kept.as_ref().map(|(_, pool)| Arc::clone(pool))
}
