//! How the dispatches of a recording share compute passes. A pass costs the CPU time, and adapters take timestamps where passes begin and
//! end, so a step is one pass wherever nothing comes in between.

use crate::on_device::recording::{GpuCommand, GpuStep, Recording, ShaderProgram};
use crate::on_device::timestamps::PassMarks;

/// After this many workgroups, the commands so far are submitted to the GPU.
const WORKGROUPS_PER_SUBMISSION: u64 = 1 << 18;

/// A dispatch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dispatch {
    pub(super) program: ShaderProgram,
    /// The number of the dispatch in its recording.
    pub(super) number: u64,
    pub(super) workgroups: [u32; 2],
}

/// Dispatches of one step that follow each other.
#[derive(Debug, Default)]
pub(super) struct Pass {
    pub(super) dispatches: Vec<Dispatch>,
    /// `None` if the recording has not said of which step they are.
    pub(super) step: Option<GpuStep>,
    pub(super) marks: PassMarks,
    /// Whether the commands up to here go to the GPU before those that follow are recorded.
    pub(super) ends_submission: bool,
}

/// What the engine encodes at once.
#[derive(Debug)]
pub(super) enum Part<'a> {
    Pass(Pass),
    /// An upload, or a buffer to clear, between passes.
    Other(&'a GpuCommand),
}

impl Part<'_> {
    fn pass(&mut self) -> Option<&mut Pass> {
        if let Part::Pass(pass) = self { Some(pass) } else { None }
    }
}

/// Returns the parts of `recording` in order, and the steps that have dispatches.
pub(super) fn parts(recording: &Recording) -> (Vec<Part<'_>>, Vec<GpuStep>) {
    let mut parts = Vec::new();
    let (mut step, mut number, mut workgroups) = (None, 0, 0);
    let mut pass = Pass::default();
    for command in &recording.commands {
        let ends_pass = match command {
            GpuCommand::Step(next) => step.replace(*next) != Some(*next),
            GpuCommand::Clear(..) | GpuCommand::Upload(..) => true,
            GpuCommand::Reserve(..) | GpuCommand::Run(..) => false,
        };
        if ends_pass {
            end(&mut pass, &mut parts);
        }
        match command {
            GpuCommand::Run(program, _, count, _) => {
                pass.step = step;
                pass.dispatches.push(Dispatch { program: *program, number, workgroups: *count });
                number += 1;
                workgroups += u64::from(count[0]) * u64::from(count[1]);
                if workgroups > WORKGROUPS_PER_SUBMISSION {
                    (workgroups, pass.ends_submission) = (0, true);
                    end(&mut pass, &mut parts);
                }
            }
            GpuCommand::Clear(..) | GpuCommand::Upload(..) => parts.push(Part::Other(command)),
            GpuCommand::Step(_) | GpuCommand::Reserve(..) => {}
        }
    }
    end(&mut pass, &mut parts);
    let steps = mark(&mut parts);
    (parts, steps)
}

fn end(pass: &mut Pass, parts: &mut Vec<Part>) {
    let pass = std::mem::take(pass);
    if !pass.dispatches.is_empty() {
        parts.push(Part::Pass(pass));
    }
}

/// Marks the first and the last pass of every step; returns the steps.
fn mark(parts: &mut [Part]) -> Vec<GpuStep> {
    let mut steps = Vec::new();
    for pass in parts.iter_mut().filter_map(Part::pass) {
        if let Some(step) = pass.step.filter(|step| !steps.contains(step)) {
            steps.push(step);
            pass.marks.begin(step);
        }
    }
    let mut ended = Vec::new();
    for pass in parts.iter_mut().rev().filter_map(Part::pass) {
        if let Some(step) = pass.step.filter(|step| !ended.contains(step)) {
            ended.push(step);
            pass.marks.end(step);
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_device::atlas::Atlas;
    use crate::on_device::buffer_id::BufferId;
    use crate::on_device::timestamps::STAMPS;
    use crate::options::VoronoiMethod;
    use delaunay::voronoi::texture_request::TextureRequest;

    fn passes<'a>(parts: &'a [Part]) -> impl Iterator<Item = &'a Pass> {
        parts.iter().filter_map(|part| if let Part::Pass(pass) = part { Some(pass) } else { None })
    }

    fn recording() -> Recording {
        let (mut atlas, sites) = (Atlas::default(), [[0, 0], [9, 0], [0, 9], [i32::MIN, 0]]);
        assert!(atlas.add(&sites[..3], &TextureRequest::default(), 1 << 20));
        Recording::mesh(&atlas, &sites, VoronoiMethod::Jfa)
    }

    #[test]
    fn every_step_begins_and_ends_once() {
        let recording = recording();
        let (parts, steps) = parts(&recording);
        assert_eq!(steps, GpuStep::ALL);
        let begins: Vec<u32> = passes(&parts).filter_map(|pass| pass.marks.begin).collect();
        let ends: Vec<u32> = passes(&parts).filter_map(|pass| pass.marks.end).collect();
        let stamps = 0..STAMPS;
        assert!(begins.into_iter().eq(stamps.clone().step_by(2)) && ends.into_iter().eq(stamps.skip(1).step_by(2)));
    }

    #[test]
    fn every_dispatch_is_in_a_pass_in_its_order() {
        let recording = recording();
        let (parts, _) = parts(&recording);
        let numbers: Vec<u64> = passes(&parts).flat_map(|pass| pass.dispatches.iter().map(|d| d.number)).collect();
        assert!(numbers.iter().copied().eq(0..recording.dispatches() as u64), "{numbers:?}");
        assert!(passes(&parts).count() < numbers.len() / 2);
    }

    #[test]
    fn what_is_cleared_is_cleared_between_the_dispatches_around_it() {
        let program = recording().commands.iter().find_map(|command| match command {
            GpuCommand::Run(program, ..) => Some(*program),
            _ => None,
        });
        let run = |groups| GpuCommand::Run(program.unwrap(), [0; 5], [groups, 1], 0);
        let clear = GpuCommand::Clear(BufferId::Flags, 4);
        let recording = Recording { commands: vec![run(1), run(2), clear, run(65_535), run(65_535)] };
        let (parts, steps) = parts(&recording);
        let shape = parts.iter().map(|part| if let Part::Pass(pass) = part { pass.dispatches.len() } else { 0 });
        assert_eq!((shape.collect::<Vec<_>>(), steps), (vec![2, 0, 2], vec![]));
    }
}
