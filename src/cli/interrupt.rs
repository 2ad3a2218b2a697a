//! Ctrl-C and SIGTERM: the first asks the render to stop and to write what there is, the second ends the process.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// Catches the signals from here on. If the system refuses, they end the process as they always do.
pub(crate) fn install() {
    INSTALLED.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
        if let Err(error) = installed {
            tracing::warn!("cannot catch Ctrl-C ({error}): it will end the run without an image");
        }
    });
}

/// Whether a signal came.
pub(crate) fn requested() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}
