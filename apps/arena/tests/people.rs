//! Runs among people who walk about, whether they heed the robot or not.

mod support;

use arena::mission::robot_model::RobotKind;
use omni_sim::crowd::CrowdConfig;
use support::{coarse, scene, short_run};

#[test]
fn nobody_is_run_into_and_walkers_are_nodes_of_the_graph() {
    let flat = scene("flat");
    for heeds_robot in [true, false] {
        let mut config = coarse(40.0);
        config.simulation.crowd = CrowdConfig { people: 5, heeds_robot, seed: 0 };
        let result = short_run(&config, RobotKind::Ground, &flat, "find the mug near the sink", 3);
        let summary = &result.summary;
        assert_eq!(summary.collisions, 0, "{:?}", result.truth.touches);
        // Who heeds nobody presses on when he is stopped by the robot; when that then moves he may touch it once more. Five such people
        // walked into it eight times in these forty seconds, twice while it moved.
        let most = if heeds_robot { 0 } else { 2 };
        assert!(summary.contacts_with_people <= most, "heeds {heeds_robot}: {:?}", result.truth.touches);
        let graph = &result.mission.world.graph;
        let people: Vec<_> = graph.confirmed_objects().filter(|object| object.label == "person").collect();
        assert!(!people.is_empty(), "five people walk about for {} s", summary.sim_s);
        assert!(people.iter().any(|person| person.trajectory.len() > 3 && !person.presence.is_empty()));
        assert!(summary.path_m > 1.0, "it stands still for fear: {} m", summary.path_m);
        // Nobody became furniture: no thing that stands was made of people.
        assert!(people.iter().all(|person| !person.trajectory.is_empty()));
        // Who was lost from sight and comes back counts anew until he is forgotten (30 s: a law of `dsg`).
        assert!(people.len() <= 2 * 5, "{} people are known, and five there are", people.len());
    }
    // The same seeds give the same people.
    let mut config = coarse(6.0);
    config.simulation.crowd.people = 5;
    let run = || short_run(&config, RobotKind::Ground, &flat, "find the mug near the sink", 3).truth.poses;
    assert_eq!(run(), run());
}
