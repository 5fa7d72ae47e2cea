//! A known building, and a robot that does not know where in it it stands: it looks, moves to see more, and goes on once it is sure.
//!
//! Until then it keeps a map of its own, in the frame of its odometry, like a robot in a building that nobody has seen. What it has seen
//! all round is compared with the known map ([`omni_perception::localise`]); where two places look alike, or none does, it goes to
//! the nearest border of what it has seen and tries again, and after some tries it says that it cannot tell. When it is sure,
//! its own map is dropped: the last seconds of the stream are seen again, in the frame of the known map.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point2, Point3, Translation3};
use octant_prompt::Action;
use omni_perception::localisation::Look;
use omni_perception::registration::thinning::thin;
use omni_perception::{Candidate, KnownPlace, LocalisationConfig, LocalisationError, Stamp, Verdict, judge};

use crate::archive::Known;
use crate::goal::{Goal, GoalStatus};
use crate::map_frame::MapFrame;
use crate::mission::{Mission, Outcome};
use crate::stream::SensorEvent;
use crate::world_model::WorldModel;
use crate::zones::ZoneFrame;

/// Looks kept: half a minute of scans.
const MOST_LOOKS: usize = 300;
/// Edge of the cells to which the points of a look are thinned.
const LOOK_LEAF_M: f64 = 0.08;
/// Times the robot tries before it says that it cannot tell.
const TRIES: u32 = 8;
/// On the way to a border of the known it stops to try again after so long.
const LEG_S: f64 = 6.0;
/// Slower than this is standing.
const STANDING_MPS: f64 = 0.05;

/// What the robot has seen from where, in its map; heights above its floor.
#[derive(Debug, Clone, Default)]
pub struct Looks {
    looks: VecDeque<(Point3<f32>, Vec<Point3<f32>>)>,
}

impl Looks {
    /// Takes one straightened scan.
    pub fn add(&mut self, eye_in_world: &Point3<f64>, points_in_world: &[Point3<f32>], floor_m: f64) {
        let mut points = thin(points_in_world, LOOK_LEAF_M).points;
        for point in &mut points {
            point.z -= floor_m as f32;
        }
        let mut eye = eye_in_world.cast::<f32>();
        eye.z -= floor_m as f32;
        self.looks.push_back((eye, points));
        if self.looks.len() > MOST_LOOKS {
            self.looks.pop_front();
        }
    }

    fn all(&self) -> Vec<Look<'_>> {
        self.looks.iter().map(|(eye, points)| Look { eye: *eye, points }).collect()
    }
}

/// A robot that does not know where it is.
pub struct Lost {
    known: Known,
    place: Result<KnownPlace, LocalisationError>,
    config: LocalisationConfig,
    tries: u32,
    /// When the present leg ends at the latest.
    leg_ends_s: f64,
    /// The last seconds of the stream.
    recent: VecDeque<SensorEvent>,
}

impl Lost {
    /// In this building, anywhere.
    pub fn new(mut known: Known) -> Self {
        known.volume.rebuild_mesh();
        let floor_m = known.floor_m as f32;
        let surface: Vec<Point3<f32>> =
            known.volume.mesh().vertices.iter().map(|v| Point3::new(v.x, v.y, v.z - floor_m)).collect();
        let config = LocalisationConfig::default();
        let place = KnownPlace::new(&surface, &config);
        Self { known, place, config, tries: 0, leg_ends_s: f64::INFINITY, recent: VecDeque::new() }
    }

    /// Keeps an event for the moment when the robot knows where it was.
    pub(crate) fn keep(&mut self, event: &SensorEvent, memory_s: f64) {
        let newest = event.stamp();
        let oldest = Stamp(newest.0 - (memory_s * 1e9) as i64);
        self.recent.push_back(event.clone());
        while self.recent.front().is_some_and(|first| first.stamp() < oldest) {
            self.recent.pop_front();
        }
    }

    fn look(&self, looks: &Looks) -> Result<Vec<Candidate>, LocalisationError> {
        let place = self.place.as_ref().map_err(Clone::clone)?;
        place.localise(&looks.all())
    }
}

impl Mission {
    /// Whether the robot is in a known building and does not know where.
    pub fn is_lost(&self) -> bool {
        self.lost.is_some()
    }

    /// Whether there are zones of which nobody knows yet where they lie, because the robot does not know where it is: it stays where it stands.
    pub(crate) fn waits_for_zones(&self) -> bool {
        self.is_lost() && self.config.zones.frame == ZoneFrame::Map && !self.config.zones.is_empty()
    }

    /// While the robot is lost: tries to recognise what it has seen, goes on to see more, or gives up.
    pub(crate) fn find_itself(&mut self, t_s: f64) {
        let is_held = self.outcome.is_some() || self.is_interrupted || self.is_paused;
        if self.lost.is_none() || is_held || !self.may_try(t_s) {
            return;
        }
        let (Some(lost), Some(looks)) = (&mut self.lost, &self.world.looks) else { return };
        let candidates = self.journal.clock.time("localisation", || lost.look(looks));
        lost.tries += 1;
        let doubt = match candidates.as_deref().map(|candidates| judge(candidates, &lost.config)) {
            Ok(Verdict::Here(here)) => return self.found(&here.clone(), t_s),
            Ok(Verdict::Ambiguous(best, second)) => format!(
                "two places look alike ({:.0} % and {:.0} % of what it sees fits)",
                100.0 * best.score,
                100.0 * second.score
            ),
            Ok(Verdict::Nowhere(score)) => {
                format!("nothing in the map looks like what it sees (at best {:.0} % fits)", 100.0 * score)
            }
            Err(error) => error.to_string(),
        };
        let is_last = lost.tries >= TRIES;
        self.journal.notes.push((t_s, format!("where it stands in the known map is not clear: {doubt}")));
        if is_last || !self.go_and_see_more(t_s) {
            let zones = if self.waits_for_zones() {
                " Because of the zones of that map it does not go to see more."
            } else {
                ""
            };
            let reason = format!(
                "It cannot tell where in the known map it is: {doubt}.{zones} Its start can be given with --start."
            );
            self.finish(Outcome::GaveUp { reason });
        }
    }

    /// Whether the robot stands and has something new to go by.
    fn may_try(&mut self, t_s: f64) -> bool {
        let Some(lost) = &self.lost else { return false };
        if lost.tries == 0 {
            return true;
        }
        if !self.body.is_ready() {
            return false;
        }
        match *self.body.status() {
            GoalStatus::Underway if t_s < lost.leg_ends_s => return false,
            GoalStatus::Underway => self.body.set_goal(Goal::Stay),
            // Frontiers reached, or out of reach, are not gone to again.
            GoalStatus::Arrived => self.arrived(None),
            GoalStatus::Failed(why) => {
                self.failed(why);
                self.body.set_goal(Goal::Stay);
            }
        }
        self.target = crate::acting::Target::None;
        self.world.odometry.is_some_and(|odometry| odometry.velocity_in_world_mps.norm() < STANDING_MPS)
    }

    /// Sets out to the nearest border of what has been seen; false if there is none to go to.
    fn go_and_see_more(&mut self, t_s: f64) -> bool {
        if self.waits_for_zones() {
            return false;
        }
        let Some(odometry) = &self.world.odometry else { return false };
        let here = Point2::from(odometry.world_from_body.translation.vector.xy());
        let borders: Vec<_> = self.world.graph.frontiers().map(|place| (place.id, place.position.xy())).collect();
        let goals: Vec<Point2<f64>> = borders.iter().map(|(_, at)| *at).collect();
        let lengths = self.world.navigation.lengths_from(&here, &goals);
        // A border that no way leads to yet may be looked into from the end of the way.
        let cost = |rank: usize| lengths[rank].unwrap_or_else(|| 10.0 + 2.0 * (goals[rank] - here).norm());
        let Some(nearest) = (0..borders.len()).min_by(|a, b| cost(*a).total_cmp(&cost(*b)).then(a.cmp(b))) else {
            return false;
        };
        self.act(Action::Explore(borders[nearest].0), t_s);
        if let Some(lost) = &mut self.lost {
            lost.leg_ends_s = t_s + LEG_S;
        }
        true
    }

    /// The robot knows where it is: the known map takes the place of its own.
    fn found(&mut self, here: &Candidate, t_s: f64) {
        let Some(lost) = self.lost.take() else { return };
        let Lost { known, recent, tries, .. } = *lost;
        let old_floor_m = self.world.floor_m;
        // The looks were heights above the floor; the map has its own zero.
        let map_from_own =
            Translation3::new(0.0, 0.0, known.floor_m) * here.map_from_scan * Translation3::new(0.0, 0.0, -old_floor_m);
        let frame = MapFrame { map_from_odometry: map_from_own * self.world.frame().map_from_odometry };
        let floor_m = known.floor_m;
        let mut world = WorldModel::new(&self.robot, &self.config, self.world.camera(), floor_m)
            .expect("the same settings made the map of its own");
        world.ignored = self.world.ignored.clone();
        world.vision = self.world.vision.take();
        if let Some(vision) = &mut world.vision {
            vision.forget_graph();
        }
        world.know(known, frame);
        for event in recent {
            world.see(event, &mut self.journal.clock);
        }
        self.world = world;
        self.body.change_frame(&map_from_own, floor_m - old_floor_m);
        self.target = crate::acting::Target::None;
        self.next_refresh_s = t_s;
        self.memory = crate::acting::StepMemory::default();
        let at = self.world.odometry.map_or_else(Isometry3::identity, |odometry| odometry.world_from_body);
        self.journal.notes.push((
            t_s,
            format!(
                "found itself in the known map at {:.2}, {:.2} heading {:.0} degrees, at try {tries}: {:.0} % of what it sees fits, {:.0} % more than anywhere else",
                at.translation.vector.x,
                at.translation.vector.y,
                at.rotation.euler_angles().2.to_degrees(),
                100.0 * here.score,
                100.0 * here.margin
            ),
        ));
    }
}
