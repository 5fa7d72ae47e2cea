//! Which neighbouring rooms get a doorway, how wide, and where in the wall.
//!
//! A maximum spanning tree over the shared walls, weighted by custom (rooms open to the corridor, kitchens to dining rooms,
//! nobody walks through a bathroom), plus a few further doors that custom allows.

use rand::{Rng, RngExt};

use crate::building::RoomKind;
use crate::floorplan::{Border, StoreyPlan, UNIT_M, shared_border};

/// Wall left on both sides of a doorway, plan units: half a wall and 15 cm.
const JAMB: i32 = 5;

/// A doorway in plan units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanDoor {
    /// Indices of the rooms in the storey's plan, smaller first.
    pub rooms: (usize, usize),
    /// The wall's centre line with the jambs as its ends.
    pub opening: Border,
}

impl PlanDoor {
    /// Clear width, metres.
    pub fn width_m(&self) -> f64 {
        f64::from(self.opening.to - self.opening.from) * UNIT_M
    }
}

/// Doorways of one storey; `None` if some room has no wall long enough for one.
pub fn draw_doors(rng: &mut impl Rng, plan: &StoreyPlan, min_door_m: f64) -> Option<Vec<PlanDoor>> {
    let least = (min_door_m / UNIT_M - 1e-9).ceil() as i32;
    let mut candidates = Vec::new();
    for a in 0..plan.rooms.len() {
        for b in a + 1..plan.rooms.len() {
            if let Some(border) = longest_border(plan, a, b)
                && border.to - border.from >= least + 2 * JAMB
            {
                let custom = custom(plan.rooms[a].kind, plan.rooms[b].kind);
                candidates.push((custom + rng.random_range(0.0..0.5), a, b, border, custom));
            }
        }
    }
    candidates.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1, x.2).cmp(&(y.1, y.2))));

    // Rooms that nobody should have to walk through come last, as leaves of the tree; if that leaves the building in pieces,
    // any wall will do.
    let is_private = |i: usize| is_private(plan.rooms[i].kind);
    let mut group: Vec<usize> = (0..plan.rooms.len()).collect();
    let mut doors: Vec<PlanDoor> = Vec::new();
    for pass in 0..3 {
        for &(_, a, b, border, custom) in &candidates {
            let turn = match (is_private(a), is_private(b)) {
                (false, false) => 0,
                (true, true) => 2,
                _ => 1,
            };
            let joins = group[a] != group[b];
            // A door more than needed only where custom likes it.
            let extra = !joins && (4.0..9.0).contains(&custom) && turn == pass && rng.random_bool(0.3);
            let leaf_is_placed = pass == 1
                && [a, b].iter().any(|&r| is_private(r) && doors.iter().any(|d| d.rooms.0 == r || d.rooms.1 == r));
            if turn > pass || !((joins && !leaf_is_placed) || extra) {
                continue;
            }
            let (ka, kb) = (plan.rooms[a].kind, plan.rooms[b].kind);
            if let Some(opening) = place(rng, &border, least, width_range(ka, kb), &doors) {
                doors.push(PlanDoor { rooms: (a, b), opening });
                let (from, to) = (group[a], group[b]);
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    doors.sort_by_key(|d| (d.rooms, d.opening.line, d.opening.from));
    group.iter().all(|g| *g == group[0]).then_some(doors)
}

/// Rooms nobody should have to walk through.
pub(crate) fn is_private(kind: RoomKind) -> bool {
    matches!(kind, RoomKind::Bathroom | RoomKind::Restroom | RoomKind::StorageRoom | RoomKind::LaundryRoom)
}

/// True if the only way between two other rooms leads through a bathroom, a storage room or the like.
pub fn leads_through_private_rooms(plan: &StoreyPlan, doors: &[PlanDoor]) -> bool {
    (0..plan.rooms.len()).filter(|&i| is_private(plan.rooms[i].kind)).any(|hidden| {
        let start = usize::from(hidden == 0);
        let mut known = vec![false; plan.rooms.len()];
        known[start] = true;
        let open = |d: &&PlanDoor| d.rooms.0 != hidden && d.rooms.1 != hidden;
        while let Some(d) = doors.iter().filter(open).find(|d| known[d.rooms.0] != known[d.rooms.1]) {
            (known[d.rooms.0], known[d.rooms.1]) = (true, true);
        }
        (0..known.len()).any(|i| i != hidden && !known[i])
    })
}

/// How natural a doorway between two kinds of rooms is.
fn custom(a: RoomKind, b: RoomKind) -> f64 {
    use RoomKind::*;
    let is_way = |k: RoomKind| matches!(k, Hallway | Corridor);
    match (a.min(b), a.max(b)) {
        (a, b) if is_way(a) && is_way(b) => 12.0,
        (a, b) if is_way(a) || is_way(b) => 10.0,
        (Stairwell, _) | (_, Stairwell) => 0.0,
        (LivingRoom, Kitchen) | (Kitchen, DiningRoom) | (LivingRoom, DiningRoom) => 6.0,
        (LivingRoom, Study | Bedroom) => 5.0,
        (LivingRoom, _) => 3.0,
        (Bedroom, Bathroom) => 4.0,
        (Kitchen, LaundryRoom | StorageRoom) => 4.0,
        (Office, Reception) | (MeetingRoom, Reception) => 5.0,
        (Office, Office) => 4.0,
        (Lab, Lab) | (Office, Lab) | (Office, PrintRoom) => 4.0,
        (_, Bathroom | Restroom) | (Bathroom | Restroom, _) => 0.5,
        (Kitchen, Bedroom) => 1.5,
        _ => 2.0,
    }
}

/// Widest and narrowest usual doorway, plan units.
fn width_range(a: RoomKind, b: RoomKind) -> (i32, i32) {
    use RoomKind::*;
    let public =
        |k: RoomKind| matches!(k, Hallway | Corridor | LivingRoom | Lounge | Reception | DiningRoom | Stairwell);
    match (public(a), public(b)) {
        (true, true) => (24, 28),
        _ => (20, 23),
    }
}

/// A place for the opening in the border, clear of the other openings of the same wall: mostly near one end, as builders
/// like it, because that leaves a long wall for furniture.
fn place(rng: &mut impl Rng, border: &Border, least: i32, usual: (i32, i32), others: &[PlanDoor]) -> Option<Border> {
    let room = border.to - border.from - 2 * JAMB;
    let width = rng.random_range(usual.0..=usual.1).max(least).min(room.max(least));
    let slack = room - width;
    if slack < 0 {
        return None;
    }
    for attempt in 0..20 {
        let offset = match rng.random_range(0..4) {
            _ if attempt > 10 => rng.random_range(0..=slack),
            0 => slack / 2,
            1 => slack - rng.random_range(0..=slack.min(6)),
            2 => rng.random_range(0..=slack.min(6)),
            _ => rng.random_range(0..=slack),
        };
        let from = border.from + JAMB + offset;
        let opening = Border { from, to: from + width, ..*border };
        let clashes = others.iter().any(|d| {
            let o = &d.opening;
            o.vertical == opening.vertical
                && o.line == opening.line
                && o.from < opening.to + 2 * JAMB
                && opening.from < o.to + 2 * JAMB
        });
        if !clashes {
            return Some(opening);
        }
    }
    None
}

/// The longest straight piece of wall between two rooms.
fn longest_border(plan: &StoreyPlan, a: usize, b: usize) -> Option<Border> {
    let pieces =
        plan.rooms[a].parts.iter().flat_map(|p| plan.rooms[b].parts.iter().filter_map(|q| shared_border(p, q)));
    let a_is_stairs = plan.rooms[a].kind == RoomKind::Stairwell;
    let b_is_stairs = plan.rooms[b].kind == RoomKind::Stairwell;
    if (a_is_stairs || b_is_stairs) && custom(plan.rooms[a].kind, plan.rooms[b].kind) < 9.0 {
        return None; // the flights leave no wall to pass but the corridor's
    }
    pieces.max_by_key(|p| (p.to - p.from, -p.line, -p.from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floorplan::{Cells, PlanRoom};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn three_in_a_row() -> StoreyPlan {
        let room = |kind, x| PlanRoom { kind, parts: vec![Cells::new(x, 0, x + 80, 80)] };
        StoreyPlan {
            rooms: vec![room(RoomKind::Bedroom, 0), room(RoomKind::LivingRoom, 80), room(RoomKind::Bathroom, 160)],
        }
    }

    #[test]
    fn three_rooms_in_a_row_get_two_doors() {
        let doors = draw_doors(&mut ChaCha8Rng::seed_from_u64(3), &three_in_a_row(), 1.0).expect("walls are 4 m long");
        assert_eq!(doors.iter().map(|d| d.rooms).collect::<Vec<_>>(), [(0, 1), (1, 2)]);
        assert!(doors.iter().all(|d| d.width_m() >= 1.0 && d.width_m() <= 1.4 + 1e-9));
    }

    #[test]
    fn a_bathroom_between_two_rooms_is_found_out() {
        let mut plan = three_in_a_row();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let doors = draw_doors(&mut rng, &plan, 1.0).expect("walls are 4 m long");
        assert!(!leads_through_private_rooms(&plan, &doors));
        plan.rooms[1].kind = RoomKind::Bathroom;
        let doors = draw_doors(&mut rng, &plan, 1.0).expect("walls are 4 m long");
        assert!(leads_through_private_rooms(&plan, &doors));
    }

    #[test]
    fn a_door_wider_than_the_wall_is_refused() {
        let mut plan = three_in_a_row();
        plan.rooms[1].parts[0].y0 = 60; // 1 m of shared wall is left
        plan.rooms[1].parts[0].y1 = 80;
        assert!(draw_doors(&mut ChaCha8Rng::seed_from_u64(3), &plan, 1.0).is_none());
    }
}
