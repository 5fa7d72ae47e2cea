//! A tiny version of each experiment, so that none rots: parts left out, narrow sensors, a far model, patrol, judge, replay.

mod support;

use std::io::BufReader;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::arms::{Arms, Setting};
use arena::bench_nav::{Given, bench_nav};
use arena::mission::ablation::Part;
use arena::mission::dsg::Verdict;
use arena::mission::event_log::EventLogReader;
use arena::mission::mission::Mission;
use arena::mission::octant_prompt::{Octant, SymbolicReasoner};
use arena::mission::reasoning::Mind;
use arena::mission::robot_model::RobotKind;
use arena::mission::stage_clock::{CpuScope, StageClock};
use arena::mission::stream::{Command, SensorEvent};
use arena::patrol::patrol;
use arena::run::{RunConfig, RunResult};
use arena::run_folder::RunFolder;
use arena::run_setup::camera_of;
use arena::simulation::Simulation;
use arena::truth_folder::judge;
use arena::write_run::write_run;
use nalgebra::Isometry3;
use support::{assert_every_decision_is_verified, coarse, robot, run_from, scene, short_run, start};

fn with(settings: &[Setting], max_time_s: f64) -> RunConfig {
    let mut config = coarse(max_time_s);
    settings.iter().for_each(|setting| setting.apply(&mut config));
    config
}

/// Some seconds in one room, with and without each part.
#[test]
fn every_part_can_be_left_out_and_is_gone_then() {
    let flat = scene("flat");
    let run = |part: Option<Part>| {
        short_run(&with(&[Setting::Without(part)], 9.0), RobotKind::Ground, &flat, "find the mug near the sink", 1)
    };
    let prompts = |result: &RunResult| -> String {
        result.journal().decisions.iter().map(|decision| decision.prompt.clone() + "\n").collect()
    };
    let has_octants = |text: &str| Octant::ALL.iter().any(|octant| text.contains(octant.name()));
    let labels = |result: &RunResult| result.mission.world.graph.objects().map(|object| object.votes.len()).max();
    let whole = run(None);
    assert!(whole.mission.world.graph.rooms().count() > 0 && has_octants(&prompts(&whole)));
    assert!(labels(&whole) > Some(1), "some label was in doubt");
    let blocked = |result: &RunResult| {
        let dropped = result.mission.world.graph.dropped_relations();
        dropped.filter(|relation| matches!(relation.evidence.verdict, Verdict::Blocked(_))).count()
    };
    // Who asks nobody believes everything for certain.
    let doubted = |result: &RunResult| {
        let graph = &result.mission.world.graph;
        graph.relations().chain(graph.dropped_relations()).filter(|relation| relation.evidence.score < 1.0).count()
    };
    assert!(blocked(&whole) > 0 && doubted(&whole) > 0, "{} blocked, {} doubted", blocked(&whole), doubted(&whole));
    let tokens_of_one = |result: &RunResult| result.journal().decisions.last().map_or(0, |last| last.prompt_tokens);
    for part in Part::ALL {
        let result = run(Some(part));
        let (graph, text) = (&result.mission.world.graph, prompts(&result));
        assert!(!result.journal().decisions.is_empty(), "{part:?}");
        match part {
            Part::Rooms => assert_eq!(graph.rooms().count(), 0),
            Part::Vote => assert_eq!(labels(&result), Some(1)),
            Part::Octants => assert!(!has_octants(&text) && text.contains(" at ("), "{text}"),
            Part::Tiers => assert!(has_octants(&text) && tokens_of_one(&result) > tokens_of_one(&whole)),
            Part::Pruning => assert_eq!(blocked(&result), 0),
            Part::Verify => assert_eq!(doubted(&result), 0),
            // A law of the prompt crate (tests/search.rs); that they reach it is `Mission`'s own test.
            Part::Steps | Part::Critic => {}
        }
    }
    let flat_text =
        short_run(&with(&[Setting::IsFlat(true)], 9.0), RobotKind::Ground, &flat, "find the mug near the sink", 1);
    assert!(prompts(&flat_text).contains(" at (") && !has_octants(&prompts(&flat_text)));
}

/// No point and no mask from behind the robot, and yet it finds what was behind it.
#[test]
fn narrow_sensors_see_ahead_only_and_the_robot_turns_for_the_rest() {
    let (spin, robot) = (scene("spin"), robot(RobotKind::Ground));
    let config = with(&[Setting::IsNarrow(true)], 60.0);
    let start = start(&spin, &robot, &config, 1);
    let mut simulation = Simulation::new(&config.simulation, &robot, &spin, &start, &Isometry3::identity(), 1).unwrap();
    let camera = simulation.camera();
    let mut clock = StageClock::new(CpuScope::Thread);
    let idle = Command::Velocity { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 };
    let (mut points, mut masks) = (0, 0);
    for _ in 0..75 {
        for event in simulation.advance(&idle, 20_000_000, &mut clock).unwrap() {
            match event {
                SensorEvent::Scan(scan) => points += scan.points.len(),
                SensorEvent::Panorama(panorama) => {
                    masks += panorama.masks.len();
                    let columns = panorama.masks.iter().flat_map(|mask| mask.rle.spans().map(|span| span.column));
                    let off = columns.map(|column| f64::from(column) / f64::from(camera.width_px) - 0.5);
                    assert!(off.into_iter().all(|off| off.abs() <= 0.126), "a quarter of the picture, in its middle");
                }
                _ => {}
            }
        }
    }
    assert!(points > 1000 && masks > 0, "{points} points, {masks} masks");

    let all_round = run_from(&with(&[], 60.0), &robot, &spin, "find the sofa", &start, 1);
    let narrow = run_from(&config, &robot, &spin, "find the sofa", &start, 1);
    assert!(narrow.summary.success, "{}", narrow.summary.reason);
    assert!(
        narrow.summary.turned_in_place_rad > all_round.summary.turned_in_place_rad + 3.0,
        "{} and {} rad",
        narrow.summary.turned_in_place_rad,
        all_round.summary.turned_in_place_rad
    );
    assert!(narrow.summary.first_sighting_s >= all_round.summary.first_sighting_s);
}

/// A model that answers after three seconds or not at all: the robot gets there, and does nothing that was not verified when it came in.
#[test]
fn a_far_model_slows_the_robot_down_and_no_unverified_action_is_done() {
    let spin = scene("spin");
    let settings = [Setting::Latency(3.0, 3.0), Setting::Loss(0.2), Setting::Outage(4.0, 10.0)];
    let result = short_run(&with(&settings, 150.0), RobotKind::Ground, &spin, "find the sofa", 2);
    assert!(result.summary.success, "{}", result.summary.reason);
    assert_every_decision_is_verified(&result);
    let decisions = &result.journal().decisions;
    assert!(decisions.iter().all(|decision| decision.decided_s - decision.asked_s >= 3.0 - 1e-6), "nobody was faster");
    assert!(decisions.iter().any(|decision| decision.is_fallback), "a call was lost in the outage");
    assert_eq!(result.summary.collisions, 0);
}

#[test]
fn a_patrol_goes_from_errand_to_errand_and_says_what_it_held() {
    let (spin, robot) = (scene("spin"), robot(RobotKind::Ground));
    let stop = Arc::new(AtomicBool::new(false));
    let found = patrol(&coarse(0.0), &robot, &spin, 1, 70.0, &|| Some(100.0), &stop, &mut |_| {}).unwrap();
    assert!(found.errands >= 2 && found.right + found.failures.len() == found.errands, "{found:?}");
    assert_eq!((found.lost_s, found.odometry_resets, found.collisions), (0.0, 0, 0));
    assert!(found.scan_to_command_ms.p99 > 0.0 && found.memory.len() == 1);
}

/// `truth/` alone gives the verdict of the run, and a changed truth another one.
#[test]
fn a_run_is_judged_again_from_its_truth() {
    let (spin, folder) = (scene("spin"), tempfile::tempdir().unwrap());
    let result = short_run(&coarse(60.0), RobotKind::Ground, &spin, "find the sofa", 1);
    let staging = RunFolder::new(&folder.path().join("run")).unwrap();
    write_run(&staging, &result, &spin).unwrap();
    let run = staging.publish().unwrap();
    let judged = judge(&run).unwrap().verdict;
    assert!(judged.success && result.verdict.success);
    assert_eq!((&judged.reason, &judged.steps), (&result.verdict.reason, &result.verdict.steps));
    for (a, b) in [
        (judged.path_m, result.verdict.path_m),
        (judged.spl, result.verdict.spl),
        (judged.shortest_m.unwrap(), result.verdict.shortest_m.unwrap()),
        (judged.turned_in_place_rad, result.verdict.turned_in_place_rad),
    ] {
        assert!((a - b).abs() < 1e-5, "{a} and {b}");
    }
    // Whoever says that it was another thing changes the verdict.
    let task = run.join("truth/task.json");
    let text = std::fs::read_to_string(&task).unwrap();
    let other = spin.building.objects.iter().find(|object| !result.task.targets().contains(&object.id)).unwrap().id;
    let targets = result.task.targets().iter().map(u32::to_string).collect::<Vec<_>>();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    json["task"]["steps"][0]["ids"] = serde_json::json!([other]);
    assert!(!targets.contains(&other.to_string()));
    std::fs::write(&task, json.to_string()).unwrap();
    let changed = judge(&run).unwrap().verdict;
    assert!(changed.shortest_m != judged.shortest_m || !changed.success);
    std::fs::remove_file(run.join("truth/rooms.json")).unwrap();
    assert!(format!("{:#}", judge(&run).unwrap_err()).contains("rooms.json"));
}

/// What the sensors said, given to a mission once more, leads to the same decisions, byte for byte.
#[test]
fn a_recorded_run_decides_the_same_again() {
    let (spin, folder) = (scene("spin"), tempfile::tempdir().unwrap());
    let log = folder.path().join("events.bin");
    let config = RunConfig { events_to: Some(log.clone()), ..coarse(60.0) };
    let result = short_run(&config, RobotKind::Ground, &spin, "find the sofa", 1);
    let robot = robot(RobotKind::Ground);
    let mind = Mind::Embedded(Box::new(SymbolicReasoner::default()));
    let begin = Isometry3::translation(0.0, 0.0, robot.stance_height_m);
    let camera = camera_of(&config.simulation);
    let start = arena::mission::omni_perception::Stamp(0);
    let mut again = Mission::new(&robot, &result.task.text, config.mission, camera, mind, start, &begin).unwrap();
    let mut reader = EventLogReader::new(BufReader::new(std::fs::File::open(log).unwrap())).unwrap();
    while let Some(cycle) = reader.next_cycle().unwrap() {
        again.perceive(cycle.events);
        again.cycle(cycle.now);
    }
    assert!(result.journal().decisions.len() > 1);
    assert_eq!(again.journal.decisions, result.journal().decisions);
}

#[test]
fn arms_run_over_the_same_scenes() {
    let robot = robot(RobotKind::Ground);
    let arms = Arms::new(&[&[Setting::IsFixed(false), Setting::IsFixed(true)]]).unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    let runs: Vec<_> = arms
        .configs(&coarse(4.0))
        .into_iter()
        .map(|(_, config)| {
            let buildings = arena::buildings::Buildings::default();
            bench_nav(
                &robot,
                RobotKind::Ground,
                &[0],
                Given::default(),
                1,
                &config,
                &buildings,
                None,
                None,
                true,
                &stop,
            )
            .unwrap()
        })
        .collect();
    let what = |bench: &arena::bench_nav::BenchNav| (bench.runs[0].scene.clone(), bench.runs[0].instruction.clone());
    assert_eq!(what(&runs[0]), what(&runs[1]));
    assert_ne!(runs[0].runs[0].objects_found, 0);
}
