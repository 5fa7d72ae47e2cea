#[path = "../tests/support/mod.rs"]
mod support;
use nalgebra::*;
use omni_sim::bvh::*;
use omni_sim::lidar::*;
use omni_sim::motion::KinematicState;
use parry3d::math::Vector as V;
use parry3d::query::{Ray, RayCast};
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    s.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-6
}
fn best(name: &str, mut f: impl FnMut()) {
    let mut b = f64::INFINITY;
    for _ in 0..30 {
        let t = cpu();
        f();
        b = b.min(cpu() - t);
    }
    println!("{name}: {b:.2} ms");
}
fn main() {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    let world = support::flat_world(40, 96);
    let mesh = world.static_mesh().clone();
    println!("{} triangles", mesh.faces.len());
    let motion = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 0.6));
    let mount = RotatingMount::rotating(Isometry3::identity());
    best("scan", || { scan(&world, &motion, &mount, &LidarConfig::default(), 0).unwrap(); });
    use omni_sim::panorama::*;
    let cfg = PanoramaConfig::default();
    let seg = omni_sim::segmenter::SegmenterConfig::default();
    let cam = Isometry3::translation(0.0, 0.0, 0.4);
    let (rec, truth) = capture_with_truth(&world, &motion, &cam, &cfg, &seg, 0).unwrap();
    println!("{} rays {} masks", truth.rays, rec.masks.len());
    best("panorama", || { capture(&world, &motion, &cam, &cfg, &seg, 0).unwrap(); });
    let snap = world.at(0);
    best("render", || { omni_sim::render::render(&snap, &Isometry3::translation(2.5, 2.0, 1.0), &cfg.view(), 60.0); });
    let full = omni_sim::render::render_every_pixel(&snap, &Isometry3::translation(2.5, 2.0, 1.0), &cfg.view(), 60.0);
    println!("differ {}", full.instances.iter().zip(&truth.instances).filter(|(a, b)| a != b).count());
    for (name, rgb) in [("/tmp/pano.ppm", &rec.rgb), ("/tmp/full.ppm", &full.rgb)] {
        let mut f = b"P6\n1920 640\n255\n".to_vec();
        f.extend_from_slice(rgb);
        std::fs::write(name, f).unwrap();
    }
    let bvh = Bvh::build(&mesh.vertices, &mesh.faces);
    let mut dirs = vec![];
    for c in 0..1024 { for b in 0..32 {
        let a = c as f32 / 1024.0 * 6.2832; let e = (b as f32 / 31.0 - 0.5) * 0.785;
        dirs.push(Vector3::new(a.cos() * e.cos(), a.sin() * e.cos(), e.sin()));
    } }
    let o = Point3::new(2.5, 2.0, 0.6);
    let mut st = RayStack::default();
    best("bvh only", || { let mut s = 0.0; for d in &dirs { s += bvh.cast(&o, d, 30.0, &mut st).map_or(0.0, |h| h.distance); } std::hint::black_box(s); });
    let tm = parry3d::shape::TriMesh::new(mesh.vertices.iter().map(|v| V::new(v.x, v.y, v.z)).collect(), mesh.faces.clone()).unwrap();
    let po = V::new(o.x, o.y, o.z);
    best("parry", || { let mut s = 0.0; for d in &dirs { s += tm.cast_local_ray(&Ray::new(po, V::new(d.x, d.y, d.z)), 30.0, false).unwrap_or(0.0); } std::hint::black_box(s); });
}
