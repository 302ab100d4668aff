//! Runs the steps of a job by hand, on many small clouds cut into tiny tiles. The final triangles of all nodes together are the
//! triangulation of all sites at once.

use delaunay::geometry::Site;
use delaunay::triangulation::reference;
use delaunay_gpu::triangulation_options::{Backend, TriangulationOptions};
use delaunay_gpu::triangulator::Triangulator;
use job::durable::atomic_file::{create_folder, publish};
use job::durable::directory::JobDirectory;
use job::durable::lock::Lock;
use job::index::{NodeIndex, PartIndex};
use job::merge_records::Seam;
use job::mesh::leaf::triangulate_leaf;
use job::mesh::merge::merge_frontiers;
use job::options::JobOptions;
use job::partition::part_points::{PointsOfPart, read_inputs};
use job::partition::parts::Parts;
use job::partition::point_file::PointFiles;
use job::partition::result::Partition;
use job::plan::job_plan::Plan;
use job::plan::lattice_choice::LatticeCoarsening;
use job::plan::make_plan::make_plan;
use job::progress::stage::ProgressOutput;
use job::records::{Leaf, Store};

use crate::clouds::{self, Cloud};
use crate::program::Job;
use crate::random::Random;

type Triangle = [Site; 3];

/// Rotates the corners so that the least comes first.
fn canonical(mut corners: Triangle) -> Triangle {
    let first = (0..3).min_by_key(|&i| corners[i]).unwrap();
    corners.rotate_left(first);
    corners
}

/// Writes the plan to its file and reads it back, as another process does.
fn written_and_read(plan: &Plan, directory: &JobDirectory) -> Plan {
    let pending = plan.write(&directory.plan()).unwrap();
    publish(&[pending.path]).unwrap();
    let read = Plan::read(&directory.plan()).unwrap();
    assert_eq!(serde_json::to_string(&read).unwrap(), serde_json::to_string(plan).unwrap());
    read
}

/// Plans, reads, triangulates every leaf and merges every merge node.
fn run_steps(job: &Job, options: &JobOptions) -> (Store, Partition) {
    let directory = JobDirectory::new(&job.out());
    Lock::take(directory.job()).unwrap();
    let plan = make_plan(options, LatticeCoarsening::default()).unwrap();
    let mut plan = written_and_read(&plan, &directory);
    // The buffers get a sixth of this.
    plan.options.limits.memory.0 = 6 << 20;
    let stage = ProgressOutput::Quiet.stage("read", 0, "points");
    let (parts, first) = (Parts::of(&plan), PartIndex::FIRST);
    let (read, blocks) = read_inputs(&plan, &parts, &directory, first, 0, false, &stage).unwrap();
    let folder = directory.part(first);
    create_folder(folder.job()).unwrap();
    let store = Store::open(folder.store(), []).unwrap();
    blocks.save(&store, first).unwrap();
    let mut points = PointsOfPart::none(&plan, &parts, first);
    points.add(first, &store, &read).unwrap();
    let partition = points.partition(&folder, plan.options.triangulation.max_points_per_tile.0).unwrap();
    let points = PointFiles::open(&folder.point_files().unwrap()).unwrap();
    let cpu = TriangulationOptions { backend: Backend::Cpu, ..TriangulationOptions::default() };
    let triangulator = Triangulator::new(&cpu, &delaunay_gpu::options::GpuOptions::default(), 1 << 28).unwrap();
    let tree = &partition.tree;
    for tile in tree.tiles().rev() {
        triangulate_leaf(&plan, &partition, &points, &store, &triangulator, tile).unwrap();
    }
    for node in (0..tree.nodes.len()).rev().map(NodeIndex::new).filter(|&node| tree.is_merge(node)) {
        let below: Vec<_> = tree.merged_by(node).into_iter().map(|child| (&store, child)).collect();
        merge_frontiers(&plan, tree.node(node).cell, &below, &store, 1 << 28, node).unwrap();
    }
    (store, partition)
}

/// Returns all sites, and all triangles that leaves and merge nodes made final, sorted.
fn collect(store: &Store, partition: &Partition) -> (Vec<Site>, Vec<Triangle>) {
    let (mut sites, mut triangles) = (Vec::new(), Vec::new());
    for tile in partition.tree.tiles() {
        let leaf = Leaf::load(store, tile).unwrap();
        let plane = |v: u32| [leaf.positions[v as usize][0], leaf.positions[v as usize][1]];
        sites.extend((0..leaf.positions.len() as u32).map(plane));
        triangles.extend(leaf.triangles.iter().map(|t| canonical(t.map(plane))));
        for node in partition.tree.merges_above(partition.tree.leaf(tile)) {
            let seam = Seam::touching(store, node, tile).unwrap();
            // A seam triangle is listed with every tile that it touches: count it with the first.
            let mine = seam.triangles.iter().filter(|t| t.iter().all(|corner| corner.tile >= tile));
            triangles.extend(mine.map(|t| canonical(t.map(|corner| corner.plane()))));
        }
    }
    triangles.sort_unstable();
    (sites, triangles)
}

#[track_caller]
fn assert_exact(cloud: &Cloud, max_points_per_tile: u64, what: &str) {
    let folder = tempfile::tempdir().unwrap();
    let job = Job::on(&[clouds::write(folder.path(), "cloud.csv", cloud)]).tiles_of(max_points_per_tile);
    let (store, partition) = run_steps(&job, &gdt_batch::config::load(&job.config()).unwrap());
    let (sites, triangles) = collect(&store, &partition);
    let mesh = reference::triangulate(&sites).unwrap();
    let mut expected: Vec<Triangle> = mesh.triangles.iter().map(|t| canonical(t.map(|v| sites[v.get()]))).collect();
    expected.sort_unstable();
    let count = |t: &[Triangle]| t.len();
    assert!(
        triangles == expected,
        "{what}, {max_points_per_tile} sites a tile: {} triangles, not {}: {cloud:?}",
        count(&triangles),
        count(&expected)
    );
}

/// Returns the points of `cloud` in another order, turned by atan(4/3) and five times as far apart, so still on whole coordinates.
fn turned_and_shuffled(cloud: Cloud, random: &mut Random) -> Cloud {
    let mut turned: Cloud = cloud.into_iter().map(|[x, y, z]| [3 * x - 4 * y, 4 * x + 3 * y, z]).collect();
    for i in (1..turned.len()).rev() {
        turned.swap(i, random.below(i as u64 + 1) as usize);
    }
    turned
}

/// Returns a cloud of kind `kind`: random points, turned lattices, cocircular points, mixtures, lines or columns.
fn small_cloud(kind: u64, random: &mut Random) -> (Cloud, &'static str) {
    let seed = random.below(1 << 40);
    let count = 20 + random.below(180) as usize;
    let lattice = |side: i64| (0..side * side).map(|i| [i % side, i / side, i]).collect::<Cloud>();
    match kind {
        0 => (clouds::uniform(count, 12, seed), "small whole numbers"),
        1 => (clouds::uniform(count, 1_000_000, seed), "random"),
        2 => (turned_and_shuffled(lattice(4 + random.below(9) as i64), random), "turned lattice"),
        3 => (clouds::exact_circle([25, 65, 325, 1105][random.below(4) as usize]), "circle"),
        4 => {
            let mut cloud = turned_and_shuffled(clouds::exact_circle(65), random);
            cloud.extend(lattice(9).iter().map(|[x, y, z]| [40 * x - 160, 40 * y - 160, *z]));
            cloud.extend(clouds::uniform(30, 300, seed));
            (cloud, "mixture")
        }
        5 => (clouds::line(count, 1), "nearly a line"),
        _ => (clouds::uniform(count, 4, seed).iter().map(|[x, y, z]| [1_000 * x, *y, *z]).collect(), "columns"),
    }
}

#[test]
fn small_clouds_in_tiny_tiles_give_the_exact_mesh() {
    let mut random = Random(20_261_120);
    for round in 0..40 {
        for kind in 0..7 {
            let (cloud, what) = small_cloud(kind, &mut random);
            assert_exact(&cloud, [5, 13, 40][round % 3], what);
        }
    }
}

#[test]
fn points_on_a_line_give_no_triangle() {
    for max_points_per_tile in [5, 13, 40] {
        assert_exact(&clouds::line(100, 0), max_points_per_tile, "line");
        assert_exact(&vec![[3, 3, 3]; 100], max_points_per_tile, "one spot");
    }
}
