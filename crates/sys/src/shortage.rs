//! What happens when the system gives no memory where nothing can be done about it: the process ends with the exit code for that,
//! and a job goes on from its journal when it runs again.

use crate::{Error, ErrorKind, Result, address_space, say};
use std::panic::PanicHookInfo;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The least memory that the program needs for anything at all.
const LEAST: u64 = 32 << 20;
/// With less, the program says in advance what to do if it does not suffice: once it runs out there is no memory to say it.
const TIGHT: u64 = 128 << 20;

/// Texts in panics that mean a lack of memory or threads: the standard library, and libraries that start threads, panic with these.
const SHORTAGES: [&str; 5] =
    ["os error 11)", "os error 12)", "code: 11,", "code: 12,", "failed to allocate an alternative stack"];

/// Makes a lack of memory end the process from now on, with the exit code that `code_of` gives, and checks that there is some.
///
/// # Errors
/// [`Error::Memory`] if there is hardly any, [`Error::Io`] if the system refuses.
pub fn listen(code_of: impl Fn(ErrorKind) -> u8) -> Result<()> {
    let panicked = Arc::new(AtomicBool::new(false));
    let [shortage_code, internal_code] =
        [Error::Memory(String::new()), Error::Broken(String::new())].map(|error| i32::from(code_of(error.kind())));
    end_aborts(&panicked, shortage_code, internal_code)?;
    let shown = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| match shortage(info) {
        Some(what) => {
            say(&format!("error: not enough memory: {what}"));
            std::process::exit(shortage_code);
        }
        None => {
            panicked.store(true, Ordering::Relaxed);
            shown(info);
        }
    }));
    let left = address_space::at_start();
    address_space::require(LEAST, left, || "the program".into())?;
    if let Some(left) = left.filter(|left| left.bytes < TIGHT) {
        say(&format!("{}: if a memory allocation fails, raise this limit", left.sentence()));
    }
    Ok(())
}

/// Rust says "memory allocation of ... bytes failed" and aborts: there is no stable way to return an error instead. A process that has
/// `panicked` aborts if it panics again meanwhile: that is an internal fault.
#[cfg(unix)]
fn end_aborts(panicked: &Arc<AtomicBool>, shortage_code: i32, internal_code: i32) -> Result<()> {
    use signal_hook::consts::SIGABRT;
    use signal_hook::flag::register_conditional_shutdown;
    // The first whose condition holds ends the process.
    register_conditional_shutdown(SIGABRT, internal_code, panicked.clone())
        .and_then(|_| register_conditional_shutdown(SIGABRT, shortage_code, Arc::new(AtomicBool::new(true))))
        .map(drop)
        .map_err(Error::io("listen to the signals of", "the system"))
}

#[cfg(not(unix))]
fn end_aborts(_: &Arc<AtomicBool>, _: i32, _: i32) -> Result<()> {
    Ok(())
}

/// Returns what a panic says if it stands for a lack of memory or threads.
fn shortage(info: &PanicHookInfo) -> Option<String> {
    let payload = info.payload();
    let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str))?;
    is_shortage(text).then(|| text.to_owned())
}

fn is_shortage(text: &str) -> bool {
    SHORTAGES.iter().any(|shortage| text.contains(shortage))
}

#[cfg(test)]
mod tests {
    use super::is_shortage;

    #[test]
    fn only_the_two_errors_of_too_little_count() {
        let text = |code| format!("cannot start: {}", std::io::Error::from_raw_os_error(code));
        let debug = |code| format!("failed: {:?}", std::io::Error::from_raw_os_error(code));
        assert!([11, 12].into_iter().all(|code| is_shortage(&text(code)) && is_shortage(&debug(code))));
        assert!(
            ![1, 2, 110, 111, 112, 119, 121]
                .into_iter()
                .any(|code| is_shortage(&text(code)) || is_shortage(&debug(code)))
        );
    }
}
