//! How alike two labels are: the same word, another word for it, or a thing that a segmenter mistakes for it.

use std::borrow::Cow;

/// Words for the same thing.
#[rustfmt::skip]
const SYNONYMS: &[&[&str]] = &[
    &["mug", "cup", "coffee mug", "coffee cup", "teacup"],
    &["sofa", "couch", "settee"],
    &["tv", "television", "tv screen"],
    &["monitor", "screen", "display", "computer monitor"],
    &["fridge", "refrigerator"],
    &["trash can", "trash bin", "bin", "waste bin", "garbage can", "wastebasket"],
    &["plant", "potted plant", "houseplant", "pot plant"],
    &["cabinet", "cupboard"],
    &["closet", "wardrobe"],
    &["stove", "oven", "cooker", "hob"],
    &["rug", "carpet", "mat"],
    &["picture", "painting", "poster", "picture frame", "photo frame"],
    &["nightstand", "bedside table", "night table"],
    &["bookshelf", "bookcase"],
    &["sink", "washbasin", "basin", "wash basin"],
    &["whiteboard", "board", "blackboard"],
    &["lamp", "light", "desk lamp", "floor lamp", "table lamp"],
    &["backpack", "rucksack", "bag"],
];

/// Things of similar shape and size that are easily confused.
#[rustfmt::skip]
const LOOK_ALIKES: &[&[&str]] = &[
    &["chair", "armchair", "stool", "bench", "office chair", "dining chair"],
    &["sofa", "armchair", "bench", "bed"],
    &["table", "desk", "dining table", "coffee table", "side table", "counter", "workbench", "meeting table"],
    &["nightstand", "side table", "cabinet", "drawer", "stool"],
    &["cabinet", "wardrobe", "dresser", "shelf", "bookshelf", "drawer", "fridge", "locker", "filing cabinet"],
    &["stove", "dishwasher", "washing machine", "dryer", "microwave"],
    &["mug", "bowl", "glass", "vase", "bottle", "pot", "jar", "can", "kettle"],
    &["tv", "monitor", "picture", "whiteboard", "mirror", "window", "laptop"],
    &["laptop", "book", "tablet", "keyboard", "notebook"],
    &["sink", "bathtub", "toilet"],
    &["printer", "copier", "microwave", "scanner"],
    &["lamp", "vase", "plant", "coat rack"],
    &["pillow", "cushion", "blanket", "towel", "backpack"],
    &["box", "basket", "trash can", "suitcase"],
];

/// Likeness of two labels in `[0, 1]`: 1 the same word, 0.9 a synonym, 0.8 the same head noun ("office chair", "chair"),
/// 0.6 look-alikes, else 0.
pub fn label_similarity(a: &str, b: &str) -> f64 {
    let (a, b) = (&*plain(a), &*plain(b));
    if a == b {
        return 1.0;
    }
    // Most labels have no synonyms: one scan each, then comparisons of numbers.
    let (same_as_a, same_as_b) = (synonyms_of(a), synonyms_of(b));
    if same_as_a.is_some() && same_as_a == same_as_b {
        return 0.9;
    }
    let head = |label: &str| label.rfind(' ').map_or(0, |space| space + 1);
    if a[head(a)..] == b[head(b)..] {
        return 0.8;
    }
    let has = |family: &[&str], label: &str, same: Option<usize>| {
        family.contains(&label) || same.is_some_and(|same| SYNONYMS[same].iter().any(|word| family.contains(word)))
    };
    let is_family = |family: &&[&str]| has(family, a, same_as_a) && has(family, b, same_as_b);
    if LOOK_ALIKES.iter().any(is_family) { 0.6 } else { 0.0 }
}

/// Trimmed and in lower case; as it is where it is so already.
fn plain(label: &str) -> Cow<'_, str> {
    let label = label.trim();
    if label.chars().any(char::is_uppercase) { Cow::Owned(label.to_lowercase()) } else { Cow::Borrowed(label) }
}

fn synonyms_of(label: &str) -> Option<usize> {
    SYNONYMS.iter().position(|words| words.contains(&label))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn likeness_falls_from_same_to_synonym_to_head_noun_to_look_alike() {
        let check = |a, b, expected| {
            assert_eq!(label_similarity(a, b), expected, "{a} / {b}");
            assert_eq!(label_similarity(b, a), expected, "{b} / {a}");
        };
        check("Mug", "mug", 1.0);
        check("mug", "cup", 0.9);
        check("office chair", "chair", 0.8);
        check("desk", "table", 0.6);
        check("couch", "armchair", 0.6);
        check("mug", "chair", 0.0);
        check("", "chair", 0.0);
    }
}
