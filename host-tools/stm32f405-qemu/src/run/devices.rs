//! The host's end of the buses: queries the devices of a run, in a thread of its own.

use std::io::{BufReader, BufWriter};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::thread::JoinHandle;

use super::error::{RunError, io};
use crate::device::{BusCall, Devices};
use crate::exchange;
use crate::machine::pin;

/// Answers for the devices until QEMU ends.
pub(super) struct DeviceServer {
    thread: Option<JoinHandle<()>>,
    path: PathBuf,
}

impl DeviceServer {
    /// `None` if there are no devices.
    ///
    /// # Errors
    /// The socket cannot be made.
    pub(super) fn start(devices: &Devices, path: PathBuf) -> Result<Option<Self>, RunError> {
        if devices.is_empty() {
            return Ok(None);
        }
        // A socket is left if an earlier QEMU of the run needed another version of the overlay.
        let _ = std::fs::remove_file(&path);
        let listener = UnixListener::bind(&path).map_err(io("cannot make the socket of the devices"))?;
        let devices = devices.clone();
        let thread = std::thread::spawn(move || {
            if let Ok((overlay, _)) = listener.accept() {
                drop(listener);
                serve(&devices, &overlay);
            }
        });
        Ok(Some(Self {
            thread: Some(thread),
            path,
        }))
    }

    /// Ends the thread, after QEMU has ended.
    ///
    /// # Panics
    /// A device has panicked: resumes that panic.
    pub(super) fn finish(mut self) {
        if let Some(Err(panic)) = self.join() {
            std::panic::resume_unwind(panic);
        }
    }

    fn join(&mut self) -> Option<std::thread::Result<()>> {
        let thread = self.thread.take()?;
        // If the overlay never connected, the thread still waits for it.
        drop(UnixStream::connect(&self.path));
        Some(thread.join())
    }
}

impl Drop for DeviceServer {
    fn drop(&mut self) {
        // A panic was printed.
        drop(self.join());
    }
}

fn serve(devices: &Devices, overlay: &UnixStream) {
    let (mut from, mut to) = (BufReader::new(overlay), BufWriter::new(overlay));
    while let Ok((call, _)) = exchange::read_message::<BusCall>(&mut from) {
        let answer = devices.answer(call);
        for level in &answer.levels {
            let name = &level.pin;
            assert!(
                pin(name).is_some(),
                "a device puts a level on {name:?}, which is no pin"
            );
        }
        if exchange::write_message(&mut to, &answer, &[]).is_err() {
            return;
        }
    }
}
