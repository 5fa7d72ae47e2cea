//! One run: a mission in the simulator, from its first look to its stop, with the referee's verdict.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, Result};
use mission::archive::Known;
use mission::config::MissionConfig;
use mission::event_log::EventLogWriter;
use mission::journal::Journal;
use mission::llm_reasoner::LlmReasoner;
use mission::mission::{Mission, Outcome, grounding};
use mission::octant_prompt::SymbolicReasoner;
use mission::omni_perception::Stamp;
use mission::openai::ChatConfig;
use mission::reasoning::Mind;
use mission::rig::Rig;
use mission::robot_model::{GaitError, RobotKind, RobotModel};
use mission::segmenter_http::{HttpSegmenter, HttpSegmenterConfig};
use mission::stage_clock::{CpuScope, StageClock};
use mission::stream::SensorEvent;
use mission::vision_verifier::VisionConfig;
use mission::zones::ZoneFrame;
use nalgebra::{Isometry3, Point2, UnitQuaternion};
use omni_sim::crowd::CrowdConfig;

use crate::bench_nav::kind_word;
use crate::cli::word;
use crate::options::{LidarMount, Options};
use crate::orders::{Orders, say_to};
use crate::progress::Progress;
use crate::referee::{Referee, RobotTruth};
use crate::scenario::{Scene, robot_truth};
use crate::simulation::{Simulation, SimulationConfig};
use crate::summary::Summary;
use crate::task::Task;
use crate::vehicle::Vehicle;
use crate::verdict::{Declared, Ending, Errand, TruthLog, Verdict, verdict};

/// Settings of a run that do not depend on the scene.
#[derive(Debug, Clone)]
pub struct RunConfig {
    /// The robot's side.
    pub mission: MissionConfig,
    /// The world's side.
    pub simulation: SimulationConfig,
    /// Simulated time after which the run ends.
    pub max_time_s: f64,
    /// A language model instead of the embedded reasoner.
    pub llm: Option<ChatConfig>,
    /// A service that segments the pictures instead of the simulated segmenter.
    pub segmenter: Option<HttpSegmenterConfig>,
    /// What the mission perceives goes into this file, bit for bit ([`mission::event_log`]).
    pub events_to: Option<PathBuf>,
    /// The robot's postures are kept, for pictures that move; default only with the feature `viz`.
    pub keeps_postures: bool,
    /// Whose CPU time the summary gives.
    pub cpu_scope: CpuScope,
    /// Where the map of `--known` lies in the building, if anybody knows: the referee needs it for zones in that map.
    pub truth_from_known: Option<Isometry3<f64>>,
}

impl RunConfig {
    /// Defaults with what the command line says.
    pub fn new(options: &Options) -> RunConfig {
        let llm = match (&options.llm, &options.model) {
            (Some(url), Some(model)) => Some(ChatConfig::new(url, model)),
            _ => None,
        };
        let vision = match (&options.vlm, &options.vlm_model) {
            (Some(url), Some(model)) => Some(VisionConfig::new(url, model)),
            _ => None,
        };
        let is_lidar_fixed = options.lidar == LidarMount::Fixed;
        RunConfig {
            max_time_s: options.max_time,
            mission: MissionConfig {
                vision,
                battery: options.flight.battery(),
                geofence: options.flight.fence.clone(),
                ..MissionConfig::default()
            },
            simulation: SimulationConfig {
                is_lidar_fixed,
                battery_endurance_s: options.flight.battery,
                crowd: CrowdConfig { people: options.people, heeds_robot: !options.heedless, seed: 0 },
                ..SimulationConfig::default()
            },
            llm,
            segmenter: options.segmenter.as_deref().map(HttpSegmenterConfig::new),
            ..RunConfig::default()
        }
    }
}

impl RunConfig {
    /// Takes the sensors of a rig on both sides. The robot model must be fitted with them ([`Rig::fitted`]).
    pub fn carry(&mut self, rig: Rig) {
        self.mission.fit(&rig);
        self.simulation.rig = Some(rig);
    }
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            mission: MissionConfig::default(),
            simulation: SimulationConfig::default(),
            max_time_s: 600.0,
            llm: None,
            segmenter: None,
            events_to: None,
            keeps_postures: cfg!(feature = "viz"),
            cpu_scope: CpuScope::Process,
            truth_from_known: None,
        }
    }
}

/// Where the robot believed to be and how it held its joints: what it takes to draw it.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// Seconds of the run.
    pub t_s: f64,
    /// Pose of the body in the robot's own map.
    pub map_from_body: Isometry3<f64>,
    /// Angles in the order of the model's moving joints; none for a robot whose joints do not move.
    pub joints: Vec<f64>,
}

/// Everything that a run leaves.
pub struct RunResult {
    /// Figures.
    pub summary: Summary,
    /// What was judged: the last instruction.
    pub task: Task,
    /// The robot's side at the end.
    pub mission: Mission,
    /// The world's side.
    pub truth: TruthLog,
    /// What the referee says.
    pub verdict: Verdict,
    /// What the referee knows of the robot.
    pub body: RobotTruth,
    /// The robot, 25 times a second, if the settings say so.
    pub postures: Vec<Posture>,
}

impl RunResult {
    /// The robot's journal.
    pub fn journal(&self) -> &Journal {
        &self.mission.journal
    }
}

/// Period of the control loop.
const STEP_NS: i64 = 20_000_000;
/// The robot's posture is written down every so many steps: fast enough for a swing of 0.2 s.
const POSTURE_STEPS: u64 = 2;
/// The robot stands still this long after it said stop, so that a swing or a slide still counts.
const SETTLE_S: f64 = 0.6;

/// What decides a run.
pub struct Setup<'a> {
    /// Settings.
    pub config: &'a RunConfig,
    /// Who runs.
    pub robot: &'a RobotModel,
    /// Where.
    pub scene: &'a Scene,
    /// What for, to begin with.
    pub task: &'a Task,
    /// Pose of the body in the building at the start.
    pub start: &'a Isometry3<f64>,
    /// What an earlier run found out.
    pub known: Option<Known>,
    /// Seed of noise and drift.
    pub seed: u64,
    /// Moves in place of the simulated body, in real time: building and sensors are simulated where it is.
    pub vehicle: Option<&'a mut (dyn Vehicle + 'static)>,
    /// What a person says meanwhile.
    pub orders: Orders,
}

/// Runs one mission. `stop` is looked at once per control period.
///
/// # Errors
/// What cannot be set up, and a simulation that breaks. A flight that ends early is a result.
pub fn run(setup: Setup<'_>, stop: &Arc<AtomicBool>, report: &mut dyn FnMut(&Progress)) -> Result<RunResult> {
    run_watched(setup, stop, report, &mut |_| {})
}

/// What somebody who looks over the robot's shoulder sees.
pub enum Watched<'a> {
    /// What a sensor says, before the robot hears it.
    Event(&'a SensorEvent),
    /// The robot's side after a cycle, and the seconds of the run.
    Cycle(f64, &'a Mission),
}

/// The same, with somebody who looks on and has no say.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    setup: Setup<'_>,
    stop: &Arc<AtomicBool>,
    report: &mut dyn FnMut(&Progress),
    watch: &mut dyn FnMut(Watched),
) -> Result<RunResult> {
    let Setup { config, robot, scene, task, start, known, seed, mut vehicle, mut orders } = setup;
    let mut task = task.clone();
    let (wall, cpu) = (Instant::now(), config.cpu_scope.now());
    let upright;
    let robot = if config.simulation.is_lidar_fixed {
        upright = with_fixed_lidar(robot);
        &upright
    } else {
        robot
    };
    let start_at = Point2::from(start.translation.vector.xy());
    let referee = Referee::new(&scene.building, &scene.world, robot_truth(robot, config.mission.flight_height_m), 0)
        .of_run_from(start_at);

    // Both sides. Unless a person says where in a known map the robot starts, the frame of the odometry begins at the robot:
    // where in the building that is, nobody on the robot's side knows.
    let start_in_map = start_in_map(known.as_ref(), robot);
    let truth_from_zones = match config.mission.zones.frame {
        ZoneFrame::Start => Some(*start),
        ZoneFrame::Map => config.truth_from_known,
    };
    // Zones of which nobody knows where they lie are judged by nobody.
    let zones = truth_from_zones.map(|frame| config.mission.zones.moved(&frame)).unwrap_or_default();
    let is_towed = vehicle.is_some();
    let world = SimulationConfig { is_towed, ..config.simulation.clone() };
    let mut simulation = Simulation::new(&world, robot, scene, start, &start_in_map, seed)?;
    let mind = match &config.llm {
        // A delay in the simulated world: the world stands still while a real model thinks.
        Some(chat) if config.mission.link.is_some() => Mind::Embedded(Box::new(LlmReasoner::new(chat.clone()))),
        Some(chat) => Mind::Remote(Box::new(LlmReasoner::new(chat.clone()))),
        None => Mind::Embedded(Box::new(SymbolicReasoner { grounding: grounding(&config.mission) })),
    };
    let mut mission = Mission::new(
        robot,
        &task.text,
        config.mission.clone(),
        simulation.camera(),
        mind,
        simulation.now(),
        &start_in_map,
    )?;
    if let Some(known) = known {
        mission.know(known);
    }
    simulation.set_phrases(mission.phrases(), mission.standing_phrases().to_vec());
    if let Some(service) = &config.segmenter {
        simulation.use_segmenter(Box::new(HttpSegmenter::new(service.clone())));
    }
    mission.journal.clock = StageClock::new(config.cpu_scope);

    // The loop: the world goes on for a step, the robot sees and commands.
    let truth_from_map = start * start_in_map.inverse();
    let mut truth =
        TruthLog { truth_from_map, zones, poses: vec![(simulation.now().0, *start)], ..TruthLog::default() };
    let (mut command, mut is_timeout) = (mission.idle(), false);
    let mut trouble = None;
    let mut postures = Vec::new();
    if let Err(why @ GaitError::OtherKindOfLeg { .. }) = simulation.legs() {
        mission.journal.notes.push((0.0, format!("The legs stand still. {why}.")));
    }
    let mut log = config.events_to.as_deref().map(open_log).transpose()?;
    let (mut settle_s, mut lost_s, mut last_activity, mut next_report_s) = (0.0, 0.0, String::new(), 0.0);
    let mut shown = 0; // questions
    loop {
        let now_s = simulation.seconds();
        if let Some(vehicle) = &mut vehicle {
            let next = Stamp(simulation.now().0 + STEP_NS);
            simulation.tell(next, vehicle.pose_when_due(next))?;
            simulation.tell_charge(vehicle.charge());
        }
        let events = simulation.advance(&command, STEP_NS, &mut mission.journal.clock)?;
        if let Some(log) = &mut log {
            log_cycle(log, &events, simulation.now()).context("keeping what the sensors said")?;
        }
        let has_scan = events.iter().any(|event| matches!(event, SensorEvent::Scan(_)));
        events.iter().for_each(|event| watch(Watched::Event(event)));
        let seen = config.cpu_scope.now();
        mission.perceive(events);
        let now = simulation.now();
        if vehicle.is_none() {
            // The simulated world waits with the robot for somebody who types, and has been shown the question.
            if mission.questions_asked() > shown {
                shown = mission.questions_asked();
                report(&Progress {
                    sim_s: now_s,
                    activity: mission.activity(),
                    is_news: true,
                    ..Progress::of(&mission)
                });
            }
            orders.wait_for_answer(&mission, stop);
        }
        while let Some(control) =
            orders.next(mission.seconds(now), settle_s >= SETTLE_S).or_else(|| orders.answer(&mission))
        {
            let control = mission.understood(control);
            // Who is at rest has done what it was told, or given it up: that is judged before it hears the next.
            let errand = mission.is_over().then(|| {
                finish(&mut truth, &mission, &task, &simulation, is_timeout, config.max_time_s);
                let Verdict { success, reason, .. } = verdict(&truth, &task, &referee, &robot.footprint);
                Errand { instruction: task.text.clone(), success, reason, end_s: now_s }
            });
            let heard = say_to(&mut mission, &control, &scene.building, now);
            let activity = match &heard {
                Ok(_) => format!("told: {}", control.line()),
                Err(why) => format!("told: {}; it goes on as before, for {why}", control.line()),
            };
            report(&Progress { sim_s: now_s, activity, is_news: true, ..Progress::of(&mission) });
            if let Ok(Some(other)) = heard {
                task = other;
                settle_s = 0.0;
                truth.errands.extend(errand);
                truth.begin_errand(now.0);
                simulation.set_phrases(mission.phrases(), mission.standing_phrases().to_vec());
            }
        }
        command = mission.cycle(now);
        if has_scan {
            mission.journal.clock.book("scan to command", seen.elapsed());
        }
        watch(Watched::Cycle(now_s, &mission));
        if let Some(estimate) = mission.odometry() {
            simulation.hear(estimate);
        }
        if let Some(vehicle) = &mut vehicle
            && let Err(why) = vehicle.obey(simulation.now(), &command, &mission)
        {
            trouble = Some(why);
            break;
        }

        let pose = simulation.true_pose();
        truth.poses.push((simulation.now().0, pose));
        if config.keeps_postures
            && simulation.steps() % POSTURE_STEPS == 0
            && let Some(odometry) = &mission.world.odometry
        {
            let joints = simulation.legs().map_or_else(|_| Vec::new(), |legs| legs.gait().angles().to_vec());
            let map_from_body = odometry.world_from_body;
            postures.push(Posture { t_s: simulation.seconds(), map_from_body, joints });
        }
        if has_scan && truth.first_sighting_s.is_none() && sees_any(&simulation, task.targets()) {
            truth.first_sighting_s = Some((simulation.now().0 - truth.heard_ns) as f64 * 1e-9);
        }
        if mission.world.odometry.is_some() && !mission.has_pose() {
            lost_s += STEP_NS as f64 * 1e-9;
        }
        // Steps are judged where the robot is when it declares them, except the last one, judged where it stands.
        while truth.declared.len() < mission.steps_done.len() && truth.declared.len() + 1 < task.steps.len() {
            let (step, stamp_ns) = (truth.declared.len(), simulation.now().0);
            truth.declared.push(Declared { step, stamp_ns, truth_from_body: pose });
        }
        if stop.load(Ordering::Relaxed) {
            mission.interrupt();
        }
        if now_s >= next_report_s {
            next_report_s = now_s + 0.5;
            let activity = mission.activity();
            let is_news = activity != last_activity;
            last_activity.clone_from(&activity);
            report(&Progress { sim_s: now_s, activity, is_news, ..Progress::of(&mission) });
        }
        if mission.is_over() {
            settle_s += STEP_NS as f64 * 1e-9;
            if settle_s >= SETTLE_S && (mission.is_interrupted() || !orders.has_more(now_s)) {
                break;
            }
        } else {
            settle_s = 0.0;
        }
        if now_s >= config.max_time_s {
            is_timeout = true;
            break;
        }
    }

    if let Some(log) = log {
        log.finish().context("keeping what the sensors said")?;
    }
    let end_s = simulation.seconds();
    let unused = mission.unused();
    mission.journal.notes.extend(unused.into_iter().map(|sentence| (end_s, sentence)));
    truth.truth_from_map *= mission.world.frame().map_from_odometry.inverse();

    // The verdict.
    finish(&mut truth, &mission, &task, &simulation, is_timeout, config.max_time_s);
    if let Some(vehicle) = vehicle {
        // The place is judged; now down. What went wrong on the way is said first, and is no success.
        let rest = vehicle.rest();
        mission.journal.notes.push((end_s, vehicle.account()));
        truth.trouble = trouble.or(rest.err()).map(|why| format!("The {} ended early: {why:#}.", vehicle.deed()));
    }
    let verdict = verdict(&truth, &task, &referee, &robot.footprint);
    let stages = mission.journal.clock.figures();
    let clearances = mission.journal.curves.iter().map(|c| c.clearance_m).filter(|c| c.is_finite());
    let summary = Summary {
        success: verdict.success,
        reason: verdict.reason.clone(),
        robot: word(robot.kind).to_owned(),
        model: robot.name.clone(),
        scene: scene.name.clone(),
        seed,
        instruction: task.text.clone(),
        kind: kind_word(&task),
        target: match &mission.outcome {
            Some(Outcome::Stopped { target, .. }) => target.clone(),
            _ => String::new(),
        },
        path_m: verdict.path_m,
        shortest_m: verdict.shortest_m,
        spl: verdict.spl,
        sim_s: simulation.seconds(),
        wall_s: wall.elapsed().as_secs_f64(),
        cpu_s: cpu.elapsed().as_secs_f64(),
        turned_in_place_rad: verdict.turned_in_place_rad,
        first_sighting_s: truth.first_sighting_s,
        decisions: mission.journal.decisions.len(),
        prompt_tokens: mission.journal.prompt_tokens(),
        answer_tokens: mission.journal.answer_tokens(),
        collisions: verdict.collisions,
        contacts_with_people: verdict.contacts_with_people,
        keep_out_entries: verdict.keep_out_entries,
        zones: verdict.zones.clone(),
        min_clearance_m: clearances.reduce(f64::min),
        rooms_found: mission.world.graph.rooms().count(),
        objects_found: mission.world.graph.confirmed_objects().count(),
        images: simulation.segmentation().images,
        images_without_masks: simulation.segmentation().without_masks,
        segmenter_error: simulation.segmentation().last_error.clone(),
        lost_s,
        odometry_resets: mission.odometry_resets(),
        interrupted: mission.is_interrupted(),
        stages,
    };
    let body = robot_truth(robot, config.mission.flight_height_m);
    Ok(RunResult { summary, task, mission, truth, verdict, body, postures })
}

/// Where the robot's odometry begins: at the robot, unless a person says where in a known map it starts.
pub(crate) fn start_in_map(known: Option<&Known>, robot: &RobotModel) -> Isometry3<f64> {
    let said = known.and_then(|known| known.start);
    said.unwrap_or_else(|| Isometry3::translation(0.0, 0.0, robot.stance_height_m))
}

fn open_log(path: &Path) -> Result<EventLogWriter<BufWriter<File>>> {
    let file = File::create(path).with_context(|| format!("writing {}", path.display()))?;
    EventLogWriter::new(BufWriter::new(file)).with_context(|| format!("writing {}", path.display()))
}

fn log_cycle(log: &mut EventLogWriter<BufWriter<File>>, events: &[SensorEvent], now: Stamp) -> std::io::Result<()> {
    events.iter().try_for_each(|event| log.event(event))?;
    log.cycle(now)
}

/// Whether ten points have met one of these things so far.
fn sees_any(simulation: &Simulation, ids: &[u32]) -> bool {
    const POINTS: u64 = 10;
    ids.iter().any(|id| simulation.lidar_points_on().get(id).is_some_and(|points| *points >= POINTS))
}

/// How it ended, and the last step where the robot came to rest.
fn finish(
    truth: &mut TruthLog,
    mission: &Mission,
    task: &Task,
    simulation: &Simulation,
    is_timeout: bool,
    max_time_s: f64,
) {
    truth.touches = simulation.touches().to_vec();
    truth.questions = mission.questions_about_this();
    truth.ending = match (&mission.outcome, mission.cancelled_s()) {
        (_, Some(t_s)) => {
            let rests = if mission.robot().kind == RobotKind::Aerial { "came down" } else { "stands" };
            Ending::Cancelled { t_s, rests: rests.into() }
        }
        _ if mission.is_interrupted() => Ending::Interrupted,
        (None, _) if is_timeout => Ending::TimedOut { max_time_s, activity: mission.activity() },
        (None, _) => Ending::Undecided,
        (Some(Outcome::GaveUp { reason }), _) => Ending::GaveUp { reason: reason.clone() },
        (Some(Outcome::Stopped { target, .. }), _) => Ending::Stopped { target: target.clone() },
    };
    if let (Ending::Stopped { .. }, Some(step)) = (&truth.ending, task.steps.len().checked_sub(1)) {
        let (stamp_ns, truth_from_body) = (simulation.now().0, simulation.true_pose());
        truth.declared.push(Declared { step, stamp_ns, truth_from_body });
    }
}

/// The same robot with its LiDAR standing upright and still: both sides must know.
pub fn with_fixed_lidar(robot: &RobotModel) -> RobotModel {
    let mut fixed = robot.clone();
    fixed.sensors.lidar.rotation_hz = 0.0;
    fixed.sensors.lidar.tilt_rad = 0.0;
    fixed.sensors.rotor_from_sensor.rotation = UnitQuaternion::identity();
    fixed
}
