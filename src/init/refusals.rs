//! Why no configuration makes a job of the clouds.

use crate::init::draft::Draft;
use job::Error;

/// What messages call the table of options that `init` never writes.
const OF_TEXTS: &str = "[input.csv]";

/// The reasons why drafts were refused, in the order in which they were tried.
#[derive(Default)]
pub(crate) struct Refusals(Vec<Refusal>);

struct Refusal {
    /// The lines of the draft, beyond what all drafts have.
    lines: String,
    error: Error,
}

impl Refusals {
    /// Adds why a draft was refused.
    pub(crate) fn add(&mut self, draft: &Draft, error: Error) {
        let lines: Vec<String> = draft.all_lines().map(|line| format!("{} = {}", line.key, line.value)).collect();
        self.0.push(Refusal { lines: lines.join(" and "), error });
    }

    /// Returns the first reason, which is that of the clouds as they are, with the last one, if that is another: the first may advise
    /// what was tried in vain.
    pub(crate) fn into_error(self) -> Error {
        let last = self.0.last().map(|last| last.error.to_string()).unwrap_or_default();
        let mut all = self.0.into_iter();
        let Some(Refusal { error: first, .. }) = all.next() else {
            return sys::Error::Broken("init gave up without a reason".into()).into();
        };
        match all.find(|later| later.error.to_string() == last) {
            Some(Refusal { lines, .. }) if first.to_string() != last => {
                with_more(first, &format!("; with {lines}: {last}"))
            }
            _ => first,
        }
    }
}

/// Returns the error with what to do if it advises a table that `init` does not write.
pub(crate) fn with_way_out(error: Error) -> Error {
    if !error.to_string().contains(OF_TEXTS) {
        return error;
    }
    with_more(
        error,
        "; init does not write this table: write a configuration yourself, with `files` under [input], such as \
         columns = [\"x\", \"y\", \"z\"] under [input.csv], and `directory` under [output]",
    )
}

/// Returns the error with more advice, if it has some.
pub(crate) fn with_more(error: Error, more: &str) -> Error {
    match error {
        Error::System(sys::Error::Input { path, what }) => sys::Error::Input { path, what: what + more }.into(),
        Error::System(sys::Error::Config(what)) => sys::Error::Config(what + more).into(),
        Error::NoTerrain(what) => Error::NoTerrain(what + more),
        error => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init::config_folder::ConfigFolder;
    use crate::init::draft::NeededLine;

    fn told(reasons: &[(&[&'static str], &str)]) -> String {
        let draft = Draft::new(Vec::new(), "out".into(), &ConfigFolder::of(None).unwrap());
        let mut refusals = Refusals::default();
        for (keys, why) in reasons {
            let lines = keys.iter().map(|key| NeededLine::of_input(key, "a", ""));
            refusals.add(&draft.with(lines), sys::Error::Config((*why).into()).into());
        }
        refusals.into_error().to_string()
    }

    #[test]
    fn the_first_reason_is_said_and_the_last_if_it_is_another() {
        assert_eq!(told(&[(&[], "x")]), "x");
        assert_eq!(told(&[(&[], "x"), (&["k"], "x")]), "x");
        assert_eq!(told(&[(&[], "x"), (&["k"], "y")]), "x; with k = \"a\": y");
        let all: [(&[&str], &str); 4] = [(&[], "x"), (&["k"], "z"), (&["l"], "y"), (&["l", "m"], "y")];
        assert_eq!(told(&all), "x; with l = \"a\": y");
    }

    #[test]
    fn advice_that_init_cannot_follow_comes_with_a_way() {
        let what = with_way_out(sys::Error::input("a.csv", "name them under [input.csv]").into()).to_string();
        assert!(what.contains("yourself") && what.contains("columns = "), "{what}");
        assert_eq!(with_way_out(sys::Error::Config("x".into()).into()).to_string(), "x");
    }
}
