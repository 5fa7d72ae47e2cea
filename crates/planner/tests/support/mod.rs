//! Small worlds shared by the tests: pictures of flats.
#![allow(dead_code)]

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
        GridView { origin: Point2::origin(), resolution_m: self.resolution_m, width: self.width, height: self.height, blocked: &self.blocked }
    }

    /// Blocks every cell that a rectangle touches.
    pub fn block(&mut self, x0: f64, y0: f64, x1: f64, y1: f64) {
        self.fill(x0, y0, x1, y1, true);
    }

    pub fn fill(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, value: bool) {
        let cell = |v: f64| v / self.resolution_m;
        for y in (cell(y0) + 1e-9).floor().max(0.0) as usize..(cell(y1) - 1e-9).ceil().clamp(0.0, self.height as f64) as usize {
            for x in (cell(x0) + 1e-9).floor().max(0.0) as usize..(cell(x1) - 1e-9).ceil().clamp(0.0, self.width as f64) as usize {
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
