//! Where one step of an instruction ends and the next begins.

use crate::instruction::Step;
use crate::lexicon::{Mark, Token};

/// Cuts at "then", at sentence ends, and at "and" or a comma before a verb.
pub(crate) fn split_steps(all: &[Token]) -> Vec<&[Token]> {
    let starts_step = |at: usize| {
        let rest = &all[at..];
        let verb = rest.iter().position(|token| !matches!(token.mark, Mark::And | Mark::Comma | Mark::Then));
        verb.is_some_and(|index| matches!(rest[index].mark, Mark::Verb | Mark::Enter))
    };
    let mut clauses = Vec::new();
    let mut start = 0;
    for at in 0..all.len() {
        let cuts = match all[at].mark {
            // "next" and "finally" open a step only where a sentence could begin.
            Mark::Then => true,
            Mark::Stop => true,
            Mark::And | Mark::Comma => starts_step(at + 1),
            _ => false,
        };
        if cuts {
            clauses.push(&all[start..at]);
            start = at + 1;
        }
    }
    clauses.push(&all[start..]);
    clauses.retain(|clause| clause.iter().any(|token| !matches!(token.mark, Mark::And | Mark::Comma)));
    clauses
}

/// "go to the table and find the one near it": a wildcard target takes the class of the step before.
pub(crate) fn resolve_pronouns(steps: &mut [Step]) {
    for index in 1..steps.len() {
        if steps[index].goal.class.text == "one" {
            let class = steps[index - 1].goal.class.clone();
            if !class.text.is_empty() {
                steps[index].goal.class = class;
            }
        }
    }
}
