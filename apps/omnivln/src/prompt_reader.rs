//! Readers of prompts: they get the bytes of one prompt and, for ours, the tools; nothing else. What they can answer is what the text says.
//!
//! They stand in for a model that makes no mistakes in reading, so that a wrong answer is a fault of the text.

use serde_json::Value;

/// The id of the nearest object of the asked class in a list of JSON lines with the agent's position before it.
pub fn read_flat(prompt: &str) -> Option<String> {
    let class = asked(prompt)?;
    let (_, pose) = prompt.split_once("You are at (")?;
    let here: Vec<f64> = pose.split_once(')')?.0.split(", ").filter_map(|number| number.parse().ok()).collect();
    let objects = prompt.lines().filter(|line| line.starts_with('{'));
    let rows =
        objects.filter_map(|line| serde_json::from_str::<Value>(line).ok()).filter(|row| row["category"] == class);
    let distance = |row: &Value| -> f64 {
        let position = row["position"].as_array().map_or(&[][..], Vec::as_slice);
        position.iter().zip(&here).filter_map(|(p, h)| Some((p.as_f64()? - h).powi(2))).sum::<f64>().sqrt()
    };
    let nearest = rows.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(nearest["id"].to_string())
}

/// The action for the nearest object of the asked class in a prompt of ours. `path_length` is the tool of that name: it is asked where
/// two rooms lie equally far by the text.
pub fn read_ours(prompt: &str, path_length: impl Fn(&str) -> Option<f64>) -> Option<String> {
    let class = asked(prompt)?;
    let is_first = |name: &str| name.strip_prefix(class).is_some_and(|ordinal| ordinal == "1");
    let words = |line: &str| {
        line.split([' ', ';', ',']).filter(|word| !word.is_empty()).map(str::to_string).collect::<Vec<_>>()
    };
    let own = prompt.lines().take_while(|line| !line.starts_with("Other rooms") && !line.starts_with("Instruction"));
    // In the own room class1 is the nearest, and every other room is farther than what stands around the robot or may be: compare.
    let mut names: Vec<String> =
        own.skip(1).flat_map(|line| words(&unquoted(line))).filter(|word| is_first(word)).take(1).collect();
    let mut section = false;
    for line in prompt.lines() {
        section = (section || line.starts_with("Other rooms")) && !line.starts_with("Farther rooms");
        if !section {
            // A line about an area names the nearest room that holds the class; its class1 is the nearest there.
            if let Some((_, rest)) = line.split_once(&format!("; {class} in ")) {
                names.extend(rest.split(' ').next().map(|room| format!("{room}.{class}1")));
            }
            continue;
        }
        let Some((head, rest)) = line.split_once("m:") else { continue };
        let room = head.split(' ').next()?;
        let holds = |word: &str| word == class || word.strip_prefix(class).is_some_and(|rest| rest.starts_with('x'));
        if words(rest).iter().any(|word| holds(word)) {
            names.push(format!("{room}.{class}1"));
        }
    }
    let nearest = match names.as_slice() {
        [only] => only.clone(),
        _ => {
            let known = names.iter().filter_map(|name| Some((path_length(name)?, name)));
            known.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)))?.1.clone()
        }
    };
    Some(format!("go_near({nearest})"))
}

fn asked(prompt: &str) -> Option<&str> {
    prompt.lines().rev().find_map(|line| line.strip_prefix("Instruction: go to the nearest ")).map(str::trim)
}

/// A line without its captions.
fn unquoted(line: &str) -> String {
    line.split('"').step_by(2).collect()
}
