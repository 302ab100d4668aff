//! What lets a job run though some heights may stand for nodata: leaving them out.

use crate::init::draft::{Draft, NeededLine};
use job::Error;

/// What a message has before the height.
const ADVICE: &str = "[input] nodata = ";

/// Returns the line that leaves out the height that the message of `error` names; `None` if it names none, or if the draft has such a line.
pub(crate) fn line_for_nodata(draft: &Draft, error: &Error) -> Option<NeededLine> {
    if draft.sets("nodata") {
        return None;
    }
    let message = error.to_string();
    let height = message.split(ADVICE).nth(1)?.split([',', ' ']).next()?;
    let value = height.parse::<i64>().map(toml::Value::from).or_else(|_| height.parse::<f64>().map(toml::Value::from));
    let why = format!("The job stops: {message}. To leave such points out, remove the #.");
    Some(NeededLine::of_input("nodata", value.ok()?, &why))
}
