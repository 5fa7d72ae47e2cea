//! The near mode: of all points under one mask, those of the thing itself.
//!
//! A mask shows a thing and, through gaps and at its border, what is behind it. The points are linked in space; of the
//! clusters that are big enough the nearest one is the thing. What lies deeper behind its front than a thing of this
//! apparent size is likely to reach is cut off.

use nalgebra::Point3;
use rustc_hash::FxHashMap;

/// Parameters, see [`crate::LabelConfig`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct NearMode {
    pub(crate) link_m: f32,
    pub(crate) link_share: f32,
    pub(crate) near_share: f32,
    pub(crate) depth_ratio: f32,
    pub(crate) min_depth_m: f32,
}

/// The members (indices into `points`, in camera coordinates) that belong to the near mode, in their order.
///
/// `size_rad` is the apparent size of the mask.
pub(crate) fn near_mode(
    points: &[Point3<f32>],
    members: &[u32],
    size_rad: f32,
    config: &NearMode,
) -> Vec<u32> {
    if members.is_empty() {
        return Vec::new();
    }
    let range_m = |&member: &u32| points[member as usize].coords.norm();
    let middle_m = quantile(members.iter().map(range_m).collect(), 0.5);
    let link_m = config.link_m.max(config.link_share * middle_m);
    let cluster_of = linked_clusters(points, members, link_m);
    let cluster = nearest_big_cluster(
        &cluster_of,
        |index| range_m(&members[index]),
        config.near_share,
    );
    let kept: Vec<u32> = members
        .iter()
        .zip(&cluster_of)
        .filter(|(_, c)| **c == cluster)
        .map(|(m, _)| *m)
        .collect();
    // The front is a low quantile, for a single stray return in front must not move it.
    let front_m = quantile(kept.iter().map(range_m).collect(), 0.1);
    let depth_m = config
        .min_depth_m
        .max(config.depth_ratio * size_rad * front_m);
    kept.into_iter()
        .filter(|member| range_m(member) <= front_m + depth_m)
        .collect()
}

/// Cluster number of each member. Cells of edge `link_m` that touch (26 neighbours) are one cluster.
fn linked_clusters(points: &[Point3<f32>], members: &[u32], link_m: f32) -> Vec<u32> {
    let mut cell_at: FxHashMap<[i32; 3], u32> = FxHashMap::default();
    let mut cells: Vec<[i32; 3]> = Vec::new();
    let cell_of_member: Vec<u32> = members
        .iter()
        .map(|&member| {
            let p = &points[member as usize];
            let cell = [p.x, p.y, p.z].map(|x| (x / link_m).floor() as i32);
            *cell_at.entry(cell).or_insert_with(|| {
                cells.push(cell);
                cells.len() as u32 - 1
            })
        })
        .collect();
    let mut cluster_of_cell = vec![u32::MAX; cells.len()];
    let mut clusters = 0;
    let mut open = Vec::new();
    for start in 0..cells.len() {
        if cluster_of_cell[start] != u32::MAX {
            continue;
        }
        cluster_of_cell[start] = clusters;
        open.push(start as u32);
        while let Some(here) = open.pop() {
            let [x, y, z] = cells[here as usize];
            for step in 0..27 {
                let next = [x + step % 3 - 1, y + step / 3 % 3 - 1, z + step / 9 - 1];
                if let Some(&next) = cell_at.get(&next)
                    && cluster_of_cell[next as usize] == u32::MAX
                {
                    cluster_of_cell[next as usize] = clusters;
                    open.push(next);
                }
            }
        }
        clusters += 1;
    }
    cell_of_member
        .into_iter()
        .map(|cell| cluster_of_cell[cell as usize])
        .collect()
}

/// The nearest (by median range) of the clusters with at least `near_share` of the largest one's points.
fn nearest_big_cluster(cluster_of: &[u32], range_m: impl Fn(usize) -> f32, near_share: f32) -> u32 {
    let clusters = cluster_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut ranges: Vec<Vec<f32>> = vec![Vec::new(); clusters];
    for (index, &cluster) in cluster_of.iter().enumerate() {
        ranges[cluster as usize].push(range_m(index));
    }
    let largest = ranges.iter().map(Vec::len).max().unwrap_or(0);
    ranges
        .into_iter()
        .enumerate()
        .filter(|(_, ranges)| ranges.len() as f32 >= near_share * largest as f32)
        .map(|(cluster, ranges)| (quantile(ranges, 0.5), cluster))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
        .map_or(0, |(_, cluster)| cluster as u32)
}

/// The value below which `share` of the numbers lie (the lowest for few numbers); zero for none.
pub(crate) fn quantile(mut numbers: Vec<f32>, share: f32) -> f32 {
    if numbers.is_empty() {
        return 0.0;
    }
    let index = ((numbers.len() - 1) as f32 * share) as usize;
    *numbers.select_nth_unstable_by(index, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: NearMode = NearMode {
        link_m: 0.1,
        link_share: 0.03,
        near_share: 0.25,
        depth_ratio: 2.0,
        min_depth_m: 0.15,
    };

    fn check(points: &[Point3<f32>], size_rad: f32, kept: usize) {
        let members: Vec<u32> = (0..points.len() as u32).collect();
        let near = near_mode(points, &members, size_rad, &CONFIG);
        assert_eq!(near, members[..kept]);
    }

    fn line(count: usize, x: f32) -> impl Iterator<Item = Point3<f32>> {
        (0..count).map(move |k| Point3::new(x, 0.02 * k as f32, 0.0))
    }

    #[test]
    fn the_wall_behind_is_left_out_however_many_points_it_has() {
        let chair_and_wall: Vec<_> = line(20, 3.0).chain(line(60, 3.5)).collect();
        check(&chair_and_wall, 0.2, 20);
    }

    #[test]
    fn a_few_stray_points_in_front_are_not_the_thing() {
        let mut points: Vec<_> = line(20, 3.0).collect();
        points.push(Point3::new(1.0, 0.0, 0.0));
        check(&points, 0.2, 20);
    }

    #[test]
    fn depth_is_limited_by_the_apparent_size() {
        // A cup (0.03 rad at 3 m = 9 cm) and the table top that runs on behind it without a gap.
        let cup_and_table: Vec<_> = (0..20)
            .map(|k| Point3::new(3.0 + 0.05 * k as f32, 0.0, 0.0))
            .collect();
        // Front 3.05 (a low quantile) and depth 2 x 0.03 x 3.05: kept up to 3.23.
        check(&cup_and_table, 0.03, 5);
    }

    #[test]
    fn one_point_and_no_point() {
        check(&[Point3::new(2.0, 0.0, 0.0)], 0.01, 1);
        check(&[], 0.01, 0);
    }
}
