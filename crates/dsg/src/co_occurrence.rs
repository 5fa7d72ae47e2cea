//! Which things are used together, and which of them carry the others: our own tables of everyday knowledge.

use crate::labels::label_similarity;

/// Things that carry or organise others, with their rank: the highest rank in a group, then the largest, names it.
const SUPPORTS: &[(&str, u32)] = &[
    ("dining table", 5),
    ("meeting table", 5),
    ("conference table", 5),
    ("reception desk", 5),
    ("bed", 5),
    ("desk", 4),
    ("workbench", 4),
    ("lab bench", 4),
    ("sofa", 4),
    ("kitchen counter", 4),
    ("counter", 4),
    ("table", 3),
    ("coffee table", 2),
    ("sideboard", 2),
    ("tv stand", 2),
    ("bookshelf", 2),
    ("shelf", 2),
    ("sink", 1),
    ("side table", 1),
    ("nightstand", 1),
    ("cabinet", 1),
];

/// Sets of classes that are used together.
#[rustfmt::skip]
const TOGETHER: &[&[&str]] = &[
    &["dining table", "table", "chair", "dining chair", "plate", "bowl", "mug", "glass", "vase", "bottle", "candle"],
    &["desk", "office chair", "chair", "monitor", "keyboard", "mouse", "laptop", "lamp", "computer", "printer", "book",
      "notebook", "mug", "phone", "filing cabinet", "headphones", "pen holder", "trash can"],
    &["sofa", "armchair", "coffee table", "tv", "tv stand", "rug", "pillow", "floor lamp", "side table", "blanket", "remote"],
    &["bed", "nightstand", "lamp", "pillow", "blanket", "dresser", "alarm clock"],
    &["kitchen counter", "counter", "stove", "sink", "fridge", "microwave", "oven", "dishwasher", "kettle", "toaster",
      "mug", "pot", "pan", "plate", "bowl", "coffee machine", "bottle", "cabinet", "dish rack", "knife block"],
    &["sink", "washbasin", "soap", "soap dispenser", "toothbrush", "bathroom cabinet"],
    &["toilet", "toilet paper", "toilet brush"],
    &["bathtub", "shower", "shampoo", "bath mat"],
    &["window", "radiator", "curtain", "blind"],
    &["meeting table", "conference table", "office chair", "chair", "whiteboard", "projector", "projector screen", "tv"],
    &["washing machine", "dryer", "laundry basket", "detergent", "ironing board", "drying rack"],
    &["printer", "copier", "paper shredder", "shelf", "cabinet", "paper tray"],
    &["bookshelf", "shelf", "book", "vase", "box", "globe", "armchair"],
    &["workbench", "lab bench", "microscope", "oscilloscope", "stool", "monitor", "computer", "toolbox", "robot arm"],
    &["coat rack", "shoe rack", "umbrella stand", "mirror", "bench"],
];

/// What a group gathers round: of these there is one in a group.
#[rustfmt::skip]
const CENTERS: &[&str] = &[
    "dining table", "kitchen table", "meeting table", "conference table", "reception desk", "desk", "workbench", "lab bench", "bed",
    "sofa", "kitchen counter", "counter", "sink", "stove", "bookshelf", "shelf", "storage rack", "sideboard", "dresser", "cabinet",
    "filing cabinet", "console table", "copier", "toilet", "bathtub",
];

/// Units that stand in a row and are used as one.
#[rustfmt::skip]
const ROW_UNITS: &[&str] = &[
    "counter", "kitchen counter", "sink", "stove", "oven", "fridge", "dishwasher", "washing machine", "dryer",
];

/// Whether a group gathers round a thing of this class.
pub(crate) fn is_center(label: &str) -> bool {
    CENTERS.contains(&label)
}

/// Whether things of this class stand in rows.
pub(crate) fn is_row_unit(label: &str) -> bool {
    ROW_UNITS.contains(&label)
}

/// How well two classes go together, in `[0, 1]`.
pub fn co_occurrence(a: &str, b: &str) -> f64 {
    together(&shares(a), &shares(b))
}

/// How much a class belongs to each set of [`TOGETHER`].
pub(crate) type Shares = [f64; TOGETHER.len()];

/// The sets a class belongs to.
pub(crate) fn shares(label: &str) -> Shares {
    let share = |set: &&[&str]| {
        set.iter().map(|class| label_similarity(class, label)).filter(|s| *s >= 0.8).fold(0.0, f64::max)
    };
    let mut shares = [0.0; TOGETHER.len()];
    for (slot, set) in shares.iter_mut().zip(TOGETHER) {
        *slot = share(set);
    }
    shares
}

/// [`co_occurrence`] from the sets of both.
pub(crate) fn together(a: &Shares, b: &Shares) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).fold(0.0, f64::max)
}

/// Rank of a class among supports, 0 for none.
pub(crate) fn rank(label: &str) -> u32 {
    let exact = SUPPORTS.iter().find(|(class, _)| *class == label);
    let narrower = || SUPPORTS.iter().find(|(class, _)| label_similarity(class, label) >= 0.8);
    exact.or_else(narrower).map_or(0, |(_, rank)| *rank)
}
