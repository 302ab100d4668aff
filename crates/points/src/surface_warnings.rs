//! What to say if the classes or returns of points do not fit the surface that a job makes.

use crate::options::InputOptions;
use crate::points::classes;
use crate::points::classes::is_ground;
use crate::points::counts::PointCounts;
use crate::points::returns::KeptReturns;
use crate::surface::{Surface, percent};

/// The most classes that a sentence lists.
const MOST_LISTED: usize = 8;

/// Returns what to do about points of which none is on the ground, if the job wants only such; `None` if there are some, or others do.
pub fn no_ground(options: &InputOptions, counts: &PointCounts) -> Option<String> {
    let has_ground = counts.classes.keys().any(|&class| is_ground(class));
    if options.surface != Surface::Ground || has_ground || counts.classes.is_empty() {
        return None;
    }
    Some(format!(
        "surface = \"ground\" takes classes 2, 8, 9 and 20, and the points have {}; fix: [input] surface = \"bare-earth\" finds the \
         ground, [input] classes takes other classes",
        listed(counts)
    ))
}

/// Returns what to do about a text without a column of classes, if the job wants the ground.
pub fn no_column_of_classes() -> String {
    "surface = \"ground\" takes classes 2, 8, 9 and 20, and the file has no column of classes; fix: [input] surface = \"bare-earth\" \
     finds the ground; [input.csv] columns names the column, if there is one"
        .into()
}

/// Returns a warning about records that do not say clearly which return they are.
pub fn unclear_returns(options: &InputOptions, counts: &PointCounts) -> Option<String> {
    // Points that do not say their return are all used.
    if options.finds_ground() {
        return None;
    }
    let rule = match options.kept_returns() {
        KeptReturns::All => return None,
        KeptReturns::First => "they are treated as first returns",
        KeptReturns::Last => "they are treated as last returns if the number is not below the number of returns",
        KeptReturns::Numbers(_) => "they are treated as number 1",
    };
    // Points of other classes are not looked at.
    let kept = options.kept_classes();
    let all: u64 = counts.classes.iter().filter(|&(&class, _)| kept[class as usize]).map(|(_, count)| count).sum();
    (counts.unclear_returns > 0).then(|| {
        format!(
            "{} of the points ({} of {all}) have no valid return number: {rule}",
            percent(counts.unclear_returns, all),
            counts.unclear_returns
        )
    })
}

/// Returns the classes of points, those of most points first.
pub fn listed(counts: &PointCounts) -> String {
    let all: u64 = counts.classes.values().sum();
    let mut by_count: Vec<(u8, u64)> = counts.classes.iter().map(|(&class, &count)| (class, count)).collect();
    by_count.sort_by_key(|&(class, count)| (std::cmp::Reverse(count), class));
    let text = |&(class, count): &(u8, u64)| match classes::name(class) {
        "" => format!("class {class} ({})", percent(count, all)),
        name => format!("class {class} ({name}, {})", percent(count, all)),
    };
    let mut texts: Vec<String> = by_count.iter().take(MOST_LISTED).map(text).collect();
    if by_count.len() > MOST_LISTED {
        texts.push(format!("{} more", by_count.len() - MOST_LISTED));
    }
    texts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str) -> InputOptions {
        toml::from_str(&format!("files = [\"a.laz\"]\n{text}")).unwrap()
    }

    fn counts(classes: &[(u8, u64)], unclear_returns: u64) -> PointCounts {
        PointCounts { classes: classes.iter().copied().collect(), unclear_returns, ..PointCounts::default() }
    }

    #[test]
    fn points_without_ground_are_described() {
        let ground = options("surface = \"ground\"");
        let what = no_ground(&ground, &counts(&[(1, 95), (5, 4), (70, 1)], 0)).unwrap();
        assert!(
            what.contains("have class 1 (unclassified, 95 %), class 5 (high vegetation, 4 %), class 70 (1 %); fix: [input] surface = \"bare-earth\""),
            "{what}"
        );
        let many: Vec<(u8, u64)> = (30..60).map(|class| (class, 1)).collect();
        assert!(no_ground(&ground, &counts(&many, 0)).unwrap().contains("class 37 (3 %), 22 more; fix"));
        assert_eq!(no_ground(&ground, &counts(&[(1, 95), (20, 1)], 0)), None);
        assert_eq!(no_ground(&ground, &counts(&[], 0)), None);
        assert_eq!(no_ground(&options(""), &counts(&[(1, 95)], 0)), None);
    }

    #[test]
    fn unclear_returns_matter_only_if_returns_are_chosen() {
        let counts = counts(&[(1, 150), (2, 50)], 50);
        assert_eq!(unclear_returns(&options("surface = \"ground\""), &counts), None);
        for (text, words) in [
            ("surface = \"first\"", "25 % of the points (50 of 200) have no valid return number: they are"),
            ("returns = \"last\"", "last returns if"),
            ("returns = [2]", "number 1"),
        ] {
            let warning = unclear_returns(&options(text), &counts).unwrap();
            assert!(warning.contains(words), "{warning}");
        }
        // Points of other classes have no say.
        let of_class = unclear_returns(&options("surface = \"first\"\nclasses = [2]"), &counts).unwrap();
        assert!(of_class.starts_with("100 % of the points (50 of 50)"), "{of_class}");
        let clear = PointCounts { unclear_returns: 0, ..counts };
        assert_eq!(unclear_returns(&options("surface = \"first\""), &clear), None);
    }
}
