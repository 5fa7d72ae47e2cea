//! Who moves: bodies that stand where the map knows nothing stands, followed from scan to scan.
//!
//! ```text
//! loose   points of a scan whose distance to everything in the map exceeds `loose_m`: something is where nothing was
//! body    connected cells of loose points, as high as a child and no wider than two people
//! track   x = (p, v),  p' = p + v dt,  white acceleration of density q      Kalman filter, the same for both axes
//! ```
//! A track is believed when it has gone somewhere, or when an image says what it is; until then it is a chair that the map has
//! not got yet. A believed one that stops is followed by its own points. What belongs to a believed track is for nobody's map.

use nalgebra::{Point2, Point3, Vector2, Vector3};

use crate::stamp::Stamp;

/// How bodies are found and followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoverConfig {
    /// Farther than this from everything in the map a point is loose; default 0.25 m.
    pub loose_m: f64,
    /// Points between these heights over the floor count; default 0.15 to 2.0 m.
    pub band_m: [f64; 2],
    /// And up to this far from the sensor; default 8 m.
    pub range_m: f64,
    /// A body has so many points; default 10.
    pub min_points: usize,
    /// It is at least so high and at most so wide; default 0.5 m, 1.2 m.
    pub size_m: [f64; 2],
    /// Radius of the circle that holds a body; default 0.35 m.
    pub radius_m: f64,
    /// Density of the white acceleration; default 0.8 m^2/s^3: who walks may stop within a step.
    pub acceleration: f64,
    /// Standard deviation of a middle; default 0.08 m: one sees one side.
    pub sigma_m: f64,
    /// Distance from its birthplace at which an unnamed track is believed; default 0.4 m.
    pub gone_m: f64,
    /// A believed track is kept unseen for so long; default 1.5 s, others for a third of it.
    pub memory_s: f64,
    /// A name holds for so long without an image that says it again; default 3 s.
    pub named_s: f64,
}

impl Default for MoverConfig {
    fn default() -> Self {
        MoverConfig {
            loose_m: 0.25,
            band_m: [0.15, 2.0],
            range_m: 8.0,
            min_points: 10,
            size_m: [0.5, 1.2],
            radius_m: 0.35,
            acceleration: 0.8,
            sigma_m: 0.08,
            gone_m: 0.4,
            memory_s: 1.5,
            named_s: 3.0,
        }
    }
}

/// Somebody who moves, or was told apart by an image.
#[derive(Debug, Clone, PartialEq)]
pub struct MoverTrack {
    /// Its number; never used again.
    pub id: u64,
    /// What an image called it, if one did.
    pub label: Option<String>,
    /// Middle of its circle on the floor, world frame, at `stamp`.
    pub position: Point2<f64>,
    /// Its velocity, m/s.
    pub velocity_mps: Vector2<f64>,
    /// Radius of its circle.
    pub radius_m: f64,
    /// Heights of its lowest and highest point.
    pub heights_m: [f64; 2],
    /// Time of `position`: that of the newest scan, whether it was seen in it or not.
    pub stamp: Stamp,
    /// When it was seen last.
    pub seen: Stamp,
    born: Point2<f64>,
    views: u32,
    is_believed: bool,
    named: Option<Stamp>,
    /// Variance of a position, of a velocity, and their covariance; the same along x and y.
    variance: [f64; 3],
    history: Vec<(Stamp, Point2<f64>)>,
}

/// The upright cylinder that holds somebody, with some room; from the floor up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoverBody {
    /// On the floor, world frame.
    pub middle: Point2<f64>,
    /// Of the cylinder.
    pub radius_m: f64,
    /// Height of its upper end in the world.
    pub top_m: f64,
}

impl MoverBody {
    /// Whether a point is in it.
    pub fn holds(&self, point: &Point3<f32>) -> bool {
        let (dx, dy) = (f64::from(point.x) - self.middle.x, f64::from(point.y) - self.middle.y);
        dx * dx + dy * dy <= self.radius_m * self.radius_m && f64::from(point.z) < self.top_m
    }
}

/// Finds and follows them.
#[derive(Debug, Clone, Default)]
pub struct MoverTracker {
    config: MoverConfig,
    tracks: Vec<MoverTrack>,
    next_id: u64,
    cells: Vec<Cell>,
}

/// Side of a cell on the floor.
const CELL_M: f64 = 0.15;
/// Poses of a track are kept for this long, so that an image that is late can name it.
const HISTORY_NS: i64 = 2_000_000_000;
/// A view further from where a track is expected is not of it.
const GATE_M: f64 = 0.5;
/// Nobody walks faster.
const MAX_SPEED_MPS: f64 = 3.0;

/// Points over one square of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    key: (i32, i32),
    count: usize,
    sum: Vector3<f64>,
    low_m: f64,
    high_m: f64,
    is_loose: bool,
}

/// Cells that hang together.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Body {
    middle: Point2<f64>,
    heights_m: [f64; 2],
}

impl MoverTracker {
    /// Nobody known.
    pub fn new(config: MoverConfig) -> MoverTracker {
        MoverTracker { config, ..MoverTracker::default() }
    }

    /// Those who are believed, by number.
    pub fn movers(&self) -> impl Iterator<Item = &MoverTrack> {
        self.tracks.iter().filter(|track| track.is_believed)
    }

    /// Takes one scan: points in the world, seen from `eye`. `distance_m` says how far from everything in the map a point that the map
    /// knows to be free is (`None`: not known to be free). Points that are not finite are skipped; a scan older than the last changes nothing.
    pub fn observe(
        &mut self,
        stamp: Stamp,
        eye: &Point3<f64>,
        floor_m: f64,
        points: &[Point3<f32>],
        distance_m: &dyn Fn(&Point3<f64>) -> Option<f64>,
    ) {
        if self.tracks.iter().any(|track| track.stamp >= stamp) {
            return;
        }
        self.sort_into_cells(eye, floor_m, points, distance_m);
        for track in &mut self.tracks {
            track.predict(stamp, &self.config);
        }
        let bodies = self.bodies();
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (t, track) in self.tracks.iter().enumerate() {
            for (b, body) in bodies.iter().enumerate() {
                let away_m = (body.middle - track.position).norm();
                if away_m <= track.gate_m() {
                    pairs.push((away_m, t, b));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let (mut of_track, mut is_taken) = (vec![None; self.tracks.len()], vec![false; bodies.len()]);
        for (_, t, b) in pairs {
            if of_track[t].is_none() && !is_taken[b] {
                (of_track[t], is_taken[b]) = (Some(bodies[b]), true);
            }
        }
        for (t, body) in of_track.into_iter().enumerate() {
            // Who stands still may have become part of the map: it is followed by what is where it stood.
            let body = body.or_else(|| self.own_points(&self.tracks[t]));
            if let Some(body) = body {
                self.tracks[t].update(stamp, eye, &body, &self.config);
            }
        }
        for (body, _) in bodies.iter().zip(&is_taken).filter(|(_, is_taken)| !**is_taken) {
            self.begin(stamp, eye, body);
        }
        let config = self.config;
        self.tracks.retain(|track| {
            let memory_s = if track.is_believed { config.memory_s } else { config.memory_s / 3.0 };
            stamp.seconds_since(track.seen) <= memory_s
        });
    }

    /// An image of the time `stamp` shows `label` over these points: a track that was there has a name from now on, and where there
    /// was none, one begins.
    pub fn name(&mut self, stamp: Stamp, label: &str, points: &[Point3<f32>]) {
        const NEAR_M: f64 = 0.7;
        let finite = points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
        let (mut count, mut sum) = (0.0, Vector3::zeros());
        let mut heights_m = [f64::INFINITY, f64::NEG_INFINITY];
        for point in finite {
            count += 1.0;
            sum += point.coords.cast::<f64>();
            heights_m = [heights_m[0].min(point.z.into()), heights_m[1].max(point.z.into())];
        }
        if count < 1.0 {
            return;
        }
        let middle = Point2::from((sum / count).xy());
        let away_m = |track: &MoverTrack| (track.position_at(stamp) - middle).norm();
        let nearest =
            (0..self.tracks.len()).min_by(|a, b| away_m(&self.tracks[*a]).total_cmp(&away_m(&self.tracks[*b])));
        let known = nearest.filter(|k| away_m(&self.tracks[*k]) <= NEAR_M);
        let index = known.unwrap_or_else(|| {
            self.begin(stamp, &Point3::new(middle.x, middle.y, 0.0), &Body { middle, heights_m });
            self.tracks.len() - 1
        });
        let track = &mut self.tracks[index];
        track.label = Some(label.to_owned());
        track.named = track.named.max(Some(stamp));
        track.is_believed = true;
    }

    /// What those who are believed by now took up at a time of the last two seconds.
    pub fn bodies_at(&self, stamp: Stamp) -> Vec<MoverBody> {
        const SLACK_M: f64 = 0.12;
        const OVER_M: f64 = 0.25;
        let body = |track: &MoverTrack| MoverBody {
            middle: track.position_at(stamp),
            radius_m: track.radius_m + SLACK_M,
            top_m: track.heights_m[1] + OVER_M,
        };
        self.movers().map(body).collect()
    }

    fn begin(&mut self, stamp: Stamp, eye: &Point3<f64>, body: &Body) {
        let position = behind_the_face(eye, &body.middle);
        let config = &self.config;
        self.tracks.push(MoverTrack {
            id: self.next_id,
            label: None,
            position,
            velocity_mps: Vector2::zeros(),
            radius_m: config.radius_m,
            heights_m: body.heights_m,
            stamp,
            seen: stamp,
            born: position,
            views: 1,
            is_believed: false,
            named: None,
            variance: [config.sigma_m * config.sigma_m, 1.0, 0.0],
            history: vec![(stamp, position)],
        });
        self.next_id += 1;
    }

    fn sort_into_cells(
        &mut self,
        eye: &Point3<f64>,
        floor_m: f64,
        points: &[Point3<f32>],
        distance_m: &dyn Fn(&Point3<f64>) -> Option<f64>,
    ) {
        let config = &self.config;
        let cells = &mut self.cells;
        cells.clear();
        let [low, high] = config.band_m.map(|m| (floor_m + m) as f32);
        for point in points {
            let (dx, dy) = (f64::from(point.x) - eye.x, f64::from(point.y) - eye.y);
            // Comparisons with NaN are false: such points end here.
            if !(point.z > low && point.z < high && dx * dx + dy * dy < config.range_m * config.range_m) {
                continue;
            }
            let at: Vector3<f64> = point.coords.cast();
            let key = ((at.x / CELL_M).floor() as i32, (at.y / CELL_M).floor() as i32);
            cells.push(Cell { key, count: 1, sum: at, low_m: at.z, high_m: at.z, is_loose: false });
        }
        cells.sort_unstable_by_key(|cell| cell.key);
        cells.dedup_by(|next, cell| {
            let is_same = next.key == cell.key;
            if is_same {
                cell.count += next.count;
                cell.sum += next.sum;
                cell.low_m = cell.low_m.min(next.low_m);
                cell.high_m = cell.high_m.max(next.high_m);
            }
            is_same
        });
        for cell in cells {
            let middle = Point3::from(cell.sum / cell.count as f64);
            cell.is_loose = distance_m(&middle).is_some_and(|distance_m| distance_m > config.loose_m);
        }
    }

    /// Loose cells that hang together and have the size of a body.
    fn bodies(&self) -> Vec<Body> {
        let mut left: Vec<usize> = (0..self.cells.len()).filter(|k| self.cells[*k].is_loose).rev().collect();
        let mut is_left: Vec<bool> = self.cells.iter().map(|cell| cell.is_loose).collect();
        let mut bodies = Vec::new();
        while let Some(first) = left.pop() {
            if !std::mem::take(&mut is_left[first]) {
                continue;
            }
            let (mut members, mut open) = (vec![first], vec![first]);
            while let Some(cell) = open.pop() {
                let (x, y) = self.cells[cell].key;
                for key in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x + dx, y + dy))) {
                    if let Ok(next) = self.cells.binary_search_by(|cell| cell.key.cmp(&key))
                        && std::mem::take(&mut is_left[next])
                    {
                        members.push(next);
                        open.push(next);
                    }
                }
            }
            bodies.extend(self.body_of(&members));
        }
        bodies
    }

    /// What is where a believed track is expected, loose or not.
    fn own_points(&self, track: &MoverTrack) -> Option<Body> {
        const NEAR_M: f64 = 0.3;
        let is_named = track.named.is_some_and(|named| track.stamp.seconds_since(named) <= self.config.named_s);
        if !(track.is_believed && is_named) {
            return None;
        }
        let is_near = |cell: &Cell| {
            let middle = cell.sum / cell.count as f64;
            (Point2::from(middle.xy()) - track.position).norm() <= NEAR_M
        };
        let members: Vec<usize> = (0..self.cells.len()).filter(|k| is_near(&self.cells[*k])).collect();
        self.body_of(&members)
    }

    fn body_of(&self, members: &[usize]) -> Option<Body> {
        let cells = || members.iter().map(|k| &self.cells[*k]);
        let count: usize = cells().map(|cell| cell.count).sum();
        let low_m = cells().map(|cell| cell.low_m).fold(f64::INFINITY, f64::min);
        let high_m = cells().map(|cell| cell.high_m).fold(f64::NEG_INFINITY, f64::max);
        let side = |axis: fn(&Cell) -> i32| {
            let low = cells().map(axis).min().unwrap_or(0);
            f64::from(cells().map(axis).max().unwrap_or(0) - low) * CELL_M
        };
        let [least_m, most_m] = self.config.size_m;
        let is_body = count >= self.config.min_points
            && high_m - low_m >= least_m
            && side(|cell| cell.key.0).max(side(|cell| cell.key.1)) <= most_m;
        let sum: Vector3<f64> = cells().map(|cell| cell.sum).sum();
        is_body.then(|| Body { middle: Point2::from((sum / count as f64).xy()), heights_m: [low_m, high_m] })
    }
}

impl MoverTrack {
    /// Where it was at a time of the last two seconds, or will be if it goes on as it does.
    pub fn position_at(&self, stamp: Stamp) -> Point2<f64> {
        if stamp >= self.stamp {
            return self.position + self.velocity_mps * stamp.seconds_since(self.stamp);
        }
        let next = self.history.partition_point(|(at, _)| *at <= stamp);
        match (next.checked_sub(1).and_then(|k| self.history.get(k)), self.history.get(next)) {
            (Some((t0, before)), Some((t1, after))) => {
                let share = stamp.seconds_since(*t0) / t1.seconds_since(*t0);
                before + (after - before) * share
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => self.position,
        }
    }

    /// Whether it stands: slower than a step in two seconds.
    pub fn stands(&self) -> bool {
        const STANDS_MPS: f64 = 0.15;
        self.velocity_mps.norm() < STANDS_MPS
    }

    fn predict(&mut self, stamp: Stamp, config: &MoverConfig) {
        let dt = stamp.seconds_since(self.stamp);
        self.position += self.velocity_mps * dt;
        let ([p, v, c], q) = (self.variance, config.acceleration);
        self.variance =
            [p + 2.0 * dt * c + dt * dt * v + q * dt * dt * dt / 3.0, v + q * dt, c + dt * v + 0.5 * q * dt * dt];
        self.stamp = stamp;
    }

    fn gate_m(&self) -> f64 {
        GATE_M + self.variance[0].sqrt().min(GATE_M)
    }

    fn update(&mut self, stamp: Stamp, eye: &Point3<f64>, body: &Body, config: &MoverConfig) {
        let [p, v, c] = self.variance;
        let total = p + config.sigma_m * config.sigma_m;
        let (gain_p, gain_v) = (p / total, c / total);
        let off = behind_the_face(eye, &body.middle) - self.position;
        self.position += off * gain_p;
        self.velocity_mps = (self.velocity_mps + off * gain_v).cap_magnitude(MAX_SPEED_MPS);
        self.variance = [(1.0 - gain_p) * p, v - gain_v * c, (1.0 - gain_p) * c];
        // What is hidden for a moment is still there: heights follow slowly.
        const FORGET: f64 = 0.1;
        self.heights_m[0] = body.heights_m[0].min(self.heights_m[0] + FORGET * (body.heights_m[0] - self.heights_m[0]));
        self.heights_m[1] = body.heights_m[1].max(self.heights_m[1] + FORGET * (body.heights_m[1] - self.heights_m[1]));
        self.seen = stamp;
        self.views += 1;
        self.history.push((stamp, self.position));
        let old = self.history.partition_point(|(at, _)| *at < stamp.plus_ns(-HISTORY_NS));
        self.history.drain(..old);
        const VIEWS: u32 = 4;
        const SPEED_MPS: f64 = 0.2;
        let has_gone = (self.position - self.born).norm() >= config.gone_m;
        self.is_believed |= self.views >= VIEWS && has_gone && self.velocity_mps.norm() >= SPEED_MPS;
    }
}

/// One sees the near side of a body: its middle is a little further.
fn behind_the_face(eye: &Point3<f64>, middle: &Point2<f64>) -> Point2<f64> {
    const HALF_DEPTH_M: f64 = 0.08;
    let ray = middle - eye.xy();
    middle + ray.try_normalize(1e-6).unwrap_or_default() * HALF_DEPTH_M
}
