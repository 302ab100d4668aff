//! Which of some names a mistyped one may mean.

/// How alike two names are at least: a letter in two may be another one.
const LEAST: f64 = 0.5;

/// Names with less in common share only letters, unless they are short.
const LEAST_OF_LONG: f64 = 0.6;

/// No name is longer.
const LONGEST: usize = 60;

/// Returns the name that is most like `word`, if one is like it.
pub(crate) fn nearest<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if word.chars().count() > LONGEST {
        return None;
    }
    let plain = |name: &str| name.to_lowercase().replace(['-', '_', ' '], "");
    let word = plain(word);
    let least = if word.chars().count() > 4 { LEAST_OF_LONG } else { LEAST };
    let likeness = |name: &'a str| (strsim::normalized_damerau_levenshtein(&word, &plain(name)), name);
    let best = names.map(likeness).max_by(|(one, _), (other, _)| one.total_cmp(other));
    best.filter(|(likeness, _)| *likeness >= least).map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_fingers_is_seen_and_another_word_is_not() {
        let names = ["files", "surface", "max_error", "to_crs", "foot", "us-foot", "metre", "check"];
        for (word, name) in [
            ("surfce", Some("surface")),
            ("Surface", Some("surface")),
            ("maxerror", Some("max_error")),
            ("max-error", Some("max_error")),
            ("file", Some("files")),
            ("feet", Some("foot")),
            ("meter", Some("metre")),
            ("us_foot", Some("us-foot")),
            ("chek", Some("check")),
            ("colour", None),
            ("", None),
        ] {
            assert_eq!(nearest(word, names.into_iter()), name, "{word}");
        }
    }
}
