//! The vote for an object's label over frames (OmniVLN Eq. 4), with sums that do not depend on their order.

use std::collections::BTreeMap;

/// Votes are multiples of this, so that their sums are exact in binary floating point (up to 2^43 votes) and the label
/// does not depend on the order of frames or merges.
pub const VOTE_STEP: f64 = 1.0 / 1024.0;

/// Adds one frame's votes: each label's share of `label_weights` times `weight`, rounded to [`VOTE_STEP`].
pub fn add_votes(votes: &mut BTreeMap<String, f64>, label_weights: &[(String, f64)], weight: f64) {
    let total: f64 = label_weights.iter().map(|(_, share)| share.max(0.0)).sum();
    if total <= 0.0 {
        return;
    }
    for (label, share) in label_weights {
        let steps = (share.max(0.0) / total * weight / VOTE_STEP).round();
        if steps > 0.0 {
            *votes.entry(label.clone()).or_insert(0.0) += steps * VOTE_STEP;
        }
    }
}

/// The label with the most votes and its margin (first - second) / sum. Of equal labels the alphabetically first;
/// `("unknown", 0)` without votes.
pub fn winner(votes: &BTreeMap<String, f64>) -> (String, f64) {
    let mut first: Option<(&String, f64)> = None;
    let mut second = 0.0_f64;
    for (label, &count) in votes {
        match first {
            Some((_, best)) if count <= best => second = second.max(count),
            _ => {
                second = first.map_or(0.0, |(_, best)| best);
                first = Some((label, count));
            }
        }
    }
    let total: f64 = votes.values().sum();
    match first {
        // OmniVLN Eq. 4: argmax over labels of the number of frames that said so.
        Some((label, best)) if total > 0.0 => (label.clone(), (best - second) / total),
        _ => ("unknown".to_owned(), 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq_4_counts_frames() {
        let mut votes = BTreeMap::new();
        for frame in ["mug", "cup", "mug", "mug"] {
            add_votes(&mut votes, &[(frame.to_owned(), 1.0)], 1.0);
        }
        assert_eq!(winner(&votes), ("mug".to_owned(), 0.5));
    }

    #[test]
    fn ties_go_to_the_first_in_the_alphabet_and_nothing_to_unknown() {
        let votes = BTreeMap::from([("b".to_owned(), 2.0), ("a".to_owned(), 2.0)]);
        assert_eq!(winner(&votes), ("a".to_owned(), 0.0));
        assert_eq!(winner(&BTreeMap::new()), ("unknown".to_owned(), 0.0));
    }
}
