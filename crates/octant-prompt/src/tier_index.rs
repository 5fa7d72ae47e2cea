//! The tiers of another pose in the same graph, without looking at all objects again.
//!
//! What does not depend on the pose is kept: the objects of each room, and how many of each class it holds. A pose then costs the rooms, and the
//! objects of the own room and of the rooms with a line. The plain text of the method is [`crate::tiers`]; both give the same.

use dsg::{Object, RoomId, SceneGraph};
use nalgebra::Point3;
use rustc_hash::FxHashMap;

use crate::situation::room_of;
use crate::tier_items::Tiers;
use crate::tiers::{Classes, Part, PartRows, Parted, View, finish, nearest};

/// The objects of a graph by room, for one instruction.
pub struct TierIndex<'a> {
    graph: &'a SceneGraph,
    classes: Classes<'a>,
    rooms: FxHashMap<Option<RoomId>, Contents<'a>>,
}

#[derive(Default)]
struct Contents<'a> {
    /// Objects with their classes, in the order of ids.
    objects: Vec<(&'a Object, usize)>,
    /// (class, how many).
    counts: Vec<(usize, u32)>,
}

impl<'a> TierIndex<'a> {
    /// Sorts the objects of a graph by room; `nouns` are the classes that the instruction mentions. Linear in objects.
    pub fn new(graph: &'a SceneGraph, nouns: &[String]) -> TierIndex<'a> {
        let mut classes = Classes::new(nouns);
        let mut rooms: FxHashMap<Option<RoomId>, Contents<'a>> = FxHashMap::default();
        for object in graph.objects() {
            let class = classes.of(&object.label);
            let room = rooms.entry(object.room).or_default();
            room.objects.push((object, class));
            match room.counts.iter_mut().find(|(known, _)| *known == class) {
                Some((_, count)) => *count += 1,
                None => room.counts.push((class, 1)),
            }
        }
        TierIndex { graph, classes, rooms }
    }

    /// The tiers of a view of the graph and the nouns that the index was made for: what [`crate::tiers::tiers`] gives.
    ///
    /// # Panics
    /// If the view is one of another graph.
    pub fn tiers(&self, view: &View) -> Tiers {
        assert!(std::ptr::eq(self.graph, view.graph), "the index was made for another graph");
        let position = Point3::from(view.world_from_body.translation.vector);
        let here = room_of(view.graph, &position);
        let homeless = self.rooms.get(&None).into_iter().flat_map(|room| &room.objects);
        let parted = Parted::new(view, here, nearest(homeless.map(|(object, _)| &object.centroid), &position));
        let mut rows = PartRows::new(&parted);
        #[allow(clippy::iter_over_hash_type)] // every part is sorted or added up afterwards
        for (room, contents) in &self.rooms {
            let Some((part, room_m)) = parted.part_of(*room) else { continue };
            if let Part::Area(area) = part {
                for (class, count) in &contents.counts {
                    let asked = room.filter(|_| self.classes.facts[*class].is_asked);
                    rows.count(area, *class, *count, asked.map(|room| (room_m, room)));
                }
            } else {
                contents
                    .objects
                    .iter()
                    .for_each(|(object, class)| rows.list(view, part, object, *class, &self.classes));
            }
        }
        finish(view, here, parted, rows, &self.classes)
    }
}
