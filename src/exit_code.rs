//! The exit codes of the program. Scripts and schedulers know them, so what a code means stays.

use sys::ErrorKind;
use verify::Conclusion;

/// Returns the exit code for a failure of this kind.
pub const fn exit_code(kind: ErrorKind) -> u8 {
    match kind {
        ErrorKind::Retry => 1,
        ErrorKind::Usage => 2,
        ErrorKind::Input => 3,
        ErrorKind::Internal => 4,
    }
}

/// Returns the exit code of `verify`. What is missing counts as a bad input: it was not given the whole output.
pub fn exit_code_of_verify(conclusion: Conclusion) -> u8 {
    match conclusion {
        Conclusion::Proved => 0,
        Conclusion::AsFarAsCanBeTold => exit_code(ErrorKind::Input),
        Conclusion::Failed => exit_code(ErrorKind::Internal),
    }
}
