//! What the user should know about attributes that vertices are to carry, and that a text has no column of.

use points::Source;
use tiles::attributes::AttributeChoice;

/// Returns a warning for each of the attributes of `wanted` that one of `sources` lacks. An interrupted job may go on with other ones, so
/// they are no part of the plan.
pub(super) fn missing_attributes<'a>(
    sources: impl Iterator<Item = &'a Source> + Clone,
    wanted: AttributeChoice,
) -> Vec<String> {
    let classes = sources.clone().filter(|source| wanted.classification && !source.has_class);
    let intensities = sources.filter(|source| wanted.intensity && !source.has_intensity);
    let classes = missing_column(classes, "classes", "class 0, \"never classified\"");
    classes.into_iter().chain(missing_column(intensities, "intensities", "intensity 0")).collect()
}

fn missing_column<'a>(mut sources: impl Iterator<Item = &'a Source>, name: &str, instead: &str) -> Option<String> {
    let first = sources.next()?.path.display();
    let others = match sources.count() {
        0 => String::new(),
        count => format!(", as {count} others"),
    };
    Some(format!(
        "{first} has no column of {name}{others}: its vertices have {instead}; fix: [input.csv] columns, if there is such a column"
    ))
}
