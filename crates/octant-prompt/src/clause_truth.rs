//! Is a claim about a thing true? Looked up in the boxes by plain inequalities, without the operators of the grounder.

use dsg::Aabb;
use nalgebra::Vector2;

use crate::describe::label;
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
}

impl Claim {
    /// In words.
    pub fn words(&self, scene: &Scene) -> String {
        let name = |index: usize| label(scene, index);
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
            Claim::Between(a, b) => format!("between the {} and the {}", name(*a), name(*b)),
        }
    }

    /// Left and right are those of somebody in the middle of the room who looks at the anchor.
    pub fn is_view_dependent(&self) -> bool {
        matches!(self, Claim::LeftOf(_) | Claim::RightOf(_))
    }
}

/// Whether the claim holds of the thing at `index`, clearly enough that people would not quarrel about it.
pub fn is_true(claim: &Claim, scene: &Scene, index: usize) -> bool {
    /// Difference of distances that people see, metres (Sr3D's generator asks for 0.2 m).
    const SEEN_M: f64 = 0.2;
    /// Ratio of sizes that people see.
    const SEEN_RATIO: f64 = 1.15;
    let own = &scene.things[index].bounds;
    let bounds = |other: usize| &scene.things[other].bounds;
    let rivals: Vec<&Aabb> = (0..scene.things.len())
        .filter(|other| *other != index && label(scene, *other) == label(scene, index))
        .map(bounds)
        .collect();
    let gap_m = |a: &Aabb, b: &Aabb| {
        (0..3).map(|k| (a.min[k] - b.max[k]).max(b.min[k] - a.max[k]).max(0.0).powi(2)).sum::<f64>().sqrt()
    };
    let size = |bounds: &Aabb| (0..3).map(|k| bounds.max[k] - bounds.min[k]).product::<f64>().cbrt();
    let height_m = |bounds: &Aabb| 0.5 * (bounds.min.z + bounds.max.z);
    match *claim {
        Claim::On(anchor) => {
            let dz_m = own.min.z - bounds(anchor).max.z;
            overlap_share(own, bounds(anchor)) > 0.5 && dz_m.abs() < 0.1
        }
        Claim::Under(anchor) => {
            overlap_share(own, bounds(anchor)) > 0.5 && bounds(anchor).min.z - own.max.z > -0.05
        }
        Claim::Closest(anchor) => {
            !rivals.is_empty() && rivals.iter().all(|rival| gap_m(own, bounds(anchor)) + SEEN_M < gap_m(rival, bounds(anchor)))
        }
        Claim::Farthest(anchor) => {
            !rivals.is_empty() && rivals.iter().all(|rival| gap_m(own, bounds(anchor)) > gap_m(rival, bounds(anchor)) + SEEN_M)
        }
        Claim::Largest => !rivals.is_empty() && rivals.iter().all(|rival| size(own) > SEEN_RATIO * size(rival)),
        Claim::Smallest => !rivals.is_empty() && rivals.iter().all(|rival| SEEN_RATIO * size(own) < size(rival)),
        Claim::Highest => !rivals.is_empty() && rivals.iter().all(|rival| height_m(own) > height_m(rival) + SEEN_M),
        Claim::Lowest => !rivals.is_empty() && rivals.iter().all(|rival| height_m(own) + SEEN_M < height_m(rival)),
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
    fn the_shortest_description_is_found_and_true() {
        let scene = scene();
        assert_eq!(describe(&scene, ObjectId(5)).expect("unique class").text, "the mug");
        let chair = describe(&scene, ObjectId(1)).expect("by the window");
        assert_eq!(chair.text, "the chair that is closest to the window");
        assert!(chair.claims.iter().all(|claim| is_true(claim, &scene, 0)));
    }
}
