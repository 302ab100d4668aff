use cpu_time::ProcessTime;
use gdt_batch::geometry::lattice::{Lattice, shortest_decimal};
use gdt_batch::output::{deviation::deviation, frame::Frame, join::join, read::read_tile, simplify::simplify};
use std::path::PathBuf;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let first: usize = std::env::args().nth(2).unwrap().parse().unwrap();
    let files: Vec<_> = (first..first + 4).map(|i| PathBuf::from(format!("{dir}/tiles/{i:06}.glb"))).collect();
    let t = ProcessTime::now();
    let read: Vec<_> = files.iter().map(|p| read_tile(p).unwrap()).collect();
    let e = read[0].extras.clone();
    let d = |v: f64| shortest_decimal(v).unwrap();
    let lattice = Lattice { offset: e.offset.map(d), resolution: d(e.resolution), resolution_z: d(e.resolution_z) };
    let rep: serde_json::Value =
        serde_json::from_slice(&std::fs::read(format!("{dir}/georeference.json")).unwrap()).unwrap();
    let b = |i: usize, k: usize| {
        ((rep["bounds"][i][k].as_f64().unwrap() - e.offset[k]) / if k < 2 { e.resolution } else { e.resolution_z })
            .round() as i32
    };
    let bounds = [[b(0, 0), b(0, 1), b(0, 2)], [b(1, 0), b(1, 1), b(1, 2)]];
    let frame = Frame::new(&lattice, e.metres_per_unit, e.metres_per_unit_z, e.crs.clone()).unwrap().refined(bounds);
    println!("read {:?}", t.elapsed());
    let t = ProcessTime::now();
    let mesh = join(&frame, &read).unwrap();
    println!("join {:?}: {} v {} t", t.elapsed(), mesh.positions.len(), mesh.triangles.len());
    let t = ProcessTime::now();
    let s = simplify(&frame, &mesh, mesh.triangles.len() / 4);
    println!(
        "simplify all {:?}: {} v {} t error {}",
        t.elapsed(),
        s.tile.positions.len(),
        s.tile.triangles.len(),
        s.error
    );
    let vertex: std::collections::HashMap<[i32; 3], u32> =
        mesh.positions.iter().enumerate().map(|(i, p)| (*p, i as u32)).collect();
    let coarse: Vec<[u32; 3]> =
        s.tile.triangles.iter().map(|t| t.map(|v| vertex[&s.tile.positions[v as usize]])).collect();
    let t = ProcessTime::now();
    let z = deviation(&mesh.positions, &mesh.triangles, &coarse);
    println!("deviation alone {:?}: {z}", t.elapsed());
    // rms at vertices by brute sieve: sample
    let orient = |a: [i32; 3], b: [i32; 3], c: [i32; 3]| {
        (b[0] - a[0]) as i64 * (c[1] - a[1]) as i64 - (b[1] - a[1]) as i64 * (c[0] - a[0]) as i64
    };
    let (mut n, mut sum, mut abs) = (0.0, 0.0, 0.0);
    for p in mesh.positions.iter().step_by(997) {
        for t in &coarse {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let (u, v, w) = (orient(b, c, *p), orient(c, a, *p), orient(a, b, *p));
            if u >= 0 && v >= 0 && w >= 0 {
                let z = (u as f64 * a[2] as f64 + v as f64 * b[2] as f64 + w as f64 * c[2] as f64) / (u + v + w) as f64;
                let d = (z - p[2] as f64).abs() * frame.resolution_metres()[1];
                n += 1.0;
                sum += d * d;
                abs += d;
                break;
            }
        }
    }
    println!("at vertices: rms {} mean {}", (sum / n as f64).sqrt(), abs / n);
}
