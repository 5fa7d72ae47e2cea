//! One cell: where its vertex lies and what it is called. Corner k of a cell lies at `(k & 1, k >> 1 & 1, k >> 2)`.

use crate::votes::Votes;

/// Mean of the crossings on the edges of a cell that has some, in voxels from the cell's first voxel centre.
///
/// Inlined and without branches, so that a loop over cells becomes a loop over lanes of cells.
#[inline(always)]
pub(super) fn cell_vertex(d: [f32; 8]) -> [f32; 3] {
    // The four edges of an axis: whether the surface crosses them, and where.
    let along = |first: [usize; 4], step: usize| {
        let mut crossing = [0f32; 4];
        let mut at = [0f32; 4];
        for (edge, a) in first.into_iter().enumerate() {
            let (a, b) = (d[a], d[a + step]);
            let is_crossing = (a < 0.0) != (b < 0.0);
            crossing[edge] = if is_crossing { 1.0 } else { 0.0 };
            at[edge] = if is_crossing { a / (a - b) } else { 0.0 };
        }
        (crossing, at)
    };
    let (cx, x) = along([0, 2, 4, 6], 1);
    let (cy, y) = along([0, 1, 4, 5], 2);
    let (cz, z) = along([0, 1, 2, 3], 4);
    let sum = |v: [f32; 4]| (v[0] + v[1]) + (v[2] + v[3]);
    let scale = 1.0 / (sum(cx) + sum(cy) + sum(cz));
    [
        (sum(x) + (cy[1] + cy[3]) + (cz[1] + cz[3])) * scale,
        (sum(y) + (cx[1] + cx[3]) + (cz[2] + cz[3])) * scale,
        (sum(z) + (cx[2] + cx[3]) + (cy[2] + cy[3])) * scale,
    ]
}

/// Label and instance of a cell's vertex: what leads in the voxel nearest to it, or where nobody voted on that one, what has the most
/// votes among the eight voxels of the cell; ties to the smaller. The votes are those of a block and its positive neighbours.
pub(super) fn cell_tag(votes: &[&Votes; 8], cell: [usize; 3], offset: [f32; 3]) -> (u16, u16) {
    let slot_of = |dx: usize, dy: usize, dz: usize| {
        let [x, y, z] = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
        let local = (x & 7) | (y & 7) << 3 | (z & 7) << 6;
        (votes[x >> 3 | y >> 3 << 1 | z >> 3 << 2], local)
    };
    let [dx, dy, dz] = offset.map(|part| usize::from(part > 0.5));
    let (nearest, local) = slot_of(dx, dy, dz);
    if let Some(tag) = nearest.leader(local) {
        return tag;
    }
    let mut voted = [((0, 0), 0); 8];
    let mut len = 0;
    for corner in 0..8 {
        let (votes, local) = slot_of(corner & 1, corner >> 1 & 1, corner >> 2);
        // Written in any case and overwritten if nobody voted: which voxels were voted on no branch can foresee.
        voted[len] = ((votes.label[local], votes.instance_at(local)), u32::from(votes.count[local]));
        len += usize::from(votes.count[local] > 0);
    }
    match &voted[..len] {
        [] => (0, 0),
        // Mostly all that voted agree.
        [(first, _), rest @ ..] if rest.iter().all(|(tag, _)| tag == first) => *first,
        voted => {
            let tally = |tag| voted.iter().filter(|vote| vote.0 == tag).map(|vote| vote.1).sum::<u32>();
            let tags = voted.iter().map(|vote| vote.0);
            tags.max_by_key(|tag| (tally(*tag), std::cmp::Reverse(*tag))).unwrap_or((0, 0))
        }
    }
}
