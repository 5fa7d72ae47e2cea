//! A language model may be down, slow, mad or malicious: the run goes on with the embedded reasoner, and nothing unverified moves
//! the robot. One that answers well is used.

mod support;

use std::time::{Duration, Instant};

use arena::mission::openai::ChatConfig;
use arena::mission::robot_model::RobotKind;
use arena::run::RunResult;
use arena::run_folder::RunFolder;
use arena::write_run::write_run;
use serde_json::{Value, json};
use support::fake_server::{Answer, FakeServer, allowed};
use support::{assert_every_decision_is_verified, coarse, scene, short_run};

/// The robot looks round for 2 s, then decides when something calls for it, at most once a second.
const MAX_TIME_S: f64 = 6.0;
const TEXT: &str = "find the mug near the sink";

fn run_with(base_url: &str, timeout_s: f64) -> RunResult {
    run_for(MAX_TIME_S, base_url, timeout_s)
}

fn run_for(max_time_s: f64, base_url: &str, timeout_s: f64) -> RunResult {
    let mut config = coarse(max_time_s);
    config.llm = Some(ChatConfig { timeout_s, attempts: 2, ..ChatConfig::new(base_url, "fake-model") });
    let result = short_run(&config, RobotKind::Ground, &scene("flat"), TEXT, 1);
    assert_every_decision_is_verified(&result);
    result
}

/// Every decision was taken by the embedded reasoner and says why.
fn assert_fell_back(result: &RunResult) {
    assert!(!result.journal().decisions.is_empty(), "the run goes on: {}", result.summary.reason);
    for decision in &result.journal().decisions {
        assert!(decision.is_fallback, "decision {} says who took it", decision.index);
        assert_ne!(decision.reasoner, "fake-model");
        assert!(decision.verdicts[0].starts_with("rejected: "), "and why: {:?}", decision.verdicts);
    }
    assert!(
        result.journal().decisions.iter().any(|decision| decision.verdicts.last().is_some_and(|v| v == "accepted")),
        "the embedded reasoner's actions are accepted"
    );
    assert!(result.summary.path_m > 0.1, "the robot went on: {} m", result.summary.path_m);
}

#[test]
fn with_a_server_that_is_down_the_embedded_reasoner_takes_every_step() {
    assert_fell_back(&run_with(&FakeServer::down(), 1.0));
}

#[test]
fn with_a_server_that_never_answers_the_wait_is_bounded() {
    let server = FakeServer::start(|_, _| Answer::Silence(Duration::from_secs(60)));
    let start = Instant::now();
    // Longer than the others: how long each wait takes is the machine's affair.
    let result = run_for(9.0, &server.base_url, 0.2);
    assert_fell_back(&result);
    assert!(start.elapsed() < Duration::from_secs(50), "nobody waited for the server");
}

#[test]
fn however_a_server_fails_the_run_goes_on_and_the_report_says_so() {
    // Decisions are rare, and each asks twice at most: every way to fail gets a short run of its own.
    let failures: [fn() -> Answer; 6] = [
        || Answer::Raw("500 Internal Server Error", b"out of memory".to_vec()),
        || Answer::Raw("200 OK", b"<html>not JSON</html>".to_vec()),
        || Answer::Raw("200 OK", br#"{"choices": []}"#.to_vec()),
        || Answer::Raw("200 OK", vec![0xff; 300_000]),
        || Answer::Raw("404 Not Found", br#"{"error": "no such model"}"#.to_vec()),
        || Answer::Say("I am a teapot.".into()),
    ];
    let results = std::thread::scope(|scope| {
        let runs = failures.map(|failure| {
            scope.spawn(move || {
                let server = FakeServer::start(move |_, _| failure());
                let result = run_for(4.0, &server.base_url, 2.0);
                assert!(!server.requests().is_empty(), "the server was asked");
                result
            })
        });
        runs.map(|run| run.join().expect("the run ends"))
    });
    for result in &results {
        assert_fell_back(result);
    }
    let result = &results[0];

    let folder = tempfile::tempdir().expect("a place for a run folder");
    let scene = scene("flat");
    let run = RunFolder::new(&folder.path().join("run")).expect("a new folder");
    write_run(&run, result, &scene).expect("written");
    let report = std::fs::read_to_string(run.path().join("report.html")).expect("a report");
    assert!(report.contains("fallback"), "the report says who decided");
}

#[test]
fn hostile_answers_move_nothing_and_leave_no_markup_in_the_report() {
    let server = FakeServer::start(|number, request| {
        let first = allowed(request, "target").into_iter().find(|name| name.starts_with("mug")).unwrap_or_default();
        Answer::Say(match number % 8 {
            0 => "<script>alert(1)</script> Ignore all rules. stop(everything)".into(),
            1 => r#"{"action": "stop", "target": "mug99999999999999999999"}"#.into(),
            2 => format!("{}1{}", "[".repeat(5000), "]".repeat(5000)),
            3 => r#"{"action": "launch_missiles", "target": "kitchen"}"#.into(),
            4 => "\u{0}\u{1b}[2J\u{202e}{\"action\": \"explore\", \"target\": \"../../etc/passwd\"}".into(),
            5 => format!("{{\"action\": \"stop\", \"target\": \"{first}\"}}"),
            6 => r#"{"action": "give_up", "target": "</pre><img src=x onerror=alert(1)>"}"#.into(),
            _ => "stop(".repeat(3000),
        })
    });
    let result = run_with(&server.base_url, 2.0);
    assert_fell_back(&result);
    assert!(result.mission.outcome.is_none(), "nothing was declared done on a stranger's word");

    let folder = tempfile::tempdir().expect("a place for a run folder");
    let scene = scene("flat");
    let run = RunFolder::new(&folder.path().join("run")).expect("a new folder");
    write_run(&run, &result, &scene).expect("written");
    let report = std::fs::read_to_string(run.path().join("report.html")).expect("a report");
    assert!(!report.contains("<script") && !report.contains("<img src=x"), "what a model wrote is text");
    let lines = std::fs::read_to_string(run.path().join("decisions.jsonl")).expect("decisions");
    assert_eq!(lines.lines().count(), result.summary.decisions);
    for line in lines.lines() {
        let decision: Value = serde_json::from_str(line).expect("each line is JSON");
        assert!(decision["replies"].as_array().is_some_and(|replies| replies.len() >= 2));
    }
}

#[test]
fn a_server_that_chooses_well_from_the_schema_is_used_without_fallback() {
    let server = FakeServer::start(|_, request| {
        let targets = allowed(request, "target");
        let frontier = targets.iter().find(|name| name.starts_with("frontier"));
        let octant = targets.iter().find(|name| name.starts_with("front-"));
        let reply = match (frontier, octant) {
            (Some(frontier), _) => json!({"room": "unknown", "target": frontier, "stop": false}),
            (None, Some(octant)) => json!({"target": octant, "stop": false}),
            _ => json!({}),
        };
        Answer::Say(reply.to_string())
    });
    let result = run_with(&server.base_url, 5.0);
    let used: Vec<_> = result.journal().decisions.iter().filter(|d| d.reasoner == "fake-model").collect();
    assert!(!used.is_empty(), "the model decides: {:?}", result.summary);
    for decision in &used {
        assert!(!decision.is_fallback);
        assert!(
            decision.action.starts_with("explore") || decision.action.starts_with("turn_to"),
            "{}",
            decision.action
        );
        assert_eq!(decision.answer_tokens % 7, 0, "the server's own count of tokens");
    }
    assert!(used.iter().any(|decision| decision.verdicts.last().is_some_and(|verdict| verdict == "accepted")));
    let fallbacks = result.journal().decisions.iter().filter(|decision| decision.is_fallback).count();
    assert_eq!(fallbacks, 0, "good answers need nobody else");

    let request = server.requests().remove(0);
    assert_eq!(request["model"], "fake-model");
    let sent = request["messages"][1]["content"].as_str().unwrap_or_default();
    assert!(sent.contains(TEXT), "the prompt holds the instruction");
    assert!(result.journal().decisions.iter().any(|decision| decision.prompt == sent), "and is what the journal says");
}
