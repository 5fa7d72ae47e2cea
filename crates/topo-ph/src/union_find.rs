//! Disjoint sets whose root is chosen by the caller (the elder rule decides who survives, not the rank).

/// Disjoint sets over 0..n with path halving: O(log n) amortised a call, in practice flat.
#[derive(Debug, Clone)]
pub(crate) struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    pub(crate) fn new(len: usize) -> UnionFind {
        UnionFind { parent: (0..len as u32).collect() }
    }

    pub(crate) fn find(&mut self, mut member: u32) -> u32 {
        while self.parent[member as usize] != member {
            let grandparent = self.parent[self.parent[member as usize] as usize];
            self.parent[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    /// Hangs the root `absorbed` below the root `survivor`.
    pub(crate) fn attach(&mut self, absorbed: u32, survivor: u32) {
        self.parent[absorbed as usize] = survivor;
    }
}
