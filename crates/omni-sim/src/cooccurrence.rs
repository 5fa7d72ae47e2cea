//! Which things stand in which kind of room: as people have it, exchanged between the kinds, or anything anywhere.
//!
//! A room keeps what gives it its name (a bedroom its bed and wardrobe, see [`essentials`](crate::furniture::essentials)), so a sentence
//! about a bedroom can be judged by anybody who looks. All else it may have from another kind of room, and what stands on a
//! table from another support: whoever has learned that mugs are in kitchens has learned nothing.

use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::building::RoomKind;

/// What occurs together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cooccurrence {
    /// What people have: the tables of [`crate::furniture`] and [`crate::small_things`].
    #[default]
    Usual,
    /// The tables of the kinds of rooms, and those of the supports, exchanged by a permutation drawn from the building's seed.
    Shuffled,
    /// Any thing that gives no room its name, in any room; any small thing on any support on which it fits.
    Uniform,
}

/// Things that carry others.
const SUPPORTS: [&str; 22] = [
    "counter",
    "dining table",
    "kitchen table",
    "coffee table",
    "side table",
    "nightstand",
    "desk",
    "conference table",
    "workbench",
    "console table",
    "reception desk",
    "bookshelf",
    "storage rack",
    "dresser",
    "sideboard",
    "tv stand",
    "filing cabinet",
    "shoe cabinet",
    "washing machine",
    "cabinet",
    "sofa",
    "bed",
];

/// The habits of one building: whose tables a room and a support follow.
#[derive(Debug, Clone)]
pub struct Habits {
    /// What occurs together.
    pub cooccurrence: Cooccurrence,
    kinds: [RoomKind; RoomKind::ALL.len()],
    supports: [&'static str; SUPPORTS.len()],
}

impl Habits {
    /// Of the building of a seed.
    pub fn of(cooccurrence: Cooccurrence, seed: u64) -> Habits {
        let mut habits = Habits { cooccurrence, kinds: RoomKind::ALL, supports: SUPPORTS };
        if cooccurrence == Cooccurrence::Shuffled {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(3);
            habits.kinds.shuffle(&mut rng);
            habits.supports.shuffle(&mut rng);
        }
        habits
    }

    /// The kind whose table a room of this kind follows, but for what gives it its name.
    pub fn table_of(&self, kind: RoomKind) -> RoomKind {
        RoomKind::ALL.iter().position(|k| *k == kind).map_or(kind, |at| self.kinds[at])
    }

    /// The support whose table a support follows.
    pub fn support_of(&self, name: &'static str) -> &'static str {
        SUPPORTS.iter().position(|s| *s == name).map_or(name, |at| self.supports[at])
    }

    /// Any kind.
    pub fn any_kind(rng: &mut ChaCha8Rng) -> RoomKind {
        RoomKind::ALL[rng.random_range(0..RoomKind::ALL.len())]
    }

    /// Any support.
    pub fn any_support(rng: &mut ChaCha8Rng) -> &'static str {
        SUPPORTS.choose(rng).copied().unwrap_or("desk")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_tables_are_a_permutation_and_usual_ones_stay() {
        for seed in 0..20 {
            let habits = Habits::of(Cooccurrence::Shuffled, seed);
            let mut all: Vec<RoomKind> = RoomKind::ALL.iter().map(|k| habits.table_of(*k)).collect();
            all.sort_unstable();
            let mut kinds = RoomKind::ALL;
            kinds.sort_unstable();
            assert_eq!(all, kinds);
            let usual = Habits::of(Cooccurrence::Usual, seed);
            assert!(RoomKind::ALL.iter().all(|k| usual.table_of(*k) == *k));
            assert!(SUPPORTS.iter().all(|s| usual.support_of(s) == *s));
        }
    }
}
