//! The world's side of the stream: body and physics, sensors, and on request an odometry with a drift of a known size. What leaves it is what a robot could know.

use std::borrow::Cow;
use std::collections::BTreeMap;

use anyhow::{Context, Result};
use mission::omni_perception::{
    EncoderSample, Equirectangular, ImuSample, Mask, MaskedPanorama, OdometryEstimate, RawPoint, RawScan, RgbImage,
    Rle, Stamp, TrackingStatus,
};
use mission::rig::Rig;
use mission::robot_model::{GaitError, RobotModel};
use mission::segmenter::{SegmentRequest, Segmenter};
use mission::stage_clock::StageClock;
use mission::stream::{BatteryState, Command, SensorEvent};
use nalgebra::Isometry3;
use omni_sim::crowd::CrowdConfig;
use omni_sim::encoder::{EncoderConfig, encoder_sample};
use omni_sim::equirect::Equirect;
use omni_sim::imu::{Imu, ImuConfig};
use omni_sim::lidar::{LidarConfig, RotatingMount, scan_with_truth};
use omni_sim::motion::KinematicState;
use omni_sim::panorama::{PanoramaConfig, PanoramaRecord, capture};
use omni_sim::render::render;
use omni_sim::segmenter::SegmenterConfig;
use omni_sim::towed::ToldPose;
use omni_sim::world::World;

use crate::body::SimulatedBody;
use crate::drift::{DriftConfig, DriftingOdometry};
use crate::estimate_frame::EstimateFrame;
use crate::legs::Legs;
use crate::people::People;
use crate::scenario::Scene;
use crate::surround::Surround;

/// Settings of the world.
#[derive(Debug, Clone, Default)]
pub struct SimulationConfig {
    /// LiDAR.
    pub lidar: LidarConfig,
    /// IMU.
    pub imu: ImuConfig,
    /// Motor's encoder.
    pub encoder: EncoderConfig,
    /// Camera.
    pub panorama: PanoramaConfig,
    /// What the segmenter gets wrong.
    pub segmenter: SegmenterConfig,
    /// Instead of the robot's own odometry: true poses that drift by so much, in the stream.
    pub drift: Option<DriftConfig>,
    /// The LiDAR's motor stands still.
    pub is_lidar_fixed: bool,
    /// Horizontal field of view of LiDAR and camera, its middle ahead; none is all round.
    pub view_rad: Option<f64>,
    /// Somebody else moves the body ([`Simulation::tell`]).
    pub is_towed: bool,
    /// The battery of an aircraft, full at the start, lasts for so many seconds of hovering; none is never empty and never heard of.
    pub battery_endurance_s: Option<f64>,
    /// People who walk about; their seed comes from the run's.
    pub crowd: CrowdConfig,
    /// Sensors from a rig file; the robot model must be fitted with them ([`Rig::fitted`]).
    pub rig: Option<Rig>,
}

impl SimulationConfig {
    /// Takes the sensors' numbers from a rig.
    pub(crate) fn carry(&mut self, rig: &Rig) {
        let (lidar, view) = (&rig.lidar, rig.camera());
        self.lidar.beams = lidar.beams;
        self.lidar.columns = lidar.columns;
        self.lidar.rate_hz = lidar.scan_hz;
        self.lidar.vertical_fov_rad = lidar.vertical_fov_rad;
        self.lidar.max_range_m = lidar.max_range_m;
        self.panorama.width = view.width_px;
        self.panorama.height = view.height_px;
        self.panorama.phi_top_rad = view.phi_top_rad;
        self.panorama.phi_bottom_rad = view.phi_bottom_rad;
    }
}

/// One touch of the robot with something.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Touch {
    /// When, in seconds of the run.
    pub t_s: f64,
    /// What: the class of the thing, or "structure".
    pub what: String,
    /// Where.
    pub at_m: [f64; 3],
    /// For how long the robot had stood still.
    pub still_s: f64,
}

/// What people are called.
pub const PERSON: &str = "person";
/// A contact with a robot that stands for so long is the walker's.
const STANDS_S: f64 = 0.5;

impl Touch {
    /// Whether the robot, not quite at rest, met somebody.
    pub fn is_with_person(&self) -> bool {
        self.what == PERSON && self.still_s < STANDS_S
    }

    /// Whether it met the building or a thing in it.
    pub fn is_collision(&self) -> bool {
        self.what != PERSON
    }
}

/// What became of the pictures.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Segmentation {
    /// Pictures taken.
    pub images: usize,
    /// Those that the robot did not get, since nobody could say what is in them.
    pub without_masks: usize,
    /// Why, the last time.
    pub last_error: Option<String>,
}

/// The battery's gauge speaks so often.
const BATTERY_NS: i64 = 500_000_000;
/// Period of odometry, IMU and physics; the encoder has its own.
const TICK_NS: i64 = 5_000_000;

/// A robot with its sensors in a scene.
pub struct Simulation<'a> {
    config: SimulationConfig,
    /// The scene's, and the people in it.
    world: Cow<'a, World>,
    people: Option<People>,
    body: SimulatedBody,
    /// When the robot moved last.
    moved_ns: i64,
    mount: RotatingMount,
    imu: Imu,
    drifting: Option<DriftingOdometry>,
    /// What the flight controller believes.
    believed: EstimateFrame,
    body_from_camera: Isometry3<f64>,
    now_ns: i64,
    steps: u64,
    next_encoder_ns: i64,
    next_scan_ns: i64,
    next_panorama_ns: i64,
    next_battery_ns: i64,
    /// How full the battery is.
    charge: f64,
    /// A gauge outside says so; until then a model does.
    is_charge_told: bool,
    touches: Vec<Touch>,
    /// LiDAR points on each instance so far.
    points_on: BTreeMap<u32, u64>,
    /// Lenses in place of the panoramic camera.
    surround: Option<Surround>,
    /// Segments the pictures instead of the simulated segmenter.
    service: Option<Box<dyn Segmenter>>,
    /// Nouns of the instruction, and what is always looked for.
    phrases: (Vec<String>, Vec<String>),
    segmentation: Segmentation,
}

impl<'a> Simulation<'a> {
    /// Puts the robot at `start` in the scene; its odometry begins at `start_in_map`.
    pub fn new(
        config: &SimulationConfig,
        robot: &RobotModel,
        scene: &'a Scene,
        start: &Isometry3<f64>,
        start_in_map: &Isometry3<f64>,
        seed: u64,
    ) -> Result<Simulation<'a>> {
        let mut config = config.clone();
        config.lidar.seed = seed.wrapping_mul(3).wrapping_add(1);
        config.imu.seed = seed.wrapping_mul(3).wrapping_add(2);
        config.segmenter.seed = seed.wrapping_mul(3).wrapping_add(3);
        let rig = config.rig.clone();
        if let Some(rig) = &rig {
            config.carry(rig);
        }
        config.crowd.seed = seed.wrapping_mul(3).wrapping_add(4);
        let (people, world) = match People::new(config.crowd, &scene.building, &scene.world, robot, start)? {
            Some((people, world)) => (Some(people), Cow::Owned(world)),
            None => (None, Cow::Borrowed(&scene.world)),
        };
        let max_range_m = config.panorama.max_range_m;
        let surround = rig.map(|rig| Surround::new(&rig, max_range_m)).transpose()?.flatten();
        let motor = robot.sensors.lidar;
        let mount = RotatingMount {
            body_from_stator: robot.sensors.body_from_lidar_stator,
            rotor_from_sensor: robot.sensors.rotor_from_sensor,
            rate_hz: motor.rotation_hz,
            phase_rad: 0.0,
        };
        Ok(Simulation {
            body: SimulatedBody::new(robot, &world, start, config.is_towed)?,
            moved_ns: 0,
            imu: Imu::new(config.imu.clone(), robot.sensors.body_from_imu).context("setting up the IMU")?,
            drifting: config.drift.map(|drift| DriftingOdometry::new(drift, seed, start, start_in_map)),
            believed: EstimateFrame::at_start(start, start_in_map),
            body_from_camera: robot.sensors.body_from_camera,
            mount,
            world,
            people,
            now_ns: 0,
            steps: 0,
            next_encoder_ns: 0,
            next_battery_ns: 0,
            charge: 1.0,
            is_charge_told: false,
            next_scan_ns: 0,
            next_panorama_ns: 0,
            touches: Vec::new(),
            points_on: BTreeMap::new(),
            surround,
            service: None,
            phrases: (Vec::new(), Vec::new()),
            segmentation: Segmentation::default(),
            config,
        })
    }

    /// The camera of the panoramas, as the robot's side describes it.
    pub fn camera(&self) -> Equirectangular {
        let camera = &self.config.panorama;
        Equirectangular {
            width_px: camera.width,
            height_px: camera.height,
            phi_top_rad: camera.phi_top_rad,
            phi_bottom_rad: camera.phi_bottom_rad,
        }
    }

    /// Time from one scan's start to the next one's.
    pub fn scan_period_ns(&self) -> i64 {
        self.config.lidar.period_ns()
    }

    /// Words that the segmenter should look for: nouns of the instruction, and what it always looks for. The simulated one
    /// knows all its classes anyway.
    pub fn set_phrases(&mut self, phrases: Vec<String>, standing: Vec<String>) {
        self.config.segmenter.phrases.clone_from(&phrases);
        self.phrases = (phrases, standing);
    }

    /// From now on somebody else segments the pictures.
    pub fn use_segmenter(&mut self, service: Box<dyn Segmenter>) {
        self.config.segmenter.blank = true;
        self.service = Some(service);
    }

    /// What became of the pictures so far.
    pub fn segmentation(&self) -> &Segmentation {
        &self.segmentation
    }

    /// What the gauge of whoever moves the body says of its battery (1 full, 0 empty), if it does: from then on no model is asked.
    pub fn tell_charge(&mut self, charge: Option<f64>) {
        if let Some(charge) = charge {
            (self.charge, self.is_charge_told) = (charge, true);
        }
    }

    /// Time.
    pub fn now(&self) -> Stamp {
        Stamp(self.now_ns)
    }

    /// Time since the start.
    pub fn seconds(&self) -> f64 {
        self.now_ns as f64 * 1e-9
    }

    /// Number of calls of [`Simulation::advance`].
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Where the robot truly is.
    pub fn true_pose(&self) -> Isometry3<f64> {
        self.body.state().world_from_body
    }

    /// Where the robot truly was at a time of the last second.
    pub fn true_pose_at(&self, stamp: Stamp) -> Isometry3<f64> {
        self.body.motion().at(stamp.0).world_from_body
    }

    /// The robot's legs, or why they do not move.
    pub fn legs(&self) -> Result<&Legs, &GaitError> {
        self.body.legs()
    }

    /// Which thing truly is in each pixel of a panorama of the last second: column by column, 0 for the structure.
    pub fn true_instances_at(&self, stamp: Stamp) -> Vec<u32> {
        if let Some(surround) = &self.surround {
            let pictures = surround.photograph(&self.world, self.body.motion(), stamp.0);
            return pictures.map_or_else(|_| Vec::new(), |pictures| surround.instances(&pictures));
        }
        let world_from_camera = self.true_pose_at(stamp) * self.body_from_camera;
        let camera = &self.config.panorama;
        render(&self.world.at(stamp.0), &world_from_camera, &camera.view(), camera.max_range_m).instances
    }

    /// How many LiDAR points each instance got so far; 0 is the structure.
    pub fn lidar_points_on(&self) -> &BTreeMap<u32, u64> {
        &self.points_on
    }

    /// Every touch so far.
    pub fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Where the world that the flight controller believes in lies in the true one.
    pub fn true_from_believed(&self) -> Isometry3<f64> {
        self.believed.estimate_from_true.inverse()
    }

    /// The newest estimate of the robot's own odometry, for its flight controller.
    pub fn hear(&mut self, estimate: &OdometryEstimate) {
        self.believed = EstimateFrame::of(estimate, &self.body.state());
    }

    /// Where a towed body truly is at a time (the end of the next step, say).
    pub fn tell(&mut self, stamp: Stamp, told: ToldPose) -> Result<()> {
        self.body.tell(stamp.0, told)
    }

    /// Lets the world go on for `step_ns` under a command. Returns what the sensors said, in order of delivery; what it
    /// costs goes to `clock`.
    pub fn advance(&mut self, command: &Command, step_ns: i64, clock: &mut StageClock) -> Result<Vec<SensorEvent>> {
        let mut events = Vec::new();
        self.body.hear(command, self.now_ns);
        let end_ns = self.now_ns + step_ns;
        while self.now_ns < end_ns {
            clock.time("sim physics", || self.tick(command, &mut events))?;
            let period_ns = self.config.lidar.period_ns();
            if self.now_ns >= self.next_scan_ns + period_ns {
                events.push(SensorEvent::Scan(clock.time("sim lidar", || self.scan())?));
                self.next_scan_ns += period_ns;
            }
            if self.now_ns >= self.next_panorama_ns {
                let panorama = match &self.surround {
                    None => clock.time("sim panorama", || self.photograph())?,
                    Some(surround) => self.look_around(surround, clock)?,
                };
                // Without masks it is no picture of an empty room: the robot does not get it.
                events.extend(self.segmented(panorama).map(SensorEvent::Panorama));
                self.next_panorama_ns += self.config.panorama.period_ns();
            }
        }
        self.steps += 1;
        Ok(events)
    }

    /// Body, contacts, IMU, encoder and odometry for one tick.
    fn tick(&mut self, command: &Command, events: &mut Vec<SensorEvent>) -> Result<()> {
        if let Some(people) = &mut self.people {
            people.go_on(self.now_ns + TICK_NS, &self.body.state(), self.world.to_mut(), &mut self.body);
        }
        self.body.advance(command, self.now_ns, TICK_NS, &self.believed)?;
        self.now_ns += TICK_NS;
        if self.body.moves() {
            self.moved_ns = self.now_ns;
        }
        for touch in self.body.take_touches() {
            let what = match touch.instance {
                0 => "structure".to_owned(),
                id => self.world.thing(id).map_or_else(|| "thing".to_owned(), |thing| thing.class.clone()),
            };
            let still_s = (self.now_ns - self.moved_ns) as f64 * 1e-9;
            let at_m = touch.point.coords.into();
            self.touches.push(Touch { t_s: self.now_ns as f64 * 1e-9, what, at_m, still_s });
        }
        if let Some(endurance_s) = self.config.battery_endurance_s {
            if !self.is_charge_told {
                let drained = self.body.power_share(command) * TICK_NS as f64 * 1e-9 / endurance_s;
                self.charge = (self.charge - drained).max(0.0);
            }
            if self.charge == 0.0 {
                self.body.cut_power();
            }
            if self.next_battery_ns <= self.now_ns {
                self.next_battery_ns = self.now_ns + BATTERY_NS;
                events.push(SensorEvent::Battery(BatteryState { stamp: Stamp(self.now_ns), charge: self.charge }));
            }
        }
        // A LiDAR without a motor has no encoder.
        while self.mount.rate_hz != 0.0 && self.next_encoder_ns <= self.now_ns {
            let sample = encoder_sample(&self.mount, &self.config.encoder, self.next_encoder_ns);
            events.push(SensorEvent::Encoder(EncoderSample {
                stamp: Stamp(sample.stamp_ns),
                angle_rad: sample.angle_rad,
            }));
            self.next_encoder_ns += (1e9 / self.config.encoder.rate_hz) as i64;
        }
        let sample = self.imu.sample(self.body.motion(), self.now_ns).context("sampling the IMU")?;
        events.push(SensorEvent::Imu(ImuSample {
            stamp: Stamp(sample.stamp_ns),
            angular_velocity_radps: sample.angular_velocity_radps,
            specific_force_mps2: sample.specific_force_mps2,
        }));
        if let Some(drifting) = &mut self.drifting {
            let state = self.body.state();
            drifting.advance(&state.world_from_body);
            let estimate = estimate(drifting, &state, self.now_ns);
            self.believed = EstimateFrame::of(&estimate, &state);
            events.push(SensorEvent::Odometry(estimate));
        }
        Ok(())
    }

    fn scan(&mut self) -> Result<RawScan> {
        let (world, motion) = (&*self.world, self.body.motion());
        let (record, instances) = scan_with_truth(world, motion, &self.mount, &self.config.lidar, self.next_scan_ns)
            .context("casting a scan")?;
        let start_ns = record.start_ns;
        let is_seen = |point: &omni_sim::lidar::LidarPoint| {
            self.config.view_rad.is_none_or(|view_rad| {
                let body_from_sensor = self.mount.body_from_sensor(start_ns + i64::from(point.offset_ns));
                let in_body = body_from_sensor * point.position.cast::<f64>();
                in_body.y.atan2(in_body.x).abs() <= 0.5 * view_rad
            })
        };
        let (points, instances): (Vec<&omni_sim::lidar::LidarPoint>, Vec<u32>) =
            record.points.iter().zip(instances).filter(|(point, _)| is_seen(point)).unzip();
        // A row of points on one thing is counted at once.
        for row in instances.chunk_by(|a, b| a == b) {
            *self.points_on.entry(row[0]).or_insert(0) += row.len() as u64;
        }
        Ok(RawScan {
            start: Stamp(record.start_ns),
            points: points
                .iter()
                .map(|point| RawPoint { position: point.position, offset_ns: point.offset_ns, ring: point.ring })
                .collect(),
        })
    }

    /// The picture with the masks of the service if there is one, and `None` if that failed.
    fn segmented(&mut self, panorama: MaskedPanorama) -> Option<MaskedPanorama> {
        self.segmentation.images += 1;
        let Some(service) = &mut self.service else { return Some(panorama) };
        let image = panorama.image.unwrap_or(RgbImage { width: 0, height: 0, rgb: Vec::new() });
        let (phrases, standing) = (&self.phrases.0, &self.phrases.1);
        let answer = service.segment(SegmentRequest { stamp: panorama.stamp, image, phrases, standing });
        answer
            .inspect_err(|error| {
                self.segmentation.without_masks += 1;
                self.segmentation.last_error = Some(error.to_string());
            })
            .ok()
    }

    /// Pictures of all lenses, stitched by the robot's side.
    fn look_around(&self, surround: &Surround, clock: &mut StageClock) -> Result<MaskedPanorama> {
        let (world, motion) = (&*self.world, self.body.motion());
        let pictures = clock.time("sim panorama", || surround.photograph(world, motion, self.now_ns))?;
        let panorama = clock.time("stitching", || surround.stitch(&pictures))?;
        clock.time("sim panorama", || {
            let segmenter = &self.config.segmenter;
            masked_panorama(surround.segment(&pictures, panorama, world, motion, segmenter, self.now_ns)?)
        })
    }

    fn photograph(&self) -> Result<MaskedPanorama> {
        let record = capture(
            &self.world,
            self.body.motion(),
            &self.body_from_camera,
            &self.config.panorama,
            &self.config.segmenter,
            self.now_ns,
        )
        .context("taking a panorama")?;
        let panorama = masked_panorama(record)?;
        match self.config.view_rad {
            Some(view_rad) => narrowed(panorama, &self.config.panorama.view(), view_rad),
            None => Ok(panorama),
        }
    }
}

/// What a camera sees of a panorama that looks ahead only: masks cut at the border of its view, black beyond.
fn narrowed(panorama: MaskedPanorama, camera: &Equirect, view_rad: f64) -> Result<MaskedPanorama> {
    let (width, height) = (camera.width, camera.height);
    let is_seen: Vec<bool> = (0..width)
        .map(|column| {
            let ahead = camera.direction(f64::from(column) + 0.5, 0.5 * f64::from(height));
            ahead.y.atan2(ahead.x).abs() <= 0.5 * view_rad
        })
        .collect();
    let cut = |mask: Mask| -> Result<Option<Mask>> {
        let spans: Vec<_> = mask.rle.spans().filter(|span| is_seen[span.column as usize]).collect();
        if spans.is_empty() {
            return Ok(None);
        }
        let rle = Rle::from_spans(width, height, spans).context("cutting a mask")?;
        Ok(Some(Mask { rle, ..mask }))
    };
    let masks = panorama.masks.into_iter().filter_map(|mask| cut(mask).transpose()).collect::<Result<Vec<_>>>()?;
    let image = panorama.image.map(|mut image| {
        for (index, pixel) in image.rgb.chunks_exact_mut(3).enumerate() {
            if !is_seen[index % width as usize] {
                pixel.fill(0);
            }
        }
        image
    });
    Ok(MaskedPanorama { masks, image, ..panorama })
}

/// The drifting odometry's view of a state.
fn estimate(odometry: &DriftingOdometry, state: &KinematicState, now_ns: i64) -> OdometryEstimate {
    OdometryEstimate {
        stamp: Stamp(now_ns),
        world_from_body: odometry.estimate_from_body(),
        velocity_in_world_mps: odometry.vector_in_estimate(&state.velocity_world),
        angular_velocity_in_body_radps: state.angular_velocity_body,
        covariance: odometry.covariance(),
        status: TrackingStatus::Tracking,
    }
}

/// The simulator's record as the robot's side reads it.
fn masked_panorama(record: PanoramaRecord) -> Result<MaskedPanorama> {
    let (width, height) = (record.width, record.height);
    let masks = record
        .masks
        .into_iter()
        .map(|mask| {
            let rle = Rle::from_counts(width, height, &mask.counts).context("reading a mask")?;
            Ok(Mask { caption: mask.caption, track: Some(mask.track), ..Mask::new(rle, mask.label, mask.score) })
        })
        .collect::<Result<Vec<Mask>>>()?;
    Ok(MaskedPanorama {
        stamp: Stamp(record.stamp_ns),
        masks,
        image: Some(RgbImage { width, height, rgb: record.rgb }),
    })
}
