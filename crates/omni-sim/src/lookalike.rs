//! Which classes a segmenter takes for each other.

/// Classes that look alike, in groups; a class may stand in several. Names are lower-case singular.
pub const LOOK_ALIKES: &[&[&str]] = &[
    &["mug", "cup", "glass", "bowl", "vase", "can"],
    &["bottle", "vase", "thermos", "can", "soap dispenser"],
    &["plate", "bowl", "tray", "clock"],
    &["chair", "armchair", "stool", "office chair", "bench"],
    &["sofa", "couch", "armchair", "bed", "bench"],
    &["table", "desk", "coffee table", "dining table", "side table", "counter", "nightstand"],
    &["cabinet", "cupboard", "wardrobe", "dresser", "bookshelf", "shelf", "filing cabinet", "nightstand"],
    &["refrigerator", "fridge", "dishwasher", "oven", "stove", "washing machine", "microwave", "cabinet"],
    &["sink", "washbasin", "bathtub", "toilet", "bowl", "bucket"],
    &["monitor", "television", "tv", "screen", "laptop", "painting", "picture", "mirror", "window", "whiteboard"],
    &["laptop", "keyboard", "book", "notebook", "tablet", "magazine"],
    &["book", "box", "folder", "magazine"],
    &["plant", "potted plant", "flower", "vase", "tree"],
    &["lamp", "floor lamp", "table lamp", "coat rack"],
    &["pillow", "cushion", "blanket", "towel", "bag"],
    &["trash can", "bin", "bucket", "basket", "laundry basket", "planter"],
    &["phone", "remote", "remote control", "mouse", "calculator", "stapler"],
    &["printer", "copier", "scanner", "microwave", "toaster", "coffee machine", "kettle"],
    &["kettle", "teapot", "jug", "pot", "pan", "coffee machine"],
    &["rug", "carpet", "mat", "blanket"],
    &["curtain", "towel", "shower curtain", "blind"],
    &["backpack", "bag", "handbag", "suitcase", "box"],
    &["clock", "mirror", "plate", "fan"],
    &["fruit", "apple", "orange", "ball", "bowl"],
    &["toothbrush", "pen", "pencil", "knife", "spoon", "fork", "remote"],
    &["door", "cabinet", "wardrobe", "painting"],
    &["person", "coat rack", "statue"],
    &["stapler", "tape", "mouse", "toy"],
    &["shoes", "slippers", "bag", "toy"],
    &["teddy bear", "toy", "doll", "cushion"],
    &["umbrella", "broom", "mop", "coat rack"],
    &["projector", "speaker", "printer", "box"],
    &["guitar", "painting", "broom"],
    &["water dispenser", "vending machine", "refrigerator", "filing cabinet"],
];

/// What `class` may be taken for: the rest of its groups, in the table's order without repeats; empty for an unknown class.
pub fn look_alikes_of(class: &str) -> Vec<&'static str> {
    let mut found: Vec<&'static str> = Vec::new();
    for group in LOOK_ALIKES.iter().filter(|g| g.contains(&class)) {
        for &other in *group {
            if other != class && !found.contains(&other) {
                found.push(other);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_alike_goes_both_ways_and_never_to_itself() {
        for class in LOOK_ALIKES.iter().flat_map(|g| g.iter()) {
            let others = look_alikes_of(class);
            assert!(!others.is_empty() && !others.contains(class));
            assert!(others.iter().all(|o| look_alikes_of(o).contains(class)));
        }
        assert!(look_alikes_of("unicorn").is_empty());
    }
}
