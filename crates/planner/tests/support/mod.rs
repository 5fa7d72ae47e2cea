//! Small worlds shared by the tests: pictures of flats.
#![allow(dead_code)]

#[cfg(feature = "air")]
pub mod corridors;

#[cfg(feature = "ground")]
pub mod base;
#[cfg(feature = "ground")]
pub mod building;
#[cfg(feature = "ground")]
pub mod clutter;
#[cfg(feature = "ground")]
pub mod drive;
#[cfg(feature = "ground")]
pub mod optimist;

use nalgebra::Point2;
use planner::GridView;

/// A picture with its own cells.
#[derive(Debug, Clone)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    pub resolution_m: f64,
    pub blocked: Vec<bool>,
}

impl Picture {
    pub fn free(width_m: f64, height_m: f64, resolution_m: f64) -> Self {
        let (width, height) = ((width_m / resolution_m).round() as usize, (height_m / resolution_m).round() as usize);
        Picture { width, height, resolution_m, blocked: vec![false; width * height] }
    }

    pub fn view(&self) -> GridView<'_> {
        GridView {
            origin: Point2::origin(),
            resolution_m: self.resolution_m,
            width: self.width,
            height: self.height,
            blocked: &self.blocked,
        }
    }

    /// Blocks every cell that a rectangle touches.
    pub fn block(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        self.fill(x0, y0, x1, y1, true);
    }

    pub fn fill(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, value: bool) {
        let cell = |v: f64| v / self.resolution_m;
        for y in (cell(y0) + 1e-9).floor().max(0.0) as usize
            ..(cell(y1) - 1e-9).ceil().clamp(0.0, self.height as f64) as usize
        {
            for x in (cell(x0) + 1e-9).floor().max(0.0) as usize
                ..(cell(x1) - 1e-9).ceil().clamp(0.0, self.width as f64) as usize
            {
                self.blocked[y * self.width + x] = value;
            }
        }
    }

    /// Distance from a point to the nearest blocked square, by looking at all of them (outside is blocked).
    pub fn distance(&self, p: &Point2<f64>) -> f64 {
        let (w, h) = (self.width as f64 * self.resolution_m, self.height as f64 * self.resolution_m);
        let mut best = p.x.min(p.y).min(w - p.x).min(h - p.y).max(0.0);
        for y in 0..self.height {
            for x in 0..self.width {
                if self.blocked[y * self.width + x] {
                    let (x0, y0) = (x as f64 * self.resolution_m, y as f64 * self.resolution_m);
                    let dx = (x0 - p.x).max(p.x - x0 - self.resolution_m).max(0.0);
                    let dy = (y0 - p.y).max(p.y - y0 - self.resolution_m).max(0.0);
                    best = best.min(dx.hypot(dy));
                }
            }
        }
        best
    }
}

/// 12 rooms of 4 x 3 m in three rows of four, all joined by doors of `door_m`; walls 0.12 m; furniture from a seed.
pub fn flat(door_m: f64, seed: u64) -> Picture {
    let mut picture = Picture::free(17.0, 10.0, 0.05);
    let mut random = SplitMix(seed);
    let (rw, rh) = (4.0, 3.0);
    for k in 0..=4 {
        let x = 0.5 + k as f64 * rw;
        picture.block(x - 0.06, 0.5, x + 0.06, 0.5 + 3.0 * rh);
    }
    for k in 0..=3 {
        let y = 0.5 + k as f64 * rh;
        picture.block(0.5, y - 0.06, 0.5 + 4.0 * rw, y + 0.06);
    }
    for row in 0..3 {
        for column in 0..4 {
            let (x0, y0) = (0.5 + column as f64 * rw, 0.5 + row as f64 * rh);
            if seed > 0 {
                for _ in 0..3 {
                    let (w, h) = (0.3 + 0.4 * random.unit(), 0.3 + 0.4 * random.unit());
                    let (x, y) = (x0 + 0.1 + random.unit() * (rw - w - 0.2), y0 + 0.1 + random.unit() * (rh - h - 0.2));
                    picture.block(x, y, x + w, y + h);
                }
            }
        }
    }
    for row in 0..3 {
        for column in 0..4 {
            let (x0, y0) = (0.5 + column as f64 * rw, 0.5 + row as f64 * rh);
            if column < 3 {
                let y = y0 + 0.8 + random.unit();
                clear(&mut picture, x0 + rw, y, door_m, true);
            }
            if row < 2 && column % 2 == 0 {
                let x = x0 + 1.0 + random.unit();
                clear(&mut picture, x, y0 + rh, door_m, false);
            }
        }
    }
    picture
}

/// Opens a door: free only the cells wholly inside it (the wall eats the cells it touches), and the space before it.
fn clear(picture: &mut Picture, x: f64, y: f64, width: f64, vertical: bool) {
    let r = picture.resolution_m;
    let low = |v: f64| (v / r - 1e-9).ceil() * r;
    let high = |v: f64| (v / r + 1e-9).floor() * r;
    let (along, across) = (width / 2.0, 0.6);
    if vertical {
        picture.fill(x - across, low(y - along), x + across, high(y + along), false);
    } else {
        picture.fill(low(x - along), y - across, high(x + along), y + across, false);
    }
}

/// The generator of the shared test data.
pub struct SplitMix(pub u64);

impl SplitMix {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / 9_007_199_254_740_992.0
    }
}

/// A voxel world with an exact distance field (to voxel centres), 10 cm, like the map's.
pub struct Voxels {
    pub size: [usize; 3],
    pub occupied: Vec<bool>,
    pub unknown: Vec<bool>,
    distance_m: Vec<f32>,
}

const VOXEL_M: f64 = 0.1;

impl Voxels {
    pub fn new(size_m: [f64; 3], boxes: &[[f64; 6]]) -> Self {
        let size = size_m.map(|s| (s / VOXEL_M).round() as usize);
        let n = size[0] * size[1] * size[2];
        let mut voxels = Voxels { size, occupied: vec![false; n], unknown: vec![false; n], distance_m: Vec::new() };
        for b in boxes {
            voxels.fill(b, true);
        }
        voxels
    }

    /// Sets every voxel that a box touches.
    pub fn fill(&mut self, b: &[f64; 6], value: bool) {
        let low = |k: usize| (b[k] / VOXEL_M + 1e-9).floor().max(0.0) as usize;
        let high = |k: usize| ((b[k + 3] / VOXEL_M - 1e-9).ceil().max(0.0) as usize).min(self.size[k]);
        for z in low(2)..high(2) {
            for y in low(1)..high(1) {
                for x in low(0)..high(0) {
                    self.occupied[(z * self.size[1] + y) * self.size[0] + x] = value;
                }
            }
        }
    }

    /// Frees only voxels wholly inside a box: a door.
    pub fn carve(&mut self, b: &[f64; 6]) {
        let low = |k: usize| (b[k] / VOXEL_M - 1e-9).ceil() * VOXEL_M;
        let high = |k: usize| (b[k] / VOXEL_M + 1e-9).floor() * VOXEL_M;
        self.fill(&[low(0), low(1), low(2), high(3), high(4), high(5)], false);
    }

    /// Separable exact transform.
    pub fn measure(&mut self) {
        let far = 1e9f32;
        let mut d: Vec<f32> = self.occupied.iter().map(|o| if *o { 0.0 } else { far }).collect();
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        for (&n, &stride) in self.size.iter().zip(&strides) {
            for base in 0..d.len() {
                if base / stride % n != 0 {
                    continue;
                }
                let row: Vec<f32> = (0..n).map(|k| d[base + k * stride]).collect();
                for k in 0..n {
                    let mut best = row[k];
                    for step in 1..n {
                        let add = (step * step) as f32;
                        if add >= best {
                            break;
                        }
                        if k >= step {
                            best = best.min(row[k - step] + add);
                        }
                        if k + step < n {
                            best = best.min(row[k + step] + add);
                        }
                    }
                    d[base + k * stride] = best;
                }
            }
        }
        self.distance_m = d.into_iter().map(|s| s.sqrt() * VOXEL_M as f32).collect();
    }

    fn index(&self, p: &nalgebra::Point3<f64>) -> Option<usize> {
        let mut index = [0usize; 3];
        for k in 0..3 {
            let i = (p[k] / VOXEL_M).floor();
            if !(i >= 0.0 && i < self.size[k] as f64) {
                return None;
            }
            index[k] = i as usize;
        }
        Some((index[2] * self.size[1] + index[1]) * self.size[0] + index[0])
    }

    pub fn distance(&self, p: &nalgebra::Point3<f64>) -> Option<f64> {
        let k = self.index(p)?;
        (!self.unknown[k]).then(|| f64::from(self.distance_m[k]))
    }

    pub fn center(&self, k: usize) -> nalgebra::Point3<f64> {
        let (x, y, z) = (k % self.size[0], k / self.size[0] % self.size[1], k / (self.size[0] * self.size[1]));
        nalgebra::Point3::new((x as f64 + 0.5) * VOXEL_M, (y as f64 + 0.5) * VOXEL_M, (z as f64 + 0.5) * VOXEL_M)
    }

    pub fn obstacles(&self, low: &nalgebra::Point3<f64>, high: &nalgebra::Point3<f64>) -> Vec<nalgebra::Point3<f64>> {
        let range = |k: usize| {
            ((low[k] / VOXEL_M).floor().max(0.0) as usize)
                ..((high[k] / VOXEL_M).ceil().max(0.0) as usize).min(self.size[k])
        };
        let mut points = Vec::new();
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let k = (z * self.size[1] + y) * self.size[0] + x;
                    if self.occupied[k] {
                        points.push(self.center(k));
                    }
                }
            }
        }
        points
    }
}

/// The flat of 12 rooms in three dimensions: ceiling 2.5 m, doors 2.05 m high, boxes on the floor.
pub fn flat_3d(door_m: f64, seed: u64) -> Voxels {
    let mut boxes = vec![[0.0, 0.0, 0.0, 17.0, 10.0, 0.1], [0.0, 0.0, 2.6, 17.0, 10.0, 2.7]];
    let mut random = SplitMix(seed);
    for k in 0..=4 {
        let x = 0.5 + f64::from(k) * 4.0;
        boxes.push([x - 0.06, 0.5, 0.0, x + 0.06, 9.5, 2.7]);
    }
    for k in 0..=3 {
        let y = 0.5 + f64::from(k) * 3.0;
        boxes.push([0.5, y - 0.06, 0.0, 16.5, y + 0.06, 2.7]);
    }
    for room in 0..12 {
        for _ in 0..2 {
            let (x0, y0) = (0.5 + f64::from(room % 4) * 4.0, 0.5 + f64::from(room / 4) * 3.0);
            let (w, d, h) = (0.3 + 0.7 * random.unit(), 0.3 + 0.7 * random.unit(), 0.4 + 1.3 * random.unit());
            let (x, y) = (x0 + 0.1 + random.unit() * (3.8 - w), y0 + 0.1 + random.unit() * (2.8 - d));
            boxes.push([x, y, 0.0, x + w, y + d, h]);
        }
    }
    let mut voxels = Voxels::new([17.0, 10.0, 2.7], &boxes);
    for row in 0..3 {
        for column in 0..4 {
            let (x0, y0) = (0.5 + f64::from(column) * 4.0, 0.5 + f64::from(row) * 3.0);
            let half = door_m / 2.0;
            if column < 3 {
                let y = y0 + 0.8 + 1.2 * random.unit();
                voxels.carve(&[x0 + 3.6, y - half, 0.1, x0 + 4.4, y + half, 2.15]);
            }
            if row < 2 && column % 2 == 0 {
                let x = x0 + 1.0 + 2.0 * random.unit();
                voxels.carve(&[x - half, y0 + 2.6, 0.1, x + half, y0 + 3.4, 2.15]);
            }
        }
    }
    voxels.measure();
    voxels
}

/// A file of the peers' data for the aerial planner; says so and is `None` where that folder is absent.
pub fn shared_aerial(file: &str) -> Option<String> {
    shared(&format!("aerial/{file}"))
}

/// A file of `shared/data`, if it is there.
pub fn shared(file: &str) -> Option<String> {
    let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = here.ancestors().map(|a| a.join("shared/data").join(file)).find(|p| p.exists());
    if found.is_none() {
        eprintln!("skipped: no shared/data/{file}");
    }
    std::fs::read_to_string(found?).ok()
}

/// Rows of three numbers.
pub fn rows(v: &serde_json::Value) -> Vec<nalgebra::Vector3<f64>> {
    let rows = v.as_array().expect("a list of rows");
    rows.iter().map(|r| nalgebra::Vector3::from_iterator(numbers(r))).collect()
}

/// A list of numbers.
pub fn numbers(v: &serde_json::Value) -> Vec<f64> {
    v.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}
