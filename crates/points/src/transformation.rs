//! What a job transforms, for its report.

use crate::source::Source;
use crs::transform::between::{CrsTransform, DatumNote};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The way of some inputs from one coordinate reference system into that of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transformation {
    /// The number of inputs that go this way.
    pub inputs: usize,
    /// What they are in.
    pub from: String,
    /// What the job has them in.
    pub to: String,
    /// The projections, in words.
    pub way: String,
    /// What was done about the datums.
    pub datums: String,
    /// What was done about heights.
    pub heights: String,
    /// The step of x and y to which every coordinate is rounded, once.
    pub step: String,
    /// How far x and y are from those of exact formulas at most, before they are rounded, in metres.
    pub formulas_m: f64,
}

/// The formulas, forward or back, are nearer to those of exact arithmetic within the area of a projection, in metres.
const FORMULAS: f64 = 1e-6;

/// Returns what is transformed of `sources`, each way once.
pub fn transformations<'a>(sources: impl Iterator<Item = &'a Source>) -> Vec<Transformation> {
    let mut found: Vec<Transformation> = Vec::new();
    for way in sources.filter_map(transformation) {
        match found.iter_mut().find(|known| Transformation { inputs: way.inputs, ..(*known).clone() } == way) {
            Some(known) => known.inputs += 1,
            None => found.push(way),
        }
    }
    found
}

fn transformation(source: &Source) -> Option<Transformation> {
    let transform = source.transform()?;
    let way = transform.way().ok()?;
    if way.is_none() && transform.heights.is_none() {
        return None;
    }
    let datums = match way.as_ref().map(CrsTransform::datums) {
        Some(DatumNote::TakenAlike(names)) => format!("{names}, treated as one: up to a metre or two apart"),
        Some(DatumNote::Assumed(names)) => format!("{names}, assumed to be the same: they are not both named"),
        Some(DatumNote::Same) | None => "the same".into(),
    };
    Some(Transformation {
        inputs: 1,
        from: transform.from.label(),
        to: transform.to.label(),
        way: way.as_ref().map_or("x and y stay".into(), |way| way.way()),
        datums,
        heights: transform.heights.map_or("the same".into(), |factor| format!("times {factor}, on the same datum")),
        step: source.axes[0].scale.to_string(),
        formulas_m: if way.is_some() { FORMULAS } else { 0.0 },
    })
}

impl fmt::Display for Transformation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Transformation { inputs, from, to, way, datums, heights, step, .. } = self;
        let inputs = if *inputs == 1 { "1 input".to_string() } else { format!("{inputs} inputs") };
        write!(f, "{inputs} from {from} to {to}: {way}; datum: {datums}; heights: {heights}; rounded to {step}")
    }
}
