//! How well a plan suits: areas near the wish, decent proportions, kitchens beside dining rooms.

use crate::building::RoomKind;
use crate::floorplan::{Cells, PlanRoom, shared_border};
use crate::program::{RoomWish, is_small};

/// How badly a room fits its wish; `None` if nobody could live with it.
pub fn room_cost(wish: &RoomWish, parts: &[Cells]) -> Option<f64> {
    let area: f64 = parts.iter().map(Cells::area_m2).sum();
    let small = is_small(wish.kind);
    let (least_side, least_area) = if small { (2.2, 6.0) } else { (2.9, 9.5) };
    // The main part of an L may be as narrow as a small room, since the rest widens it.
    let side_needed = match wish.kind {
        // A table with chairs on both sides and a way round it.
        RoomKind::MeetingRoom => 4.3,
        RoomKind::DiningRoom => 3.7,
        RoomKind::LivingRoom | RoomKind::Lounge => 3.3,
        _ if parts.len() > 1 => 2.5,
        _ => least_side,
    };
    if parts[0].short_m() < side_needed || area < least_area || area > 42.0 {
        return None;
    }
    let stretch = (area / wish.area_m2).ln();
    let long = (parts[0].aspect() - 1.5).max(0.0);
    if long > 1.1 {
        return None;
    }
    Some(stretch * stretch + 0.6 * long * long)
}

/// Rewards kitchens beside dining and living rooms, and bathrooms beside bedrooms.
pub fn neighbour_bonus(rooms: &[PlanRoom]) -> f64 {
    use RoomKind::*;
    let mut bonus = 0.0;
    for (i, a) in rooms.iter().enumerate() {
        for b in &rooms[i + 1..] {
            let value = match (a.kind.min(b.kind), a.kind.max(b.kind)) {
                (LivingRoom, Kitchen) | (Kitchen, DiningRoom) | (LivingRoom, DiningRoom) => 0.15,
                (Bedroom, Bathroom) => 0.08,
                _ => 0.0,
            };
            if value > 0.0 && a.parts.iter().any(|p| b.parts.iter().any(|q| shared_border(p, q).is_some())) {
                bonus += value;
            }
        }
    }
    bonus
}
