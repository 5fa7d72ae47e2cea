//! Relations among objects by their true boxes, for whoever writes instructions and referees answers.
//!
//! Sorted lists, so that the same building gives the same order everywhere.

use crate::building::{Building, ObjectTruth};

/// Largest gap between the boxes of two things that are near each other, metres.
pub const NEAR_GAP_M: f64 = 0.6;
/// Share of the smaller footprint that must lie over the other one for above and below.
const OVERLAP_SHARE: f64 = 0.5;

/// How one thing stands to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TruthKind {
    /// In the same room, boxes at most [`NEAR_GAP_M`] apart; the support of a thing is not near it. Symmetric.
    Near,
    /// Carried by the other.
    On,
    /// Higher than the other, over its footprint, without being carried by it.
    Above,
    /// Lower than the other, under its footprint, without carrying it.
    Below,
}

/// A relation: `subject` is near, on, above or below `object`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct TruthRelation {
    /// Id of the thing spoken of.
    pub subject: u32,
    /// The relation.
    pub kind: TruthKind,
    /// Id of the reference.
    pub object: u32,
    /// Gap between the boxes, metres.
    pub gap_m: f64,
}

/// All relations, ordered by subject, kind and object. Quadratic in the things of a room.
pub fn truth_relations(building: &Building) -> Vec<TruthRelation> {
    let mut list = Vec::new();
    for subject in &building.objects {
        for object in &building.objects {
            if subject.id == object.id || subject.room != object.room {
                continue;
            }
            let gap_m = subject.bounds.gap_m(&object.bounds);
            let mut push = |kind| list.push(TruthRelation { subject: subject.id, kind, object: object.id, gap_m });
            if subject.supported_by == Some(object.id) {
                push(TruthKind::On);
            } else if object.supported_by != Some(subject.id) {
                if gap_m <= NEAR_GAP_M {
                    push(TruthKind::Near);
                }
                if is_over(subject, object) {
                    push(TruthKind::Above);
                }
                if is_over(object, subject) {
                    push(TruthKind::Below);
                }
            }
        }
    }
    list.sort_by_key(|r| (r.subject, r.kind, r.object));
    list
}

/// True if the middle of `between` lies between the boxes of two other things of the room: within 0.4 m of the straight line
/// between their middles and nearer to each than they are to each other.
pub fn is_between(between: &ObjectTruth, a: &ObjectTruth, b: &ObjectTruth) -> bool {
    if between.room != a.room || between.room != b.room {
        return false;
    }
    let (p, q, m) = (a.bounds.center().xy(), b.bounds.center().xy(), between.bounds.center().xy());
    let line = q - p;
    let length = line.norm();
    if length < 1e-6 {
        return false;
    }
    let along = (m - p).dot(&line) / length;
    let off = ((m - p) - line * (along / length)).norm();
    along > 0.0 && along < length && off <= 0.4
}

/// True if `upper` begins where `lower` ends or higher and at least half of the smaller footprint is shared.
fn is_over(upper: &ObjectTruth, lower: &ObjectTruth) -> bool {
    if upper.bounds.min.z < lower.bounds.max.z - 1e-9 {
        return false;
    }
    let (a, b) = (upper.bounds.footprint(), lower.bounds.footprint());
    let w = (a.max.x.min(b.max.x) - a.min.x.max(b.min.x)).max(0.0);
    let h = (a.max.y.min(b.max.y) - a.min.y.max(b.min.y)).max(0.0);
    w * h >= OVERLAP_SHARE * a.area_m2().min(b.area_m2())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::building::Bounds;
    use crate::mesh::TriangleMesh;
    use nalgebra::Point3;

    fn thing(id: u32, x: f64, z: f64, supported_by: Option<u32>) -> ObjectTruth {
        ObjectTruth {
            id,
            class: "box".into(),
            color: "red".into(),
            rgb: [190, 36, 36],
            material: "cardboard".into(),
            function: "storing odds and ends".into(),
            caption: String::new(),
            bounds: Bounds { min: Point3::new(x, 0.0, z), max: Point3::new(x + 0.5, 0.5, z + 0.5) },
            yaw_rad: 0.0,
            room: 0,
            supported_by,
            placed_with: None,
        }
    }

    fn building(objects: Vec<ObjectTruth>) -> Building {
        Building { rooms: vec![], doors: vec![], objects, mesh: TriangleMesh::default(), movers: vec![] }
    }

    #[test]
    fn four_boxes_by_hand() {
        // 1 on the floor, 2 on top of 1, 3 half a metre beside 1, 4 floating over 3.
        let b = building(vec![
            thing(1, 0.0, 0.0, None),
            thing(2, 0.0, 0.5, Some(1)),
            thing(3, 1.0, 0.0, None),
            thing(4, 1.0, 1.2, None),
        ]);
        let found: Vec<_> = truth_relations(&b).iter().map(|r| (r.subject, r.kind, r.object)).collect();
        use TruthKind::*;
        assert_eq!(
            found,
            [
                (1, Near, 3),
                (2, Near, 3),
                (2, Near, 4),
                (2, On, 1),
                (3, Near, 1),
                (3, Near, 2),
                (3, Below, 4),
                (4, Near, 2),
                (4, Above, 3),
            ]
        );
    }

    #[test]
    fn the_middle_one_of_three_is_between() {
        let (a, m, b) = (thing(1, 0.0, 0.0, None), thing(2, 1.0, 0.0, None), thing(3, 2.0, 0.0, None));
        assert!(is_between(&m, &a, &b));
        assert!(!is_between(&a, &m, &b));
    }
}
