//! The rules inside a crate: which module may import which. Between crates the compiler holds them. A broken rule gives a sentence that names
//! the arrow.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::imports::Arrow;

/// No file in `modules` of a crate imports anything from `never`. A module is a folder, or a file that is named without its ending.
struct Rule {
    of: &'static str,
    modules: &'static [&'static str],
    never: &'static [&'static str],
    why: &'static str,
}

/// The modules of a job's steps, in order. Each imports only from those before it.
const STEPS: [&str; 6] = ["plan", "partition", "mesh", "tiles", "levels", "publish"];

const JOB: &str = "crates/job/src";
const PROGRAM: &str = "src";

const RULES: [Rule; 7] = [
    Rule {
        of: PROGRAM,
        modules: &["view"],
        never: &["config", "init", "submit", "cli"],
        why: "the server knows files, no job",
    },
    Rule {
        of: PROGRAM,
        modules: &["init"],
        never: &["submit", "view", "cli"],
        why: "init looks at a job, and runs none",
    },
    Rule {
        of: PROGRAM,
        modules: &["config"],
        never: &["init", "submit", "view", "cli", "sample", "gpu_trial"],
        why: "config knows options, and no command",
    },
    Rule {
        of: JOB,
        modules: &["durable", "progress"],
        never: &["records", "merge_records", "plan", "partition", "mesh", "tiles", "levels", "publish"],
        why: "durable and progress know no step",
    },
    Rule {
        of: JOB,
        modules: &["durable", "progress", "records", "merge_records", "options", "index"],
        never: &["run", "preflight", "report", "lib"],
        why: "what all steps share does not know the modules that use it",
    },
    Rule {
        of: JOB,
        modules: &STEPS,
        never: &["run", "preflight", "report", "lib"],
        why: "a step does not know who runs it",
    },
    Rule { of: JOB, modules: &["preflight", "report"], never: &["run", "lib"], why: "only lib.rs imports run" },
];

/// Returns a sentence for every rule that a crate breaks, whose sources are in the folder `of`.
pub(crate) fn broken(of: &str, arrows: &[Arrow]) -> Vec<String> {
    let directions =
        arrows.iter().filter_map(|arrow| Some(format!("{}: {}", text(of, arrow), broken_rule(of, arrow)?)));
    directions.chain(circles(of, arrows)).collect()
}

/// Returns a line that describes the arrow and leads to it.
fn text(of: &str, arrow: &Arrow) -> String {
    format!("{of}/{}:{} imports {} from {of}/{}", arrow.from, arrow.line, arrow.path, arrow.to)
}

fn broken_rule(of: &str, arrow: &Arrow) -> Option<&'static str> {
    let (is_from, is_to) = (|module: &&str| is_in(&arrow.from, module), |module: &&str| is_in(&arrow.to, module));
    let mut rules = RULES.iter().filter(|rule| rule.of == of);
    let step = |is: &dyn Fn(&&str) -> bool| STEPS.iter().position(is).filter(|_| of == JOB);
    match rules.find(|rule| rule.modules.iter().any(is_from) && rule.never.iter().any(is_to)) {
        Some(rule) => Some(rule.why),
        None => match (step(&is_from), step(&is_to)) {
            (Some(from), Some(to)) if from < to => Some("a step imports only from the steps before it"),
            _ => None,
        },
    }
}

fn is_in(file: &str, module: &str) -> bool {
    file.strip_prefix(module).is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
}

/// Finds circles in every folder, between its files and its sub-folders. A sub-folder counts as one, with everything in it. Where
/// there is none, no files are in a circle either, in one module or in several.
fn circles(of: &str, arrows: &[Arrow]) -> Vec<String> {
    let arrows: Vec<&Arrow> = arrows.iter().filter(|arrow| !arrow.passes_on).collect();
    let folders = |file: &str| -> Vec<String> { file.match_indices('/').map(|(at, _)| file[..=at].into()).collect() };
    let all: BTreeSet<String> = arrows.iter().flat_map(|arrow| folders(&arrow.from)).chain([String::new()]).collect();
    all.iter().flat_map(|folder| circles_in(of, folder, &arrows)).collect()
}

/// Returns the shortest circles of a folder. A circle that shares an arrow with a shorter one is reported when that one is gone.
fn circles_in(of: &str, folder: &str, arrows: &[&Arrow]) -> Vec<String> {
    let mut graph = Graph::new();
    for arrow in arrows {
        if let (Some(from), Some(to)) = (entry(folder, &arrow.from), entry(folder, &arrow.to)) {
            graph.entry(from).or_default().entry(to).or_insert(arrow);
        }
    }
    let edges = graph.iter().flat_map(|(&from, targets)| targets.keys().map(move |&to| (from, to)));
    let circle = |(from, to)| Some([&[from], way(&graph, to, from)?.as_slice()].concat());
    let mut circles: Vec<Vec<&str>> = edges.filter(|(from, to)| from != to).filter_map(circle).collect();
    circles.sort_by_key(Vec::len);
    let (mut told, mut texts) = (BTreeSet::new(), Vec::new());
    for circle in circles {
        let edges: Vec<_> = circle.windows(2).map(|pair| (pair[0], pair[1])).collect();
        if edges.iter().all(|edge| !told.contains(edge)) {
            let arrows: String =
                edges.iter().map(|(from, to)| format!("\n    {}", text(of, graph[from][to]))).collect();
            texts.push(format!("a circle in {of}/{folder}: {}{arrows}", circle.join(" -> ")));
            told.extend(edges);
        }
    }
    texts
}

/// Returns the name of the file or sub-folder of `folder` that `file` is in.
fn entry<'a>(folder: &str, file: &'a str) -> Option<&'a str> {
    let rest = file.strip_prefix(folder)?;
    Some(rest.split_once('/').map_or(rest, |(sub, _)| sub))
}

type Graph<'a> = BTreeMap<&'a str, BTreeMap<&'a str, &'a Arrow>>;

/// Returns the shortest way along arrows, with both ends.
fn way<'a>(graph: &Graph<'a>, from: &'a str, to: &'a str) -> Option<Vec<&'a str>> {
    let (mut ways, mut seen) = (VecDeque::from([vec![from]]), BTreeSet::from([from]));
    while let Some(way) = ways.pop_front() {
        let end = *way.last()?;
        if end == to {
            return Some(way);
        }
        for &next in graph.get(end).into_iter().flat_map(BTreeMap::keys).filter(|next| seen.insert(**next)) {
            ways.push_back([way.as_slice(), &[next]].concat());
        }
    }
    None
}
