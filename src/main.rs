//! The command-line program; see `signorini --help` and the README.

use std::env;

#[global_allocator]
static ALLOCATOR: signorini::memory::LargePages = signorini::memory::LargePages;

fn main() -> std::process::ExitCode {
    without_device_selection();
    signorini::cli::run(env::args_os()).into()
}

/// Disables Mesa's layer that orders Vulkan devices, where it would only write errors: it asks Wayland for the device
/// of the screen. Without a directory for that (over ssh, in containers and batch jobs) libwayland writes
/// `error: XDG_RUNTIME_DIR is invalid or not set` into each run that looks for a GPU. `NODEVICE_SELECT` is the layer's
/// own switch. It stays on for users who select a device with it.
fn without_device_selection() {
    let is_there = env::var_os("XDG_RUNTIME_DIR")
        .is_some_and(|path| path.as_encoded_bytes().starts_with(b"/"));
    let is_used = ["MESA_VK_DEVICE_SELECT", "NODEVICE_SELECT"].map(env::var_os);
    if !is_there && is_used.iter().all(Option::is_none) {
        // SAFETY: no other thread exists yet that could read the environment.
        unsafe { env::set_var("NODEVICE_SELECT", "1") };
    }
}
