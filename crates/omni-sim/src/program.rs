//! The programme of a building: which rooms it has and how large each would like to be.
//!
//! Rooms are taken from a list in order of need (a flat of two rooms has no laundry), with a few random swaps so that two
//! buildings of the same size differ in kind as well.

use rand::{Rng, RngExt};

use crate::building::{RoomKind, Style};

/// A room before it has a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoomWish {
    /// Purpose.
    pub kind: RoomKind,
    /// Wanted area, square metres.
    pub area_m2: f64,
}

/// The rooms of one storey, corridors and stairwell not counted, most needed first.
pub fn program(rng: &mut impl Rng, style: Style, storey: u32, count: usize) -> Vec<RoomWish> {
    let mut kinds: Vec<RoomKind> = (0..).flat_map(|round| needs(style, storey, round)).take(count + 2).collect();
    // One late room may be replaced by the next on the list, and neighbours in need may change places.
    if kinds.len() > 4 && rng.random_bool(0.5) {
        let late = rng.random_range(3..kinds.len());
        let last = kinds.len() - 1;
        kinds.swap(late, last);
    }
    if kinds.len() > 3 && rng.random_bool(0.3) {
        kinds.swap(1, 2);
    }
    kinds.truncate(count);
    kinds.into_iter().map(|kind| wish(rng, kind)).collect()
}

/// A wish for one room of a kind.
pub fn wish(rng: &mut impl Rng, kind: RoomKind) -> RoomWish {
    let (low, high) = area_range_m2(kind);
    RoomWish { kind, area_m2: rng.random_range(low..high) }
}

/// Rooms in order of need. Large buildings go through the list again from its later rounds.
fn needs(style: Style, storey: u32, round: usize) -> Vec<RoomKind> {
    use RoomKind::*;
    match (style, storey, round) {
        (Style::Flat, 0, 0) => vec![LivingRoom, Kitchen, Bedroom, Bathroom, Bedroom, Study, DiningRoom, LaundryRoom],
        (Style::Flat, _, 0) => vec![Bedroom, Bathroom, Bedroom, Study, Bedroom, StorageRoom, LivingRoom],
        (Style::Flat, _, _) => vec![Bedroom, Bathroom, StorageRoom, Bedroom, Study, LivingRoom, Bedroom, Kitchen],
        (Style::Office, 0, 0) => vec![Office, MeetingRoom, Kitchen, Reception, Office, Restroom, PrintRoom, Lab],
        (Style::Office, _, 0) => vec![Office, MeetingRoom, Office, Restroom, Lounge, Office, PrintRoom, Lab],
        (Style::Office, _, _) => vec![Office, Lounge, Office, StorageRoom, MeetingRoom, Lab, Office, Kitchen, Restroom],
    }
}

/// Usual floor area of a kind of room, square metres.
fn area_range_m2(kind: RoomKind) -> (f64, f64) {
    use RoomKind::*;
    match kind {
        LivingRoom => (20.0, 32.0),
        Kitchen => (12.0, 18.0),
        DiningRoom => (14.0, 20.0),
        Bedroom => (13.0, 19.0),
        Bathroom => (7.5, 10.5),
        Restroom => (8.5, 13.0),
        Study => (11.0, 16.0),
        LaundryRoom => (8.5, 11.0),
        StorageRoom => (8.5, 12.0),
        Office => (13.0, 24.0),
        MeetingRoom => (20.0, 30.0),
        Lab => (20.0, 32.0),
        PrintRoom => (9.0, 13.0),
        Lounge => (18.0, 28.0),
        Reception => (16.0, 25.0),
        Stairwell => (12.0, 13.0),
        Hallway | Corridor => (8.0, 30.0),
    }
}

/// Rooms that may be narrow and are often cut out of the corner of a larger one.
pub fn is_small(kind: RoomKind) -> bool {
    use RoomKind::*;
    matches!(kind, Bathroom | Restroom | LaundryRoom | StorageRoom | PrintRoom)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_small_flat_has_a_living_room_and_a_kitchen() {
        for seed in 0..50 {
            let kinds: Vec<RoomKind> =
                program(&mut ChaCha8Rng::seed_from_u64(seed), Style::Flat, 0, 4).iter().map(|w| w.kind).collect();
            assert_eq!(kinds.len(), 4);
            assert!(kinds.contains(&RoomKind::LivingRoom) && kinds.contains(&RoomKind::Kitchen), "{kinds:?}");
        }
    }

    #[test]
    fn thirty_rooms_are_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for style in [Style::Flat, Style::Office] {
            assert_eq!(program(&mut rng, style, 0, 30).len(), 30);
        }
    }
}
