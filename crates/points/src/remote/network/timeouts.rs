//! How often a request is repeated, and how long the program waits for a server.

use std::time::{Duration, Instant};

use crate::remote::network::failure::{Failure, FailureKind};
use sys::fault;

/// How long a server may take.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// The longest time for a connection, for the beginning of an answer, and for a body.
    pub(crate) answer: Duration,
    /// No request is repeated when so much time has passed without progress.
    pub(crate) give_up: Duration,
    /// The pause before the first repetition. Each later one is twice as long, up to [`LONGEST_PAUSE`].
    first_pause: Duration,
}

/// Whatever a server asks for, no pause is longer.
const LONGEST_PAUSE: Duration = Duration::from_secs(20);

/// Of a server that could never be reached, no more is to be expected after so many requests.
const MOST_UNREACHABLE: u32 = 3;

/// So many bytes of an answer that broke off are progress.
const PROGRESS: usize = 1 << 12;

impl Timeouts {
    /// Returns that of the program.
    pub(crate) fn standard() -> Timeouts {
        match fault::network_timeout() {
            Some(all) => Timeouts { answer: all / 4, give_up: all, first_pause: all / 100 },
            None => Timeouts {
                answer: Duration::from_secs(30),
                give_up: Duration::from_secs(90),
                first_pause: Duration::from_millis(500),
            },
        }
    }
}

/// Runs `attempt` until it succeeds, cannot succeed, or makes no progress for too long. It returns the number of bytes that came if it
/// fails. `was_reached` tells whether the server was ever reached.
pub(crate) fn persist<T>(
    timeouts: Timeouts,
    was_reached: bool,
    mut attempt: impl FnMut() -> Result<T, (usize, Failure)>,
) -> Result<T, Failure> {
    let (mut quiet_since, mut in_vain, mut pause) = (Instant::now(), 0, timeouts.first_pause);
    loop {
        let (came, failure) = match attempt() {
            Ok(done) => return Ok(done),
            Err(failed) => failed,
        };
        if came >= PROGRESS {
            (quiet_since, in_vain, pause) = (Instant::now(), 0, timeouts.first_pause);
        }
        in_vain += 1;
        let is_hopeless = failure.kind == FailureKind::Unreachable && !was_reached && in_vain >= MOST_UNREACHABLE;
        let wanted = failure.pause.unwrap_or(pause).max(pause).min(LONGEST_PAUSE);
        let is_too_late = quiet_since.elapsed().saturating_add(wanted) > timeouts.give_up;
        if !failure.may_pass() {
            return Err(failure);
        }
        if is_hopeless || is_too_late {
            let seconds = quiet_since.elapsed().as_secs_f64();
            let what = format!("{} ({in_vain} times in {seconds:.0} s); run again later", failure.what);
            return Err(Failure { what, ..failure });
        }
        std::thread::sleep(wanted);
        pause = pause.saturating_mul(2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Timeouts = Timeouts {
        answer: Duration::from_millis(10),
        give_up: Duration::from_millis(60),
        first_pause: Duration::from_millis(1),
    };

    /// Returns what came of attempts that fail with these kinds and numbers of bytes, and how many there were.
    fn outcome(
        was_reached: bool,
        fails: &mut dyn FnMut(u32) -> Option<(usize, FailureKind)>,
    ) -> (Result<(), Failure>, u32) {
        let mut count = 0;
        let done = persist(SHORT, was_reached, || {
            count += 1;
            fails(count).map_or(Ok(()), |(came, kind)| Err((came, Failure::new(kind, "it failed"))))
        });
        (done, count)
    }

    #[test]
    fn what_may_pass_is_tried_again_but_not_for_ever() {
        let (done, count) = outcome(false, &mut |count| (count < 4).then_some((0, FailureKind::Passing)));
        assert!(done.is_ok() && count == 4);
        let (done, count) = outcome(false, &mut |_| Some((0, FailureKind::Passing)));
        // 1 + 2 + 4 + 8 + 16 ms of pauses fit, and 32 more do not.
        assert!((2..=6).contains(&count), "{count}");
        assert!(done.unwrap_err().what.contains(&format!("it failed ({count} times in 0 s)")));
        let (_, count) = outcome(false, &mut |_| Some((0, FailureKind::Refused)));
        assert_eq!(count, 1);
    }

    #[test]
    fn a_server_that_was_never_reached_is_given_up_sooner() {
        assert_eq!(outcome(false, &mut |_| Some((0, FailureKind::Unreachable))).1, MOST_UNREACHABLE);
        assert!(outcome(true, &mut |count| (count < 5).then_some((0, FailureKind::Unreachable))).0.is_ok());
    }

    #[test]
    fn progress_gives_new_patience() {
        let (done, _) = outcome(false, &mut |count| (count < 30).then_some((PROGRESS, FailureKind::Passing)));
        assert!(done.is_ok());
        let (done, _) = outcome(false, &mut |count| (count < 300).then_some((PROGRESS - 1, FailureKind::Passing)));
        assert!(done.is_err());
    }
}
