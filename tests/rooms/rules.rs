//! The rules: which room may import which. A broken rule gives a sentence that names the arrow.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::house::Arrow;

/// No file in `rooms` imports anything from `never`. A room is a folder, or a file that is named without its ending.
struct Rule {
    rooms: &'static [&'static str],
    never: &'static [&'static str],
    why: &'static str,
}

/// The rooms of a job's steps, in order. Each imports only from those before it.
const STEPS: [&str; 6] = ["job/plan", "job/partition", "job/mesh", "job/tiles", "job/levels", "job/publish"];

const RULES: [Rule; 10] = [
    Rule {
        rooms: &["breaklines"],
        never: &["input", "output", "gpu", "voronoi", "triangulation", "mesh"],
        why: "breaklines are lattice integers, not files",
    },
    Rule {
        rooms: &["breaklines", "geometry", "mesh", "voronoi", "gpu", "triangulation", "input", "output"],
        never: &["config", "job", "init", "submit", "verify", "view", "cli"],
        why: "a library room knows no job",
    },
    Rule {
        rooms: &["verify"],
        never: &["config", "job", "init", "submit", "view", "cli"],
        why: "the proof shares nothing with the job",
    },
    Rule {
        rooms: &["view"],
        never: &["config", "job", "init", "submit", "verify", "cli"],
        why: "the server knows files, no job",
    },
    Rule {
        rooms: &["init"],
        never: &["submit", "verify", "view", "cli", "job/run", "job/mod"],
        why: "init looks at a job, and runs none",
    },
    Rule {
        rooms: &["job"],
        never: &["config", "init", "submit", "verify", "view", "cli"],
        why: "a job does not know where its options come from, nor who starts its tasks",
    },
    Rule {
        rooms: &["job/durable", "job/progress"],
        never: &[
            "job/records",
            "job/merge_records",
            "job/plan",
            "job/partition",
            "job/mesh",
            "job/tiles",
            "job/levels",
            "job/publish",
        ],
        why: "durable and progress know no step",
    },
    Rule {
        rooms: &["job/durable", "job/progress", "job/records", "job/merge_records", "job/options", "job/index"],
        never: &["job/run", "job/preflight", "job/report", "job/mod"],
        why: "what all steps share does not know the rooms that use it",
    },
    Rule {
        rooms: &STEPS,
        never: &["job/run", "job/preflight", "job/report", "job/mod"],
        why: "a step does not know who runs it",
    },
    Rule {
        rooms: &["job/preflight", "job/report"],
        never: &["job/run", "job/mod"],
        why: "only job/mod.rs imports job/run",
    },
];

/// Returns a sentence for every broken rule.
pub(crate) fn broken(arrows: &[Arrow]) -> Vec<String> {
    let directions = arrows.iter().filter_map(|arrow| Some(format!("{}: {}", text(arrow), broken_rule(arrow)?)));
    directions.chain(circles(arrows)).collect()
}

/// Returns a line that describes the arrow and leads to it.
fn text(arrow: &Arrow) -> String {
    format!("src/{}:{} imports {} from src/{}", arrow.from, arrow.line, arrow.path, arrow.to)
}

fn broken_rule(arrow: &Arrow) -> Option<&'static str> {
    let (is_from, is_to) = (|room: &&str| is_in(&arrow.from, room), |room: &&str| is_in(&arrow.to, room));
    let rule = RULES.iter().find(|rule| rule.rooms.iter().any(is_from) && rule.never.iter().any(is_to));
    let step = |is: &dyn Fn(&&str) -> bool| STEPS.iter().position(is);
    match (step(&is_from), step(&is_to)) {
        _ if rule.is_some() => rule.map(|rule| rule.why),
        (Some(from), Some(to)) if from < to => Some("a step imports only from the steps before it"),
        _ if is_from(&"config") && !is_open_to_config(&arrow.to) => {
            Some("config imports only options, errors, warnings, geometry and the text of paths")
        }
        _ => None,
    }
}

fn is_open_to_config(file: &str) -> bool {
    file.ends_with("/options.rs")
        || ["config", "geometry", "error", "warnings", "path_text"].iter().any(|room| is_in(file, room))
}

fn is_in(file: &str, room: &str) -> bool {
    file.strip_prefix(room).is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
}

/// Finds circles in every folder, between its files and its sub-folders. A sub-folder counts as one, with everything in it. Where
/// there is none, no files are in a circle either, in one room or in several.
fn circles(arrows: &[Arrow]) -> Vec<String> {
    let arrows: Vec<&Arrow> = arrows.iter().filter(|arrow| !arrow.passes_on).collect();
    let folders = |file: &str| -> Vec<String> { file.match_indices('/').map(|(at, _)| file[..=at].into()).collect() };
    let all: BTreeSet<String> = arrows.iter().flat_map(|arrow| folders(&arrow.from)).chain([String::new()]).collect();
    all.iter().flat_map(|folder| circles_in(folder, &arrows)).collect()
}

/// Returns the shortest circles of a folder. A circle that shares an arrow with a shorter one is reported when that one is gone.
fn circles_in(folder: &str, arrows: &[&Arrow]) -> Vec<String> {
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
            let arrows: String = edges.iter().map(|(from, to)| format!("\n    {}", text(graph[from][to]))).collect();
            texts.push(format!("a circle in src/{folder}: {}{arrows}", circle.join(" -> ")));
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
