//! Is a claim about a thing true, and of that thing alone? Looked up in the boxes by plain inequalities, without the operators of the
//! grounder.

use dsg::Aabb;
use nalgebra::Vector2;

use crate::refer_set::middle;
use crate::scene::Scene;

/// A claim about a thing; the numbers are indices of its anchors in the scene.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Claim {
    On(usize),
    Under(usize),
    Closest(usize),
    Farthest(usize),
    Largest,
    Smallest,
    Highest,
    Lowest,
    LeftOf(usize),
    RightOf(usize),
    Between(usize, usize),
    /// The n-th nearest (from 2) to the anchor among those of the class.
    NthClosest(u32, usize),
    /// The n-th farthest.
    NthFarthest(u32, usize),
    /// The n-th from above among those of the class.
    NthHighest(u32),
    /// The n-th from the left among those of the class.
    NthFromLeft(u32),
}

impl Claim {
    /// In words; `name` says what an anchor is called.
    pub fn words(&self, name: &dyn Fn(usize) -> String) -> String {
        match self {
            Claim::On(a) => format!("on the {}", name(*a)),
            Claim::Under(a) => format!("under the {}", name(*a)),
            Claim::Closest(a) => format!("closest to the {}", name(*a)),
            Claim::Farthest(a) => format!("farthest from the {}", name(*a)),
            Claim::Largest => "the largest".into(),
            Claim::Smallest => "the smallest".into(),
            Claim::Highest => "the highest".into(),
            Claim::Lowest => "the lowest".into(),
            Claim::LeftOf(a) => format!("left of the {}", name(*a)),
            Claim::RightOf(a) => format!("right of the {}", name(*a)),
            Claim::NthClosest(n, a) => format!("{} closest to the {}", ordinal(*n), name(*a)),
            Claim::NthFarthest(n, a) => format!("{} farthest from the {}", ordinal(*n), name(*a)),
            Claim::NthHighest(n) => format!("{} highest", ordinal(*n)),
            Claim::NthFromLeft(n) => format!("{} from the left", ordinal(*n)),
            Claim::Between(a, b) => format!("between the {} and the {}", name(*a), name(*b)),
        }
    }

    /// Counted among all of the class.
    pub fn is_ordinal(&self) -> bool {
        matches!(self, Claim::NthClosest(..) | Claim::NthFarthest(..) | Claim::NthHighest(_) | Claim::NthFromLeft(_))
    }

    /// Left and right are those of somebody in the middle of the room who looks at the anchor.
    pub fn is_view_dependent(&self) -> bool {
        matches!(self, Claim::LeftOf(_) | Claim::RightOf(_) | Claim::NthFromLeft(_))
    }
}

/// The word; numbers beyond the sixth have none here.
fn ordinal(n: u32) -> &'static str {
    ["first", "second", "third", "fourth", "fifth", "sixth"].get(n.saturating_sub(1) as usize).unwrap_or(&"last")
}

/// Whether all claims hold of the thing at `index`, and of no other thing with its label.
pub fn singles_out(claims: &[Claim], scene: &Scene, index: usize) -> bool {
    let holds = |index: usize| claims.iter().all(|claim| is_true(claim, scene, index));
    holds(index) && twins(scene, index).all(|twin| !holds(twin))
}

/// The other things with the same label.
fn twins(scene: &Scene, index: usize) -> impl Iterator<Item = usize> + '_ {
    let label = scene.label(index);
    (0..scene.things.len()).filter(move |other| *other != index && scene.label(*other) == label)
}

/// Whether the claim holds of the thing at `index`, clearly enough that people would not quarrel about it.
pub fn is_true(claim: &Claim, scene: &Scene, index: usize) -> bool {
    /// Difference of distances that people see, metres (Sr3D's generator asks for 0.2 m).
    const SEEN_M: f64 = 0.2;
    /// Difference of heights that people see in a stack, metres.
    const STACKED_M: f64 = 0.03;
    /// Ratio of sizes that people see.
    const SEEN_RATIO: f64 = 1.15;
    let own = &scene.things[index].bounds;
    let bounds = |other: usize| &scene.things[other].bounds;
    let rivals: Vec<&Aabb> = twins(scene, index).map(bounds).collect();
    let gap_m = |a: &Aabb, b: &Aabb| {
        (0..3).map(|k| (a.min[k] - b.max[k]).max(b.min[k] - a.max[k]).max(0.0).powi(2)).sum::<f64>().sqrt()
    };
    let middles_m = |a: &Aabb, b: &Aabb| {
        (0..3).map(|k| (a.min[k] + a.max[k] - b.min[k] - b.max[k]).powi(2)).sum::<f64>().sqrt() / 2.0
    };
    // Nearer by the gap, or, of things about as near, by the distance of the middles.
    let is_nearer_by = |seen_m: f64, a: &Aabb, b: &Aabb, to: &Aabb| {
        let (gap_a, gap_b) = (gap_m(a, to), gap_m(b, to));
        gap_a + seen_m < gap_b || (gap_a <= gap_b + 1e-9 && middles_m(a, to) + seen_m < middles_m(b, to))
    };
    let is_nearer = |a: &Aabb, b: &Aabb, to: &Aabb| is_nearer_by(SEEN_M, a, b, to);
    // Whoever counts looks more closely.
    let comes_before = |a: &Aabb, b: &Aabb, to: &Aabb| is_nearer_by(SEEN_M / 2.0, a, b, to);
    let size = |bounds: &Aabb| (0..3).map(|k| bounds.max[k] - bounds.min[k]).product::<f64>().cbrt();
    let height_m = |bounds: &Aabb| 0.5 * (bounds.min.z + bounds.max.z);
    match *claim {
        Claim::On(anchor) => {
            let dz_m = own.min.z - bounds(anchor).max.z;
            overlap_share(own, bounds(anchor)) > 0.5 && dz_m.abs() < 0.1
        }
        Claim::Under(anchor) => overlap_share(own, bounds(anchor)) > 0.5 && bounds(anchor).min.z - own.max.z > -0.05,
        Claim::Closest(anchor) => {
            !rivals.is_empty() && rivals.iter().all(|rival| is_nearer(own, rival, bounds(anchor)))
        }
        Claim::Farthest(anchor) => {
            !rivals.is_empty() && rivals.iter().all(|rival| is_nearer(rival, own, bounds(anchor)))
        }
        Claim::NthClosest(n, anchor) => {
            let nearer = rivals.iter().filter(|rival| comes_before(rival, own, bounds(anchor))).count();
            let farther = rivals.iter().filter(|rival| comes_before(own, rival, bounds(anchor))).count();
            nearer + 1 == n as usize && nearer + farther == rivals.len()
        }
        Claim::NthFarthest(n, anchor) => {
            let nearer = rivals.iter().filter(|rival| comes_before(rival, own, bounds(anchor))).count();
            let farther = rivals.iter().filter(|rival| comes_before(own, rival, bounds(anchor))).count();
            farther + 1 == n as usize && nearer + farther == rivals.len()
        }
        Claim::Largest => !rivals.is_empty() && rivals.iter().all(|rival| size(own) > SEEN_RATIO * size(rival)),
        Claim::Smallest => !rivals.is_empty() && rivals.iter().all(|rival| SEEN_RATIO * size(own) < size(rival)),
        Claim::Highest => !rivals.is_empty() && rivals.iter().all(|rival| height_m(own) > height_m(rival) + SEEN_M),
        Claim::Lowest => !rivals.is_empty() && rivals.iter().all(|rival| height_m(own) + SEEN_M < height_m(rival)),
        Claim::NthHighest(n) => {
            let over = rivals.iter().filter(|rival| height_m(rival) > height_m(own) + STACKED_M).count();
            let below = rivals.iter().filter(|rival| height_m(own) > height_m(rival) + STACKED_M).count();
            over + 1 == n as usize && over + below == rivals.len()
        }
        Claim::NthFromLeft(n) => {
            let turns: Vec<f64> = rivals.iter().map(|rival| turn_rad(scene, own, rival)).collect();
            // Somebody who sees them all at once; 0.02 rad is a hand's breadth across the room.
            let is_one_view = turns.iter().all(|turn| turn.abs() < 1.2 && turn.abs() > 0.02);
            is_one_view && turns.iter().filter(|turn| **turn > 0.0).count() + 1 == n as usize
        }
        Claim::LeftOf(anchor) => side_m(scene, own, bounds(anchor)) > 0.3,
        Claim::RightOf(anchor) => side_m(scene, own, bounds(anchor)) < -0.3,
        Claim::Between(a, b) => is_between(own, bounds(a), bounds(b)),
    }
}

/// Metres to the left of the anchor for somebody in the middle of the room who looks at it; zero if it is rather in front or behind.
fn side_m(scene: &Scene, own: &Aabb, anchor: &Aabb) -> f64 {
    let center = |bounds: &Aabb| Vector2::new(0.5 * (bounds.min.x + bounds.max.x), 0.5 * (bounds.min.y + bounds.max.y));
    let eye = middle(scene).xy().coords;
    let ahead = center(anchor) - eye;
    let Some(ahead) = ahead.try_normalize(0.3) else { return 0.0 };
    let offset = center(own) - center(anchor);
    let (left_m, far_m) = (ahead.x * offset.y - ahead.y * offset.x, ahead.dot(&offset));
    if left_m.abs() > 2.0 * far_m.abs() && left_m.abs() < 3.0 { left_m } else { 0.0 }
}

/// By how much somebody in the middle of the room turns left from `own` to `other`, radians.
fn turn_rad(scene: &Scene, own: &Aabb, other: &Aabb) -> f64 {
    let eye = middle(scene).xy().coords;
    let towards =
        |bounds: &Aabb| Vector2::new(0.5 * (bounds.min.x + bounds.max.x), 0.5 * (bounds.min.y + bounds.max.y)) - eye;
    let (a, b) = (towards(own), towards(other));
    (a.x * b.y - a.y * b.x).atan2(a.dot(&b))
}

fn is_between(own: &Aabb, a: &Aabb, b: &Aabb) -> bool {
    let center = |bounds: &Aabb| Vector2::new(0.5 * (bounds.min.x + bounds.max.x), 0.5 * (bounds.min.y + bounds.max.y));
    let (p, q, s) = (center(a), center(b), center(own));
    let axis = q - p;
    let length_m = axis.norm();
    if length_m < 0.5 {
        return false;
    }
    let along = (s - p).dot(&axis) / (length_m * length_m);
    let across_m = ((s - p).x * axis.y - (s - p).y * axis.x).abs() / length_m;
    (0.2..0.8).contains(&along) && across_m < 0.4
}

/// Share of the smaller footprint that lies over the other.
fn overlap_share(a: &Aabb, b: &Aabb) -> f64 {
    let side = |bounds: &Aabb, k: usize| (bounds.max[k] - bounds.min[k]).max(0.01);
    let common = |k: usize| (a.max[k].min(b.max[k]) - a.min[k].max(b.min[k])).max(0.0);
    common(0) * common(1) / (side(a, 0) * side(a, 1)).min(side(b, 0) * side(b, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::describe::describe;
    use crate::refer_set::read_scene;
    use dsg::ObjectId;

    fn scene() -> Scene {
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],
            [3,"window",-0.5,0,1.5,0.1,1,1,20,20,20,null,null,null],[4,"table",2,2,0.4,1,1,0.7,12,9,6,null,null,null],[5,"mug",2,2,0.8,0.1,0.1,0.1,9,9,9,null,null,null]]}"#;
        read_scene(&line.replace('\n', "")).expect("sound").1
    }

    #[test]
    fn claims_by_hand() {
        let scene = scene();
        assert!(is_true(&Claim::Closest(2), &scene, 0) && !is_true(&Claim::Closest(2), &scene, 1));
        assert!(is_true(&Claim::On(3), &scene, 4) && is_true(&Claim::Under(4), &scene, 3));
        assert!(!is_true(&Claim::Largest, &scene, 0), "equal sizes");
        assert!(!is_true(&Claim::Between(2, 4), &scene, 1));
    }

    #[test]
    fn what_is_true_of_two_singles_out_none() {
        let scene = scene();
        assert!(singles_out(&[Claim::Closest(2)], &scene, 0) && !singles_out(&[Claim::Closest(2)], &scene, 1));
        assert!(singles_out(&[], &scene, 3), "the only table");
        assert!(!singles_out(&[], &scene, 0), "one of two chairs");
        // Under a roof over both chairs, "under the roof" is true of each and tells them apart from nothing.
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,9,6,4,null,null,null],
            [3,"roof",2,0,3,9,9,0.1,20,20,20,null,null,null]]}"#;
        let scene = read_scene(&line.replace('\n', "")).expect("sound").1;
        assert!(is_true(&Claim::Under(2), &scene, 0) && !singles_out(&[Claim::Under(2)], &scene, 0));
    }

    #[test]
    fn the_shortest_description_is_found_and_true() {
        let scene = scene();
        assert_eq!(describe(&scene, ObjectId(5)).expect("unique class").text, "the mug");
        let chair = describe(&scene, ObjectId(1)).expect("by the window");
        assert_eq!(chair.text, "the chair that is closest to the window");
        assert!(chair.claims.iter().all(|claim| is_true(claim, &scene, 0)));
    }
}
