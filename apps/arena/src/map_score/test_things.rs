//! Rooms and boxes for tests of the scoring.

use nalgebra::{Point3, Vector3};
use omni_sim::building::{Bounds, Building, ObjectTruth, Rect, RoomKind, RoomTruth};
use omni_sim::mesh::TriangleMesh;

/// A cube.
pub fn thing(id: u32, class: &str, center: [f64; 3], side_m: f64) -> ObjectTruth {
    boxed(id, class, center, [side_m; 3])
}

/// A box in room 0.
pub fn boxed(id: u32, class: &str, center: [f64; 3], sides_m: [f64; 3]) -> ObjectTruth {
    let (center, half) = (Point3::from(center), Vector3::from(sides_m) / 2.0);
    ObjectTruth {
        id,
        class: class.into(),
        color: "red".into(),
        rgb: [190, 36, 36],
        material: "wood".into(),
        function: "being compared".into(),
        caption: String::new(),
        bounds: Bounds { min: center - half, max: center + half },
        yaw_rad: 0.0,
        room: 0,
        supported_by: None,
        placed_with: None,
    }
}

/// A room of one rectangle x0, y0, x1, y1.
pub fn room(id: u32, [x0, y0, x1, y1]: [f64; 4]) -> RoomTruth {
    RoomTruth {
        id,
        kind: RoomKind::Office,
        name: format!("office {id}"),
        rects: vec![Rect::new(x0, y0, x1, y1)],
        floor_z_m: 0.0,
        height_m: 2.6,
        storey: 0,
    }
}

/// Rooms without walls, and things of solid boxes.
pub fn building_of(rooms: Vec<RoomTruth>, objects: Vec<ObjectTruth>) -> Building {
    let mut mesh = TriangleMesh::default();
    for object in &objects {
        let Bounds { min, max } = object.bounds;
        let first = mesh.vertices.len() as u32;
        for corner in 0..8_u32 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
            mesh.vertices.push(Point3::new(pick(0), pick(1), pick(2)).cast());
        }
        let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        for [a, b, c, d] in quads {
            for face in [[a, b, c], [a, c, d]] {
                mesh.faces.push(face.map(|corner: u32| first + corner));
                mesh.instances.push(object.id);
                mesh.colors.push(object.rgb);
            }
        }
    }
    Building { rooms, doors: Vec::new(), objects, mesh, movers: Vec::new() }
}
