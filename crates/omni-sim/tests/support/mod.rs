//! Small worlds for tests, benches and examples: a closed room and a flat of six rooms with furniture.
#![allow(dead_code)] // each user needs another part

use nalgebra::{Isometry3, Point3, Vector3};
use omni_sim::mesh::{Mover, TriangleMesh};
use omni_sim::noise::NoiseKey;
use omni_sim::world::{Thing, World};

/// A box, corners `low` and `high`, normals outwards.
pub fn push_box(mesh: &mut TriangleMesh, low: [f32; 3], high: [f32; 3], instance: u32, color: [u8; 3]) {
    let base = mesh.vertices.len() as u32;
    for i in 0..8 {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 { low[axis] } else { high[axis] }
        };
        mesh.vertices.push(Point3::new(pick(0), pick(1), pick(2)));
    }
    for quad in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        let q = quad.map(|i| base + i);
        push_quad(mesh, q, instance, color);
    }
}

fn push_quad(mesh: &mut TriangleMesh, q: [u32; 4], instance: u32, color: [u8; 3]) {
    for face in [[q[0], q[1], q[2]], [q[0], q[2], q[3]]] {
        mesh.faces.push(face);
        mesh.instances.push(instance);
        mesh.colors.push(color);
    }
}

/// A standing cylinder with `segments` sides and lids; bulges in the middle by `bulge` (a vase for > 0).
pub fn push_round(
    mesh: &mut TriangleMesh,
    foot: [f32; 3],
    radius: f32,
    height: f32,
    segments: u32,
    instance: u32,
    color: [u8; 3],
) {
    let base = mesh.vertices.len() as u32;
    for level in 0..2 {
        for s in 0..segments {
            let (sin, cos) = (std::f32::consts::TAU * s as f32 / segments as f32).sin_cos();
            mesh.vertices.push(Point3::new(
                foot[0] + radius * cos,
                foot[1] + radius * sin,
                foot[2] + height * level as f32,
            ));
        }
    }
    mesh.vertices.push(Point3::new(foot[0], foot[1], foot[2]));
    mesh.vertices.push(Point3::new(foot[0], foot[1], foot[2] + height));
    for s in 0..segments {
        let (a, b) = (base + s, base + (s + 1) % segments);
        let (c, d) = (a + segments, b + segments);
        push_quad(mesh, [a, b, d, c], instance, color);
        for face in [[base + 2 * segments, b, a], [base + 2 * segments + 1, c, d]] {
            mesh.faces.push(face);
            mesh.instances.push(instance);
            mesh.colors.push(color);
        }
    }
}

/// A closed room, 4 x 5 x 2.5 m, its six sides cut into `cuts` x `cuts` squares each: many shared edges. Normals inwards.
pub fn closed_room(cuts: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let size = [4.0_f32, 5.0, 2.5];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in 0..2 {
            let base = mesh.vertices.len() as u32;
            for i in 0..=cuts {
                for j in 0..=cuts {
                    let mut p = [0.0_f32; 3];
                    p[axis] = size[axis] * side as f32;
                    p[u] = size[u] * (i as f32 / cuts as f32);
                    p[v] = size[v] * (j as f32 / cuts as f32);
                    mesh.vertices.push(Point3::from(p));
                }
            }
            let at = |i: u32, j: u32| base + i * (cuts + 1) + j;
            for i in 0..cuts {
                for j in 0..cuts {
                    let mut q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if side == 1 {
                        q.reverse();
                    }
                    push_quad(&mut mesh, q, 0, [200, 200, 190]);
                }
            }
        }
    }
    mesh
}

const WALL: [u8; 3] = [225, 220, 210];
const CLASSES: [(&str, &str, [u8; 3]); 8] = [
    ("table", "brown", [130, 90, 50]),
    ("chair", "black", [40, 40, 45]),
    ("sofa", "grey", [120, 120, 130]),
    ("mug", "white", [240, 240, 240]),
    ("vase", "blue", [50, 80, 190]),
    ("plant", "green", [50, 140, 60]),
    ("cabinet", "white", [235, 235, 230]),
    ("lamp", "yellow", [240, 210, 90]),
];

/// A flat of 3 x 2 rooms, 5 x 4 m each, 2.5 m high, with doors of 1.1 m, and `per_room` things in each room.
/// `segments` is the number of sides of round things (more: more triangles).
pub fn flat(per_room: usize, segments: u32) -> (TriangleMesh, Vec<Thing>) {
    let mut mesh = TriangleMesh::default();
    push_box(&mut mesh, [-0.1, -0.1, -0.1], [15.1, 8.1, 0.0], 0, [150, 125, 100]);
    push_box(&mut mesh, [-0.1, -0.1, 2.5], [15.1, 8.1, 2.6], 0, [245, 245, 245]);
    for x in [0.0, 15.0] {
        push_box(&mut mesh, [x - 0.05, -0.05, 0.0], [x + 0.05, 8.05, 2.5], 0, WALL);
    }
    for y in [0.0, 8.0] {
        push_box(&mut mesh, [0.05, y - 0.05, 0.0], [14.95, y + 0.05, 2.5], 0, WALL);
    }
    for x in [5.0, 10.0] {
        for y in [0.05, 4.0] {
            wall_with_door(&mut mesh, 0, x, y, y + 3.95);
        }
    }
    for x in [0.05, 5.05, 10.05] {
        wall_with_door(&mut mesh, 1, 4.0, x, x + 4.9);
    }
    let mut things = Vec::new();
    let mut instance = 0;
    for room in 0..6 {
        let (x0, y0) = (5.0 * (room % 3) as f32, 4.0 * (room / 3) as f32);
        for k in 0..per_room {
            instance += 1;
            let key = NoiseKey::new(11).with(instance);
            let (class, color, rgb) = CLASSES[(k + room) % CLASSES.len()];
            // Along the walls, so that the middle stays free for a robot.
            let along = key.with(1).uniform() as f32;
            let (x, y) = match key.with(2).index(4) {
                0 => (x0 + 0.5 + 4.0 * along, y0 + 0.4),
                1 => (x0 + 0.5 + 4.0 * along, y0 + 3.6),
                2 => (x0 + 0.4, y0 + 0.5 + 3.0 * along),
                _ => (x0 + 4.6, y0 + 0.5 + 3.0 * along),
            };
            let id = instance as u32;
            match class {
                "mug" => push_round(&mut mesh, [x, y, 0.75], 0.04, 0.1, segments, id, rgb),
                "vase" => push_round(&mut mesh, [x, y, 0.75], 0.08, 0.3, segments, id, rgb),
                "plant" => push_round(&mut mesh, [x, y, 0.0], 0.2, 1.1, segments, id, rgb),
                "lamp" => push_round(&mut mesh, [x, y, 0.0], 0.15, 1.6, segments, id, rgb),
                "table" => {
                    push_box(&mut mesh, [x - 0.4, y - 0.3, 0.7], [x + 0.4, y + 0.3, 0.74], id, rgb);
                    for (dx, dy) in [(-0.35, -0.25), (-0.35, 0.25), (0.35, -0.25), (0.35, 0.25)] {
                        let (a, b) = (x + dx, y + dy);
                        push_box(&mut mesh, [a - 0.02, b - 0.02, 0.0], [a + 0.02, b + 0.02, 0.7], id, rgb);
                    }
                }
                "chair" => {
                    push_box(&mut mesh, [x - 0.2, y - 0.2, 0.4], [x + 0.2, y + 0.2, 0.45], id, rgb);
                    push_box(&mut mesh, [x - 0.2, y - 0.2, 0.0], [x + 0.2, y - 0.15, 0.9], id, rgb);
                }
                _ => push_box(&mut mesh, [x - 0.3, y - 0.25, 0.0], [x + 0.3, y + 0.25, 0.9], id, rgb),
            }
            things.push(Thing {
                instance: id,
                class: class.to_string(),
                color: color.to_string(),
                caption: format!("A {color} {class} in room {room}."),
            });
        }
    }
    (mesh, things)
}

/// Wall across `axis` at `at`, from `from` to `to` on the other axis, with a door in the middle.
fn wall_with_door(mesh: &mut TriangleMesh, axis: usize, at: f32, from: f32, to: f32) {
    let middle = (from + to) / 2.0;
    for (a, b, low) in [(from, middle - 0.55, 0.0), (middle + 0.55, to, 0.0), (middle - 0.55, middle + 0.55, 2.05)] {
        let (mut p, mut q) = ([0.0, 0.0, low], [0.0, 0.0, 2.5]);
        (p[axis], q[axis]) = (at - 0.05, at + 0.05);
        (p[1 - axis], q[1 - axis]) = (a, b);
        push_box(mesh, p, q, 0, WALL);
    }
}

/// A person-like cylinder that walks 2 m along x in room 0 within four seconds.
pub fn walker(instance: u32) -> Mover {
    let mut mesh = TriangleMesh::default();
    push_round(&mut mesh, [0.0, 0.0, 0.0], 0.2, 1.7, 12, instance, [180, 60, 60]);
    let at = |x: f64| Isometry3::new(Vector3::new(x, 1.5, 0.0), Vector3::zeros());
    Mover { instance, mesh, path: vec![(0, at(1.5)), (4_000_000_000, at(3.5))] }
}

/// The flat with a walker in it.
pub fn flat_world(per_room: usize, segments: u32) -> World {
    let (mesh, mut things) = flat(per_room, segments);
    let id = 10_000;
    things.push(Thing {
        instance: id,
        class: "person".to_string(),
        color: "red".to_string(),
        caption: "A person in a red coat.".to_string(),
    });
    World::new(mesh, vec![walker(id)], things).expect("the flat is well formed")
}
