use octant_prompt::parse_instruction;
use std::io::BufRead;
fn main() {
    for line in std::io::stdin().lock().lines() {
        let line = line.unwrap();
        let i = parse_instruction(&line);
        let s: Vec<String> = i
            .steps
            .iter()
            .map(|s| {
                format!(
                    "{:?}:{}{}{}",
                    s.kind,
                    if s.goal.is_any { "(any) " } else { "" },
                    s.goal,
                    if s.goal.class.also.is_empty() { String::new() } else { format!(" also {:?}", s.goal.class.also) }
                )
            })
            .collect();
        println!(
            "{line}\n      => {}   {:?}",
            s.join(" | "),
            i.readings.iter().map(|r| format!("{}>{} {:.2}", r.said, r.meant, r.confidence)).collect::<Vec<_>>()
        );
    }
}
