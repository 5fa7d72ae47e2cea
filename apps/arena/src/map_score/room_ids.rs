//! Whether rooms keep their ids while the robot goes on: the replay of a run.
//!
//! A true room is followed from the moment the robot has been in it with its whole circle. At every refresh the id that most
//! of its places have is its id (the one it had wins a tie); every time that is another one than before counts.

use std::collections::BTreeMap;

use mission::dsg::RoomId;
use nalgebra::{Point2, Vector2};
use omni_sim::building::RoomTruth;
use serde::Serialize;

/// Figures of the replay.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct RoomIdFigures {
    /// How often the id of a true room changed.
    pub changes: usize,
    /// True rooms that were followed.
    pub rooms: usize,
    /// Moments at which they were looked at.
    pub looks: usize,
}

impl RoomIdFigures {
    /// Of several buildings.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a RoomIdFigures>) -> RoomIdFigures {
        all.fold(RoomIdFigures::default(), |sum, one| RoomIdFigures {
            changes: sum.changes + one.changes,
            rooms: sum.rooms + one.rooms,
            looks: sum.looks + one.looks,
        })
    }
}

/// Follows the rooms of one building.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoomIds {
    /// Id of each room that has been entered; `None` until it has places with a room.
    id_of: BTreeMap<u32, Option<RoomId>>,
    figures: RoomIdFigures,
    /// What happened: true room, old id, new id, when in seconds.
    pub changes: Vec<(u32, RoomId, RoomId, f64)>,
}

impl RoomIds {
    /// The robot is in this room with all of its circle.
    pub fn enter(&mut self, room: u32) {
        self.id_of.entry(room).or_insert(None);
    }

    /// A moment: for each place the true room it lies in and the id it has.
    pub fn look(&mut self, now_s: f64, places: impl IntoIterator<Item = (u32, RoomId)>) {
        let mut votes: BTreeMap<u32, BTreeMap<RoomId, usize>> = BTreeMap::new();
        for (room, id) in places {
            *votes.entry(room).or_default().entry(id).or_insert(0) += 1;
        }
        self.figures.looks += 1;
        for (room, known) in &mut self.id_of {
            let ids = votes.get(room).into_iter().flatten();
            let best = ids.max_by_key(|(id, count)| (**count, Some(**id) == *known, std::cmp::Reverse(**id)));
            let Some((id, _)) = best else { continue };
            if let Some(known) = *known
                && known != *id
            {
                self.figures.changes += 1;
                self.changes.push((*room, known, *id, now_s));
            }
            *known = Some(*id);
        }
    }

    /// The figures so far.
    pub fn figures(&self) -> RoomIdFigures {
        RoomIdFigures { rooms: self.id_of.len(), ..self.figures.clone() }
    }
}

/// The room in which a circle lies wholly, as eight points on it say.
pub fn room_round(rooms: &[RoomTruth], at: &Point2<f64>, radius_m: f64) -> Option<u32> {
    let room = rooms.iter().find(|room| room.contains(at))?;
    let on_circle = |k: u32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
        at + Vector2::new(cos, sin) * radius_m
    };
    (0..8).all(|k| room.contains(&on_circle(k))).then_some(room.id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map_score::test_things::room;

    #[test]
    fn a_flip_counts_and_what_comes_before_the_visit_does_not() {
        let mut ids = RoomIds::default();
        let look = |ids: &mut RoomIds, of: &[u64]| ids.look(1.0, of.iter().map(|id| (0, RoomId(*id))));
        look(&mut ids, &[1, 1]);
        look(&mut ids, &[2, 2]);
        ids.enter(0);
        look(&mut ids, &[3, 3, 4]);
        look(&mut ids, &[3, 4]);
        assert_eq!(ids.figures().changes, 0, "a tie is no change");
        look(&mut ids, &[]);
        look(&mut ids, &[3, 4, 4]);
        assert_eq!(ids.figures(), RoomIdFigures { changes: 1, rooms: 1, looks: 6 });
        assert_eq!(ids.changes, [(0, RoomId(3), RoomId(4), 1.0)]);
    }

    #[test]
    fn half_in_the_door_is_not_in_the_room() {
        let rooms = [room(0, [0.0, 0.0, 4.0, 4.0]), room(1, [4.1, 0.0, 8.0, 4.0])];
        assert_eq!(room_round(&rooms, &Point2::new(2.0, 2.0), 0.4), Some(0));
        assert_eq!(room_round(&rooms, &Point2::new(3.8, 2.0), 0.4), None);
        assert_eq!(room_round(&rooms, &Point2::new(4.05, 2.0), 0.4), None);
        assert_eq!(room_round(&rooms, &Point2::new(4.6, 2.0), 0.4), Some(1));
    }
}
