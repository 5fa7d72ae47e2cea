//! How alike two labels are: the same word, another word for it, or a thing that a segmenter mistakes for it.

/// Words for the same thing.
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
    if a.eq_ignore_ascii_case(b) {
        return 1.0;
    }
    let (a, b) = (a.trim().to_lowercase(), b.trim().to_lowercase());
    if a == b {
        return 1.0;
    }
    if SYNONYMS.iter().any(|words| words.contains(&&*a) && words.contains(&&*b)) {
        return 0.9;
    }
    let head = |label: &str| label.rsplit(' ').next().unwrap_or_default().to_owned();
    if head(&a) == head(&b) {
        return 0.8;
    }
    let family = |words: &&[&str]| is_in(words, &a) && is_in(words, &b);
    if LOOK_ALIKES.iter().any(family) { 0.6 } else { 0.0 }
}

/// Whether a label, or a synonym of it, is in the list.
fn is_in(words: &[&str], label: &str) -> bool {
    words.contains(&label)
        || SYNONYMS.iter().any(|same| same.contains(&label) && same.iter().any(|word| words.contains(word)))
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
