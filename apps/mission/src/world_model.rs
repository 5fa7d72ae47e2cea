//! What the robot knows of the world: volume, distances, places, rooms, objects, and where it has looked.
//!
//! [`WorldModel::see`] takes what the sensors say as it comes; [`WorldModel::refresh`] twice a second draws the conclusions.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};

use dsg::SceneGraph;
use nalgebra::{Isometry3, Point2, Point3};
use omni_perception::{
    DeskewConfig, EncoderTrack, Equirectangular, MaskedPanorama, OdometryEstimate, RawScan, ReferenceTime,
    RotatingMount, Stamp, Trajectory, deskew,
};
use robot_model::{RobotKind, RobotModel};
use volumetric_map::{Cell, DistanceField, OccupancyGrid, PlaceConfig, PlaceGraph, Volume};

use crate::ablation::Part;
use crate::blind_spot::BlindSpot;
use crate::config::MissionConfig;
use crate::coverage::Coverage;
use crate::error::MissionError;
use crate::graph_builder::{GraphBuilder, is_visible};
use crate::localisation::Looks;
use crate::map_frame::MapFrame;
use crate::navigation::NavigationMap;
use crate::people::People;
use crate::rooms::RoomMap;
use crate::stage_clock::StageClock;
use crate::stream::SensorEvent;
use crate::vision_verifier::VisionVerifier;
use crate::zones::Zones;

mod labelling;
mod zones_in_map;

/// Height of the room slice above the floor: over tables and most cupboards, under lintels (2.05 m).
const ROOM_SLICE_M: (f64, f64) = (1.45, 1.90);
/// Height of the slice above it that shows the rooms with their doors closed: over doors and cupboards, under ceilings.
const LINTEL_SLICE_M: (f64, f64) = (2.15, 2.30);
/// Obstacles of a scan are kept up to this range for the local policy.
const OBSTACLE_RANGE_M: f64 = 3.5;

/// One deskewed scan, kept until the images around it have been labelled.
struct RecentScan {
    stamp: Stamp,
    points_in_world: Vec<Point3<f32>>,
}

/// Counts of what was not used, and why; reported, never silent.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Ignored {
    /// Points that were not finite, or older or younger than their scan.
    pub points: u64,
    /// Encoder angles and odometry that were not finite or out of order.
    pub samples: u64,
    /// Scans without odometry around them.
    pub scans: u64,
    /// Images without scans or odometry around them.
    pub images: u64,
    /// Map updates that were refused, e.g. because the map is full.
    pub updates: u64,
    /// Changes of the scene graph that were refused; each left its layer as it was.
    pub changes: u64,
}

impl Ignored {
    /// What was not used, one sentence each; nothing where all was.
    pub fn sentences(&self) -> Vec<String> {
        let counted = [
            (self.points, "LiDAR points were not finite or outside the time of their scan"),
            (self.samples, "encoder angles or poses of the odometry were not finite or out of order"),
            (self.scans, "scans had no odometry around them"),
            (self.images, "images had no scan or no odometry around them"),
            (self.updates, "scans did not fit into the map any more"),
            (self.changes, "changes of the scene graph were refused"),
        ];
        counted
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("not used: {count} times {what}"))
            .collect()
    }
}

/// Whether the map has its frame yet.
enum Frame {
    /// What the sensors said until the turn is known.
    Waiting(Vec<SensorEvent>),
    /// The map has begun.
    Set(MapFrame),
}

/// Everything known, in the frame of the map: level, turned to the walls, zero where the odometry has it.
pub struct WorldModel {
    config: MissionConfig,
    mount: RotatingMount,
    camera: Equirectangular,
    body_from_camera: Isometry3<f64>,
    solid_m: (f64, f64),
    robot: RobotModel,
    encoder: EncoderTrack,
    trajectory: Trajectory,
    recent: VecDeque<RecentScan>,
    waiting: VecDeque<MaskedPanorama>,
    obstacles: VecDeque<(Stamp, Vec<Point2<f32>>)>,
    /// Obstacles round the robot, as of the newest scan.
    gathered: (Option<Stamp>, Vec<Point2<f32>>),
    label_ids: BTreeMap<String, u16>,
    builder: GraphBuilder,
    frame: Frame,
    /// Newest odometry.
    pub odometry: Option<OdometryEstimate>,
    /// How full the battery is (0 to 1), if anybody says so.
    pub battery_charge: Option<f64>,
    /// Surface and free space.
    pub volume: Volume,
    /// Distances to obstacles.
    pub field: DistanceField,
    /// Skeleton of the free space.
    pub places: PlaceGraph,
    /// The five layers.
    pub graph: SceneGraph,
    /// Rooms as cut from the last slice.
    pub rooms: Option<RoomMap>,
    /// The slice they were cut from, as it was seen.
    pub slice: OccupancyGrid,
    /// Where the camera has looked.
    pub coverage: Coverage,
    /// Where this robot can go.
    pub navigation: NavigationMap,
    /// Where it may not be or only slowly, in the map; none before the map has its frame.
    pub zones: Zones,
    /// Posts round the zones to keep out of.
    zone_posts: Vec<Point2<f64>>,
    /// The frame in which the zones were put there.
    zones_placed: Option<MapFrame>,
    /// From the body's middle, how far away the floor comes into sight: what the steepest rays of the first scans show.
    blind_m: f64,
    /// Rise of the steepest ray upwards, per metre of way: how far away a height over the eye comes into sight.
    steepest_rise: f64,
    /// What that hid at the first refresh.
    blind_spot: Option<BlindSpot>,
    /// Where the LiDAR was at the newest scan.
    eye: Point3<f64>,
    /// Height of the floor.
    pub floor_m: f64,
    /// Height of the body origin above the floor when it moves.
    pub body_height_m: f64,
    /// Those who move near the robot.
    pub people: People,
    /// What was not used.
    pub ignored: Ignored,
    /// Who shows relations to a vision model, if there is one.
    pub vision: Option<VisionVerifier>,
    /// What was seen from where, while the robot does not know where in a known building it is.
    pub looks: Option<Looks>,
}

impl WorldModel {
    /// Nothing known; `floor_m` is the height of the floor under the robot in the frame of the odometry.
    pub fn new(
        robot: &RobotModel,
        config: &MissionConfig,
        camera: Equirectangular,
        floor_m: f64,
    ) -> Result<Self, MissionError> {
        let body_height_m = match robot.kind {
            RobotKind::Ground => robot.stance_height_m,
            RobotKind::Aerial => config.flight_height_m,
        };
        let (low_m, high_m) = robot.height_span_m;
        Ok(Self {
            mount: RotatingMount {
                body_from_stator: robot.sensors.body_from_lidar_stator,
                rotor_from_sensor: robot.sensors.rotor_from_sensor,
            },
            camera,
            body_from_camera: robot.sensors.body_from_camera,
            solid_m: (body_height_m + low_m, body_height_m + high_m),
            robot: robot.clone(),
            encoder: config.encoder_track(robot),
            trajectory: Trajectory::default(),
            recent: VecDeque::new(),
            waiting: VecDeque::new(),
            obstacles: VecDeque::new(),
            gathered: (None, Vec::new()),
            label_ids: BTreeMap::new(),
            builder: GraphBuilder::new(&config.without),
            frame: Frame::Waiting(Vec::new()),
            odometry: None,
            battery_charge: None,
            volume: Volume::new(config.volume.clone())?,
            field: DistanceField::new(config.field_resolution_m, config.field_max_distance_m),
            places: PlaceGraph::new(PlaceConfig {
                // Where bodies move: under the lintels, over the thresholds.
                height_band_m: Some([floor_m + 0.2, floor_m + 2.0]),
                ..PlaceConfig::default()
            })?,
            graph: SceneGraph::new(),
            rooms: None,
            slice: OccupancyGrid {
                origin: Point2::origin(),
                resolution_m: config.volume.voxel_m,
                width: 0,
                height: 0,
                cells: Vec::new(),
            },
            coverage: Coverage::new(config.coverage.clone()),
            navigation: NavigationMap::new(robot),
            zones: Zones::default(),
            zone_posts: Vec::new(),
            zones_placed: None,
            blind_m: f64::INFINITY,
            steepest_rise: 0.0,
            blind_spot: None,
            eye: Point3::origin(),
            floor_m,
            body_height_m,
            people: People::default(),
            ignored: Ignored::default(),
            vision: config.vision.clone().map(VisionVerifier::new).transpose()?,
            looks: None,
            config: config.clone(),
        })
    }

    /// Begins with a known building: its graph, its map, and everything in it counts as looked at.
    /// `frame` says where the odometry begins in it.
    pub fn know(&mut self, known: crate::archive::Known, frame: MapFrame) {
        self.frame = Frame::Set(frame);
        self.graph = known.graph;
        self.volume = known.volume;
        self.label_ids = known.labels.into_iter().map(|(id, name)| (name, id)).collect();
        self.slice = self.volume.slice(self.floor_m + ROOM_SLICE_M.0, self.floor_m + ROOM_SLICE_M.1, None);
        self.coverage.know(&self.slice);
        self.builder.forget_frontiers(&mut self.graph);
    }

    /// The robot is thought to stand at rest there, and no sensor says anything: what the map does not know round it stays unknown, but
    /// for the floor under its own outline.
    pub(crate) fn imagine_at(&mut self, world_from_body: Isometry3<f64>) {
        let stamp = Stamp(self.odometry.as_ref().map_or(0, |odometry| odometry.stamp.0) + 1);
        self.odometry = Some(OdometryEstimate::at_rest(stamp, world_from_body));
        self.blind_m = 0.0;
    }

    /// Where the odometry's frame lies in the map; identity until the map has been turned to the walls.
    pub fn frame(&self) -> MapFrame {
        match &self.frame {
            Frame::Waiting(_) => MapFrame::default(),
            Frame::Set(frame) => *frame,
        }
    }

    /// Takes one thing that the sensors said. The first second is kept until it has shown how the walls run.
    pub fn see(&mut self, event: SensorEvent, clock: &mut StageClock) {
        const LOOK_NS: i64 = 1_100_000_000;
        match &mut self.frame {
            Frame::Set(_) => self.take(event, clock),
            Frame::Waiting(events) => {
                events.push(event);
                let first = events.first().map_or(Stamp(0), SensorEvent::stamp);
                if events.last().is_some_and(|last| last.stamp().0 - first.0 >= LOOK_NS) {
                    let events = std::mem::take(events);
                    let frame = clock.time("alignment", || {
                        MapFrame::of_first_look(&events, &self.mount, self.encoder.clone(), self.floor_m)
                    });
                    self.frame = Frame::Set(frame);
                    for event in events {
                        self.take(event, clock);
                    }
                }
            }
        }
    }

    fn take(&mut self, event: SensorEvent, clock: &mut StageClock) {
        match event {
            SensorEvent::Imu(_) => {} // only the odometry needs it
            SensorEvent::Encoder(sample) => {
                if self.encoder.push(sample).is_err() {
                    self.ignored.samples += 1;
                }
            }
            SensorEvent::Odometry(estimate) => {
                let estimate = self.frame().estimate_in_map(&estimate);
                if self.trajectory.push(&estimate).is_ok() {
                    self.odometry = Some(estimate);
                } else {
                    self.ignored.samples += 1;
                }
            }
            SensorEvent::Scan(scan) => self.see_scan(&scan, clock),
            SensorEvent::Panorama(mut panorama) => {
                self.config.label_names.apply(&mut panorama);
                self.waiting.push_back(panorama);
            }
            SensorEvent::Battery(battery) => {
                let is_share = (0.0..=1.0).contains(&battery.charge);
                self.ignored.samples += u64::from(!is_share);
                self.battery_charge = is_share.then_some(battery.charge).or(self.battery_charge);
            }
        }
        self.label_waiting(clock);
    }

    /// One revolution of the LiDAR: straightened, put into the map, and its nearest obstacles kept.
    fn see_scan(&mut self, scan: &RawScan, clock: &mut StageClock) {
        let config = DeskewConfig::default();
        let straight = clock
            .time("deskew", || deskew(scan, &self.encoder, &self.mount, &self.trajectory, ReferenceTime::End, &config));
        let Ok(straight) = straight else {
            self.ignored.scans += 1;
            return;
        };
        let dropped = &straight.dropped;
        self.ignored.points += (dropped.non_finite + dropped.outside_time) as u64;
        let points = straight.points_in_world();
        let origin = straight.sensor_origin_in_world();
        clock.time("people", || self.people.see(straight.stamp, &origin, self.floor_m, &points, &self.field));
        // Whoever walks is for nobody's map.
        let still = match self.people.is_empty() {
            true => Cow::Borrowed(&points),
            false => Cow::Owned(self.people.without(&points, straight.stamp).collect::<Vec<Point3<f32>>>()),
        };
        let integrated = clock.time("volume", || self.volume.integrate(&origin, &still));
        if integrated.is_err() {
            self.ignored.updates += 1;
        }
        self.eye = origin;
        if !self.navigation.has_begun() {
            self.see_how_near(&origin, &still);
        }
        if let Some(looks) = &mut self.looks {
            looks.add(&origin, &still, self.floor_m);
        }
        // In the air the distance field is asked instead.
        if self.robot.kind == RobotKind::Ground {
            let here = straight.world_from_body.translation.vector;
            let obstacles = clock.time("obstacles", || self.obstacles_of(&still, &Point2::new(here.x, here.y)));
            let oldest = Stamp(straight.stamp.0 - (self.config.obstacle_memory_s * 1e9) as i64);
            self.obstacles.push_back((straight.stamp, obstacles));
            while self.obstacles.front().is_some_and(|(stamp, _)| *stamp < oldest) {
                self.obstacles.pop_front();
            }
        }
        let horizon = Stamp(straight.stamp.0 - 5_000_000_000);
        self.trajectory.forget_before(horizon);
        self.encoder.forget_before(horizon);
        self.recent.push_back(RecentScan { stamp: straight.stamp, points_in_world: points });
        let window_s = self.config.label_window_s + self.config.label_delay_s + 0.6;
        let oldest = Stamp(straight.stamp.0 - (window_s * 1e9) as i64);
        while self.recent.front().is_some_and(|scan| scan.stamp < oldest) {
            self.recent.pop_front();
        }
    }

    /// The steepest rays so far say where the floor comes into sight, and what is over the head.
    fn see_how_near(&mut self, eye: &Point3<f64>, points: &[Point3<f32>]) {
        const CELL_M: f64 = 0.1;
        let eye_f32 = eye.cast::<f32>();
        let rise = |p: &Point3<f32>| (p.z - eye_f32.z) / (p.x - eye_f32.x).hypot(p.y - eye_f32.y).max(0.1);
        let (down, up) =
            points.iter().map(rise).fold((0.0_f32, 0.0_f32), |(low, high), rise| (low.min(rise), high.max(rise)));
        let height_m = eye.z - self.floor_m;
        self.blind_m = self.blind_m.min(height_m / f64::from(-down).max(1e-3) + CELL_M);
        self.steepest_rise = self.steepest_rise.max(f64::from(up));
    }

    /// The slice for rooms; what is over the robot's head at the first time stays open until it is seen.
    fn room_slice(&mut self) -> OccupancyGrid {
        let spot = self.blind_spot.get_or_insert_with(|| {
            const CELL_M: f64 = 0.1;
            const MOST_BLIND_M: f64 = 1.5;
            let eye = self.eye;
            let over_m = self.floor_m + ROOM_SLICE_M.1 - eye.z;
            let reach_m = (over_m / self.steepest_rise.max(1e-3) + CELL_M).min(MOST_BLIND_M);
            let at_eye = self.volume.slice(eye.z - CELL_M, eye.z + CELL_M, None);
            BlindSpot::new(&self.slice, &at_eye, &eye.xy(), reach_m)
        });
        let mut slice = self.slice.clone();
        spot.fill(&mut slice);
        slice
    }

    /// Points at the height of the body, thinned to one per 4 cm.
    fn obstacles_of(&self, points: &[Point3<f32>], here: &Point2<f64>) -> Vec<Point2<f32>> {
        const THIN_M: f32 = 0.04;
        const OVER_FLOOR_M: f64 = 0.10;
        let low_m = (self.floor_m + self.solid_m.0.max(OVER_FLOOR_M)) as f32;
        let high_m = (self.floor_m + self.solid_m.1 + 0.05) as f32;
        let (x, y) = (here.x as f32, here.y as f32);
        let range = OBSTACLE_RANGE_M as f32;
        let mut cells: Vec<(i32, i32)> = points
            .iter()
            .filter(|p| p.z > low_m && p.z < high_m && (p.x - x).abs() < range && (p.y - y).abs() < range)
            .map(|p| ((p.x / THIN_M).floor() as i32, (p.y / THIN_M).floor() as i32))
            .collect();
        cells.sort_unstable();
        cells.dedup();
        cells.into_iter().map(|(ix, iy)| Point2::new((ix as f32 + 0.5) * THIN_M, (iy as f32 + 0.5) * THIN_M)).collect()
    }

    /// What the last scans show around the robot, and where the map knows something or has seen no floor. Gathered once per scan:
    /// between two scans nothing new is seen.
    pub fn obstacles_near(&mut self, here: &Point2<f64>) -> &[Point2<f32>] {
        const MEMORY_RANGE_M: f64 = 1.2;
        // Farther than the scans count: nothing else shows a zone.
        const POST_RANGE_M: f64 = 8.0;
        let newest = self.obstacles.back().map(|(stamp, _)| *stamp);
        if newest.is_none() || self.gathered.0 != newest {
            let mut points: Vec<Point2<f32>> =
                self.obstacles.iter().flat_map(|(_, points)| points.iter().copied()).collect();
            points.extend(self.navigation.barred_near(here, MEMORY_RANGE_M));
            let near = self.zone_posts.iter().filter(|post| (*post - here).norm() <= POST_RANGE_M);
            points.extend(near.map(|post| post.cast::<f32>()));
            points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
            points.dedup();
            self.gathered = (newest, points);
        }
        &self.gathered.1
    }

    /// Twice a second: surface, distances, places, rooms, relations, ways.
    pub fn refresh(&mut self, now_s: f64, clock: &mut StageClock) {
        let Some(odometry) = self.odometry else { return };
        self.place_zones();
        clock.time("mesh", || self.volume.update_mesh());
        clock.time("distance", || self.field.update(&self.volume));
        let events = clock.time("places", || self.places.update(&self.field));
        self.slice = clock
            .time("slice", || self.volume.slice(self.floor_m + ROOM_SLICE_M.0, self.floor_m + ROOM_SLICE_M.1, None));
        clock.time("navigation", || {
            self.navigation.refresh(
                &self.volume,
                &self.robot,
                &odometry.world_from_body,
                self.floor_m,
                self.body_height_m,
                self.blind_m,
            );
        });
        clock.time("coverage", || self.coverage.update(&self.slice, now_s));
        self.rooms = clock.time("rooms", || {
            let slice = self.room_slice();
            let config = &self.config.rooms;
            let above = self.volume.slice(self.floor_m + LINTEL_SLICE_M.0, self.floor_m + LINTEL_SLICE_M.1, None);
            match &self.rooms {
                Some(before) => before.next(&slice, Some(&above), config).ok(),
                None => RoomMap::new(&slice, Some(&above), config).ok(),
            }
        });
        clock.time("graph", || {
            self.builder.update(
                &mut self.graph,
                &events,
                self.rooms.as_ref().filter(|_| self.config.without.keeps(Part::Rooms)),
                self.coverage.frontiers(),
                &self.field,
                &odometry,
                self.floor_m,
                self.vision.as_mut(),
            );
        });
        self.ignored.changes += self.builder.take_refusals();
        let told = clock.time("people", || self.people.tell(&mut self.graph, odometry.stamp));
        self.ignored.changes += u64::from(told.is_err());
        if let Some(vision) = &mut self.vision {
            let volume = &self.volume;
            clock.time("vision", || {
                vision.ask(&self.graph, odometry.stamp, &|eye, bounds| is_visible(eye, bounds, volume));
            });
        }
    }

    /// Offers the frontiers again that were left alone for a while.
    pub fn offer_again(&mut self, now_s: f64, clock: &mut StageClock) {
        self.coverage.reconsider();
        clock.time("coverage", || self.coverage.update(&self.slice, now_s));
        self.builder.put_frontiers(&mut self.graph, self.coverage.frontiers(), self.floor_m);
    }

    /// What was not used and what the vision model was asked, in sentences.
    pub fn account(&self) -> Vec<String> {
        let mut sentences = self.ignored.sentences();
        sentences.extend(self.vision.as_ref().and_then(|vision| vision.counts.sentence()));
        sentences
    }

    /// Height of the camera over the floor while the robot moves.
    pub fn camera_height_m(&self) -> f64 {
        self.body_height_m + self.body_from_camera.translation.vector.z
    }

    /// Whether the map shows nothing between two points.
    pub fn is_clear(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let way = to - from;
        let steps = (way.norm() / (0.5 * self.config.volume.voxel_m)).ceil().max(1.0) as usize;
        (0..=steps).all(|step| {
            let point = from + way * (step as f64 / steps as f64);
            self.volume.observe(&point) != Cell::Occupied
        })
    }

    /// The camera of the panoramas.
    pub fn camera(&self) -> Equirectangular {
        self.camera
    }

    /// Name of each label id that the volume carries.
    pub fn label_names(&self) -> BTreeMap<u16, String> {
        self.label_ids.iter().map(|(name, id)| (*id, name.clone())).collect()
    }
}
