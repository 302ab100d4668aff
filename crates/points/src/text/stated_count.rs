//! Numbers of points in comments, such as `# Number of points: 5000`.

use crate::text::comment_names::texts_of;
use crate::text::lines::shown;
use crate::windows_1252::decoded;

/// Words for points, of which there are several.
const POINTS: [&str; 11] =
    ["points", "pts", "vertices", "npoints", "npts", "numpoints", "pointcount", "punkte", "punkten", "puntos", "punti"];

/// Words beside them that leave the number that of all points of the file.
const BESIDE: [&str; 31] = [
    "3d", "all", "anzahl", "are", "cloud", "contains", "count", "data", "der", "exported", "file", "has", "have", "in",
    "is", "lidar", "no", "nr", "num", "number", "numero", "of", "saved", "the", "there", "these", "this", "total",
    "with", "written", "de",
];

/// The number of points that a comment states.
#[derive(Clone, Debug)]
pub(crate) struct StatedCount {
    points: u64,
    /// The comment, in quotes.
    comment: String,
}

/// Returns the number of points that `line` states, if it is a comment that states no more.
pub(crate) fn stated_count(line: &[u8], marks: &[String]) -> Option<StatedCount> {
    let text = decoded(texts_of(line, marks).pop()?).to_lowercase();
    // "Number of points: 5000, mean track length: 3.3"
    let text = text.split([';', '(']).next()?.split(", ").next()?;
    let is_between = |c: char| !c.is_alphanumeric() && !matches!(c, ',' | '.' | '\'');
    let words = text.split(is_between).map(|word| word.trim_matches(['.', ',', '\'']));
    let (numbers, words): (Vec<&str>, Vec<&str>) = words
        .filter(|word| !word.is_empty())
        .partition(|word| *word != "3d" && word.starts_with(|c: char| c.is_ascii_digit()));
    let [number] = numbers[..] else { return None };
    let is_count = |word: &&str| POINTS.contains(word) || *word == "point" && words.contains(&"count");
    let are_known = words.iter().all(|word| is_count(word) || BESIDE.contains(word));
    let points = whole(number).filter(|_| are_known && words.iter().any(is_count))?;
    Some(StatedCount { points, comment: shown(line) })
}

/// Returns a whole number, with or without signs between thousands.
fn whole(number: &str) -> Option<u64> {
    let groups: Vec<&str> = number.split([',', '.', '\'']).collect();
    let are_thousands = groups.len() == 1 || groups[0].len() <= 3 && groups[1..].iter().all(|group| group.len() == 3);
    are_thousands.then(|| groups.concat().parse().ok()).flatten()
}

/// Returns a warning if comments state other numbers than `rows`: neither one of them nor all together.
pub(crate) fn count_warning(counts: &[StatedCount], rows: u64) -> Option<String> {
    let first = counts.first()?;
    let sum = counts.iter().fold(0, |sum: u64, count| sum.saturating_add(count.points));
    if sum == rows || counts.iter().any(|count| count.points == rows) {
        return None;
    }
    let StatedCount { points, comment } = first;
    Some(if *points > rows {
        format!(
            "the comment {comment} gives {points} points, but the file has only {rows}: it may be cut off; fix: copy the file again"
        )
    } else {
        format!("the comment {comment} gives {points} points, but the file has {rows}: all are read")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(comment: &str) -> Option<u64> {
        stated_count(comment.as_bytes(), &["#".to_string(), "//".to_string()]).map(|count| count.points)
    }

    #[test]
    fn numbers_of_points_are_read() {
        for comment in [
            "# Number of points: 5000",
            "#   Number of points: 5000, mean track length: 3.3",
            "# Total points = 5,000",
            "// 5000 points exported",
            "# Points: 5.000",
            "# point count 5000",
            "# this file contains 5000 points.",
            "# npoints=5000",
        ] {
            assert_eq!(points(comment), Some(5000), "{comment}");
        }
        for comment in [
            "# 5000",
            "# point 5000",
            "# 5 control points",
            "# points 1 to 5000",
            "# 5000 points before the filter",
            "# points per m2: 5",
            "# points: x y z",
            "5000 points",
            "# points 0.5",
        ] {
            assert_eq!(points(comment), None, "{comment}");
        }
    }

    #[test]
    fn one_number_or_the_sum_of_all_is_right() {
        let warning = |points: &[u64], rows| {
            let count = |points: &u64| StatedCount { points: *points, comment: "\"#\"".to_string() };
            count_warning(&points.iter().map(count).collect::<Vec<_>>(), rows)
        };
        assert!(warning(&[], 5).is_none() && warning(&[5], 5).is_none() && warning(&[9, 5], 5).is_none());
        assert!(warning(&[2, 3], 5).is_none());
        assert!(warning(&[9], 5).is_some_and(|what| what.contains("gives 9 points, but the file has only 5")));
        assert!(warning(&[2], 5).is_some_and(|what| what.contains("gives 2 points, but the file has 5")));
    }
}
