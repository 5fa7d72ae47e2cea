//! Whole runs with sentences from elsewhere: the robot asks which one is meant, says what is not there, and a replay does the same.

mod support;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::bench_nav::{BenchNav, Given, bench_nav};
use arena::buildings::Buildings;
use arena::instructions::{Answers, open_instructions};
use arena::mission::robot_model::RobotKind;
use arena::orders::{Orders, script_of};
use arena::run::RunResult;
use support::{coarse, decisions_jsonl, robot, scene, start, steered_run, summary_without_clocks};

fn file(folder: &tempfile::TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::File::create(&path).and_then(|mut file| file.write_all(text.as_bytes())).expect("a file");
    path
}

fn bench(instructions: &str, answers: &str) -> BenchNav {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = robot(RobotKind::Ground);
    let instructions =
        open_instructions(&file(&folder, "instructions.jsonl", instructions), &robot).expect("instructions");
    let answers = Answers::open(&file(&folder, "answers.jsonl", answers)).expect("answers");
    let given = Given { instructions: Some(&instructions), answers: Some(&answers) };
    let indices: Vec<usize> = (0..instructions.len()).collect();
    let (config, stop) = (coarse(300.0), Arc::new(AtomicBool::new(false)));
    bench_nav(&robot, RobotKind::Ground, &indices, given, 1, &config, &Buildings::default(), None, None, true, &stop)
        .expect("a bench")
}

#[test]
fn a_bench_of_given_sentences_counts_by_kind() {
    let sofa = scene("spin").building.objects.iter().find(|object| object.class == "sofa").expect("a sofa").id;
    let lines = format!(
        "{{\"scene\": \"spin\", \"text\": \"pls go to teh sofaa\", \"targets\": [{sofa}], \"kind\": \"typo\"}}\n\
         {{\"scene\": \"spin\", \"text\": \"find the bathtub\", \"targets\": [], \"kind\": \"false_premise\"}}\n\
         {{\"scene\": \"spin\", \"text\": \"find the sofa\", \"targets\": [], \"kind\": \"false_premise\"}}\n"
    );
    let result = bench(&lines, "");
    let right: Vec<bool> = result.runs.iter().map(|run| run.success).collect();
    let reasons: Vec<&str> = result.runs.iter().map(|run| run.reason.as_str()).collect();
    // The third line is a lie of the file's: there is a sofa, and the robot that stops at it is counted wrong.
    assert_eq!(right, [true, true, false], "{reasons:?}");
    assert!(reasons[1].contains("There is no bathtub here"), "{reasons:?}");
    assert!(reasons[2].contains("which is the wrong place"), "{reasons:?}");
    assert_eq!((result.by_kind["typo"].right, result.by_kind["false_premise"].n), (1, 2));
    assert!(result.by_kind["typo"].spl.is_some() && result.by_kind["false_premise"].spl.is_none());
}

#[test]
fn wrong_lines_are_refused_before_anything_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = |line: &str| open_instructions(&file(&folder, "x.jsonl", line), &robot(RobotKind::Ground));
    let line = |scene: &str, targets: &str| {
        format!("{{\"scene\": {scene}, \"text\": \"find it\", \"targets\": {targets}, \"kind\": \"class\"}}")
    };
    for (line, why) in [
        (line("\"spin\"", "[99999]"), "building spin has no object 99999"),
        (line("\"nowhere\"", "[]"), "no building is called \"nowhere\""),
        ("{\"scene\": \"spin\", \"txt\": \"x\"}".to_owned(), "line 1: unknown field `txt`"),
        (String::new(), "holds no instruction"),
    ] {
        let error = format!("{:#}", open(&line).expect_err("a wrong line"));
        assert!(error.contains(why), "{error}");
    }
}

/// In the flat stand two kettles: asked for "the kettle", the robot asks, is told, and a replay of what was said is the same run.
#[test]
fn a_robot_that_was_answered_goes_there_and_a_replay_repeats_it() {
    let (robot, scene, config) = (robot(RobotKind::Ground), scene("flat"), coarse(200.0));
    let kettles: Vec<_> = scene.building.objects.iter().filter(|object| object.class == "kettle").collect();
    let colors: Vec<&str> = kettles.iter().map(|kettle| kettle.color.as_str()).collect();
    assert_eq!(colors, ["grey", "black"], "what this test is about");
    let start = start(&scene, &robot, &config, 1);
    let asked =
        |orders: Orders| -> RunResult { steered_run(&config, &robot, &scene, "go to the kettle", &start, 1, orders) };
    let live = asked(Orders::default().with_answers(vec!["hm?".into(), "the black one".into()]));
    let questions: Vec<_> = live.journal().decisions.iter().filter_map(|decision| decision.question.as_ref()).collect();
    assert_eq!(questions.len(), 2, "{questions:?}");
    assert!(questions[0].text.starts_with("Which kettle do you mean"), "{questions:?}");
    assert_eq!(questions[1].answer.as_deref(), Some("the black one"));
    assert!(live.summary.success, "{}", live.summary.reason);
    let meant = questions[1].meaning.strip_prefix("it goes to ").expect("one was chosen");
    assert!(live.summary.target.ends_with(meant), "{} {meant}", live.summary.target);
    let script = script_of(live.journal());
    assert!(script.contains(" ask me\n") && script.contains(" answer: the black one\n"), "{script}");
    let again = asked(Orders::script(&script).expect("a script"));
    assert_eq!(decisions_jsonl(&live), decisions_jsonl(&again));
    assert_eq!(summary_without_clocks(&live), summary_without_clocks(&again));
    // Without anybody to ask it goes to any.
    let alone = asked(Orders::default());
    assert!(alone.journal().decisions.iter().all(|decision| decision.question.is_none()));
    assert!(alone.summary.success, "{}", alone.summary.reason);
}
