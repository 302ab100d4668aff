//! Dealing out the parts of a phase to tasks.

use crate::index::PartIndex;
use crate::partition::parts::Parts;
use crate::phase::Phase;
use crate::plan::job_plan::Plan;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Returns the parts of `phase`, each with the number of the task that it falls to, from 1 to `tasks`. It depends on the plan alone, so
/// that all machines deal alike.
pub(crate) fn deal(plan: &Plan, parts: &Parts, phase: Phase, tasks: u32) -> Vec<(PartIndex, u32)> {
    let records = |part: PartIndex| {
        let inputs = parts.new_inputs(part);
        (!inputs.is_empty()).then(|| inputs.iter().map(|&input| plan.inputs[input].source.records).sum())
    };
    let weight = |part| match phase {
        // A part that needs no new input has nothing to read.
        Phase::Read => records(part),
        _ => Some(parts.expected_points(part)),
    };
    let weights: Vec<(PartIndex, u64)> = parts.all().filter_map(|part| Some((part, weight(part)?))).collect();
    balanced(weights, tasks)
}

/// Gives the heaviest parts first, each to the task that has the least so far.
fn balanced(mut weights: Vec<(PartIndex, u64)>, tasks: u32) -> Vec<(PartIndex, u32)> {
    weights.sort_by_key(|&(part, weight)| (Reverse(weight), part));
    // More tasks than parts have nothing to do.
    let most = tasks.min(weights.len() as u32).max(1);
    let mut loads: BinaryHeap<Reverse<(u64, u32)>> = (1..=most).map(|task| Reverse((0, task))).collect();
    let mut dealt = Vec::with_capacity(weights.len());
    for (part, weight) in weights {
        let Some(mut least) = loads.peek_mut() else { break };
        dealt.push((part, least.0.1));
        // Parts without points are dealt out evenly too.
        least.0.0 += weight.max(1);
    }
    dealt.sort_unstable();
    dealt
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_falls_to_one_task_and_tasks_are_balanced() {
        let weights: Vec<u64> = (0..100).map(|i| (i * 7919) % 1000).collect();
        let parts = || (0..).map(PartIndex::new).zip(weights.iter().copied()).collect::<Vec<_>>();
        for tasks in [1, 3, 8, 99, 100, 5000] {
            let dealt = balanced(parts(), tasks);
            assert!(dealt.iter().map(|(part, _)| part.get()).eq(0..100));
            let load =
                |task: u32| dealt.iter().filter(|dealt| dealt.1 == task).map(|dealt| weights[dealt.0.get()]).sum();
            let loads: Vec<u64> = (1..=tasks.min(100)).map(load).collect();
            let (most, mean) = (loads.iter().max().unwrap(), loads.iter().sum::<u64>() / loads.len() as u64);
            assert!(*most <= mean + 1000, "{tasks} tasks: {loads:?}");
            assert!(dealt.iter().all(|dealt| (1..=tasks).contains(&dealt.1)));
        }
        assert!(balanced(Vec::new(), 4).is_empty());
    }
}
