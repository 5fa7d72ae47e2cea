//! Layer 1: obstacle polygons of what is known round the robot, and their convex vertices.
//!
//! Border following along the cracks between occupied and other cells, topology filter, Douglas-Peucker, pillars. The region is that
//! of the window rounded up to whole tiles, so that polygons stay what they are while the window moves over them.

use nalgebra::Point2;

use super::super::grid::PaddedGrid;
use super::super::outline::{Corner, outlines, simplify};
use super::super::vertex::{Vertex, vertices_round};
use super::config::FarConfig;
use super::memory::{Memory, Spot};
use super::tile::{SIDE, Through};

/// Douglas-Peucker tolerance in cells. FAR has 1.5; a straight wall at any angle wavers by less than 1, and with less than 1 a wall of one
/// cell keeps both corners of its end, so that vertices need not stand off from a corner that is not there.
const SIMPLIFY_CELLS: f64 = 0.99;
/// Most vertices of one cycle; what a window has beyond is counted and left.
const MAX_VERTICES: usize = 4096;

/// Tiles from `low` to `high`, the latter not included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Region {
    pub low: [i32; 2],
    pub high: [i32; 2],
}

impl Region {
    /// The tiles that a window touches.
    pub fn of_window(first_cell: [i64; 2], width: usize, height: usize) -> Self {
        let tile = |cell: i64| cell.div_euclid(SIDE as i64) as i32;
        Region {
            low: first_cell.map(tile),
            high: [tile(first_cell[0] + width as i64 - 1) + 1, tile(first_cell[1] + height as i64 - 1) + 1],
        }
    }

    /// Whether a point is inside by at least `margin` cells.
    pub fn contains(&self, p: &Point2<f64>, margin: f64) -> bool {
        let side = SIDE as f64;
        (0..2).all(|axis| {
            let (low, high) = (f64::from(self.low[axis]) * side, f64::from(self.high[axis]) * side);
            p[axis] >= low + margin && p[axis] <= high - margin
        })
    }
}

/// A vertex of this cycle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalVertex {
    pub vertex: Vertex,
    pub is_pillar: bool,
}

/// The local layer; kept between cycles because most windows change no obstacle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Contours {
    region: Option<(Region, f64)>,
    pub vertices: Vec<LocalVertex>,
    /// Simplified rings in cells, obstacle on the left.
    pub polygons: Vec<Vec<[f64; 2]>>,
    /// Vertices beyond the most that are taken.
    pub left_out: usize,
    blocked: Vec<bool>,
}

impl Contours {
    /// How far inside the region a vertex has to be: what is nearer to the border may be an obstacle cut in two.
    pub fn margin(radius: f64) -> f64 {
        2.0 * radius + 2.0
    }

    /// Polygons and vertices of a region, anew if the region or an obstacle in it changed.
    pub fn extract(&mut self, memory: &Memory, region: Region, robot: &Spot, has_changed: bool, config: &FarConfig) {
        if !has_changed && self.region == Some((region, robot.floor_m)) {
            return;
        }
        self.region = Some((region, robot.floor_m));
        let grid = self.picture(memory, region, robot.floor_m);
        let offset = region.low.map(|t| i64::from(t) * SIDE as i64 - 1);
        let mut rings = outlines(&grid);
        let here = Point2::new(robot.at.x - offset[0] as f64, robot.at.y - offset[1] as f64);
        let is_in_obstacle = grid.is_blocked(here.x.floor() as i64, here.y.floor() as i64);
        if !is_in_obstacle {
            drop_unreachable(&mut rings, &here, 2.0 * memory.radius);
        }
        self.blocked = grid.blocked;

        self.polygons.clear();
        self.vertices.clear();
        self.left_out = 0;
        let margin = Contours::margin(memory.radius);
        for ring in &rings {
            let is_pillar = perimeter(ring) * config.voxel_m <= config.pillar_perimeter_m && area2(ring) > 0;
            let mut simple = if is_pillar { bounding_box(ring) } else { simplify(ring, SIMPLIFY_CELLS) };
            let bulges = if is_pillar { vec![0.0; simple.len()] } else { bulges(ring, &simple) };
            for corner in &mut simple {
                *corner = [corner[0] + offset[0] as f64, corner[1] + offset[1] as f64];
            }
            let is_free = |p: &Point2<f64>| {
                let spot = Spot { at: *p, floor_m: robot.floor_m };
                region.contains(p, margin) && memory.is_free(&spot, Through::Unknown)
            };
            let waver = |k: usize| bulges[k].max(bulges[(k + bulges.len() - 1) % bulges.len()]);
            vertices_round(&simple, memory.radius, waver, config.accept_align_rad, is_free, |vertex| {
                if self.vertices.len() < MAX_VERTICES {
                    self.vertices.push(LocalVertex { vertex, is_pillar });
                } else {
                    self.left_out += 1;
                }
            });
            self.polygons.push(simple);
        }
    }

    /// The occupied cells of a region with a free border of one cell.
    fn picture(&mut self, memory: &Memory, region: Region, floor_m: f64) -> PaddedGrid {
        let width = (region.high[0] - region.low[0]) as usize * SIDE + 2;
        let height = (region.high[1] - region.low[1]) as usize * SIDE + 2;
        let mut blocked = std::mem::take(&mut self.blocked);
        blocked.clear();
        blocked.resize(width * height, false);
        for ty in region.low[1]..region.high[1] {
            for tx in region.low[0]..region.high[0] {
                let Some(id) = memory.tile_at((tx, ty), floor_m) else { continue };
                let corner =
                    ((ty - region.low[1]) as usize * SIDE + 1) * width + (tx - region.low[0]) as usize * SIDE + 1;
                for (j, row) in memory.tiles[id as usize].occupied.iter().enumerate() {
                    let mut bits = *row;
                    while bits != 0 {
                        blocked[corner + j * width + bits.trailing_zeros() as usize] = true;
                        bits &= bits - 1;
                    }
                }
            }
        }
        PaddedGrid { origin: Point2::origin(), resolution_m: 1.0, width, height, blocked }
    }
}

/// FAR's topology filter: free space that obstacles enclose and the robot is not in goes, with all that stands in it. Holes
/// narrower than `least` cells go at once: nothing fits into them.
fn drop_unreachable(rings: &mut Vec<Vec<Corner>>, robot: &Point2<f64>, least: f64) {
    let mut keep = vec![true; rings.len()];
    let mut closed: Vec<(usize, [i32; 4])> = Vec::new();
    for (k, ring) in rings.iter().enumerate().filter(|(_, ring)| area2(ring) < 0) {
        let e = extent(ring);
        let is_narrow = f64::from(e[2] - e[0]) < least || f64::from(e[3] - e[1]) < least;
        keep[k] = !is_narrow && is_inside(ring, robot);
        if !(is_narrow || keep[k]) {
            closed.push((k, e));
        }
    }
    for k in 0..rings.len() {
        let corner = rings[k][0];
        let p = Point2::new(f64::from(corner.x), f64::from(corner.y) + 0.5);
        let is_nested = |(hole, e): &(usize, [i32; 4])| {
            let within = corner.x > e[0] && corner.x < e[2] && corner.y > e[1] && corner.y < e[3];
            *hole != k && within && is_inside(&rings[*hole], &p)
        };
        keep[k] = keep[k] && !closed.iter().any(is_nested);
    }
    let mut kept = keep.into_iter();
    rings.retain(|_| kept.next().unwrap_or(true));
}

/// Whether a point is inside a rectilinear ring. Exact: a horizontal ray is compared with upright sides only.
fn is_inside(ring: &[Corner], p: &Point2<f64>) -> bool {
    let n = ring.len();
    let crossings = (0..n).filter(|&k| {
        let (a, b) = (ring[k], ring[(k + 1) % n]);
        a.x == b.x && f64::from(a.x) > p.x && f64::from(a.y.min(b.y)) <= p.y && p.y < f64::from(a.y.max(b.y))
    });
    crossings.count() % 2 == 1
}

/// Twice the signed area: positive round an obstacle, negative round enclosed free space.
fn area2(ring: &[Corner]) -> i64 {
    let cross = |a: Corner, b: Corner| i64::from(a.x) * i64::from(b.y) - i64::from(b.x) * i64::from(a.y);
    (0..ring.len()).map(|k| cross(ring[k], ring[(k + 1) % ring.len()])).sum()
}

fn perimeter(ring: &[Corner]) -> f64 {
    let side = |a: Corner, b: Corner| (a.x.abs_diff(b.x) + a.y.abs_diff(b.y)) as f64;
    (0..ring.len()).map(|k| side(ring[k], ring[(k + 1) % ring.len()])).sum()
}

/// For each side of a simplified ring how far the corners it leaves out stand out of it into the free. A ring that became its box has none
/// outside.
fn bulges(ring: &[Corner], simple: &[[f64; 2]]) -> Vec<f64> {
    let n = simple.len();
    let at = |c: &Corner| [f64::from(c.x), f64::from(c.y)];
    let mut bulges = vec![0.0f64; n];
    let Some(start) = ring.iter().position(|c| at(c) == simple[0]) else { return bulges };
    let mut side = 0;
    for corner in (1..ring.len()).map(|k| at(&ring[(start + k) % ring.len()])) {
        if side + 1 < n && corner == simple[side + 1] {
            side += 1;
            continue;
        }
        let (a, b) = (Point2::from(simple[side]), Point2::from(simple[(side + 1) % n]));
        let along = b - a;
        let out = -along.perp(&(Point2::from(corner) - a)) / along.norm().max(1e-9);
        bulges[side] = bulges[side].max(out);
    }
    bulges
}

/// `[x low, y low, x high, y high]`.
fn extent(ring: &[Corner]) -> [i32; 4] {
    let start = [i32::MAX, i32::MAX, i32::MIN, i32::MIN];
    ring.iter().fold(start, |e, c| [e[0].min(c.x), e[1].min(c.y), e[2].max(c.x), e[3].max(c.y)])
}

fn bounding_box(ring: &[Corner]) -> Vec<[f64; 2]> {
    let [x0, y0, x1, y1] = extent(ring).map(f64::from);
    vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

#[cfg(test)]
mod tests {
    use super::super::window::{Seen, Window};
    use super::*;

    fn contours(picture: &[&str], robot: (f64, f64)) -> Contours {
        let (height, width) = (picture.len(), picture[0].len());
        let seen: Vec<Seen> = picture
            .iter()
            .rev()
            .flat_map(|row| row.chars().map(|c| if c == '#' { Seen::Occupied } else { Seen::Free }))
            .collect();
        let config = FarConfig { voxel_m: 0.2, pillar_perimeter_m: 1.0, ..FarConfig::default() };
        let mut memory = Memory::new(2.0, 1.0);
        memory.write(&Window { first_cell: [10, 10], width, height, seen: &seen }, 0.0, &mut Vec::new());
        let mut contours = Contours::default();
        let region = Region::of_window([10, 10], width, height);
        let robot = Spot { at: Point2::new(10.0 + robot.0, 10.0 + robot.1), floor_m: 0.0 };
        contours.extract(&memory, region, &robot, true, &config);
        contours
    }

    #[test]
    fn a_single_cell_is_a_pillar_with_eight_vertices_round_it() {
        let contours = contours(&["..........", "....#.....", ".........."], (1.0, 1.0));
        assert_eq!(contours.polygons, [vec![[14.0, 11.0], [15.0, 11.0], [15.0, 12.0], [14.0, 12.0]]]);
        assert_eq!(contours.vertices.len(), 8);
        assert!(contours.vertices.iter().all(|v| v.is_pillar));
    }

    #[test]
    fn a_closed_room_goes_with_what_stands_in_it_unless_the_robot_is_in_it() {
        let picture = [
            "..........................",
            "..####################....",
            "..#..................#....",
            "..#..................#....",
            "..#..................#....",
            "..#.......##.........#....",
            "..#.......##.........#....",
            "..#..................#....",
            "..#..................#....",
            "..#..................#....",
            "..####################....",
            "..........................",
        ];
        assert_eq!(contours(&picture, (24.0, 3.0)).polygons.len(), 1);
        assert_eq!(contours(&picture, (5.0, 5.0)).polygons.len(), 3);
    }
}
