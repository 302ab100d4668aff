//! Opening the browser of the user.

/// Opens `url` in the browser of the user. Returns why that cannot be done.
///
/// # Errors
/// A text for the user.
pub fn open(url: &str) -> Result<(), String> {
    if !has_screen() {
        return Err("this machine has no screen".into());
    }
    open::that_detached(url).map_err(|error| error.to_string())
}

/// Tells whether a browser has a screen to appear on. Without one, Linux would start a browser for the terminal, if anything.
fn has_screen() -> bool {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(target_os = "linux") || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")
}
