//! Fitting a prompt into its budget by dropping detail, the farthest and least relevant first.
//!
//! The order is fixed: far rooms lose their groups, then their counts (rooms without the asked class first, the farthest first); then
//! peripheral objects, the places beyond the second, captions, and focal objects, each from far to near. So "how much must go" is one
//! number, found by bisection with the real counter on the real text: O(log n) renderings.

use crate::names::NameTable;
use crate::prompt::PromptConfig;
use crate::render::{Detail, render};
use crate::tiers::{Item, Tiers};
use crate::tokens::TokenCounter;

/// Rooms that are shown at most; the rest is folded from the start.
const MAX_ROOMS: usize = 64;
/// Objects listed one by one at most, per tier.
const MAX_ITEMS: usize = 48;

/// A prompt's text within its budget, with its tokens and names.
pub fn fit(
    tiers: &Tiers,
    instruction: &str,
    revision: u64,
    config: &PromptConfig,
    counter: &dyn TokenCounter,
) -> (String, usize, NameTable) {
    let plan = Plan::new(tiers, instruction, config);
    let written = |detail: &Detail| {
        let mut names = NameTable::new(revision);
        let text = render(tiers, instruction, detail, Some(&mut names));
        let tokens = counter.count(&text);
        (text, tokens, names)
    };
    // The usual case: everything fits, and is written once.
    let full = written(&plan.after(0));
    if full.1 <= config.budget_tokens {
        return full;
    }
    let fits = |detail: &Detail| counter.count(&render(tiers, instruction, detail, None)) <= config.budget_tokens;
    written(&richest(&plan, instruction, &fits))
}

/// The richest detail that fits, given that the full one does not.
fn richest(plan: &Plan, instruction: &str, fits: &dyn Fn(&Detail) -> bool) -> Detail {
    // The last step drops everything; if even that is too long, the instruction is cut.
    let (mut too_much, mut enough) = (0, plan.steps());
    if !fits(&plan.after(enough)) {
        return cut_instruction(plan.after(enough), instruction, fits);
    }
    while enough - too_much > 1 {
        let middle = (too_much + enough) / 2;
        if fits(&plan.after(middle)) { enough = middle } else { too_much = middle }
    }
    plan.after(enough)
}

fn cut_instruction(mut detail: Detail, instruction: &str, fits: &dyn Fn(&Detail) -> bool) -> Detail {
    let (mut enough, mut too_much) = (0, instruction.len());
    while too_much - enough > 1 {
        let middle = (enough + too_much) / 2;
        detail.instruction_bytes = middle;
        if fits(&detail) { enough = middle } else { too_much = middle }
    }
    detail.instruction_bytes = enough;
    detail
}

/// The fixed order of dropping.
struct Plan {
    /// Rooms in the order in which they lose detail.
    rooms: Vec<usize>,
    shown_rooms: usize,
    room_count: usize,
    /// Objects in the order in which they go.
    peripheral: Vec<usize>,
    focal: Vec<usize>,
    captions: usize,
    places: usize,
    instruction_bytes: usize,
}

/// Places that survive the peripheral objects.
const KEPT_PLACES: usize = 2;

impl Plan {
    fn new(tiers: &Tiers, instruction: &str, config: &PromptConfig) -> Plan {
        let mut rooms: Vec<usize> = (0..tiers.rooms.len()).collect();
        // Unasked before asked, far before near; `tiers.rooms` is sorted by distance.
        rooms.sort_by_key(|index| (tiers.rooms[*index].is_asked, std::cmp::Reverse(*index)));
        let hidden = rooms.len().saturating_sub(MAX_ROOMS);
        let rooms: Vec<usize> = rooms.split_off(hidden);
        let captioned = tiers.focal.iter().filter(|item| item.is_asked && !item.caption.is_empty()).count();
        Plan {
            shown_rooms: rooms.len(),
            rooms,
            room_count: tiers.rooms.len(),
            peripheral: dropping_order(&tiers.peripheral),
            focal: dropping_order(&tiers.focal),
            captions: captioned.min(config.max_captions),
            places: tiers.places.len(),
            instruction_bytes: instruction.len(),
        }
    }

    fn steps(&self) -> usize {
        2 * self.shown_rooms + self.peripheral.len() + self.places + self.captions + self.focal.len()
    }

    /// The detail after `count` steps of dropping.
    fn after(&self, count: usize) -> Detail {
        let mut left = count;
        let mut take = |most: usize| {
            let taken = left.min(most);
            left -= taken;
            taken
        };
        let mut rooms = vec![0; self.room_count];
        let room_steps = take(2 * self.shown_rooms);
        for (position, index) in self.rooms.iter().enumerate() {
            rooms[*index] = 2 - room_steps.saturating_sub(2 * position).min(2) as u8;
        }
        let peripheral = take(self.peripheral.len());
        let far_places = take(self.places.saturating_sub(KEPT_PLACES));
        let captions = take(self.captions);
        let focal = take(self.focal.len());
        let places = self.places - far_places - take(self.places.min(KEPT_PLACES));
        let kept = |order: &[usize], dropped: usize| {
            let mut kept = order[dropped..].to_vec();
            kept.sort_unstable();
            kept
        };
        Detail {
            captions: self.captions - captions,
            focal: kept(&self.focal, focal),
            peripheral: kept(&self.peripheral, peripheral),
            rooms,
            places,
            instruction_bytes: self.instruction_bytes,
        }
    }
}

/// Unasked before asked, far before near, at most [`MAX_ITEMS`] of the nearest.
fn dropping_order(items: &[Item]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|index| (items[*index].is_asked, std::cmp::Reverse(*index)));
    let hidden = order.len().saturating_sub(MAX_ITEMS);
    order.split_off(hidden)
}
