//! Whether a window can be opened here. winit and wgpu panic where it cannot, so it is asked before.

/// Whether a window can be opened.
pub fn check() -> Result<(), String> {
    #[cfg(target_os = "linux")]
    linux::display()?;
    check_driver()
}

/// Whether something can be drawn.
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

    /// winit takes Wayland if `WAYLAND_DISPLAY` is set and does not fall back to X11.
    pub fn display() -> Result<(), String> {
        if let Some(name) = std::env::var_os("WAYLAND_DISPLAY").filter(|name| !name.is_empty()) {
            let folder = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default();
            let answers = UnixStream::connect(folder.join(name)).is_ok();
            return answers.then_some(()).ok_or("the Wayland display does not answer".into());
        }
        let Some(display) = std::env::var("DISPLAY").ok().filter(|display| !display.is_empty()) else {
            return Err("there is no display (neither WAYLAND_DISPLAY nor DISPLAY is set)".into());
        };
        if x11_answers(&display) { Ok(()) } else { Err(format!("the display {display} does not answer")) }
    }

    /// A display on this machine must answer; one on another (`host:0`) is taken at its word.
    fn x11_answers(display: &str) -> bool {
        let Some((host, screen)) = display.rsplit_once(':') else { return false };
        let number = screen.split('.').next().unwrap_or_default();
        let here = host.is_empty() || host == "unix";
        !here || UnixStream::connect(format!("/tmp/.X11-unix/X{number}")).is_ok()
    }
}
