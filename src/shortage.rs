//! What happens when the system gives no memory where nothing can be done about it: the process ends with the exit code for that,
//! and a job goes on from its journal when it runs again.

use crate::{Error, Result, address_space, say};
use std::panic::PanicHookInfo;

/// The least address space that the program needs for anything at all.
const LEAST: u64 = 16 << 20;

/// What panics say that stand for a lack of memory or threads. Rust's own threads and libraries that start some panic with these.
const SHORTAGES: [&str; 5] =
    ["os error 11", "os error 12", "code: 11,", "code: 12,", "failed to allocate an alternative stack"];

/// Makes a lack of memory end the process with its exit code from now on, and checks that there is some.
///
/// # Errors
/// [`Error::Memory`] if there is hardly any, [`Error::Io`] if the system refuses.
pub fn listen() -> Result<()> {
    end_aborts()?;
    let shown = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| match shortage(info) {
        Some(what) => {
            say(&format!("error: not enough memory: {what}"));
            std::process::exit(exit_code());
        }
        None => shown(info),
    }));
    address_space::require(LEAST, address_space::at_start(), || "the program".into())
}

/// Rust says "memory allocation of ... bytes failed" and aborts: there is no stable way to return an error instead. Other aborts, as after
/// a panic while panicking, get that exit code too; they say what they are.
#[cfg(unix)]
fn end_aborts() -> Result<()> {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    let always = Arc::new(AtomicBool::new(true));
    signal_hook::flag::register_conditional_shutdown(signal_hook::consts::SIGABRT, exit_code(), always)
        .map(drop)
        .map_err(Error::io("listen to the signals of", "the system"))
}

#[cfg(not(unix))]
fn end_aborts() -> Result<()> {
    Ok(())
}

fn exit_code() -> i32 {
    i32::from(Error::Memory(String::new()).exit_code())
}

/// Returns what a panic says if it stands for a lack of memory or threads.
fn shortage(info: &PanicHookInfo) -> Option<String> {
    let payload = info.payload();
    let text = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str))?;
    SHORTAGES.iter().any(|shortage| text.contains(shortage)).then(|| text.to_owned())
}
