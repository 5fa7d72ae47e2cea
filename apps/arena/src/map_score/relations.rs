//! Relations of the graph against the truth, at three stages: as proposed, after the map's word (Eq. 6), after the verifier's
//! (Eq. 7).
//!
//! Only relations among objects that are things count (whether they are is another figure), and the truth is computed among
//! these things only, so that a thing nobody knows takes no place among the nearest. What is [`Holds::Unsure`] is neither
//! right nor wrong, and is counted by itself.

use std::collections::BTreeMap;

use mission::dsg::{ObjectId, Relation, RelationKind, Verdict};
use serde::Serialize;

use super::ratio::Ratio;
use super::relation_truth::{Holds, Key};

/// How good the relations of one stage are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Stage {
    /// Of those the graph has, the true ones.
    pub precision: Ratio,
    /// Of the true ones, those the graph has.
    pub recall: Ratio,
    /// Of those that hang on less than the error of measurement, those the graph has.
    pub unsure: Ratio,
}

/// Figures of the relations.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RelationFigures {
    /// As the boxes propose them.
    pub proposed: Stage,
    /// Without those the map blocks (OmniVLN Eq. 6).
    pub after_eq6: Stage,
    /// Without those the verifier rejects (OmniVLN Eq. 7): what the graph says in the end.
    pub after_eq7: Stage,
    /// The last stage by kind.
    pub kinds: BTreeMap<&'static str, Stage>,
}

impl RelationFigures {
    /// Of several buildings.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a RelationFigures> + Clone) -> RelationFigures {
        let pool = |stages: &[Stage]| Stage {
            precision: Ratio::pooled(stages.iter().map(|stage| stage.precision)),
            recall: Ratio::pooled(stages.iter().map(|stage| stage.recall)),
            unsure: Ratio::pooled(stages.iter().map(|stage| stage.unsure)),
        };
        let stage = |pick: fn(&RelationFigures) -> Stage| pool(&all.clone().map(pick).collect::<Vec<_>>());
        let kind = |kind: RelationKind| {
            pool(&all.clone().filter_map(|figures| figures.kinds.get(kind.word()).copied()).collect::<Vec<_>>())
        };
        RelationFigures {
            proposed: stage(|f| f.proposed),
            after_eq6: stage(|f| f.after_eq6),
            after_eq7: stage(|f| f.after_eq7),
            kinds: RelationKind::ALL.into_iter().map(|of| (of.word(), kind(of))).collect(),
        }
    }
}

/// Compares. `relations` are all of the graph, the dropped ones too; `thing_of` says which thing an object is.
pub fn relation_figures(
    relations: &[Relation],
    thing_of: &BTreeMap<ObjectId, u32>,
    truth: &BTreeMap<Key, Holds>,
) -> RelationFigures {
    let known: Vec<(Key, Verdict)> = relations
        .iter()
        .filter_map(|relation| Some((key_among_things(relation, thing_of)?, relation.evidence.verdict)))
        .collect();
    let stage = |passes: &dyn Fn(&Key, &Verdict) -> bool, is_asked: &dyn Fn(&Key) -> bool| {
        let kept: Vec<Key> = known.iter().filter(|(key, verdict)| passes(key, verdict)).map(|(key, _)| *key).collect();
        let holds = |key: &Key| truth.get(key).copied().unwrap_or(Holds::No);
        let all = |wanted: Holds| truth.iter().filter(move |(key, holds)| **holds == wanted && is_asked(key)).count();
        let has = |wanted: Holds| kept.iter().filter(|key| holds(key) == wanted).count();
        Stage {
            precision: Ratio::new(has(Holds::Yes), has(Holds::Yes) + has(Holds::No)),
            recall: Ratio::new(has(Holds::Yes), all(Holds::Yes)),
            unsure: Ratio::new(has(Holds::Unsure), all(Holds::Unsure)),
        }
    };
    let any = |_: &Key| true;
    let of_kind =
        |kind: RelationKind| stage(&|key, verdict| key.1 == kind && *verdict == Verdict::Holds, &|key| key.1 == kind);
    RelationFigures {
        proposed: stage(&|_, _| true, &any),
        after_eq6: stage(&|_, verdict| !matches!(verdict, Verdict::Blocked(_)), &any),
        after_eq7: stage(&|_, verdict| *verdict == Verdict::Holds, &any),
        kinds: RelationKind::ALL.into_iter().map(|kind| (kind.word(), of_kind(kind))).collect(),
    }
}

/// The relation among the things that its objects are, `None` if one of them is none.
pub fn key_among_things(relation: &Relation, thing_of: &BTreeMap<ObjectId, u32>) -> Option<Key> {
    let (subject, object) = (*thing_of.get(&relation.subject)?, *thing_of.get(&relation.object)?);
    Some(match (relation.kind, relation.other) {
        (RelationKind::Near, _) => (subject.min(object), RelationKind::Near, subject.max(object), None),
        (kind, Some(other)) => {
            let other = *thing_of.get(&other)?;
            (subject, kind, object.min(other), Some(object.max(other)))
        }
        (kind, None) => (subject, kind, object, None),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mission::dsg::{Evidence, EvidenceSource};
    use nalgebra::Point3;

    fn relation(subject: u64, kind: RelationKind, object: u64, verdict: Verdict) -> Relation {
        let evidence = Evidence { verdict, source: EvidenceSource::Geometry, distance_m: 0.5, score: 1.0 };
        Relation { subject: ObjectId(subject), kind, object: ObjectId(object), other: None, evidence }
    }

    #[test]
    fn three_stages_by_hand() {
        use RelationKind::{Near, On};
        // Objects 11.. are things 1..; 19 is no thing. Ids run the other way for 14 and 15.
        let thing_of = BTreeMap::from([(11, 1), (12, 2), (13, 3), (14, 5), (15, 4)].map(|(o, t)| (ObjectId(o), t)));
        let truth = BTreeMap::from([
            ((1, Near, 2, None), Holds::Yes),
            ((4, Near, 5, None), Holds::Yes),
            ((3, On, 1, None), Holds::Yes),
            ((2, Near, 3, None), Holds::Unsure),
        ]);
        let relations = [
            relation(11, Near, 12, Verdict::Holds),
            relation(14, Near, 15, Verdict::Rejected),
            relation(12, Near, 13, Verdict::Holds),
            relation(11, Near, 13, Verdict::Blocked(Point3::origin())),
            relation(12, On, 11, Verdict::Holds),
            relation(11, Near, 19, Verdict::Holds),
        ];
        let figures = relation_figures(&relations, &thing_of, &truth);
        let stage = |precision: (usize, usize), recall: (usize, usize)| Stage {
            precision: Ratio::new(precision.0, precision.1),
            recall: Ratio::new(recall.0, recall.1),
            unsure: Ratio::new(1, 1),
        };
        assert_eq!(figures.proposed, stage((2, 4), (2, 3)));
        assert_eq!(figures.after_eq6, stage((2, 3), (2, 3)));
        assert_eq!(figures.after_eq7, stage((1, 2), (1, 3)));
        assert_eq!(figures.kinds["near"], stage((1, 1), (1, 2)));
        assert_eq!(figures.kinds["on"], Stage { unsure: Ratio::new(0, 0), ..stage((0, 1), (0, 1)) });
        let pooled = RelationFigures::pooled([&figures, &figures].into_iter());
        assert_eq!(pooled.after_eq7.recall, Ratio::new(2, 6));
        assert_eq!(pooled.kinds["on"].precision, Ratio::new(0, 2));
    }
}
