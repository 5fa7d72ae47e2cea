//! scratch
#[path = "../tests/support/mod.rs"]
mod support;
use nalgebra::Point3;
use std::io::{Read, Write};
use support::{Lidar, World, drive, in_world};
use volumetric_map::{DistanceField, PlaceConfig, PlaceGraph, Volume, VolumeConfig};

fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
}
type Scans = Vec<(Point3<f64>, Vec<Point3<f32>>)>;
fn record() -> Scans {
    let path = "/tmp/vol/drive.bin";
    if let Ok(mut f) = std::fs::File::open(path) {
        let mut b = Vec::new();
        f.read_to_end(&mut b).unwrap();
        let mut at = 0;
        let mut out = Vec::new();
        let f64at = |at: usize| f64::from_le_bytes(b[at..at + 8].try_into().unwrap());
        while at < b.len() {
            let o = Point3::new(f64at(at), f64at(at + 8), f64at(at + 16));
            let n = f64at(at + 24) as usize;
            at += 32;
            let f = |k: usize| f32::from_le_bytes(b[at + 4 * k..at + 4 * k + 4].try_into().unwrap());
            out.push((o, (0..n).map(|i| Point3::new(f(3 * i), f(3 * i + 1), f(3 * i + 2))).collect()));
            at += 12 * n;
        }
        return out;
    }
    let world = World::flat();
    let mut lidar = Lidar::new(32, 1024, 0.015, 7);
    let way = [[2.0, 2.5], [6.5, 2.5], [7.7, 4.0], [7.7, 7.0], [6.0, 7.5], [3.0, 7.5], [2.0, 6.0], [2.0, 2.5]];
    let scans: Scans = drive(&way, 0.61, 0.07)
        .into_iter()
        .map(|(pose, _)| (pose.translation.vector.into(), in_world(&lidar.scan(&world, &pose), &pose)))
        .collect();
    let mut f = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    for (o, p) in &scans {
        for v in [o.x, o.y, o.z, p.len() as f64] {
            f.write_all(&v.to_le_bytes()).unwrap();
        }
        for q in p {
            for v in q.iter() {
                f.write_all(&v.to_le_bytes()).unwrap();
            }
        }
    }
    scans
}
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
}
fn main() {
    let scans = record();
    let runs: usize = std::env::var("RUNS").ok().and_then(|v| v.parse().ok()).unwrap_or(3);
    let mut best: [Vec<f64>; 4] = Default::default();
    let world = World::flat();
    for run in 0..runs {
        let mut times: [Vec<f64>; 4] = Default::default();
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let mut field = DistanceField::new(0.1, 2.0);
        let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
        let mut events = 0u64;
        let mut sums = [0usize; 4];
        for (k, (o, p)) in scans.iter().enumerate() {
            let t = cpu_ms();
            let r = volume.integrate(o, p).unwrap();
            times[0].push(cpu_ms() - t);
            sums[0] += r.clearing_rays;
            sums[1] += r.cleared_voxels;
            if k % 5 == 4 {
                let t = cpu_ms();
                volume.update_mesh();
                let t2 = cpu_ms();
                field.update(&volume);
                let t3 = cpu_ms();
                let e = graph.update(&field);
                let t4 = cpu_ms();
                times[1].push(t2 - t);
                times[2].push(t3 - t2);
                times[3].push(t4 - t3);
                events = (events ^ hash(format!("{e:?}").as_bytes())).wrapping_mul(0x100_0000_01b3);
            }
        }
        if run == 0 {
            best = times;
            let mut b = Vec::new();
            volume.save(&mut b).unwrap();
            let mesh = volume.mesh();
            let mut m = Vec::new();
            mesh.write_ply(&mut m).unwrap();
            println!(
                "volume {:016x} mesh {:016x} places {:016x} n {} sums {:?}",
                hash(&b),
                hash(&m),
                events,
                graph.places().len(),
                sums
            );
            let err: Vec<f64> = mesh.vertices.iter().map(|v| world.signed_distance(&v.cast::<f64>()).abs()).collect();
            let mean = err.iter().sum::<f64>() / err.len() as f64;
            println!(
                "mesh {} verts {} faces, mean err {:.2} mm, blocks {}",
                mesh.vertices.len(),
                mesh.faces.len(),
                mean * 1e3,
                volume.block_count()
            );
        } else {
            for (b, t) in best.iter_mut().zip(times) {
                for (b, t) in b.iter_mut().zip(t) {
                    *b = b.min(t);
                }
            }
        }
    }
    for (name, t) in ["integrate", "mesh", "distance", "places"].iter().zip(&best) {
        println!("{name:<10} mean of minima {:.2} ms", t.iter().sum::<f64>() / t.len() as f64);
    }
}
