//! Fitting a prompt into its budget by dropping detail, the farthest and least relevant first.
//!
//! The order is fixed: areas lose their counts, then their lines (the farthest first); far rooms lose their groups, then their counts (rooms without the asked class first, the farthest first); then
//! peripheral objects, the places beyond the second, captions, and focal objects, each from far to near; last of all, where in the rooms that
//! are folded away the nearest thing asked for is. So "how much must go" is one
//! number, found by bisection with the real counter on the real text: O(log n) renderings.

use crate::names::NameTable;
use crate::prompt::PromptConfig;
use crate::render::{Detail, render};
use crate::tier_items::{Item, Tiers};
use crate::tokens::TokenCounter;

/// Rooms that are shown with groups and distances.
const FULL_ROOMS: usize = 4;

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
    room_count: usize,
    /// Areas in the order in which they lose detail.
    areas: Vec<usize>,
    /// Objects in the order in which they go.
    peripheral: Vec<usize>,
    focal: Vec<usize>,
    captions: usize,
    has_crowd: bool,
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
        let mut areas: Vec<usize> = (0..tiers.areas.len()).collect();
        areas.sort_by_key(|index| (!tiers.areas[*index].asked.is_empty(), std::cmp::Reverse(*index)));
        let captioned = tiers.focal.iter().filter(|item| item.is_asked && !item.caption.is_empty()).count();
        Plan {
            rooms,
            room_count: tiers.rooms.len(),
            areas,
            peripheral: dropping_order(&tiers.peripheral),
            focal: dropping_order(&tiers.focal),
            captions: captioned.min(config.max_captions),
            has_crowd: !tiers.crowd.is_empty(),
            places: tiers.places.len(),
            instruction_bytes: instruction.len(),
        }
    }

    fn steps(&self) -> usize {
        2 * (self.areas.len() + self.rooms.len())
            + usize::from(self.has_crowd)
            + self.peripheral.len()
            + self.places
            + self.captions
            + self.focal.len()
            + 1
    }

    /// The detail after `count` steps of dropping.
    fn after(&self, count: usize) -> Detail {
        let mut left = count;
        let mut take = |most: usize| {
            let taken = left.min(most);
            left -= taken;
            taken
        };
        // One after the other in the given order, each in two steps.
        let levels = |order: &[usize], steps: usize| {
            let mut levels = vec![0; order.len()];
            for (position, index) in order.iter().enumerate() {
                levels[*index] = 2 - steps.saturating_sub(2 * position).min(2) as u8;
            }
            levels
        };
        let areas = levels(&self.areas, take(2 * self.areas.len()));
        let mut rooms = levels(&self.rooms, take(2 * self.room_count));
        // The larger the building, the less of each room: groups and distances of the nearest only, of none where there are areas.
        let full = if self.areas.is_empty() { FULL_ROOMS } else { 0 };
        rooms.iter_mut().skip(full).for_each(|level| *level = (*level).min(1));
        let crowd = take(usize::from(self.has_crowd));
        let peripheral = take(self.peripheral.len());
        let far_places = take(self.places.saturating_sub(KEPT_PLACES));
        let captions = take(self.captions);
        let focal = take(self.focal.len());
        let places = self.places - far_places - take(self.places.min(KEPT_PLACES));
        let asked = take(1) == 0;
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
            areas,
            crowd: crowd == 0,
            asked,
            places,
            instruction_bytes: self.instruction_bytes,
        }
    }
}

/// Unasked before asked, far before near.
fn dropping_order(items: &[Item]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|index| (items[*index].is_asked, std::cmp::Reverse(*index)));
    order
}
