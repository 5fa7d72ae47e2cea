//! Blocks in the order of their last change, newest first: readers that come now and then find what changed without looking at the rest.

use crate::block::NONE;

/// A doubly linked list over block numbers.
#[derive(Debug, Clone)]
pub(crate) struct Recent {
    newest: u32,
    /// (newer, older) of each block.
    beside: Vec<[u32; 2]>,
}

impl Default for Recent {
    fn default() -> Self {
        Self { newest: NONE, beside: Vec::new() }
    }
}

impl Recent {
    /// A new block, numbered in the order of making; it is the newest.
    pub fn push(&mut self) {
        let id = self.beside.len() as u32;
        self.beside.push([NONE; 2]);
        self.put_first(id);
    }

    /// The block has changed just now.
    pub fn renew(&mut self, id: u32) {
        if self.newest == id {
            return;
        }
        let [newer, older] = self.beside[id as usize];
        self.beside[newer as usize][1] = older;
        if older != NONE {
            self.beside[older as usize][0] = newer;
        }
        self.put_first(id);
    }

    /// A block is gone; the last one takes its number.
    pub fn remove(&mut self, id: u32) {
        let [newer, older] = self.beside[id as usize];
        self.tie(newer, older);
        let moved = self.beside.pop().expect("there is a block to remove");
        if (id as usize) < self.beside.len() {
            self.beside[id as usize] = moved;
            self.tie(moved[0], id);
            self.tie(id, moved[1]);
        }
    }

    /// All blocks, newest change first.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        let at = |id: u32| (id != NONE).then_some(id);
        std::iter::successors(at(self.newest), move |id| at(self.beside[*id as usize][1]))
    }

    fn tie(&mut self, newer: u32, older: u32) {
        match newer {
            NONE => self.newest = older,
            newer => self.beside[newer as usize][1] = older,
        }
        if older != NONE {
            self.beside[older as usize][0] = newer;
        }
    }

    fn put_first(&mut self, id: u32) {
        self.beside[id as usize] = [NONE, self.newest];
        if self.newest != NONE {
            self.beside[self.newest as usize][0] = id;
        }
        self.newest = id;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_renewed_comes_first() {
        let mut recent = Recent::default();
        assert_eq!(recent.iter().count(), 0);
        for _ in 0..4 {
            recent.push();
        }
        for id in [1, 1, 0, 3] {
            recent.renew(id);
        }
        assert_eq!(recent.iter().collect::<Vec<_>>(), [3, 0, 1, 2]);
        recent.renew(2);
        assert_eq!(recent.iter().collect::<Vec<_>>(), [2, 3, 0, 1]);
        // Number 3 becomes number 0.
        recent.remove(0);
        assert_eq!(recent.iter().collect::<Vec<_>>(), [2, 0, 1]);
        recent.remove(2);
        assert_eq!(recent.iter().collect::<Vec<_>>(), [0, 1]);
        recent.remove(0);
        recent.remove(0);
        assert_eq!(recent.iter().count(), 0);
    }
}
