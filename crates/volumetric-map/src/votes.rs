//! Whose is this voxel? Votes for a label and an instance, one slot a voxel.
//!
//! A Misra-Gries count with one slot (Boyer and Moore's majority vote): a vote that agrees adds one, one that disagrees takes one away, at
//! zero the newcomer takes over. Whatever has more than half of all votes wins, in any order. What is voted for is the pair of label and
//! instance; most maps know no instances and carry no memory for them.

use crate::block::BLOCK_VOXELS;

/// Votes of a block; only blocks that were voted on carry them.
#[derive(Debug, Clone)]
pub(crate) struct Votes {
    /// Leading label, 0 = none.
    pub label: [u16; BLOCK_VOXELS],
    /// Its lead.
    pub count: [u8; BLOCK_VOXELS],
    /// Leading instance, 0 = none; absent as long as nobody named one.
    pub instance: Option<Box<[u16; BLOCK_VOXELS]>>,
}

impl Votes {
    /// No votes yet.
    pub const NONE: Self = Self { label: [0; BLOCK_VOXELS], count: [0; BLOCK_VOXELS], instance: None };

    /// No votes yet.
    pub fn none() -> Box<Self> {
        Box::new(Self::NONE)
    }

    /// Label and instance that lead in a voxel; `None` where nobody leads.
    pub fn leader(&self, local: usize) -> Option<(u16, u16)> {
        (self.count[local] > 0).then(|| (self.label[local], self.instance_at(local)))
    }

    /// The instance in the slot, 0 = none.
    pub fn instance_at(&self, local: usize) -> u16 {
        self.instance.as_ref().map_or(0, |instance| instance[local])
    }

    /// Counts some equal votes; true if the voxel has another leader than before, or one for the first time.
    pub fn vote(&mut self, local: usize, label: u16, instance: u16, votes: u8) -> bool {
        let lead = self.count[local];
        if lead > 0 && (self.label[local], self.instance_at(local)) == (label, instance) {
            self.count[local] = lead.saturating_add(votes);
            return false;
        }
        if lead >= votes {
            self.count[local] = lead - votes;
            return false;
        }
        self.label[local] = label;
        self.count[local] = votes - lead;
        if instance != 0 || self.instance.is_some() {
            self.instance.get_or_insert_with(|| Box::new([0; BLOCK_VOXELS]))[local] = instance;
        }
        true
    }

    /// Counts the votes of another block.
    pub fn join(&mut self, other: &Self) {
        for local in 0..BLOCK_VOXELS {
            if other.count[local] > 0 {
                self.vote(local, other.label[local], other.instance_at(local), other.count[local]);
            }
        }
    }

    /// Memory taken, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.instance.as_ref().map_or(0, |_| size_of::<[u16; BLOCK_VOXELS]>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_majority_by_hand() {
        let mut votes = Votes::none();
        assert_eq!(votes.leader(5), None);
        for (label, leader) in [(7, Some((7, 0))), (3, None), (3, Some((3, 0))), (3, Some((3, 0))), (7, Some((3, 0)))] {
            votes.vote(5, label, 0, 1);
            assert_eq!(votes.leader(5), leader);
        }
        assert!(votes.instance.is_none(), "no memory for instances that nobody named");
        assert!(votes.vote(6, 3, 11, 1));
        assert!(!votes.vote(6, 3, 12, 1), "the same label, but another thing");
        assert!(votes.vote(6, 3, 12, 1));
        assert_eq!((votes.leader(6), votes.leader(5)), (Some((3, 12)), Some((3, 0))));
        let mut other = Votes::none();
        other.vote(6, 4, 0, 9);
        votes.join(&other);
        assert_eq!((votes.leader(6), votes.count[6]), (Some((4, 0)), 8));
    }
}
