//! Ops on places, rooms and buildings, with their consequences.

use std::sync::Arc;

use crate::apply::Edit;
use crate::check::{check_place, check_place_edge, check_point, check_range};
use crate::group::Group;
use crate::ids::{PlaceId, RoomId};
use crate::object::Object;
use crate::op::OpError;
use crate::place::{Place, PlaceEdge};
use crate::room::{Building, Room, RoomEdge};

impl Edit<'_> {
    pub(crate) fn put_place(&mut self, mut place: Place) -> Result<(), OpError> {
        check_place(&place)?;
        place.room = self.graph.place(place.id).and_then(|known| known.room);
        self.set_place(place.id, Some(place));
        Ok(())
    }

    pub(crate) fn remove_place(&mut self, id: PlaceId) -> Result<(), OpError> {
        let place = *self.graph.place(id).ok_or(OpError::NoPlace(id))?;
        let neighbours: Vec<PlaceId> = self.graph.place_neighbours(id).collect();
        for other in neighbours {
            self.set_place_edge((id.min(other), id.max(other)), None);
        }
        let objects: Vec<Arc<Object>> =
            self.graph.objects.values().filter(|object| object.place == Some(id)).cloned().collect();
        for object in objects {
            self.set_object(object.id, Some(Arc::new(Object { place: None, ..(*object).clone() })));
        }
        if let Some(room) = place.room {
            self.leave_room(id, room);
        }
        self.set_place(id, None);
        Ok(())
    }

    pub(crate) fn put_place_edge(&mut self, edge: PlaceEdge) -> Result<(), OpError> {
        check_place_edge(&edge)?;
        let (a, b) = (edge.a.min(edge.b), edge.a.max(edge.b));
        for id in [a, b] {
            self.graph.place(id).ok_or(OpError::NoPlace(id))?;
        }
        self.set_place_edge((a, b), Some(PlaceEdge { a, b, ..edge }));
        Ok(())
    }

    /// Takes a place out of its room's list.
    pub(crate) fn leave_room(&mut self, place: PlaceId, room: RoomId) {
        if let Some(mut changed) = self.graph.room(room).cloned() {
            changed.places.retain(|member| *member != place);
            self.set_room(room, Some(Arc::new(changed)));
        }
    }

    // Rooms and buildings

    pub(crate) fn put_room(&mut self, mut room: Room) -> Result<(), OpError> {
        check_point("room", "center", &room.center)?;
        check_range("room", "area_m2", room.area_m2, 0.0)?;
        check_range("room", "kind_confidence", room.kind_confidence, 0.0)?;
        self.check_room_name(room.id, &room.name)?;
        room.places.sort_unstable();
        room.places.dedup();
        for place in &room.places {
            self.graph.place(*place).ok_or(OpError::NoPlace(*place))?;
        }
        let old = self.graph.room(room.id).map(|known| known.places.clone()).unwrap_or_default();
        for place in old.iter().filter(|place| room.places.binary_search(place).is_err()) {
            self.set_room_of_place(*place, None);
        }
        // Places that come from other rooms, room by room: one change per room, not one per place.
        let mut others: Vec<RoomId> = room.places.iter().filter_map(|place| self.graph.places[place].room).collect();
        others.sort_unstable();
        others.dedup();
        for other in others.into_iter().filter(|other| *other != room.id) {
            if let Some(mut changed) = self.graph.room(other).cloned() {
                changed.places.retain(|place| room.places.binary_search(place).is_err());
                self.set_room(other, Some(Arc::new(changed)));
            }
        }
        for place in &room.places {
            self.set_room_of_place(*place, Some(room.id));
        }
        self.set_room(room.id, Some(Arc::new(room)));
        Ok(())
    }

    pub(crate) fn check_room_name(&self, id: RoomId, name: &str) -> Result<(), OpError> {
        let taken = self.graph.rooms().any(|room| room.id != id && room.name == name);
        if name.trim().is_empty() || taken {
            return Err(OpError::BadName { node: "room", field: "name" });
        }
        Ok(())
    }

    pub(crate) fn set_room_of_place(&mut self, id: PlaceId, room: Option<RoomId>) {
        let place = self.graph.places[&id];
        self.set_place(id, Some(Place { room, ..place }));
    }

    pub(crate) fn remove_room(&mut self, id: RoomId) -> Result<(), OpError> {
        let room = self.graph.rooms.get(&id).cloned().ok_or(OpError::NoRoom(id))?;
        for place in &room.places {
            self.set_room_of_place(*place, None);
        }
        let objects: Vec<Arc<Object>> =
            self.graph.objects.values().filter(|object| object.room == Some(id)).cloned().collect();
        for object in objects {
            self.set_object(object.id, Some(Arc::new(Object { room: None, ..(*object).clone() })));
        }
        let groups: Vec<Arc<Group>> =
            self.graph.groups.values().filter(|group| group.room == Some(id)).cloned().collect();
        for group in groups {
            self.set_group(group.id, Some(Arc::new(Group { room: None, ..(*group).clone() })));
        }
        let doors: Vec<(RoomId, RoomId)> =
            self.graph.room_edges.keys().filter(|(a, b)| *a == id || *b == id).copied().collect();
        for door in doors {
            self.set_room_edge(door, None);
        }
        let buildings: Vec<Arc<Building>> =
            self.graph.buildings.values().filter(|building| building.rooms.contains(&id)).cloned().collect();
        for building in buildings {
            let mut changed = (*building).clone();
            changed.rooms.retain(|member| *member != id);
            self.set_building(changed.id, Some(Arc::new(changed)));
        }
        self.set_room(id, None);
        Ok(())
    }

    pub(crate) fn name_room(&mut self, id: RoomId, name: String) -> Result<(), OpError> {
        let room = self.graph.room(id).ok_or(OpError::NoRoom(id))?.clone();
        let name = name.trim().to_owned();
        self.check_room_name(id, &name)?;
        self.set_room(id, Some(Arc::new(Room { name, is_user_named: true, ..room })));
        Ok(())
    }

    pub(crate) fn put_room_edge(&mut self, edge: RoomEdge) -> Result<(), OpError> {
        check_point("room edge", "doorway", &edge.doorway)?;
        check_range("room edge", "width_m", edge.width_m, 0.0)?;
        let (a, b) = (edge.a.min(edge.b), edge.a.max(edge.b));
        if a == b {
            return Err(OpError::SelfJoin);
        }
        for id in [a, b] {
            self.graph.room(id).ok_or(OpError::NoRoom(id))?;
        }
        self.set_room_edge((a, b), Some(RoomEdge { a, b, ..edge }));
        Ok(())
    }

    pub(crate) fn put_building(&mut self, mut building: Building) -> Result<(), OpError> {
        check_point("building", "center", &building.center)?;
        for storey in &building.storeys {
            check_range("building", "height_m", storey.height_m, f64::NEG_INFINITY)?;
        }
        building.rooms.sort_unstable();
        building.rooms.dedup();
        for room in &building.rooms {
            self.graph.room(*room).ok_or(OpError::NoRoom(*room))?;
        }
        self.set_building(building.id, Some(Arc::new(building)));
        Ok(())
    }
}
