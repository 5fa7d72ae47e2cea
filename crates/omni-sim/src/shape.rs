//! Solids with few triangles from which furniture is put together, and their placement in the world.
//!
//! The frame of a model: origin on the floor (or support) under the middle of the footprint, x to the front, y to the left,
//! z up.

use nalgebra::{Point3, Vector3};

use crate::building::Bounds;
use crate::mesh::{InstanceId, TriangleMesh};

/// Sides of a round solid.
const SIDES: usize = 8;

/// The shape of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Solid {
    /// Axis-aligned box: 12 triangles.
    Block {
        /// Corner with the smaller coordinates.
        min: Point3<f64>,
        /// Corner with the larger coordinates.
        max: Point3<f64>,
    },
    /// Upright round post, cone frustum or dish: 28 triangles.
    Round {
        /// Middle of the lower end.
        base: Point3<f64>,
        /// Radius of the lower end.
        radius_low_m: f64,
        /// Radius of the upper end.
        radius_high_m: f64,
        /// Height.
        height_m: f64,
    },
    /// Rounded lump (icosahedron): 20 triangles.
    Lump {
        /// Middle.
        center: Point3<f64>,
        /// Half extents.
        radii: Vector3<f64>,
    },
}

/// A solid with a colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Shape.
    pub solid: Solid,
    /// Colour.
    pub rgb: [u8; 3],
}

/// A top on which things may stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Smaller x and y, at the height of the surface.
    pub min: Point3<f64>,
    /// Larger x and y, at the same height.
    pub max: Point3<f64>,
    /// Free height above.
    pub headroom_m: f64,
}

/// A thing made of parts, in its own frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Model {
    /// What is seen and touched.
    pub parts: Vec<Part>,
    /// Where things may stand.
    pub surfaces: Vec<Surface>,
}

/// Position and heading of a model in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The model's origin in the world.
    pub origin: Point3<f64>,
    /// Heading of the model's x axis, radians from world x.
    pub yaw_rad: f64,
}

impl Placement {
    /// Model coordinates to world coordinates. Quarter turns are exact.
    pub fn world_from_model(&self, p: &Point3<f64>) -> Point3<f64> {
        let (s, c) = exact_sin_cos(self.yaw_rad);
        Point3::new(self.origin.x + c * p.x - s * p.y, self.origin.y + s * p.x + c * p.y, self.origin.z + p.z)
    }
}

/// Sine and cosine that are exact for multiples of a quarter turn, so that furniture touches walls and supports exactly.
pub fn exact_sin_cos(yaw_rad: f64) -> (f64, f64) {
    let quarters = yaw_rad / std::f64::consts::FRAC_PI_2;
    if (quarters - quarters.round()).abs() < 1e-9 {
        return [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][(quarters.round() as i64).rem_euclid(4) as usize];
    }
    yaw_rad.sin_cos()
}

impl Solid {
    /// A box from its lower middle: extents along x, y and z.
    pub fn block(x: f64, y: f64, z: f64, dx: f64, dy: f64, dz: f64) -> Self {
        Solid::Block {
            min: Point3::new(x - dx / 2.0, y - dy / 2.0, z),
            max: Point3::new(x + dx / 2.0, y + dy / 2.0, z + dz),
        }
    }

    /// An upright cylinder from its lower middle.
    pub fn post(x: f64, y: f64, z: f64, radius_m: f64, height_m: f64) -> Self {
        Solid::Round { base: Point3::new(x, y, z), radius_low_m: radius_m, radius_high_m: radius_m, height_m }
    }

    /// Corners and faces, counter-clockwise from outside.
    fn triangles(&self) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
        match *self {
            Solid::Block { min, max } => {
                let corner = |i: usize| {
                    Point3::new(
                        if i & 1 == 0 { min.x } else { max.x },
                        if i & 2 == 0 { min.y } else { max.y },
                        if i & 4 == 0 { min.z } else { max.z },
                    )
                };
                (
                    (0..8).map(corner).collect(),
                    vec![
                        [0, 2, 3],
                        [0, 3, 1],
                        [4, 5, 7],
                        [4, 7, 6],
                        [0, 1, 5],
                        [0, 5, 4],
                        [2, 6, 7],
                        [2, 7, 3],
                        [0, 4, 6],
                        [0, 6, 2],
                        [1, 3, 7],
                        [1, 7, 5],
                    ],
                )
            }
            Solid::Round { base, radius_low_m, radius_high_m, height_m } => {
                let mut points = Vec::with_capacity(2 * SIDES);
                for (radius, z) in [(radius_low_m, base.z), (radius_high_m, base.z + height_m)] {
                    for k in 0..SIDES {
                        let (s, c) = exact_sin_cos(k as f64 * std::f64::consts::TAU / SIDES as f64);
                        points.push(Point3::new(base.x + radius * c, base.y + radius * s, z));
                    }
                }
                let n = SIDES as u32;
                let mut faces = Vec::with_capacity(4 * SIDES - 4);
                for k in 0..n {
                    let l = (k + 1) % n;
                    faces.extend([[k, l, n + l], [k, n + l, n + k]]);
                }
                for k in 1..n - 1 {
                    faces.extend([[0, k + 1, k], [n, n + k, n + k + 1]]);
                }
                (points, faces)
            }
            Solid::Lump { center, radii } => {
                // Icosahedron: (0, +-1, +-g) and its cyclic permutations, scaled so that the extents are the radii.
                let g = (1.0 + 5f64.sqrt()) / 2.0;
                let (a, b) = (1.0 / g, 1.0);
                let raw = [
                    [-a, b, 0.0],
                    [a, b, 0.0],
                    [-a, -b, 0.0],
                    [a, -b, 0.0],
                    [0.0, -a, b],
                    [0.0, a, b],
                    [0.0, -a, -b],
                    [0.0, a, -b],
                    [b, 0.0, -a],
                    [b, 0.0, a],
                    [-b, 0.0, -a],
                    [-b, 0.0, a],
                ];
                (
                    raw.iter().map(|r| center + Vector3::new(r[0] * radii.x, r[1] * radii.y, r[2] * radii.z)).collect(),
                    vec![
                        [0, 11, 5],
                        [0, 5, 1],
                        [0, 1, 7],
                        [0, 7, 10],
                        [0, 10, 11],
                        [1, 5, 9],
                        [5, 11, 4],
                        [11, 10, 2],
                        [10, 7, 6],
                        [7, 1, 8],
                        [3, 9, 4],
                        [3, 4, 2],
                        [3, 2, 6],
                        [3, 6, 8],
                        [3, 8, 9],
                        [4, 9, 5],
                        [2, 4, 11],
                        [6, 2, 10],
                        [8, 6, 7],
                        [9, 8, 1],
                    ],
                )
            }
        }
    }
}

impl Model {
    /// Box of the placed model.
    pub fn bounds(&self, placement: &Placement) -> Bounds {
        let points = self.parts.iter().flat_map(|p| p.solid.triangles().0).map(|p| placement.world_from_model(&p));
        bounds_of(points)
    }

    /// Boxes of the placed parts, one each.
    pub fn part_bounds(&self, placement: &Placement) -> Vec<Bounds> {
        self.parts
            .iter()
            .map(|p| bounds_of(p.solid.triangles().0.iter().map(|q| placement.world_from_model(q))))
            .collect()
    }

    /// Adds the placed model's triangles.
    pub fn push(&self, mesh: &mut TriangleMesh, placement: &Placement, instance: InstanceId) {
        for part in &self.parts {
            let (points, faces) = part.solid.triangles();
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(points.iter().map(|p| placement.world_from_model(p).cast::<f32>()));
            for f in faces {
                mesh.faces.push(f.map(|i| first + i));
                mesh.instances.push(instance);
                mesh.colors.push(part.rgb);
            }
        }
    }
}

/// Adds a flat four-sided face, counter-clockwise seen from its front.
pub fn push_quad(mesh: &mut TriangleMesh, quad: [Point3<f64>; 4], instance: InstanceId, color: [u8; 3]) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(quad.iter().map(|p| p.cast::<f32>()));
    for face in [[first, first + 1, first + 2], [first, first + 2, first + 3]] {
        mesh.faces.push(face);
        mesh.instances.push(instance);
        mesh.colors.push(color);
    }
}

fn bounds_of(points: impl Iterator<Item = Point3<f64>>) -> Bounds {
    let empty = Bounds { min: Point3::from([f64::INFINITY; 3]), max: Point3::from([f64::NEG_INFINITY; 3]) };
    points.fold(empty, |b, p| Bounds { min: b.min.inf(&p), max: b.max.sup(&p) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signed volume by the divergence theorem: positive only if closed and wound outwards.
    fn volume(solid: Solid) -> f64 {
        let (p, f) = solid.triangles();
        f.iter()
            .map(|t| p[t[0] as usize].coords.dot(&p[t[1] as usize].coords.cross(&p[t[2] as usize].coords)) / 6.0)
            .sum()
    }

    #[test]
    fn volumes_have_the_right_sign_and_size() {
        assert!((volume(Solid::block(3.0, 1.0, 0.5, 1.0, 2.0, 3.0)) - 6.0).abs() < 1e-9);
        // A regular octagon of radius 1 has the area 2 sqrt 2.
        assert!((volume(Solid::post(0.0, 2.0, 1.0, 1.0, 2.0)) - 4.0 * 2f64.sqrt()).abs() < 1e-9);
        let lump = volume(Solid::Lump { center: Point3::new(5.0, 0.0, 0.0), radii: Vector3::new(1.0, 1.0, 1.0) });
        assert!(lump > 2.0 && lump < 4.2, "{lump}");
    }

    #[test]
    fn a_quarter_turn_is_exact() {
        let model = Model {
            parts: vec![Part { solid: Solid::block(0.0, 0.0, 0.0, 0.6, 2.0, 0.5), rgb: [0; 3] }],
            ..Default::default()
        };
        let at = Placement { origin: Point3::new(1.0, 1.0, 0.0), yaw_rad: std::f64::consts::FRAC_PI_2 };
        let b = model.bounds(&at);
        assert_eq!((b.min, b.max), (Point3::new(0.0, 0.7, 0.0), Point3::new(2.0, 1.3, 0.5)));
    }
}
