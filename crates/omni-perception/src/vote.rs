//! The majority vote that names a thing (OmniVLN Eq. 4).
//!
//! ```text
//! L(o) = argmax_l  sum over frames t of  I(label of o in t = l)
//! ```
//! Departure: as printed the indicator counts the points of a frame, so that one close-up with 5000 points outvotes twenty
//! frames. Here each frame gives one histogram over names that sums to one ([`ObjectObservation::label_weights`]: two masks on
//! one thing share the frame by their scores), times one weight: the best score over the variance of the range, which grows
//! with its square ([`ObjectObservation::weight`]). The sums may decay. [`UNKNOWN`](crate::UNKNOWN) is a name like any other:
//! a thing that most frames cannot name has none. Ties go to the higher mean score, then to the first in the alphabet, and
//! the result keeps the second best and the margin, so that the caller can wait for more frames.

use std::collections::BTreeMap;

use crate::observation::sound_score;
use crate::{Mask, ObjectObservation};

/// The votes for the name of one thing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LabelVote {
    /// For each label the sum of weights, and of weights times score.
    sums: BTreeMap<String, (f64, f64)>,
    frames: u32,
}

/// The outcome of a [`LabelVote`].
#[derive(Debug, Clone, PartialEq)]
pub struct VoteResult {
    /// The winner.
    pub label: String,
    /// Its share of all votes.
    pub share: f64,
    /// The label in second place, if any.
    pub runner_up: Option<String>,
    /// Share of the winner minus share of the second.
    pub margin: f64,
    /// Number of frames that voted.
    pub frames: u32,
}

impl LabelVote {
    /// Adds the vote of one frame. Older votes are first multiplied by `decay` (1 forgets nothing).
    pub fn add(&mut self, observation: &ObjectObservation, decay: f64) {
        for sums in self.sums.values_mut() {
            *sums = (sums.0 * decay, sums.1 * decay);
        }
        for (label, share) in &observation.label_weights {
            // OmniVLN Eq. 4
            let vote = share * observation.weight;
            let sums = self.sums.entry(label.clone()).or_default();
            *sums = (sums.0 + vote, sums.1 + vote * f64::from(observation.score));
        }
        self.frames += 1;
    }

    /// The winner: most votes, then higher mean score, then the first in the alphabet. `None` before any vote.
    pub fn result(&self) -> Option<VoteResult> {
        let total: f64 = self.sums.values().map(|sums| sums.0).sum();
        let mean_score = |sums: &(f64, f64)| if sums.0 > 0.0 { sums.1 / sums.0 } else { 0.0 };
        let mut ranking: Vec<(&String, &(f64, f64))> = self.sums.iter().collect();
        ranking.sort_by(|(_, a), (_, b)| b.0.total_cmp(&a.0).then(mean_score(b).total_cmp(&mean_score(a))));
        let (label, first) = *ranking.first()?;
        let share = |sums: &(f64, f64)| if total > 0.0 { sums.0 / total } else { 0.0 };
        let second = ranking.get(1);
        Some(VoteResult {
            label: label.clone(),
            share: share(first),
            runner_up: second.map(|(label, _)| (*label).clone()),
            margin: share(first) - second.map_or(0.0, |(_, sums)| share(sums)),
            frames: self.frames,
        })
    }
}

/// One frame's histogram over the masks of a thing (at least one): shares by score, and the best mask.
pub(crate) fn frame_histogram<'a>(masks: &[&'a Mask]) -> (Vec<(String, f64)>, &'a Mask) {
    let mut best = masks[0];
    let mut scores: BTreeMap<&str, f64> = BTreeMap::new();
    for mask in masks {
        if sound_score(mask.score) > sound_score(best.score) {
            best = mask;
        }
        // Two masks of the same name are one opinion.
        let score = scores.entry(&mask.label).or_default();
        *score = score.max(f64::from(sound_score(mask.score)));
    }
    let total: f64 = scores.values().sum();
    let mut histogram: Vec<(String, f64)> =
        scores.into_iter().map(|(label, score)| (label.to_string(), score / total)).collect();
    histogram.sort_by(|a, b| b.1.total_cmp(&a.1)); // stable: ties stay in the order of names
    (histogram, best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rle, Stamp};
    use nalgebra::Point3;

    fn seen(label: &str, points: usize, score: f32, weight: f64) -> ObjectObservation {
        ObjectObservation {
            stamp: Stamp(0),
            label_weights: vec![(label.into(), 1.0)],
            caption: String::new(),
            score,
            weight,
            points_in_world: vec![Point3::origin(); points],
            range_m: 1.0,
            color_rgb: None,
            touches_image_border: false,
            track: None,
        }
    }

    #[test]
    fn eq_4_frames_vote_not_points() {
        let mut vote = LabelVote::default();
        assert_eq!(vote.result(), None);
        vote.add(&seen("bucket", 5000, 0.9, 0.9), 1.0);
        for _ in 0..3 {
            vote.add(&seen("mug", 8, 0.6, 0.4), 1.0);
        }
        let result = vote.result().expect("votes");
        assert_eq!((result.label.as_str(), result.runner_up.as_deref(), result.frames), ("mug", Some("bucket"), 4));
        assert!((result.share - 1.2 / 2.1).abs() < 1e-12 && (result.margin - 0.3 / 2.1).abs() < 1e-12);
    }

    #[test]
    fn ties_go_to_the_better_score_then_the_name() {
        let mut vote = LabelVote::default();
        vote.add(&seen("cup", 1, 0.5, 0.5), 1.0);
        vote.add(&seen("mug", 1, 0.9, 0.5), 1.0);
        vote.add(&seen("pot", 1, 0.9, 0.5), 1.0);
        assert_eq!(vote.result().expect("votes").label, "mug");
        vote.add(&seen("pot", 1, 0.9, 0.1), 0.5);
        assert_eq!(vote.result().expect("votes").label, "pot");
    }

    #[test]
    fn unknown_is_a_name_like_any_other() {
        let mut vote = LabelVote::default();
        for label in [crate::UNKNOWN, crate::UNKNOWN, "mug"] {
            vote.add(&seen(label, 9, 0.9, 0.5), 1.0);
        }
        let result = vote.result().expect("votes");
        assert_eq!((result.label.as_str(), result.runner_up.as_deref()), (crate::UNKNOWN, Some("mug")));
        assert!((result.margin - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn older_frames_may_count_less() {
        let mut vote = LabelVote::default();
        vote.add(&seen("cup", 9, 0.9, 0.5), 0.5);
        vote.add(&seen("mug", 9, 0.9, 0.5), 0.5);
        let result = vote.result().expect("votes");
        assert_eq!(result.label, "mug");
        assert!((result.share - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_frame_shares_its_vote_by_score() {
        let mask =
            |label: &str, score: f32| Mask::new(Rle::from_counts(1, 1, &[0, 1]).expect("one pixel"), label, score);
        let masks = [mask("sofa", 0.6), mask("couch", 0.2), mask("sofa", 0.3), mask("bed", f32::NAN)];
        let (histogram, best) = frame_histogram(&masks.iter().collect::<Vec<_>>());
        assert_eq!(best.label, "sofa");
        assert_eq!(histogram[0].0, "sofa");
        assert!((histogram[0].1 - 0.6 / 0.801).abs() < 1e-6);
        assert!((histogram.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
