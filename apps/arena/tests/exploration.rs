//! A search ends when nothing is left to search: not before, whoever says so, and not never.

mod support;

use arena::mission::mission::Outcome;
use arena::mission::openai::ChatConfig;
use arena::mission::robot_model::RobotKind;
use support::fake_server::{Answer, FakeServer};
use support::{coarse, scene, short_run};

/// What is not there is looked for everywhere; then the robot says so, and knows no place any more where it could go.
#[test]
fn nothing_is_given_up_while_a_reachable_place_is_left() {
    let mut result = short_run(&coarse(200.0), RobotKind::Ground, &scene("spin"), "find the unicorn", 2);
    let Some(Outcome::GaveUp { reason }) = &result.mission.outcome else { panic!("{}", result.summary.reason) };
    assert!(reason.contains("searched everywhere"), "{reason}");
    assert_eq!(result.mission.places_left(), []);
}

/// A model whose only word is "give up" ends no search: the critic counts the places that are left, and the robot goes on.
#[test]
fn a_model_that_gives_up_at_once_is_not_believed() {
    let server =
        FakeServer::start(|_, _| Answer::Say("{\"action\": \"give_up\", \"reason\": \"nothing is here\"}".into()));
    let mut config = coarse(8.0);
    config.llm = Some(ChatConfig { timeout_s: 2.0, attempts: 2, ..ChatConfig::new(&server.base_url, "fake-model") });
    let mut result = short_run(&config, RobotKind::Ground, &scene("flat"), "find the unicorn", 1);
    assert!(result.mission.outcome.is_none(), "{}", result.summary.reason);
    assert!(!result.mission.places_left().is_empty() && result.summary.path_m > 0.1);
    let verdicts = result.mission.journal.decisions.iter().flat_map(|decision| &decision.verdicts);
    let premature = verdicts.filter(|verdict| verdict.contains("reachable places are left")).count();
    assert!(premature > 0, "the model was heard, and refused: {:?}", result.mission.journal.decisions[0].verdicts);
}
