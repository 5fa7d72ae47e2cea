//! When a thing was there, and where it went: stretches of presence and the trajectory of what moves.

use nalgebra::Point3;

/// A closed stretch of time in which a thing was there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Presence {
    /// First stamp.
    pub first_ns: i64,
    /// Last stamp, not before the first.
    pub last_ns: i64,
}

/// Where a moving thing was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// When.
    pub stamp_ns: i64,
    /// Middle of its box, metres, world frame.
    pub position: Point3<f64>,
}

/// The thing was there at `stamp_ns`: the last stretch grows if no more than `gap_ns` lie between, else a new one begins. A stamp
/// before the last stretch is late news and belongs to the stretch it lies in or beside.
pub fn extend(presence: &mut Vec<Presence>, stamp_ns: i64, gap_ns: i64) {
    let is_near =
        |p: &Presence| stamp_ns >= p.first_ns.saturating_sub(gap_ns) && stamp_ns <= p.last_ns.saturating_add(gap_ns);
    match presence.iter_mut().find(|p| is_near(p)) {
        Some(stretch) => {
            stretch.first_ns = stretch.first_ns.min(stamp_ns);
            stretch.last_ns = stretch.last_ns.max(stamp_ns);
        }
        None => presence.push(Presence { first_ns: stamp_ns, last_ns: stamp_ns }),
    }
    join(presence, gap_ns);
}

/// Two histories of one thing.
pub(crate) fn union(a: &[Presence], b: &[Presence]) -> Vec<Presence> {
    let mut all = [a, b].concat();
    join(&mut all, 0);
    all
}

/// Puts stretches in order and joins those with no more than `gap_ns` between them.
fn join(presence: &mut Vec<Presence>, gap_ns: i64) {
    presence.sort_unstable();
    presence.dedup_by(|next, before| {
        let is_one = next.first_ns <= before.last_ns.saturating_add(gap_ns);
        if is_one {
            before.last_ns = before.last_ns.max(next.last_ns);
        }
        is_one
    });
}

/// Two trajectories of one thing, by time; of points at the same time the first trajectory's.
pub(crate) fn merged(a: &[TrackPoint], b: &[TrackPoint]) -> Vec<TrackPoint> {
    let mut all = [a, b].concat();
    all.sort_by_key(|point| point.stamp_ns);
    all.dedup_by_key(|point| point.stamp_ns);
    all
}

/// Whether stretches are in order and apart, and points in order and finite.
pub(crate) fn is_sound(presence: &[Presence], trajectory: &[TrackPoint]) -> bool {
    presence.iter().all(|p| p.first_ns <= p.last_ns)
        && presence.windows(2).all(|pair| pair[0].last_ns < pair[1].first_ns)
        && trajectory.windows(2).all(|pair| pair[0].stamp_ns <= pair[1].stamp_ns)
        && trajectory.iter().all(|point| point.position.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_long_absence_begins_a_new_stretch() {
        let mut presence = Vec::new();
        for stamp in [0, 10, 20, 100, 110] {
            extend(&mut presence, stamp, 15);
        }
        assert_eq!(presence, [Presence { first_ns: 0, last_ns: 20 }, Presence { first_ns: 100, last_ns: 110 }]);
    }

    proptest! {
        #[test]
        fn stretches_are_apart_cover_every_stamp_and_do_not_depend_on_the_order(
            stamps in prop::collection::vec(-500_i64..500, 1..40), gap in 0_i64..30, seed in any::<u64>(),
        ) {
            let build = |stamps: &[i64]| {
                let mut presence = Vec::new();
                stamps.iter().for_each(|stamp| extend(&mut presence, *stamp, gap));
                presence
            };
            let presence = build(&stamps);
            prop_assert!(is_sound(&presence, &[]));
            prop_assert!(presence.windows(2).all(|pair| pair[1].first_ns - pair[0].last_ns > gap));
            for stamp in &stamps {
                prop_assert!(presence.iter().any(|p| p.first_ns <= *stamp && *stamp <= p.last_ns));
            }
            for p in &presence {
                prop_assert!(stamps.contains(&p.first_ns) && stamps.contains(&p.last_ns));
            }
            let mut other = stamps.clone();
            let middle = (seed % stamps.len() as u64) as usize;
            other.rotate_left(middle);
            prop_assert_eq!(build(&other), presence);
        }
    }
}
