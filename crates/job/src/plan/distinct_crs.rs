//! The different coordinate systems among the inputs, and whether any two of them contradict each other.

use crs::{ComparableCrs, Crs};
use std::collections::{HashMap, HashSet};
use sys::{Result, interrupt};

/// The systems of a job's inputs, each once, in the order in which they come first.
pub(crate) struct DistinctCrs<'a> {
    /// The number of the first input with each system, and the system.
    pub(crate) systems: Vec<(usize, ComparableCrs<'a>)>,
    /// Which of the systems each input has; `None` for an input that says nothing.
    of_input: Vec<Option<usize>>,
}

impl<'a> DistinctCrs<'a> {
    /// Takes the systems apart.
    pub(crate) fn of(all: impl Iterator<Item = &'a Crs>) -> DistinctCrs<'a> {
        let (mut systems, mut of_input, mut known) = (Vec::new(), Vec::new(), HashMap::new());
        for (input, crs) in all.enumerate() {
            of_input.push((*crs != Crs::default()).then(|| {
                *known.entry(format!("{crs:?}")).or_insert_with(|| {
                    systems.push((input, ComparableCrs::of(crs)));
                    systems.len() - 1
                })
            }));
        }
        DistinctCrs { systems, of_input }
    }

    /// Returns the system of an input.
    pub(crate) fn of_input(&self, input: usize) -> Option<&ComparableCrs<'a>> {
        Some(&self.systems[self.of_input[input]?].1)
    }

    /// Returns the first two systems that differ, as numbers of their first inputs, and in what. Two that differ may both agree with a
    /// third that says less, so every pair counts. Of thousands that differ in nothing but their names, one stands for all.
    ///
    /// # Errors
    /// `Interrupted` if the user ends the job.
    pub(crate) fn contradiction(&self) -> Result<Option<(usize, usize, Vec<String>)>> {
        let mut kinds = HashSet::new();
        let is_first: Vec<bool> = self.systems.iter().map(|(_, system)| kinds.insert(system.kind())).collect();
        // A system that is known by its name alone is compared with the names of all.
        let is_name: Vec<bool> = self.systems.iter().map(|(_, system)| system.is_known_by_name()).collect();
        let numbers = |is_wanted: &dyn Fn(usize) -> bool| -> Vec<usize> {
            (0..self.systems.len()).filter(|index| is_wanted(*index)).collect()
        };
        let (all, names) = (numbers(&|_| true), numbers(&|index| is_name[index] && is_first[index]));
        let firsts = numbers(&|index| is_first[index]);
        for (index, (own, system)) in self.systems.iter().enumerate() {
            interrupt::check()?;
            let others = match (is_name[index], is_first[index]) {
                (true, true) => &all,
                (true, false) => continue,
                (false, true) => &firsts,
                (false, false) => &names,
            };
            for (other, others) in others.iter().filter(|other| **other > index).map(|other| &self.systems[*other]) {
                let differences = system.differences(others);
                if !differences.is_empty() {
                    return Ok(Some((*own, *other, differences)));
                }
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::CrsChoice;

    fn utm(name: &str, meridian: u32) -> Crs {
        let text = format!(
            r#"PROJCS["{name}",GEOGCS["g",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],
            UNIT["Degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],
            PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",{meridian}],PARAMETER["Scale_Factor",0.9996],
            PARAMETER["Latitude_Of_Origin",0.0],UNIT["Meter",1.0]]"#
        );
        match CrsChoice::try_from(text).unwrap() {
            CrsChoice::Given { crs, .. } => *crs,
            other => panic!("{other:?}"),
        }
    }

    fn contradiction(all: &[Crs]) -> Option<(usize, usize)> {
        let distinct = DistinctCrs::of(all.iter());
        distinct.contradiction().unwrap().map(|(own, other, _)| (own, other))
    }

    #[test]
    fn one_of_many_systems_that_differ_in_name_alone_stands_for_all() {
        let mut all: Vec<Crs> = (0..200).map(|tile| utm(&format!("tile {tile}"), 9)).collect();
        all.insert(3, Crs::default());
        let distinct = DistinctCrs::of(all.iter());
        let kinds: HashSet<String> = distinct.systems.iter().map(|(_, system)| system.kind()).collect();
        assert_eq!((distinct.systems.len(), kinds.len()), (200, 1));
        assert!(distinct.of_input(3).is_none() && distinct.of_input(4).is_some());
        assert_eq!(contradiction(&all), None);
        all.push(utm("tile 7", 15));
        assert_eq!(contradiction(&all), Some((0, 201)));
    }

    #[test]
    fn a_system_that_is_known_by_its_name_is_compared_with_all_names() {
        let named = |name: &str| Crs { name: Some(name.into()), ..Crs::default() };
        assert_eq!(contradiction(&[utm("site", 9), named("site"), named("Site")]), None);
        assert_eq!(contradiction(&[utm("site", 9), utm("grid", 9), named("site")]), Some((1, 2)));
        assert_eq!(contradiction(&[named("site"), utm("site", 9), utm("grid", 9)]), Some((0, 2)));
    }
}
