//! Checks for a display and a graphics driver, without which winit and wgpu panic.

/// Checks whether a window can be opened; the error is the reason.
pub fn check() -> Result<(), String> {
    #[cfg(target_os = "linux")]
    linux::display()?;
    check_driver()
}

/// Checks for a graphics driver; the error is the reason.
pub fn check_driver() -> Result<(), String> {
    let wanted = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
    let instance = wgpu::Instance::default();
    if bevy::tasks::block_on(instance.enumerate_adapters(wanted & wgpu::Backends::PRIMARY)).is_empty() {
        return Err("there is no graphics driver (Vulkan on Linux)".into());
    }
    Ok(())
}

#[cfg(target_os = "linux")]
mod linux {
    use std::os::unix::net::UnixStream;
    use std::path::PathBuf;

    /// winit uses Wayland if `WAYLAND_DISPLAY` is set, without a fallback to X11.
    pub fn display() -> Result<(), String> {
        if let Some(name) = std::env::var_os("WAYLAND_DISPLAY").filter(|name| !name.is_empty()) {
            let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default();
            let is_running = UnixStream::connect(folder.join(name)).is_ok();
            return is_running.then_some(()).ok_or("the Wayland display does not respond".into());
        }
        let Some(display) = std::env::var("DISPLAY").ok().filter(|display| !display.is_empty()) else {
            return Err("there is no display (neither WAYLAND_DISPLAY nor DISPLAY is set)".into());
        };
        if x11_responds(&display) { Ok(()) } else { Err(format!("the display {display} does not respond")) }
    }

    /// Whether a display on this machine responds; true for one on another machine (`host:0`), which is not checked.
    fn x11_responds(display: &str) -> bool {
        let Some((host, screen)) = display.rsplit_once(':') else { return false };
        let number = screen.split('.').next().unwrap_or_default();
        let here = host.is_empty() || host == "unix";
        !here || UnixStream::connect(format!("/tmp/.X11-unix/X{number}")).is_ok()
    }
}
