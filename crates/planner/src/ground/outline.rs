//! Obstacle polygons of an occupancy picture: border following along the cracks between cells
//! (blocked cells that touch by a corner belong together), then Douglas-Peucker.

use super::grid::PaddedGrid;

/// A turn of a ring, in cell units of the padded grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Corner {
    pub x: i32,
    pub y: i32,
    /// The obstacle fills less than half of the surroundings.
    pub convex: bool,
}

/// All rings that part blocked from free cells; the obstacle lies on the left, so the outline of an island
/// runs counter-clockwise and that of a room clockwise. Exact: rings are the borders of the squares.
pub(crate) fn outlines(grid: &PaddedGrid) -> Vec<Vec<Corner>> {
    // A ring has a bottom side (blocked above, free below, walked in +x) or it has none and is empty: every
    // closed rectilinear ring walks in +x somewhere.
    let mut visited = vec![false; grid.width * grid.height];
    let mut rings = Vec::new();
    for y in 1..grid.height {
        for x in 0..grid.width {
            let starts = grid.blocked[y * grid.width + x] && !grid.blocked[(y - 1) * grid.width + x];
            if starts && !visited[y * grid.width + x] {
                rings.push(follow(grid, x as i64, y as i64, &mut visited));
            }
        }
    }
    rings
}

/// Walks one ring from the lower side of blocked cell `(x, y)`.
fn follow(grid: &PaddedGrid, x: i64, y: i64, visited: &mut [bool]) -> Vec<Corner> {
    let mut corners = Vec::new();
    let (mut px, mut py) = (x, y);
    let (mut dx, mut dy) = (1i64, 0i64);
    loop {
        if (dx, dy) == (1, 0) {
            let cell = py as usize * grid.width + px as usize;
            if visited[cell] {
                break;
            }
            visited[cell] = true;
        }
        px += dx;
        py += dy;
        // The two cells ahead: centres at p + d/2 +- left/2, with left = (-dy, dx).
        let cell = |side: i64| {
            let cx = 2 * px + dx - side * dy;
            let cy = 2 * py + dy + side * dx;
            grid.is_blocked((cx - 1).div_euclid(2), (cy - 1).div_euclid(2))
        };
        let (left, right) = (cell(1), cell(-1));
        if right {
            corners.push(Corner { x: px as i32, y: py as i32, convex: false });
            (dx, dy) = (dy, -dx);
        } else if !left {
            corners.push(Corner { x: px as i32, y: py as i32, convex: true });
            (dx, dy) = (-dy, dx);
        }
    }
    corners
}

/// Douglas-Peucker on a closed ring: a subset of its corners, in order, such that no corner is further than
/// `tolerance` from the simplified ring. A ring that would fall below three corners becomes its bounding box.
pub(crate) fn simplify(ring: &[Corner], tolerance: f64) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = ring.iter().map(|c| [f64::from(c.x), f64::from(c.y)]).collect();
    if points.len() <= 4 {
        return points;
    }
    // Two corners that surely belong to the outline: the lowest-left one and the one furthest from it.
    let first = (0..ring.len()).min_by_key(|&k| (ring[k].x, ring[k].y)).unwrap_or(0);
    let gap = |k: usize| {
        let (dx, dy) = (i64::from(ring[k].x - ring[first].x), i64::from(ring[k].y - ring[first].y));
        dx * dx + dy * dy
    };
    let second = (0..ring.len()).max_by_key(|&k| (gap(k), std::cmp::Reverse(k))).unwrap_or(0);
    let mut keep = vec![false; points.len()];
    keep[first] = true;
    keep[second] = true;
    split(&points, first, second, tolerance, &mut keep);
    split(&points, second, first, tolerance, &mut keep);
    let kept: Vec<[f64; 2]> = (0..points.len()).filter(|&k| keep[k]).map(|k| points[k]).collect();
    if kept.len() >= 3 {
        return kept;
    }
    let low = |axis: usize| points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    let (x0, x1, y0, y1) = (low(0), high(0), low(1), high(1));
    vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

/// Keeps, between kept corners `from` and `to` (walking forward), the furthest one while it is too far.
fn split(points: &[[f64; 2]], from: usize, to: usize, tolerance: f64, keep: &mut [bool]) {
    let n = points.len();
    let mut open = vec![(from, to)];
    while let Some((a, b)) = open.pop() {
        let mut furthest = (tolerance, None);
        let mut k = (a + 1) % n;
        while k != b {
            let d = distance_to_segment(points[k], points[a], points[b]);
            if d > furthest.0 {
                furthest = (d, Some(k));
            }
            k = (k + 1) % n;
        }
        if let Some(k) = furthest.1 {
            keep[k] = true;
            open.push((a, k));
            open.push((k, b));
        }
    }
}

fn distance_to_segment(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (ux, uy) = (b[0] - a[0], b[1] - a[1]);
    let (wx, wy) = (p[0] - a[0], p[1] - a[1]);
    let length = ux * ux + uy * uy;
    let t = if length > 0.0 { ((wx * ux + wy * uy) / length).clamp(0.0, 1.0) } else { 0.0 };
    (wx - t * ux).hypot(wy - t * uy)
}

#[cfg(test)]
mod tests {
    use super::super::grid::GridView;
    use super::*;
    use nalgebra::Point2;

    fn grid(picture: &[&str]) -> PaddedGrid {
        let height = picture.len();
        let width = picture[0].len();
        let blocked: Vec<bool> = picture.iter().rev().flat_map(|row| row.chars().map(|c| c == '#')).collect();
        PaddedGrid::new(&GridView { origin: Point2::origin(), resolution_m: 1.0, width, height, blocked: &blocked })
            .unwrap()
    }

    /// Twice the signed area: positive where the ring runs counter-clockwise.
    fn area2(ring: &[Corner]) -> i64 {
        (0..ring.len())
            .map(|k| {
                let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
                i64::from(a.x) * i64::from(b.y) - i64::from(b.x) * i64::from(a.y)
            })
            .sum()
    }

    #[test]
    fn one_cell_in_a_room_gives_an_island_and_the_room() {
        let rings = outlines(&grid(&["....", ".#..", "....", "...."]));
        assert_eq!(rings.len(), 2);
        let mut areas: Vec<i64> = rings.iter().map(|r| area2(r)).collect();
        areas.sort_unstable();
        assert_eq!(areas, [-32, 2]);
        let island = rings.iter().find(|r| area2(r) > 0).unwrap();
        assert!(island.len() == 4 && island.iter().all(|c| c.convex));
        let room = rings.iter().find(|r| area2(r) < 0).unwrap();
        assert!(room.len() == 4 && room.iter().all(|c| !c.convex));
    }

    #[test]
    fn cells_that_touch_by_a_corner_are_one_obstacle() {
        let rings = outlines(&grid(&[".....", ".#...", "..#..", "....."]));
        assert_eq!(rings.len(), 2);
        assert_eq!(rings.iter().map(|r| area2(r)).sum::<i64>(), 2 * 2 - 2 * 20);
    }

    #[test]
    fn a_staircase_becomes_a_line() {
        let rings =
            outlines(&grid(&["#.......", "##......", "###.....", "####....", "#####...", "######..", "#######."]));
        assert_eq!(rings.len(), 1);
        let simple = simplify(&rings[0], 1.5);
        assert!(simple.len() <= 4, "{simple:?}");
    }

    /// OpenCV's borders of three obstacle pictures: the same outer borders and holes, pixel for pixel.
    #[test]
    fn borders_are_those_of_opencv() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/maps/contours_golden.json");
        let Ok(text) = std::fs::read_to_string(path) else {
            println!("skipped: {path} is not here");
            return;
        };
        let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
        for image in golden["images"].as_array().unwrap() {
            let size = image["size"].as_u64().unwrap() as usize;
            let mut value = image["first_value"].as_u64() == Some(1);
            let (mut blocked, mut cell) = (vec![false; (size + 2) * (size + 2)], 0);
            for run in image["runs"].as_array().unwrap() {
                for _ in 0..run.as_u64().unwrap() {
                    blocked[(cell / size + 1) * (size + 2) + cell % size + 1] = value;
                    cell += 1;
                }
                value = !value;
            }
            let (width, height) = (size + 2, size + 2);
            let grid = PaddedGrid { origin: Point2::origin(), resolution_m: 1.0, width, height, blocked };
            let mut ours: Vec<(bool, Vec<(i64, i64)>)> =
                outlines(&grid).iter().map(|ring| (area2(ring) > 0, pixels_beside(ring))).collect();
            let hierarchy = image["hierarchy"].as_array().unwrap();
            let mut theirs: Vec<(bool, Vec<(i64, i64)>)> = image["contours"]
                .as_array()
                .unwrap()
                .iter()
                .zip(hierarchy)
                .map(|(contour, link)| {
                    let pixel = |p: &serde_json::Value| (p[0].as_i64().unwrap() + 1, p[1].as_i64().unwrap() + 1);
                    let mut pixels: Vec<(i64, i64)> = contour.as_array().unwrap().iter().map(pixel).collect();
                    pixels.sort_unstable();
                    pixels.dedup();
                    // Outer borders and holes take turns from the root of the tree down.
                    let (mut is_outer, mut parent) = (true, link[3].as_i64().unwrap());
                    while parent >= 0 {
                        is_outer = !is_outer;
                        parent = hierarchy[parent as usize][3].as_i64().unwrap();
                    }
                    (is_outer, pixels)
                })
                .collect();
            ours.sort_unstable();
            theirs.sort_unstable();
            assert_eq!(ours.len(), theirs.len(), "{}", image["map"]);
            assert!(ours == theirs, "{}", image["map"]);
        }
    }

    /// The blocked cells on the left of a ring, sorted.
    fn pixels_beside(ring: &[Corner]) -> Vec<(i64, i64)> {
        let mut pixels = Vec::new();
        for k in 0..ring.len() {
            let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
            let (dx, dy) = (i64::from((b.x - a.x).signum()), i64::from((b.y - a.y).signum()));
            let (mut x, mut y) = (i64::from(a.x), i64::from(a.y));
            while (x, y) != (i64::from(b.x), i64::from(b.y)) {
                // Middle of the step, half a cell to the left.
                pixels.push(((2 * x + dx - dy).div_euclid(2), (2 * y + dy + dx).div_euclid(2)));
                (x, y) = (x + dx, y + dy);
            }
        }
        pixels.sort_unstable();
        pixels.dedup();
        pixels
    }
}
